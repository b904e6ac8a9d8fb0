"""The rules of the house: who may import whom, what a node says of itself, and which configuration is read where."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from explore_command.parameters import NODE_CONFIGS

ROOT = Path(__file__).resolve().parents[2]
SHARED_ORDER = ("rigid_geometry", "stage_config", "robot_body")  # each may use those before it
SHARED = set(SHARED_ORDER)
STAGES = {
    "exploration_evaluation",
    "local_terrain_costmap",
    "octomap_server_3dnav",
    "odometry_fusion",
    "path_following",
    "pose_graph_mapping",
    "pybullet_simulation",
    "stop_scan_and_go",
    "sweep_assembly",
}
ADAPTERS = "ros_adapters"
PROGRAMS = {
    "explore_command",
    "evaluation_campaign",
    "evaluation_report",
    "mapping_tools",
    "roslaunch_process",
    "run_replay",
    "terrain_tools",
}  # they use stages, and no stage uses them
ROS = {
    "rospy",
    "tf2_ros",
    "actionlib",
    "rosgraph",
    "genpy",
    "rosbag",
    "message_filters",
    "explore_3dnav",
    "std_srvs",
    "rostest",
    "roslaunch",
}
NODES = sorted((ROOT / "nodes").iterdir())


def imported(path: Path) -> Iterator[str]:
    """Top-level names of all modules that a file imports, inside functions, too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.partition(".")[0]


def is_ros(module: str) -> bool:
    return module in ROS or module.endswith("_msgs")


def modules_of(package: str) -> list[Path]:
    return sorted((ROOT / "src" / package).rglob("*.py"))


def test_every_package_is_known_to_these_rules() -> None:
    packages = {p.name for p in (ROOT / "src").iterdir() if (p / "__init__.py").exists()}
    assert packages == STAGES | SHARED | PROGRAMS | {ADAPTERS}


@pytest.mark.parametrize("package", sorted(STAGES | SHARED))
def test_stage_imports_no_other_stage(package: str) -> None:
    others = (STAGES | SHARED | PROGRAMS | {ADAPTERS}) - {package} - SHARED
    if package in SHARED:
        others |= set(SHARED_ORDER[SHARED_ORDER.index(package) + 1 :])
    found = [(path.name, name) for path in modules_of(package) for name in imported(path) if name in others]
    assert not found


@pytest.mark.parametrize("package", sorted(STAGES | SHARED | PROGRAMS))
def test_ros_is_imported_by_nodes_and_adapters_only(package: str) -> None:
    found = [(path.name, name) for path in modules_of(package) for name in imported(path) if is_ros(name)]
    assert not found


def test_adapters_do_not_know_the_programs() -> None:
    assert not [path.name for path in modules_of(ADAPTERS) if PROGRAMS & set(imported(path))]


@pytest.mark.parametrize("package", sorted(STAGES))
def test_stage_reads_no_clock_and_prints_nothing(package: str) -> None:
    if package == "exploration_evaluation":
        pytest.skip("a program of its own: it prints its report")
    for path in modules_of(package):
        assert not {"time", "datetime"} & set(imported(path)), f"{path} reads a clock"
        calls = [n.func.id for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)]
        assert "print" not in calls, f"{path} prints"


@pytest.mark.parametrize(
    "path", [*NODES, *(p for package in sorted(STAGES | SHARED | PROGRAMS | {ADAPTERS}) for p in modules_of(package))], ids=lambda p: p.name
)
def test_every_module_says_what_it_is(path: Path) -> None:
    assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))), path


@pytest.mark.parametrize("path", NODES, ids=lambda p: p.name)
def test_node_is_executable_and_named_as_one(path: Path) -> None:
    assert path.name.endswith("_node") and path.stat().st_mode & 0o100


@pytest.mark.parametrize("path", NODES, ids=lambda p: p.name)
def test_node_s_docstring_names_every_topic_and_service(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docstring = " ".join((ast.get_docstring(tree) or "").split())
    missing = [name for name in sorted(topics_and_services(tree)) if name.lstrip("/~") not in docstring]
    assert not missing, f"{path.name} does not mention {missing}"


def topics_and_services(tree: ast.Module) -> set[str]:
    """First arguments of everything that makes a topic or service."""
    makers = {"subscribe", "publisher", "Subscriber", "Publisher", "Service", "ServiceProxy"}
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in makers and node.args:
            first = node.args[0]
            if isinstance(first, ast.Constant) and isinstance(first.value, str):
                found.add(first.value)
    return found


def configs_read_by(path: Path) -> set[tuple[str, str]]:
    """(section, class name) of every `self.parameters(Class, section=...)` of a node."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") == "parameters" and isinstance(node.args[0], ast.Name):
            section = next((k.value.value for k in node.keywords if k.arg == "section" and isinstance(k.value, ast.Constant)), "")
            found.add((str(section), node.args[0].id))
    return found


@pytest.mark.parametrize("node", sorted(set(NODE_CONFIGS) - {"pybullet_sim_node"}))
def test_node_reads_the_configurations_that_overrides_are_checked_against(node: str) -> None:
    listed = {(section, dotted.rpartition(".")[2]) for section, dotted in NODE_CONFIGS[node].items()}
    assert configs_read_by(ROOT / "nodes" / node) == listed
