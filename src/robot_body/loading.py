"""RobotBody from robot.yaml, or from the same as a mapping: nothing may be missing, and every violation is told at once."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path

import yaml

from robot_body.body import RobotBody
from robot_body.mounts import read_mounts
from robot_body.package_folder import PACKAGE_FOLDER
from stage_config import ConfigError, load_config, to_mapping, yaml_values

_CONFIG = PACKAGE_FOLDER / "config"
DEFAULT_ROBOT_FILE = _CONFIG / "robot.yaml"
_ROBOTS = {"husky": DEFAULT_ROBOT_FILE, **{path.stem: path for path in sorted((_CONFIG / "robots").glob("*.yaml"))}}


def robot_names() -> list[str]:
    """The robots that come with the project."""
    return list(_ROBOTS)


def robot_file(name_or_file: str) -> Path:
    """The file of a robot that comes with the project, or the file that is named."""
    return _ROBOTS.get(name_or_file, Path(name_or_file))


def load_robot(path: Path | str = DEFAULT_ROBOT_FILE) -> RobotBody:
    """The robot of a YAML file. ConfigError lists all violations, one a line, each with the file's name."""
    return robot_from_mapping(robot_values(path), str(path))


def robot_values(path: Path | str) -> dict[str, object]:
    """What a robot's file says, unchecked, with the path of a description beside it. ConfigError when it cannot be read."""
    try:
        content = yaml_values(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: no such robot or file; robots are {', '.join(_ROBOTS)}, or a file like config/robot.yaml") from error
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (yaml.YAMLError, UnicodeDecodeError, ValueError) as error:
        raise ConfigError(f"{path}: is no YAML: {' '.join(str(error).split())}") from error
    if not isinstance(content, dict):
        raise ConfigError(f"{path}: expected the robot's values by name, as in config/robot.yaml")
    values = {str(name): value for name, value in content.items()}
    if sections := [name for name, value in values.items() if isinstance(value, dict) and name != "mounts"]:
        raise ConfigError(f"{path}: {sections[0]} is no value of a robot: a --profile has parameters of nodes, by section")
    beside = Path(path).absolute().parent / str(values.get("urdf"))
    return {**values, "urdf": str(beside)} if values.get("urdf") and beside.exists() else values


def robot_from_mapping(values: Mapping[str, object], where: str = "robot") -> RobotBody:
    """The robot that `values` of robot.yaml describe. ConfigError lists all violations, one a line behind `where`."""
    mounts, problems = read_mounts(values.get("mounts", {}))
    if values.get("name") == "":
        problems.append("name is empty")
    missing = [f.name for f in dataclasses.fields(RobotBody) if f.name not in values]
    unknown = {f.name: math.nan for f in dataclasses.fields(RobotBody) if f.name in missing and isinstance(f.default, float)}
    known = {name: value for name, value in values.items() if name != "mounts"} | unknown
    robot = None
    try:
        robot = load_config(RobotBody, known if problems or "mounts" not in values else {**known, "mounts": mounts})
    except ConfigError as error:
        lines = [line.partition(": ")[2] for line in str(error).splitlines()]
        problems = [line for line in lines if line.partition(" = ")[0] not in unknown] + problems
    if problems or missing or robot is None:
        raise ConfigError("\n".join(f"{where}: {text}" for text in [f"{name} is missing" for name in missing] + problems))
    return robot


def overlaid(values: Mapping[str, object], changes: Mapping[str, object]) -> dict[str, object]:
    """The values with `changes` over them, "name" or "mounts/SENSOR" to value."""
    found = dict(values)
    for path, value in changes.items():
        name, _, rest = path.partition("/")
        inner = found.get(name)
        found[name] = overlaid(inner if isinstance(inner, Mapping) else {}, {rest: value}) if rest else value
    return found


def robot_mapping(robot: RobotBody) -> dict[str, object]:
    """The robot as robot.yaml writes it, in plain types: `robot_from_mapping` gives the same robot."""
    return {**to_mapping(robot), "mounts": {mount.sensor: mount.as_mapping() for mount in robot.mounts}}
