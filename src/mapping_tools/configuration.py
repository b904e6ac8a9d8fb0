"""Parameters of the mapping tools: those of the stage, given as NAME=VALUE."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import yaml

from explore_command.arguments import ArgumentProblem
from mapping_tools.sensor_chain import SensorConfig
from odometry_fusion import OdometryConfig
from pose_graph_mapping.config import MappingConfig, RegistrationConfig
from sensor_checks import ImuLimits
from stage_config import load_config
from sweep_assembly import LidarConfig, ScanFilterConfig, SweepAssemblyConfig


@dataclass(frozen=True)
class ToolConfig:
    """What a tool maps with; `sensors` only where it maps from what drivers sent."""

    registration: RegistrationConfig
    mapping: MappingConfig
    sensors: SensorConfig


_CLASSES = (RegistrationConfig, MappingConfig, ScanFilterConfig, LidarConfig, SweepAssemblyConfig, OdometryConfig, ImuLimits)


def configured(texts: Sequence[str], *, use_gravity: bool = True, of_sensors: bool = True) -> ToolConfig:
    """Defaults, and what the texts say; ArgumentProblem for what is no NAME=VALUE, no parameter, or no value of it.

    A name that several stages have is set in all of them. of_sensors: whether parameters of the sensors' nodes have an effect.
    """
    values = dict(_parsed(text) for text in texts)
    names = {c: {f.name for f in dataclasses.fields(c)} for c in _CLASSES}
    known = set().union(*names.values())
    for name in values:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            raise ArgumentProblem(f"--set {name}: no such parameter" + (f", did you mean {near[0]}?" if near else ""))
        if not of_sensors and name not in names[RegistrationConfig] | names[MappingConfig]:
            raise ArgumentProblem(f"--set {name}: has no effect on sweeps that are made already")
    own = {c: {k: v for k, v in values.items() if k in names[c]} for c in _CLASSES}
    try:
        return ToolConfig(
            load_config(RegistrationConfig, own[RegistrationConfig]),
            load_config(MappingConfig, {"use_gravity": use_gravity} | own[MappingConfig]),
            SensorConfig(
                load_config(ScanFilterConfig, own[ScanFilterConfig]),
                load_config(LidarConfig, own[LidarConfig]),
                load_config(SweepAssemblyConfig, own[SweepAssemblyConfig]),
                load_config(OdometryConfig, own[OdometryConfig]),
                load_config(ImuLimits, own[ImuLimits]),
            ),
        )
    except ValueError as error:
        raise ArgumentProblem("--set: " + "; ".join(str(error).splitlines())) from error


def _parsed(text: str) -> tuple[str, Any]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ArgumentProblem(f"--set {text}: expected PARAMETER=VALUE, for example vertex_voxel_m=0.2")
    try:
        return name, yaml.safe_load(value)
    except yaml.YAMLError as error:
        raise ArgumentProblem(f"--set {text}: {value!r} is no value") from error
