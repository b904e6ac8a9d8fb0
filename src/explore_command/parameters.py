"""Which node reads which configuration under which section: --set is checked against it before anything is started."""

import difflib
import importlib
from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from stage_config import ConfigError, load_config

NODE_CONFIGS: dict[str, dict[str, str]] = {
    "pybullet_sim_node": {"": "pybullet_simulation.SimulationConfig"},
    "scan_filter_node": {"": "sweep_assembly.ScanFilterConfig"},
    "odometry_fusion_node": {"": "odometry_fusion.OdometryConfig"},
    "sweep_assembler_node": {"": "sweep_assembly.SweepAssemblyConfig"},
    "icp_matcher_node": {"": "pose_graph_mapping.registration.RegistrationConfig"},
    "pose_graph_mapping_node": {"": "pose_graph_mapping.config.MappingConfig"},
    "octomap_server_3dnav_node": {
        "": "octomap_server_3dnav.map_builder.MapConfig",
        "sensor_model": "octomap_server_3dnav.octree.SensorModel",
        "terrain": "octomap_server_3dnav.terrain.TerrainConfig",
        "frontier": "octomap_server_3dnav.frontiers.FrontierConfig",
        "planner": "octomap_server_3dnav.planner.PlannerConfig",
        "exploration": "octomap_server_3dnav.exploration.ExplorationConfig",
    },
    "octomap_server_3dnav_local_node": {
        "": "octomap_server_3dnav.local_grid.LocalGridConfig",
        "terrain": "octomap_server_3dnav.terrain.TerrainConfig",
    },
    "move_base_node": {"costmap": "local_terrain_costmap.CostmapConfig", "follower": "path_following.FollowerConfig"},
    "stop_scan_and_go_node": {"": "stop_scan_and_go.StopScanAndGoConfig"},
    "exploration_monitor_node": {"": "ros_adapters.monitor_config.MonitorConfig"},
}


def config_class(dotted: str) -> type:
    """The dataclass of a dotted name in `NODE_CONFIGS`."""
    module, _, name = dotted.rpartition(".")
    found = getattr(importlib.import_module(module), name)
    assert isinstance(found, type)
    return found


def parsed_overrides(texts: Sequence[str]) -> dict[str, dict[str, Any]]:
    """NODE/PARAMETER=VALUE texts as parameters by node; values are YAML. ValueError when one cannot be read."""
    overrides: dict[str, dict[str, Any]] = {}
    for text in texts:
        name, _, value = text.partition("=")
        node, _, parameter = name.strip("/").partition("/")
        try:
            overrides.setdefault(node, {})[parameter] = yaml.safe_load(value)
        except yaml.YAMLError as error:
            raise ValueError(f"{text}: the value cannot be read") from error
    return overrides


def override_problems(overrides: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """What is wrong with parameters by node, "section/name" or "name" to value: one sentence each, naming the nearest valid name."""
    found = []
    for node, values in overrides.items():
        if node not in NODE_CONFIGS:
            found.append(f"unknown node {node}{_nearest(node, NODE_CONFIGS)}")
            continue
        for path, value in values.items():
            section, _, name = path.rpartition("/")
            found += _parameter_problems(node, section, name, value)
    return found


def _parameter_problems(node: str, section: str, name: str, value: Any) -> list[str]:
    sections = NODE_CONFIGS[node]
    if section not in sections:
        return [f"{node} has no section {section!r}{_nearest(section, sections)}"]
    try:
        load_config(config_class(sections[section]), {name: value})
    except ConfigError as error:
        return [f"{node}: {line.partition(': ')[2]}" for line in str(error).splitlines()]
    return []


def _nearest(word: str, known: Mapping[str, Any]) -> str:
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f", did you mean {near[0]}?" if near else f"; known: {', '.join(filter(None, known))}"
