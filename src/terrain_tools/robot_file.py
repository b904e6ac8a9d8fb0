"""The robot that a map is judged for: parameters of octomap_server_3dnav_node from a YAML file, over their defaults."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import yaml

from explore_command.arguments import ArgumentProblem
from explore_command.parameters import NODE_CONFIGS, config_class, override_problems
from octomap_server_3dnav.exploration.frontiers import FrontierConfig
from octomap_server_3dnav.navigation.planner import PlannerConfig
from octomap_server_3dnav.octree.map_builder import MapConfig
from octomap_server_3dnav.octree.octree import SensorModel
from octomap_server_3dnav.terrain.classify import TerrainConfig
from stage_config import load_config

NODE = "octomap_server_3dnav_node"


@dataclass(frozen=True)
class RobotConfig:
    """What of the node's configuration says something about a map by itself; `octree` is the one without a section."""

    octree: MapConfig = field(default_factory=MapConfig)
    sensor_model: SensorModel = field(default_factory=SensorModel)
    terrain: TerrainConfig = field(default_factory=TerrainConfig)
    frontier: FrontierConfig = field(default_factory=FrontierConfig)
    planner: PlannerConfig = field(default_factory=PlannerConfig)


def read_robot(path: Path) -> RobotConfig:
    """The defaults, and over them the file: the node's parameters by section as in config/, or a profile, of which the node's part counts.

    ArgumentProblem when it cannot be read; it lists every unknown name and wrong value, and the names that there are.
    """
    values = _node_values(_content(path))
    flat = {f"{key}/{name}": v for key, part in values.items() if isinstance(part, dict) for name, v in part.items()}
    flat |= {key: part for key, part in values.items() if not isinstance(part, dict)}
    if problems := override_problems({NODE: flat}):
        raise ArgumentProblem(f"--robot {path}: {'; '.join(problems + _known_names(flat))}")
    return RobotConfig(
        load_config(MapConfig, {key: v for key, v in values.items() if not isinstance(v, dict)}),
        load_config(SensorModel, values.get("sensor_model", {})),
        load_config(TerrainConfig, values.get("terrain", {})),
        load_config(FrontierConfig, values.get("frontier", {})),
        load_config(PlannerConfig, values.get("planner", {})),
    )


def _content(path: Path) -> dict[str, Any]:
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ArgumentProblem(f"--robot {path}: cannot be read: {error.strerror or error}") from error
    except (yaml.YAMLError, UnicodeDecodeError, ValueError) as error:
        raise ArgumentProblem(f"--robot {path}: is no YAML: {' '.join(str(error).split())}") from error
    if content is not None and not isinstance(content, dict):
        raise ArgumentProblem(f"--robot {path}: expected sections with parameters, as 'terrain: {{max_step_m: 0.1}}'")
    return {str(key): value for key, value in (content or {}).items()}


def _node_values(content: dict[str, Any]) -> dict[str, Any]:
    """The node's part of a profile; anything else is that part itself. A section or part without content has no parameters."""
    is_profile = any(key in NODE_CONFIGS for key in content)
    values = content.get(NODE, {}) if is_profile else content
    return {key: {} if value is None and key in NODE_CONFIGS[NODE] else value for key, value in (values or {}).items()}


def _known_names(flat: dict[str, Any]) -> list[str]:
    """What there is in those sections in which something is named that there is not."""
    found = []
    for section, dotted in NODE_CONFIGS[NODE].items():
        known = [f.name for f in fields(config_class(dotted))]
        named = [path.rpartition("/")[2] for path in flat if path.rpartition("/")[0] == section]
        if any(name not in known for name in named):
            found.append(f"{section or 'without a section'} knows {', '.join(known)}")
    return found
