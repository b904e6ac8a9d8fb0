"""A whole exploration of `rooms` with a spinning lidar in the laser's place: as complete, as true, and the same every time."""

from pathlib import Path

import pytest
from exploring import ExploreRun, summary

LIMIT_S = 400.0
AGAIN_S = 20  # sweeps, a decision and a drive


@pytest.fixture(scope="module")
def spinning_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int, str]:
    """Folder, exit code and terminal of one run."""
    return explored(tmp_path_factory.mktemp("spinning") / "run")


def explored(out: Path, *arguments: object) -> tuple[Path, int, str]:
    with ExploreRun("--world", "rooms", "--seed", 1, "--sensor", "spinning", "--headless", "--out", out, *arguments) as run:
        return out, run.wait(LIMIT_S), run.text


def test_rooms_are_explored_without_a_collision(spinning_run: tuple[Path, int, str]) -> None:
    out, code, text = spinning_run
    assert code == 0, text
    result = summary(out)
    assert str(result["stop_reason"]).startswith("explored"), result
    assert result["coverage"] >= 0.95 and result["collisions"] == 0, result  # type: ignore[operator]


def test_map_and_trajectory_are_true(spinning_run: tuple[Path, int, str]) -> None:
    result = summary(spinning_run[0])
    assert result["trajectory_ate_m"] < 0.05 and result["map_rmse_m"] < 0.05, result  # type: ignore[operator]


def test_no_node_printed_a_traceback(spinning_run: tuple[Path, int, str]) -> None:
    assert "Traceback" not in (spinning_run[0] / "roslaunch.log").read_text()


def test_same_run_again_drives_the_same_way(spinning_run: tuple[Path, int, str], tmp_path: Path) -> None:
    out, _, text = explored(tmp_path / "again", "--max-sim-time", AGAIN_S)
    assert str(summary(out)["stop_reason"]).startswith("time limit"), text
    again, first = ((folder / "trajectory_truth.txt").read_text().splitlines() for folder in (out, spinning_run[0]))
    assert len(again) > 0.9 * AGAIN_S / 0.05 and summary(out)["distance_m"] > 1.0  # type: ignore[operator]
    assert again == first[: len(again)]
