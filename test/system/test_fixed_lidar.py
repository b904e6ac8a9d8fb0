"""A whole exploration of `rooms` by a robot whose lidar is fixed, pitched 25 degrees down: no joint tilts, no sweep is asked for."""

from pathlib import Path

import pytest
from exploring import ExploreRun, summary

ROBOT = Path(__file__).parents[2] / "config" / "robots" / "husky_vlp16.yaml"
AGAIN_S = 15


def explored(out: Path, *arguments: object) -> tuple[Path, int, str]:
    with ExploreRun("--robot", ROBOT, "--world", "rooms", "--seed", 1, "--headless", "--out", out, *arguments) as run:
        return out, run.wait(400.0), run.text


@pytest.fixture(scope="module")
def driven(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, str]:
    """Folder, exit code and output of the run."""
    return explored(tmp_path_factory.mktemp("fixed") / "run")


def test_rooms_are_explored_and_mapped_truly_while_driving(driven: tuple[Path, int, str]) -> None:
    out, code, text = driven
    assert code == 0, text
    result = summary(out)
    assert result["coverage"] >= 0.995 and result["collisions"] == 0 and result["wrong_edges"] == 0, result  # type: ignore[operator]
    assert result["trajectory_ate_m"] < 0.03 and result["map_rmse_m"] < 0.03, result  # type: ignore[operator]


def test_it_stands_only_to_look(driven: tuple[Path, int, str]) -> None:
    activity = summary(driven[0])["activity_s"]
    assert isinstance(activity, dict)
    assert activity["driving"] > 0.8 * sum(activity.values()), activity


def test_no_node_printed_a_traceback(driven: tuple[Path, int, str]) -> None:
    assert "Traceback" not in (driven[0] / "roslaunch.log").read_text()


def test_same_run_again_drives_the_same_way(driven: tuple[Path, int, str], tmp_path: Path) -> None:
    out, _, text = explored(tmp_path / "again", "--max-sim-time", AGAIN_S)
    assert str(summary(out)["stop_reason"]).startswith("time limit"), text
    again, first = ((folder / "trajectory_truth.txt").read_text().splitlines() for folder in (out, driven[0]))
    assert len(again) > 0.9 * AGAIN_S / 0.05
    assert again == first[: len(again)]
