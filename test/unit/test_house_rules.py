"""The rules of the house: who may import whom, how long and wide code may be, what a node says of itself, which configuration it reads."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from house_graph import imported_modules, modules_below

from explore_command.parameters import NODE_CONFIGS

ROOT = Path(__file__).resolve().parents[2]
ADAPTERS = "ros_adapters"
BASE = {"robot_body", "rigid_geometry", "stage_config", "whole_files"}
MAPPING = {"pose_graph_mapping", *(f"pose_graph_mapping.{room}" for room in ("registration", "graph", "session"))}
TERRAIN = {f"octomap_server_3dnav.{room}" for room in ("octree", "terrain", "navigation", "exploration")}
ORDER: dict[str, set[str]] = {
    # shared
    "whole_files": set(),
    "stage_config": set(),
    "rigid_geometry": set(),
    "mesh_files": {"rigid_geometry"},
    "robot_body": {"mesh_files", "rigid_geometry", "stage_config"},
    "point_cloud2": set(),
    "sensor_checks": BASE,
    "map_zones": {"stage_config", "whole_files"},
    "node_life": {"whole_files"},
    "world_files": {"mesh_files", "rigid_geometry", "stage_config"},
    # stages
    "simulated_movers": {"stage_config", "whole_files"},
    "pybullet_simulation": BASE | {"simulated_movers", "world_files"},
    "odometry_fusion": BASE | {"sensor_checks"},
    "mount_calibration": BASE,
    "sweep_assembly": BASE | {"mount_calibration", "point_cloud2"},
    "scan_tracking": BASE | {"mount_calibration", "sweep_assembly"},
    "pose_graph_mapping": {"stage_config"},  # what its rooms are configured by
    "pose_graph_mapping.registration": BASE | {"pose_graph_mapping"},
    "pose_graph_mapping.graph": BASE | {"pose_graph_mapping", "pose_graph_mapping.registration"},
    "pose_graph_mapping.session": BASE | {"pose_graph_mapping", "pose_graph_mapping.registration", "pose_graph_mapping.graph"},
    "octomap_server_3dnav": set(),
    "octomap_server_3dnav.octree": BASE,
    "octomap_server_3dnav.terrain": BASE | {"map_zones", "octomap_server_3dnav.octree"},
    "octomap_server_3dnav.navigation": BASE | {"map_zones", "octomap_server_3dnav.octree", "octomap_server_3dnav.terrain"},
    "octomap_server_3dnav.exploration": BASE | {"map_zones"} | TERRAIN - {"octomap_server_3dnav.exploration"},
    "finished_maps": BASE | MAPPING | {"octomap_server_3dnav.octree"},
    "local_terrain_costmap": BASE,
    "path_following": BASE,
    "collision_monitor": BASE,
    "stop_scan_and_go": BASE,
    "exploration_evaluation": BASE | {"map_zones"},  # the judge knows no stage that it judges
    # between the stages and ROS
    ADAPTERS: BASE
    | MAPPING
    | TERRAIN
    | {
        "exploration_evaluation",
        "finished_maps",
        "local_terrain_costmap",
        "map_zones",
        "mount_calibration",
        "node_life",
        "path_following",
        "point_cloud2",
        "pybullet_simulation",
        "sensor_checks",
        "stop_scan_and_go",
        "sweep_assembly",
    },
    # programs: they use stages, and no stage uses them
    "roslaunch_process": set(),
    "node_revival": {"node_life", "roslaunch_process", "whole_files"},
    "explore_command": BASE
    | {
        "world_files",
        "exploration_evaluation",
        "map_zones",
        "pose_graph_mapping.session",
        "pybullet_simulation",
        "roslaunch_process",
        "simulated_movers",
    },
    "mapping_tools": BASE
    | MAPPING
    | {"explore_command", "mount_calibration", "odometry_fusion", "point_cloud2", "roslaunch_process", "sensor_checks", "sweep_assembly"},
    "terrain_tools": BASE
    | TERRAIN
    | {"exploration_evaluation", "explore_command", "finished_maps", "mapping_tools", "pose_graph_mapping.session"},
    "run_replay": BASE | MAPPING | TERRAIN | {"exploration_evaluation", "explore_command", "roslaunch_process"},
    "evaluation_report": BASE | {"exploration_evaluation"},
    "evaluation_campaign": BASE | {"evaluation_report", "exploration_evaluation", "explore_command", "node_life", "roslaunch_process"},
}
"""Every package and what it may import, earlier ones only. Rooms count as packages."""
SHARED = BASE | {"map_zones", "mesh_files", "node_life", "point_cloud2", "world_files"}
PROGRAMS = set(list(ORDER)[list(ORDER).index(ADAPTERS) + 1 :])
STAGES = {name.partition(".")[0] for name in ORDER} - SHARED - PROGRAMS - {ADAPTERS}
ROS = {
    "rospy",
    "tf2_ros",
    "actionlib",
    "dynamic_reconfigure",
    "interactive_markers",
    "rosgraph",
    "genpy",
    "rosbag",
    "message_filters",
    "explore_3dnav",
    "std_srvs",
    "rostest",
    "roslaunch",
}
SRC = ROOT / "src"
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


def package_of(dotted: str) -> str:
    """The package or room that a module lies in."""
    return max((name for name in ORDER if f"{dotted}.".startswith(f"{name}.")), key=len)


def test_every_package_and_room_has_its_place_in_the_order() -> None:
    assert {".".join(path.parent.relative_to(SRC).parts) for path in SRC.rglob("__init__.py")} == ORDER.keys()


def test_order_has_no_way_back() -> None:
    names = list(ORDER)
    assert not [(name, used) for name in names for used in ORDER[name] if used not in names[: names.index(name)]]


@pytest.mark.parametrize("package", ORDER)
def test_package_imports_what_its_line_names(package: str) -> None:
    allowed = ORDER[package] | {package}
    modules = {dotted: path for dotted, path in modules_below(SRC).items() if package_of(dotted) == package}
    found = [(dotted, to) for dotted, path in modules.items() for to in imported_modules(path, SRC) if package_of(to) not in allowed]
    assert not found


@pytest.mark.parametrize("package", sorted(STAGES | SHARED | PROGRAMS))
def test_ros_is_imported_by_nodes_and_adapters_only(package: str) -> None:
    found = [(path.name, name) for path in modules_of(package) for name in imported(path) if is_ros(name)]
    assert not found


@pytest.mark.parametrize("package", ["exploration_evaluation", "evaluation_report", "evaluation_campaign"])
def test_judge_reaches_into_no_private_names(package: str) -> None:
    found = []
    for path in modules_of(package):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom):
                found += [(path.name, alias.name) for alias in node.names if alias.name.startswith("_")]
            elif isinstance(node, ast.Attribute) and node.attr.startswith("_") and not node.attr.startswith("__"):
                found += [(path.name, node.attr)] if not (isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")) else []
    assert not found


@pytest.mark.parametrize("package", sorted(STAGES))
def test_stage_reads_no_clock_and_prints_nothing(package: str) -> None:
    for path in modules_of(package):
        if path.parts[-2:] == ("exploration_evaluation", "__main__.py"):
            continue  # a program: it prints its report
        assert not {"time", "datetime"} & set(imported(path)), f"{path} reads a clock"
        calls = [n.func.id for n in ast.walk(ast.parse(path.read_text())) if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)]
        assert "print" not in calls, f"{path} prints"


@pytest.mark.parametrize(
    "path", [*NODES, *(p for package in sorted(STAGES | SHARED | PROGRAMS | {ADAPTERS}) for p in modules_of(package))], ids=lambda p: p.name
)
def test_every_module_says_what_it_is(path: Path) -> None:
    assert ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))), path


def _own_names(node: ast.ClassDef) -> set[str]:
    """Methods and attributes that a class gives itself."""
    stored = {
        n.attr
        for n in ast.walk(node)
        if isinstance(n, ast.Attribute) and isinstance(n.ctx, ast.Store) and isinstance(n.value, ast.Name) and n.value.id == "self"
    }
    return stored | {n.name for n in node.body if isinstance(n, ast.FunctionDef)}


@pytest.mark.parametrize("path", NODES, ids=lambda p: p.name)
def test_node_takes_no_private_name_of_what_all_nodes_share(path: Path) -> None:
    shared = ast.parse((SRC / ADAPTERS / "node.py").read_text(encoding="utf-8"))
    taken = next(_own_names(c) for c in shared.body if isinstance(c, ast.ClassDef) and c.name == "Node")
    for c in ast.parse(path.read_text(encoding="utf-8")).body:
        if isinstance(c, ast.ClassDef) and any(isinstance(b, ast.Name) and b.id == "Node" for b in c.bases):
            assert not {name for name in _own_names(c) & taken if name.startswith("_") and name != "__init__"}


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
    return first_arguments(tree, {"subscribe", "publisher", "Subscriber", "Publisher", "Service", "ServiceProxy", "serve"})


def first_arguments(tree: ast.Module, makers: set[str]) -> set[str]:
    """Texts that are the first arguments of calls of these names."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "attr", getattr(node.func, "id", "")) in makers and node.args:
            first = node.args[0]
            if isinstance(first, ast.Constant) and isinstance(first.value, str):
                found.add(first.value)
    return found


OF_ALL_ROBOTS = {"/tf", "/tf_static", "/clock", "/diagnostics", "/use_sim_time"}  # the first three are remapped by the launch files
MORE_NAMES = {"get_param", "has_param", "AskedService", "CountingPublisher", "HeardTopic", "_publisher", "InteractiveMarkerServer"}


@pytest.mark.parametrize("path", [*NODES, *modules_of(ADAPTERS)], ids=lambda p: p.name)
def test_name_of_a_topic_service_or_parameter_is_relative(path: Path) -> None:
    """So a node works in the namespace of one of several robots."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    found = topics_and_services(tree) | first_arguments(tree, MORE_NAMES)
    assert not {name for name in found if name.startswith("/")} - OF_ALL_ROBOTS


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


WRITERS = {"whole_files", "node_life", "node_revival"}  # the last two write to RAM
BARE = re.compile(r"\.write_text\(|\.write_bytes\(|\bopen\([^)]*[\"'][wax]b?\+?[\"']|os\.(replace|rename)\(")
IN_WHOLE = re.compile(r"unfinished|probe")


@pytest.mark.parametrize("path", [*NODES, *sorted(SRC.rglob("*.py"))], ids=lambda p: p.name)
def test_file_is_written_whole_or_not_at_all(path: Path) -> None:
    """By `whole_files`: who writes otherwise leaves half a file on a full disk."""
    if path.parent.name in WRITERS or path.name == "runner.py":  # whose logs are of its children
        return
    lines = path.read_text(encoding="utf-8").splitlines()
    assert not [line for line in lines if BARE.search(line) and not IN_WHOLE.search(line)]
