"""A whole exploration of `doors`: through every passage that leaves no room to turn, up the narrow ramp, and nothing is touched."""

from pathlib import Path

import numpy as np
import pytest
from exploring import ExploreRun, summary

LIMIT_S = 600.0
HALL_X, MIDDLE_Y, DECK_X, DECK_HEIGHT_M = -1.5, 0.0, 3.0, 0.45
INSIDE_M = 0.6  # from a wall on, the robot is through its door

Run = tuple[Path, int, str]


@pytest.fixture(scope="module")
def doors_run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Folder, exit code and terminal of one run."""
    out = tmp_path_factory.mktemp("doors") / "run"
    with ExploreRun("--world", "doors", "--seed", 1, "--headless", "--out", out) as run:
        return out, run.wait(LIMIT_S), run.text


def test_doors_are_explored_without_a_collision(doors_run: Run) -> None:
    out, code, text = doors_run
    assert code == 0, text
    result = summary(out)
    assert str(result["stop_reason"]).startswith("explored"), result
    assert result["collisions"] == 0, result


def test_robot_was_in_both_rooms_in_the_hall_and_on_the_deck(doors_run: Run) -> None:
    x, y, z = np.loadtxt(doors_run[0] / "trajectory_truth.txt")[:, 1:4].T
    in_a_room, in_the_hall = x < HALL_X - INSIDE_M, x > HALL_X + INSIDE_M
    assert (in_a_room & (y < MIDDLE_Y - INSIDE_M)).any() and (in_a_room & (y > MIDDLE_Y + INSIDE_M)).any() and in_the_hall.any()
    assert ((x > DECK_X + INSIDE_M) & (z > DECK_HEIGHT_M)).any()


def test_no_node_printed_a_traceback(doors_run: Run) -> None:
    assert "Traceback" not in (doors_run[0] / "roslaunch.log").read_text()
