"""What a map is judged by: the robot of its file, and the parameters of octomap_server_3dnav_node, of a profile over their defaults."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import yaml

from explore_command.arguments import ArgumentProblem
from explore_command.parameters import NODE_CONFIGS, PROFILES, ROBOT, config_class, override_problems, profile_names
from octomap_server_3dnav.exploration.frontiers import FrontierConfig
from octomap_server_3dnav.navigation.passages import TerrainSettings
from octomap_server_3dnav.navigation.planner import PlannerConfig
from octomap_server_3dnav.navigation.straight_lines import PassageConfig
from octomap_server_3dnav.octree.map_builder import MapConfig
from octomap_server_3dnav.octree.octree import SensorModel
from octomap_server_3dnav.terrain.classify import TerrainConfig
from robot_body import DEFAULT_ROBOT_FILE, RobotBody, overlaid, robot_from_mapping, robot_values
from stage_config import ConfigError, load_config, yaml_values

NODE = "octomap_server_3dnav_node"


@dataclass(frozen=True)
class Criteria:
    """The robot, and what of the node's configuration says something about a map by itself; `octree` is the one without a section."""

    robot: RobotBody = field(default_factory=RobotBody)
    octree: MapConfig = field(default_factory=MapConfig)
    sensor_model: SensorModel = field(default_factory=SensorModel)
    terrain: TerrainConfig = field(default_factory=TerrainConfig)
    passages: PassageConfig = field(default_factory=PassageConfig)
    frontier: FrontierConfig = field(default_factory=FrontierConfig)
    planner: PlannerConfig = field(default_factory=PlannerConfig)

    @property
    def settings(self) -> TerrainSettings:
        """What a terrain is made for."""
        return TerrainSettings(self.robot, self.terrain, self.passages)


def read_criteria(robot_file: Path | None = None, profile: str | None = None) -> Criteria:
    """The robot of a file like config/robot.yaml, and the parameters of a profile: its name, or a YAML file with the node's parameters by
    section as in config/, or by node, among them those of "robot", which lie over the file's.

    ArgumentProblem lists all that is wrong with robot and parameters, one a line.
    """
    content = _content(_profile_file(profile)) if profile else {}
    problems: list[str] = []
    robot, criteria = RobotBody(), Criteria()
    try:
        robot = _robot(robot_file or DEFAULT_ROBOT_FILE, content.get(ROBOT) or {})
    except ConfigError as error:
        problems += [f"--robot {line}" for line in str(error).splitlines()]
    try:
        criteria = _criteria(robot, content)
    except ConfigError as error:
        problems += [f"--profile {profile}: {line}" for line in str(error).splitlines()]
    if problems:
        raise ArgumentProblem("\n".join(problems))
    return criteria


def _robot(path: Path, changes: object) -> RobotBody:
    if not isinstance(changes, dict):
        raise ConfigError(f"{path}: the profile's {ROBOT} = {changes!r} is no mapping")
    return robot_from_mapping(overlaid(robot_values(path), changes), str(path))


def _profile_file(profile: str) -> Path:
    return PROFILES / f"{profile}.yaml" if profile in profile_names() else Path(profile)


def _criteria(robot: RobotBody, content: dict[str, Any]) -> Criteria:
    values = _node_values(content)
    flat = {f"{key}/{name}": v for key, part in values.items() if isinstance(part, dict) for name, v in part.items()}
    flat |= {key: part for key, part in values.items() if not isinstance(part, dict)}
    if problems := override_problems({NODE: flat}):
        raise ConfigError("\n".join(problems + _known_names(flat)))
    return Criteria(
        robot,
        load_config(MapConfig, _of(MapConfig, values)),
        load_config(SensorModel, _of(SensorModel, values.get("sensor_model", {}))),
        load_config(TerrainConfig, values.get("terrain", {})),
        load_config(PassageConfig, values.get("passages", {})),
        load_config(FrontierConfig, values.get("frontier", {})),
        load_config(PlannerConfig, values.get("planner", {})),
    )


def _of(cls: type, values: dict[str, Any]) -> dict[str, Any]:
    """The values of a class; the node knows more names, for what comes by topics."""
    return {f.name: values[f.name] for f in fields(cls) if f.name in values}


def _content(path: Path) -> dict[str, Any]:
    try:
        content = yaml_values(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ArgumentProblem(
            f"--profile {path}: cannot be read: {error.strerror or error}; profiles are {', '.join(profile_names())}"
        ) from error
    except (yaml.YAMLError, UnicodeDecodeError, ValueError) as error:
        raise ArgumentProblem(f"--profile {path}: is no YAML: {' '.join(str(error).split())}") from error
    if content is not None and not isinstance(content, dict):
        raise ArgumentProblem(f"--profile {path}: expected sections with parameters, as 'terrain: {{clearance_margin_m: 0.1}}'")
    return {str(key): value for key, value in (content or {}).items()}


def _node_values(content: dict[str, Any]) -> dict[str, Any]:
    """The node's part of a profile; anything else is that part itself. A section or part without content has no parameters."""
    is_profile = any(key in NODE_CONFIGS or key == ROBOT for key in content)
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
