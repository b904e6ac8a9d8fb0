"""What --help and the pages say of how a tool is called: with examples that it would take."""

import argparse
import re
import shlex
from collections.abc import Callable
from pathlib import Path

import pytest

import evaluation_campaign.arguments
import explore_command.arguments
import mapping_tools.calibrate_mount
import mapping_tools.map_bag
import mapping_tools.merge_maps
import mapping_tools.optimize_graph
import mapping_tools.register_clouds
import run_replay.arguments
import terrain_tools.classify_map
import terrain_tools.export_map
from mapping_tools.live_arguments import live_arguments

ROOT = Path(__file__).resolve().parents[2]
PARSERS: dict[str, Callable[[], argparse.ArgumentParser]] = {
    "calibrate_mount": mapping_tools.calibrate_mount.parser,
    "classify_map": terrain_tools.classify_map.parser,
    "evaluate": evaluation_campaign.arguments.parser,
    "explore": explore_command.arguments.parser,
    "export_map": terrain_tools.export_map.parser,
    "map_bag": mapping_tools.map_bag.parser,
    "merge_maps": mapping_tools.merge_maps.parser,
    "optimize_graph": mapping_tools.optimize_graph.parser,
    "register_clouds": mapping_tools.register_clouds.parser,
    "replay": run_replay.arguments.parser,
}
ELSEWHERE = {"check": "check", "check_robot": "nodes/check_robot_node"}
"""Tools without such a parser, and where their help stands."""


def test_every_tool_is_listed_here() -> None:
    tools = {path.name for path in ROOT.iterdir() if path.is_file() and path.stat().st_mode & 0o100}
    assert tools == PARSERS.keys() | ELSEWHERE.keys()


@pytest.mark.parametrize("tool", PARSERS)
def test_example_of_a_tool_is_one_that_it_takes(tool: str) -> None:
    parser = PARSERS[tool]()
    example = re.search(rf"Example:\s\./{tool} (.*?)\.\s", parser.epilog or "")
    assert example, parser.epilog
    parser.parse_args(shlex.split(example[1]))


@pytest.mark.parametrize("tool", ELSEWHERE)
def test_tool_with_another_help_has_an_example(tool: str) -> None:
    assert re.search(rf"Example.*\./{tool}\b", (ROOT / ELSEWHERE[tool]).read_text(encoding="utf-8"))


def commands_of(page: Path) -> list[list[str]]:
    """The words of all commands ./TOOL of a page, in its blocks of code; what stands in capitals or dots is no command."""
    blocks = re.findall(r"^```\n(.*?)^```|((?:^    [^\n]*\n)+)", page.read_text(encoding="utf-8"), re.S | re.M)
    lines = [line.strip() for fenced, indented in blocks for line in (fenced or indented).splitlines()]
    words = [shlex.split(line, comments=True) for line in lines if line.startswith("./")]
    return [found for found in words if found[0][2:] in PARSERS and not {"FILE", "...", "FILE.yaml"} & set(found)]


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


@pytest.mark.parametrize("page", PAGES, ids=[page.name for page in PAGES])
def test_commands_of_a_page_are_ones_that_the_tools_take(page: Path) -> None:
    for tool, *words in commands_of(page):
        if tool != "./calibrate_mount" or "--from" in words:
            PARSERS[tool[2:]]().parse_args(words)
        else:
            live_arguments([word for word in words if not word.endswith(":=FILE")])


def test_tutorial_and_readme_have_commands() -> None:
    assert all(len(commands_of(ROOT / page)) > 4 for page in ("README.md", "docs/tutorial.md"))
