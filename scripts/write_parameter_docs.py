"""Writes docs/parameters.md from the dataclasses that hold the defaults, the launch files and the nodes' docstrings.

    python scripts/write_parameter_docs.py [--check]        in the shell that `source .ws/devel/setup.bash` gives

With --check nothing is written; the exit code is 1 when the file is not what the code says.
"""

import argparse
import ast
import dataclasses
import math
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src"))

from explore_command.parameters import NODE_CONFIGS, ROBOT, config_class  # noqa: E402
from robot_body import RobotBody, SensorMount  # noqa: E402
from stage_config import documented  # noqa: E402

TARGET = ROOT / "docs" / "parameters.md"
HEADER = ("Parameter", "Default", "Unit", "Allowed", "Meaning")
INTRODUCTION = """# Parameters

Made by `scripts/write_parameter_docs.py` from the dataclasses in `src/`, which are the only home of the defaults. Edits here are lost.
"""
WAYS_TO_SET = """## How to set them

A parameter is private to its node. To change it, in the order in which one overrides the other:

- in the node's file in `config/`, which its launch file loads; the values there are the defaults of those that are touched first;
- in `config/modes/driving.yaml`, which is loaded after them unless it maps by stop and go: it drives at up to 0.7 m/s, for one.
  `driving_lidar.yaml` beside it is for `sensor:=spinning`, `off.yaml` for `mapping:=off`;
- in a profile: `./explore --profile FILE`;
- in a YAML file of your own, by node: `roslaunch explore_3dnav explore.launch overrides:=FILE`;
- for one run: `./explore --set octomap_server_3dnav_node/resolution=0.05`.

All nodes read the robot. Its values are in `config/robot.yaml`, or in a file like it: `./explore --robot FILE`. Single ones are set below
`robot` in the same ways: `./explore --set robot/max_step_m=0.08`.

Those with a star in the column *Allowed* may be changed while the node runs, by [dynamic_reconfigure](interfaces.md#dynamic_reconfigure).

An unknown name, a wrong type or a value out of range ends the run before it starts. The message names the nearest valid name. `run.json`
and `summary.json` keep what was set. Angles are in radians, lengths in metres, times in seconds of the robot's clock.
"""


class Common(NamedTuple):
    """A parameter that people change: its name as `--set` takes it, and when to touch it."""

    name: str
    when: str


COMMON = (
    Common("robot/length_m", "another robot, with all that is mounted on it"),
    Common("robot/width_m", "another robot, with some room for what sticks out"),
    Common("robot/max_step_m", "another robot, or kerbs that it should not climb"),
    Common("robot/max_slope_rad", "another robot, or slippery ground"),
    Common("robot/max_speed_mps", "another drive; the follower never asks for more"),
    Common(
        "octomap_server_3dnav_node/resolution",
        "finer for small maps and narrow places; give `move_base_node/costmap/resolution_m` the same",
    ),
    Common("octomap_server_3dnav_node/max_range_m", "another laser; hits count within `crop_half_m` only, so change both"),
    Common("octomap_server_3dnav_node/terrain/range_noise_m", "another laser: more noise makes the robot more careful"),
    Common("octomap_server_3dnav_node/terrain/margin_m", "more where ranges or poses are worse than thought, less where room is scarce"),
    Common("octomap_server_3dnav_node/exploration/local_radius_m", "higher: it leaves near frontiers less often; lower: it decides sooner"),
    Common(
        "move_base_node/follower/max_speed_mps",
        "lower on rough ground, higher on a floor; `config/modes/driving.yaml` sets 0.7 while it maps and drives",
    ),
    Common("stop_scan_and_go_node/max_distance_m", "lower where odometry slips, higher where time is short"),
)
# What the nodes read beside the configuration of their stage; the rest comes from the launch arguments of the same name.
OWN_PARAMETERS = {
    "pybullet_sim_node": (
        ("`~answer_timeout_s`", "120.0", "s", "> 0", "wall time after which an unanswered tick ends the run and names what is missing"),
        ("`~ready_timeout_s`", "60.0", "s", "> 0", "wall time within which the nodes of `~wait_for_nodes` must be ready"),
        ("`~wait_for_nodes`", "all of the launch file", "-", "names", "the clock starts when these are ready"),
    ),
}


class Launched(NamedTuple):
    """A node as the launch files start it: its name, launch file and configuration file."""

    name: str
    launch: str
    config: str


def launched_nodes(launch_folder: Path) -> list[Launched]:
    """This package's nodes in the order in which explore.launch includes their files."""
    includes = ElementTree.parse(launch_folder / "explore.launch").getroot().iter("include")
    return [node for include in includes for node in _nodes_of(launch_folder / Path(include.attrib["file"]).name)]


def _nodes_of(launch: Path) -> Iterator[Launched]:
    for node in ElementTree.parse(launch).getroot().iter("node"):
        config = node.find("rosparam")
        if config is not None:
            yield Launched(node.attrib["name"], launch.name, Path(config.attrib["file"]).name)


def purpose(node: Path) -> str:
    """The first paragraph of a node's docstring."""
    text = ast.get_docstring(ast.parse(node.read_text(encoding="utf-8"))) or ""
    return text.split("\n\n")[0].replace("\n", " ")


def _number(value: float) -> str:
    return f"{value:.4g}" if isinstance(value, float) and len(repr(value)) > 8 else repr(value)


def shown_value(value: Any, unit: str) -> str:
    """A default as one would write it in YAML, long floats with four digits, angles in degrees beside it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(item.frame if isinstance(item, SensorMount) else _number(item) for item in value)}]"
    if isinstance(value, str):
        return value or '""'
    degrees = f" ({math.degrees(value):.3g} deg)" if unit.startswith("rad") and "/" not in unit and value else ""
    return _number(value) + degrees


def allowed(field: dataclasses.Field[Any]) -> str:
    """The declared range or choices of a field in words, with a star where it may be changed while the node runs."""
    return _range(field) + (" *" if field.metadata.get("at_runtime") else "")


def _range(field: dataclasses.Field[Any]) -> str:
    low, high, choices = (field.metadata.get(key) for key in ("low", "high", "choices"))
    if choices:
        return ", ".join(choices)
    if isinstance(field.default, bool):
        return "true, false"
    if low is None and high is None:
        return "any"
    if high is None:
        return f">= {low:g}"
    return f"<= {high:g}" if low is None else f"{low:.4g} to {high:.4g}"


def table(rows: Iterable[Iterable[str]]) -> str:
    """A Markdown table with the reference's columns."""
    lines = [HEADER, tuple("---" for _ in HEADER), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines) + "\n"


def config_table(cls: type, prefix: str) -> str:
    """All fields of a configuration dataclass, their names behind `prefix`."""
    fields = {f.name: f for f in dataclasses.fields(cls)}
    return table(
        (f"`{prefix}{name}`", shown_value(default, unit), unit, allowed(fields[name]), meaning)
        for name, default, unit, meaning in documented(cls)
    )


def _section(node: str, section: str, dotted: str, first_shown: dict[str, str]) -> str:
    prefix = f"~{section}/" if section else "~"
    title = f"### `{prefix}`\n\n" if section else ""
    if dotted in first_shown:
        other = first_shown[dotted]
        return f"{title}The same parameters as [{other}](#{other}) has below `{prefix}`; `config/{section}.yaml` sets both.\n"
    first_shown[dotted] = node
    cls = config_class(dotted)
    return f"{title}{(cls.__doc__ or '').splitlines()[0]}\n\n{config_table(cls, prefix)}"


def node_chapter(node: Launched, first_shown: dict[str, str]) -> str:
    """One node: what it is for, where it is started and set, and every parameter it reads."""
    head = f"## {node.name}\n\n{purpose(ROOT / 'nodes' / node.name)} Started by `launch/{node.launch}`, set in `config/{node.config}`.\n"
    sections = [_section(node.name, *item, first_shown) for item in NODE_CONFIGS.get(node.name, {}).items()]
    own = OWN_PARAMETERS.get(node.name)
    return "\n".join([head, *sections, *([f"Of the node itself:\n\n{table(own)}"] if own else [])])


def common_chapter(nodes: Iterable[Launched]) -> str:
    """The parameters that people change, a line each; only the last column is written by hand."""
    files = {node.name: node.config for node in nodes} | {ROBOT: "robot.yaml"}
    head = (
        "## Those that people change\n\nThe names are as `./explore --set NAME=VALUE` takes them. The defaults suit the simulated Husky.\n"
    )
    head += "\n| Name | Default | Where | What for | When to touch it |\n| --- | --- | --- | --- | --- |\n"
    rows = "".join(f"| `{c.name}` | {_default_and_file(c.name, files)} | {c.when} |\n" for c in COMMON)
    return f"{head}{rows}\nWhat the judge asks of a success is no parameter: [The judge](architecture.md#the-judge).\n"


def _default_and_file(name: str, files: dict[str, str]) -> str:
    node, *section, field = name.split("/")
    cls = RobotBody if node == ROBOT else config_class(NODE_CONFIGS[node]["/".join(section)])
    default, unit, meaning = next(row[1:] for row in documented(cls) if row[0] == field)
    value, _, degrees = shown_value(default, unit).partition(" ")
    return f"{value} {unit}{degrees and ' '}{degrees} | `config/{files[node]}` | {meaning}"


def launch_arguments(launch: Path) -> str:
    """The arguments of explore.launch with their defaults."""
    arguments = ElementTree.parse(launch).getroot().findall("arg")
    rows = "".join(f"| `{a.attrib['name']}` | {a.attrib['default'] or 'empty'} | {a.attrib.get('doc', '')} |\n" for a in arguments)
    return f"## Arguments of explore.launch\n\n| Argument | Default | Meaning |\n| --- | --- | --- |\n{rows}"


def robot_chapter() -> str:
    """The robot: what robot.yaml says, and what is derived from it, with its value for ours."""
    head = (
        "## The robot\n\nThe parameters of `/robot`, all of which `config/robot.yaml` says: nothing may be missing in a file of your own.\n"
    )
    derived = "What follows from them, so that nothing of it is written by hand (`src/robot_body/body.py`):\n"
    return "\n".join([head, config_table(RobotBody, ""), derived, _derived_table(RobotBody())])


def _derived_table(robot: RobotBody) -> str:
    rows = []
    for name, member in vars(RobotBody).items():
        if isinstance(member, property):
            unit = name.rpartition("_")[2]
            text = " ".join((member.__doc__ or "").split())
            rows.append(f"| `{name}` | {shown_value(getattr(robot, name), unit)} | {unit} | {text} |\n")
    return "| Derived | Value | Unit | How |\n| --- | --- | --- | --- |\n" + "".join(rows)


def check_chapter() -> str:
    """What check_robot takes for a fault; no node of the launch file, so its parameters are given on its command line."""
    head = "## check_robot\n\nPrivate parameters, as in `rosrun explore_3dnav check_robot _apart_s:=0.2`. Below `~imu` it reads those of\n"
    head += "[odometry_fusion_node](#odometry_fusion_node).\n"
    return f"{head}\n{config_table(config_class('sensor_checks.CheckLimits'), '~')}"


def reference() -> str:
    """The whole file."""
    nodes = launched_nodes(ROOT / "launch")
    contents = "- [The robot](#the-robot)\n" + "".join(f"- [{node.name}](#{node.name})\n" for node in nodes)
    contents += "- [check_robot](#check_robot)\n"
    first_shown: dict[str, str] = {}
    chapters = [node_chapter(node, first_shown) for node in nodes]
    return "\n".join(
        [
            INTRODUCTION,
            common_chapter(nodes),
            WAYS_TO_SET,
            contents,
            robot_chapter(),
            launch_arguments(ROOT / "launch" / "explore.launch"),
            *chapters,
            check_chapter(),
        ]
    )


def main() -> int:
    parser = argparse.ArgumentParser(description="Writes docs/parameters.md from the code.")
    parser.add_argument("--check", action="store_true", help="write nothing; exit code 1 when the file is out of date")
    check = parser.parse_args().check
    text = reference()
    if check and (not TARGET.exists() or TARGET.read_text(encoding="utf-8") != text):
        print(f"{TARGET.relative_to(ROOT)} is out of date: run scripts/write_parameter_docs.py", file=sys.stderr)
        return 1
    if not check:
        TARGET.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
