"""The files in config/ and the parameter reference say what the code says."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import yaml

from explore_command.parameters import NODE_CONFIGS, config_class, override_problems, parsed_overrides, read_profile, robot_of
from octomap_server_3dnav.navigation.local_grid import LocalGridConfig
from path_following import FollowerConfig
from robot_body import DEFAULT_ROBOT_FILE, RobotBody, robot_mapping
from stage_config import load_config, to_mapping
from stop_scan_and_go import StopScanAndGoConfig

pytest.importorskip("_octree_binding", reason="the octree's extension module is not on PYTHONPATH: source .ws/devel/setup.bash")

ROOT = Path(__file__).resolve().parents[3]


def _reference() -> ModuleType:
    spec = importlib.util.spec_from_file_location("write_parameter_docs", ROOT / "scripts" / "write_parameter_docs.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


REFERENCE = _reference()
LIDAR = ROOT / "config/lidar.yaml"
CONFIG_FILE = {node.name: ROOT / "config" / node.config for node in REFERENCE.launched_nodes(ROOT / "launch")}


def _values(node: str) -> dict[str, dict[str, Any]]:
    """The file's parameters by section."""
    values = yaml.safe_load(CONFIG_FILE[node].read_text()) or {}
    values |= {LIDAR.stem: yaml.safe_load(LIDAR.read_text())} if LIDAR.stem in NODE_CONFIGS[node] else {}
    sections = {section: values.pop(section, {}) for section in NODE_CONFIGS[node] if section}
    return {"": values, **sections}


@pytest.mark.parametrize("node", NODE_CONFIGS)
def test_every_parameter_of_a_file_is_known_and_in_range(node: str) -> None:
    values = {f"{section}/{name}".lstrip("/"): v for section, part in _values(node).items() for name, v in part.items()}
    assert values, f"{CONFIG_FILE[node].name} sets nothing"
    assert override_problems({node: values}) == []


@pytest.mark.parametrize("node", NODE_CONFIGS)
def test_files_hold_the_defaults(node: str) -> None:
    for section, dotted in NODE_CONFIGS[node].items():
        cls, values = config_class(dotted), _values(node)[section]
        assert to_mapping(load_config(cls, values)) == to_mapping(cls())


@pytest.mark.parametrize("robot", [DEFAULT_ROBOT_FILE, *sorted((ROOT / "config" / "robots").glob("*.yaml"))], ids=lambda path: path.stem)
def test_tracked_robot_is_swept_while_its_whole_outline_still_stands_before_the_end_of_the_terrain(robot: Path) -> None:
    follower = FollowerConfig()
    way_m = StopScanAndGoConfig().max_tracked_distance_m + follower.stopping_m(follower.max_speed_mps)
    assert way_m + robot_of(robot, {}).half_length_m <= LocalGridConfig().size_m / 2


def test_reference_has_every_value_of_the_robot_and_all_that_is_derived_from_it() -> None:
    chapter = REFERENCE.reference().partition("## The robot\n")[2].partition("\n## ")[0]
    names = [*robot_mapping(RobotBody()), *(name for name, member in vars(RobotBody).items() if isinstance(member, property))]
    assert all(f"| `{name}` |" in chapter for name in names)


@pytest.mark.parametrize("common", REFERENCE.COMMON, ids=lambda common: common.name)
def test_parameter_that_people_change_is_taken_by_set_with_the_default_that_is_told(common: Any) -> None:
    row = next(line for line in REFERENCE.reference().splitlines() if line.startswith(f"| `{common.name}` |"))
    node, _, name = common.name.partition("/")
    overrides = parsed_overrides([f"{common.name}={row.split('|')[2].split()[0]}"])
    assert override_problems(overrides) == []
    robot = robot_of(None, overrides)  # refuses an unknown name
    assert node != "robot" or getattr(robot, name) == pytest.approx(getattr(RobotBody(), name), abs=1e-4)


def test_reference_begins_with_the_twelve_parameters_that_people_change() -> None:
    first = REFERENCE.reference().split("\n## ")[1]
    assert first.startswith("Those that people change\n")
    assert first.count("\n| `") == len(REFERENCE.COMMON) == 12


def test_every_file_belongs_to_a_node_or_is_the_robot_or_the_lidar() -> None:
    files = {path.name for path in (ROOT / "config").glob("*.yaml")}
    assert files == {path.name for path in CONFIG_FILE.values()} | {DEFAULT_ROBOT_FILE.name, LIDAR.name}


def test_reference_names_every_parameter_once_a_node() -> None:
    text = REFERENCE.reference()
    for node, sections in NODE_CONFIGS.items():
        assert text.count(f"\n## {node}\n") == 1
        for section, dotted in sections.items():
            prefix = f"~{section}/" if section else "~"
            assert REFERENCE.config_table(config_class(dotted), prefix) in text or f"below `{prefix}`" in text


def test_reference_on_disk_is_up_to_date() -> None:
    assert (ROOT / "docs" / "parameters.md").read_text(encoding="utf-8") == REFERENCE.reference()


@pytest.mark.parametrize("mode", sorted((ROOT / "config" / "modes").glob("*.yaml")), ids=lambda path: path.stem)
def test_parameters_of_a_mode_are_ones_that_its_nodes_know(mode: Path) -> None:
    assert not override_problems(read_profile(str(mode)))
