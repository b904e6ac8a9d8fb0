"""The figures of docs/terrain.md show what the classification does."""

import re
from pathlib import Path

import pytest
from terrain_figures import classified, classified_plan

from explore_command.parameters import read_profile
from octomap_server_3dnav.terrain.classify import TerrainConfig
from stage_config import load_config

DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "terrain.md"
FIGURES = re.findall(r"```terrain (\w+)\n(.*?)\n```", DOCUMENT.read_text(encoding="utf-8"), flags=re.DOTALL)
PLANS = re.findall(r"```plan (\w+)\n(.*?)\n```", DOCUMENT.read_text(encoding="utf-8"), flags=re.DOTALL)


def terrain_config(profile: str) -> TerrainConfig:
    values = read_profile(profile).get("octomap_server_3dnav_node", {})
    return load_config(TerrainConfig, {path.removeprefix("terrain/"): v for path, v in values.items() if path.startswith("terrain/")})


def test_document_has_its_figures() -> None:
    assert len(FIGURES) >= 8


@pytest.mark.parametrize(("profile", "figure"), FIGURES, ids=range(len(FIGURES)))
def test_figure_is_classified_as_drawn(profile: str, figure: str) -> None:
    lines = figure.split("\n")
    assert "\n".join(classified(lines, terrain_config(profile))).rstrip() == figure


@pytest.mark.parametrize(("profile", "figure"), PLANS, ids=range(len(PLANS)))
def test_plan_is_classified_as_drawn(profile: str, figure: str) -> None:
    assert "\n".join(classified_plan(figure.split("\n"), terrain_config(profile))) == figure
