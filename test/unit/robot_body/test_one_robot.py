"""The robot stands in one place: nothing else in the project says by itself how large it is or what it can do."""

import ast
import dataclasses
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from robot_body import RobotBody

ROOT = Path(__file__).resolve().parents[3]
HUSKY = RobotBody()
MODULES = sorted([p for p in (ROOT / "src").rglob("*.py") if p.parent.name != "robot_body"] + [*(ROOT / "nodes").iterdir()])
FILES = sorted([p for p in (ROOT / "config").rglob("*.yaml") if p.name != "robot.yaml" and p.parent.name != "robots"])
OF_THE_BODY = {f.name for f in dataclasses.fields(RobotBody)} - {"name", "urdf", "mounts"}
# A name that also means something else: how fast the follower wants to go, how far the costmap's costs reach, how wide a door is.
OTHER_KEYS = {"max_speed_mps", "max_turn_rate_radps", "inflation_radius_m"}
OF_THE_FOLLOWER = {"max_speed_mps", "max_turn_rate_radps", "max_acceleration_mps2", "max_turn_acceleration_radps2"}
OTHERS = {("path_following/config.py", name) for name in OF_THE_FOLLOWER}
OTHERS |= {("local_terrain_costmap/config.py", "inflation_radius_m"), ("simulated_movers/specification.py", "width_m")}  # a door's


def significant_digits(value: float) -> int:
    return len(f"{value:.6g}".replace(".", "").lstrip("0"))


def telling_numbers() -> set[float]:
    """Values of the robot, and what is derived from them, that nobody writes for another reason."""
    derived = [name for name, member in vars(RobotBody).items() if isinstance(member, property) and name.endswith(("_m", "_rad"))]
    values = [getattr(HUSKY, name) for name in [*OF_THE_BODY, *derived]]
    return {round(v, 6) for v in values if isinstance(v, float) and significant_digits(v) >= 3}


def is_number(node: ast.expr | None) -> bool:
    """A number, also one behind a minus, in a tuple, or as the default of a `parameter`."""
    match node:
        case ast.Constant(value=value):
            return isinstance(value, (int, float)) and not isinstance(value, bool)
        case ast.UnaryOp(operand=operand):
            return is_number(operand)
        case ast.Tuple(elts=elements):
            return any(map(is_number, elements))
        case ast.Call(args=[first, *_]):
            return is_number(first)
    return False


def given_numbers(tree: ast.Module) -> Iterator[str]:
    """Names that are assigned a number, one by one or in a row."""
    for node in ast.walk(tree):
        targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        for target in targets:
            names = target.elts if isinstance(target, ast.Tuple) else [target]
            values = node.value.elts if isinstance(node.value, ast.Tuple) and len(names) > 1 else [node.value] * len(names)
            yield from (name.id for name, value in zip(names, values, strict=False) if isinstance(name, ast.Name) and is_number(value))


def relative(path: Path) -> str:
    return path.relative_to(path.parents[1]).as_posix()


def keys(content: object) -> Iterator[str]:
    if isinstance(content, dict):
        for key, value in content.items():
            yield str(key)
            yield from keys(value) if key != "robot" else ()


def test_names_and_numbers_are_looked_for_that_there_are() -> None:
    assert {0.132, 0.1651, 0.0992, 0.5708, 0.512, 1.16, 0.335, 0.385} <= telling_numbers()
    found = set(given_numbers(ast.parse("LENGTH_M, WIDTH_M = 0.9, 0.6\ntrack_m: float = parameter(0.5)\nbody_min_m = (-0.6, 0.4)")))
    assert found == {"LENGTH_M", "WIDTH_M", "track_m", "body_min_m"}


@pytest.mark.parametrize("path", MODULES, ids=relative)
def test_module_gives_no_name_of_the_body_a_number(path: Path) -> None:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    named = [name for name in given_numbers(tree) if name.lower() in OF_THE_BODY and (relative(path), name) not in OTHERS]
    assert not named, f"{named} of {path}: the robot stands in robot_body"


@pytest.mark.parametrize("path", MODULES, ids=relative)
def test_module_holds_no_number_of_the_body(path: Path) -> None:
    constants = (node.value for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Constant))
    found = {value for value in constants if isinstance(value, float) and round(abs(value), 6) in telling_numbers()}
    assert not found, f"{found} in {path}: the robot stands in robot_body"


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.name)
def test_parameter_file_says_nothing_of_the_body(path: Path) -> None:
    found = set(keys(yaml.safe_load(path.read_text(encoding="utf-8")))) & OF_THE_BODY
    assert found <= OTHER_KEYS, f"{found} of {path.name}: the robot stands in robot.yaml"
