"""Parameters of the mapping tools: those of the stage, given as NAME=VALUE."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from explore_command.arguments import ArgumentProblem
from pose_graph_mapping.config import MappingConfig, RegistrationConfig
from stage_config import load_config


@dataclass(frozen=True)
class ToolConfig:
    """What a tool maps with."""

    registration: RegistrationConfig
    mapping: MappingConfig


def configured(texts: Sequence[str], *, use_gravity: bool = True) -> ToolConfig:
    """Defaults, and what the texts say; ArgumentProblem for what is no NAME=VALUE, no parameter, or no value of it."""
    values = dict(_parsed(text) for text in texts)
    registration, mapping = ({f.name for f in dataclasses.fields(c)} for c in (RegistrationConfig, MappingConfig))
    for name in values:
        if name not in registration | mapping:
            near = difflib.get_close_matches(name, registration | mapping, n=1)
            raise ArgumentProblem(f"--set {name}: no such parameter" + (f", did you mean {near[0]}?" if near else ""))
    try:
        return ToolConfig(
            load_config(RegistrationConfig, {k: v for k, v in values.items() if k in registration}),
            load_config(MappingConfig, {"use_gravity": use_gravity} | {k: v for k, v in values.items() if k in mapping}),
        )
    except ValueError as error:
        raise ArgumentProblem("--set: " + "; ".join(str(error).splitlines())) from error


def _parsed(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ArgumentProblem(f"--set {text}: expected PARAMETER=VALUE, for example vertex_voxel_m=0.2")
    return name, yaml.safe_load(value)
