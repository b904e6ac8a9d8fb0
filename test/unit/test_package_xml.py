"""package.xml names every ROS package that the nodes, their launch files and the rostests use: rosdep and catkin know no others."""

import ast
import re
import sys
from collections.abc import Iterator
from importlib.metadata import packages_distributions
from pathlib import Path
from xml.etree import ElementTree

import pytest

ROOT = Path(__file__).resolve().parents[2]
HOUSE = {"explore_3dnav", *(path.name for path in (ROOT / "src").iterdir())}
RUN = {"depend", "exec_depend"}
TEST = RUN | {"test_depend"}
CODE = {
    "nodes": [*sorted((ROOT / "nodes").iterdir()), *sorted((ROOT / "src/ros_adapters").glob("*.py"))],
    "tests": [*sorted((ROOT / "test/rostest").glob("*.py")), *sorted((ROOT / "test/system").glob("*.py"))],
}
LAUNCHED = {
    "nodes": sorted((ROOT / "launch").glob("*.launch")),
    "tests": [*sorted((ROOT / "test/rostest").glob("*.test")), *sorted((ROOT / "test/system").glob("*.launch"))],
}


def declared(kinds: set[str]) -> set[str]:
    return {e.text for e in ElementTree.parse(ROOT / "package.xml").getroot() if e.tag in kinds and e.text}


def from_pip() -> set[str]:
    """Modules of what requirements.txt names."""
    lines = (ROOT / "requirements.txt").read_text(encoding="utf-8").splitlines()
    wanted = {line.partition("==")[0].lower() for line in lines if not line.startswith("#")}
    return {module for module, names in packages_distributions().items() if {name.lower().replace("-", "_") for name in names} & wanted}


def imports(tree: ast.AST) -> Iterator[str]:
    """Top-level modules, but for those that may be missing: under a try that catches ImportError."""
    for node in ast.iter_child_nodes(tree):
        if isinstance(node, ast.Try) and any(isinstance(h.type, ast.Name) and h.type.id == "ImportError" for h in node.handlers):
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.partition(".")[0]
        yield from imports(node)


def packages_in(launch: str) -> set[str]:
    """Packages whose nodes a launch file starts, or whose files it names."""
    return set(re.findall(r'(?:pkg="|\$\(find |rosrun )(\w+)', launch))


@pytest.mark.parametrize(("code", "kinds"), [("nodes", RUN), ("tests", TEST)])
def test_imported_packages_are_declared(code: str, kinds: set[str]) -> None:
    neighbours = {path.stem for path in ROOT.glob("test/**/*.py")} | {path.stem for path in ROOT.glob("scripts/*.py")}
    known = set(sys.stdlib_module_names) | HOUSE | from_pip() | neighbours | declared(kinds)
    found = {(path.name, name) for path in CODE[code] for name in imports(ast.parse(path.read_text(encoding="utf-8")))}
    assert not sorted((path, name) for path, name in found if name not in known)


@pytest.mark.parametrize(("code", "kinds"), [("nodes", RUN), ("tests", TEST)])
def test_launched_packages_are_declared(code: str, kinds: set[str]) -> None:
    found = {(path.name, name) for path in LAUNCHED[code] for name in packages_in(path.read_text(encoding="utf-8"))}
    assert found
    assert not sorted((path, name) for path, name in found if name not in declared(kinds) | HOUSE)


def test_package_that_may_be_missing_need_not_be_declared() -> None:
    source = "import rospy\ntry:\n    from map_msgs.msg import A\nexcept ImportError:\n    A = None\ndef f():\n    import tf2_ros\n"
    assert set(imports(ast.parse(source))) == {"rospy", "tf2_ros"}


def test_launch_file_names_packages_in_three_ways() -> None:
    text = '<node pkg="rviz" launch-prefix="rosrun gate it"/><include file="$(find maps)/a.launch"/><param name="x" value="$(arg y)"/>'
    assert packages_in(text) == {"rviz", "gate", "maps"}
