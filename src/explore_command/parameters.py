"""Which node reads which configuration under which section: --profile and --set are checked against it before anything is started.

What all of them share is the robot: its file, and over it the parameters of "robot" among the others. A profile's "explore" has what it
chooses of the command's arguments.
"""

import importlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from explore_command.arguments import MAPPINGS
from robot_body import (
    DEFAULT_ROBOT_FILE,
    PACKAGE_FOLDER,
    URDF_FOLDER,
    RobotBody,
    overlaid,
    robot_from_mapping,
    robot_values,
    simulation_problems,
    urdf_file,
)
from stage_config import ConfigError, load_config, nearest, yaml_values

PROFILES = PACKAGE_FOLDER / "config" / "profiles"

ROBOT, COMMAND = "robot", "explore"
Overrides = dict[str, dict[str, object]]

NODE_CONFIGS: dict[str, dict[str, str]] = {
    "pybullet_sim_node": {
        "": "pybullet_simulation.SimulationConfig",
        "spinning": "pybullet_simulation.SpinningLidarConfig",
        "timing": "pybullet_simulation.TimingConfig",
    },
    "scan_filter_node": {"": "sweep_assembly.ScanFilterConfig", "lidar": "sweep_assembly.LidarConfig"},
    "odometry_fusion_node": {"": "odometry_fusion.OdometryConfig", "imu": "sensor_checks.ImuLimits"},
    "scan_tracking_node": {"": "scan_tracking.ScanTrackingConfig", "lidar": "sweep_assembly.LidarConfig"},
    "sweep_assembler_node": {
        "": "sweep_assembly.SweepAssemblyConfig",
        "lidar": "sweep_assembly.LidarConfig",
        "mount_watch": "mount_calibration.MountWatchConfig",
        "mount": "mount_calibration.MountCalibrationConfig",
    },
    "icp_matcher_node": {"": "pose_graph_mapping.config.RegistrationConfig"},
    "pose_graph_mapping_node": {
        "": "pose_graph_mapping.config.MappingConfig",
    },
    "octomap_server_3dnav_node": {
        "": "ros_adapters.octomap_server_config.OctomapServerConfig",
        "sensor_model": "ros_adapters.octomap_server_config.OctomapServerSensorModel",
        "terrain": "octomap_server_3dnav.terrain.classify.TerrainConfig",
        "passages": "octomap_server_3dnav.navigation.straight_lines.PassageConfig",
        "frontier": "octomap_server_3dnav.exploration.frontiers.FrontierConfig",
        "planner": "octomap_server_3dnav.navigation.planner.PlannerConfig",
        "exploration": "octomap_server_3dnav.exploration.config.ExplorationConfig",
    },
    "octomap_server_3dnav_local_node": {
        "": "octomap_server_3dnav.navigation.local_grid.LocalGridConfig",
    },
    "move_base_node": {
        "costmap": "local_terrain_costmap.CostmapConfig",
        "follower": "path_following.FollowerConfig",
        "monitor": "collision_monitor.CollisionMonitorConfig",
        "lidar": "sweep_assembly.LidarConfig",
    },
    "stop_scan_and_go_node": {"": "stop_scan_and_go.StopScanAndGoConfig"},
    "exploration_monitor_node": {"": "ros_adapters.monitor_config.MonitorConfig"},
}


ROBOT_NODES = tuple(node for node in NODE_CONFIGS if node != "pybullet_sim_node")
"""The nodes of the robot, each of which is started again when it dies."""


def config_class(dotted: str) -> type:
    """The dataclass of a dotted name in `NODE_CONFIGS`."""
    module, _, name = dotted.rpartition(".")
    found = getattr(importlib.import_module(module), name)
    assert isinstance(found, type)
    return found


def profile_names() -> list[str]:
    """Profiles that come with the project."""
    return sorted(path.stem for path in PROFILES.glob("*.yaml"))


def read_profile(name: str) -> Overrides:
    """A profile by its name, or from a YAML file: parameters by node, "section/name" or "name" to value.

    ValueError when there is none, it cannot be read, or it is no mapping of nodes to parameters.
    """
    path = PROFILES / f"{name}.yaml" if name in profile_names() else Path(name)
    if not path.is_file():
        raise ValueError(f"{name}: no such profile or file; profiles are {', '.join(profile_names())}")
    try:
        content = yaml_values(path.read_text(encoding="utf-8")) or {}
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ValueError(f"{name}: cannot be read: {' '.join(str(error).split())}") from error
    if not isinstance(content, dict) or not all(isinstance(values, dict) for values in content.values()):
        raise ValueError(f"{name}: a profile maps nodes to their parameters")
    return {str(node): _flat(values) for node, values in content.items()}


def _flat(values: Mapping[str, object]) -> dict[str, object]:
    """Sections one level deep as "section/name"."""
    flat: dict[str, object] = {}
    for key, value in values.items():
        flat.update({f"{key}/{name}": v for name, v in value.items()} if isinstance(value, dict) else {str(key): value})
    return flat


def all_overrides(profile: str, texts: Sequence[str]) -> Overrides:
    """The profile's parameters, and over them those of --set. ValueError as `read_profile` and `parsed_overrides` raise it."""
    found = read_profile(profile)
    for node, values in parsed_overrides(texts).items():
        found.setdefault(node, {}).update(values)
    return found


def parsed_overrides(texts: Sequence[str]) -> Overrides:
    """NODE/PARAMETER=VALUE texts as parameters by node; values are YAML. ValueError when one cannot be read."""
    overrides: Overrides = {}
    for text in texts:
        name, _, value = text.partition("=")
        node, _, parameter = name.strip("/").partition("/")
        try:
            overrides.setdefault(node, {})[parameter] = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise ValueError(f"{text}: the value cannot be read") from error
    return overrides


def override_problems(overrides: Mapping[str, Mapping[str, object]]) -> list[str]:
    """What is wrong with parameters by node, "section/name" or "name" to value: one sentence each, naming the nearest valid name or, of
    one that moved, where it stands now."""
    found = []
    for node, values in overrides.items():
        if node == ROBOT:  # as a whole, with its file: `robot_of`
            continue
        if node == COMMAND:
            found += _command_problems(values)
            continue
        if node not in NODE_CONFIGS:
            found.append(f"unknown node {node}{nearest(node, {**NODE_CONFIGS, ROBOT: {}, COMMAND: {}})}")
            continue
        sections: dict[str, dict[str, object]] = {}
        for path, value in values.items():
            section, _, name = path.rpartition("/")
            sections.setdefault(section, {})[name] = value
        for section, together in sections.items():
            found += _section_problems(node, section, together)
    return found


def robot_of(file: Path | None, overrides: Overrides) -> RobotBody:
    """The robot of a file, by default the project's, with its overrides.

    ConfigError lists all that is wrong, also where its URDF says something else or cannot be simulated, one a line.
    """
    path = file or DEFAULT_ROBOT_FILE
    robot = robot_from_mapping(overlaid(robot_values(path), overrides.get(ROBOT, {})), str(path))
    try:
        text = urdf_file(robot).read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise ConfigError(f"{path}: urdf {robot.urdf}: no such file beside this one, nor in {URDF_FOLDER}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: urdf {robot.urdf} cannot be read: {' '.join(str(error).split())}") from error
    if problems := simulation_problems(robot, text, urdf_file(robot).parent):
        raise ConfigError("\n".join(f"{path}: {text} ({Path(robot.urdf).name})" for text in problems))
    return robot


def chosen_mapping(overrides: Overrides) -> str | None:
    """The mapping, one of MAPPINGS, that a profile chooses, or None."""
    mapping = overrides.get(COMMAND, {}).get("mapping")
    return None if mapping is None else str(mapping)


def _command_problems(values: Mapping[str, object]) -> list[str]:
    return [
        f"{COMMAND} has {name} = {value!r}: a profile chooses mapping, one of {', '.join(MAPPINGS)}"
        for name, value in values.items()
        if name != "mapping" or value not in MAPPINGS
    ]


def _section_problems(node: str, section: str, values: Mapping[str, object]) -> list[str]:
    """Judges all values of a section together: one may be right only beside another."""
    sections = NODE_CONFIGS[node]
    if section not in sections:
        return [f"{node} has no section {section!r}{nearest(section, sections)}"]
    try:
        load_config(config_class(sections[section]), values)
    except ConfigError as error:
        return [f"{node}: {line.partition(': ')[2]}" for line in str(error).splitlines()]
    return []
