"""A whole exploration of `doors`: through every passage that leaves no room to turn, up the narrow ramp, and nothing is touched."""

from pathlib import Path

import numpy as np
import pytest
from exploring import ExploreRun, summary
from scipy.spatial.transform import Rotation

LIMIT_S = 600.0
HALL_X, MIDDLE_Y, DECK_X, DECK_HEIGHT_M = -1.5, 0.0, 3.0, 0.45
RAMP_X, RAMP_Y = (1.35, 3.0), (2.0, 3.0)  # from where it is 10 cm high
INSIDE_M = 0.6  # from a wall on, the robot is through its door
OUTLINE = np.array([(x, y) for x in np.linspace(-0.495, 0.495, 9) for y in (-0.335, 0.335)])  # of the robot, in base_link
KEPT_M = 0.05  # from a drop

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


def test_outline_stays_over_the_narrow_ramp(doors_run: Run) -> None:
    truth = np.loadtxt(doors_run[0] / "trajectory_truth.txt")
    R = Rotation.from_quat(truth[:, 4:8]).as_matrix()[:, :2, :2]
    x, y = (truth[:, None, 1:3] + OUTLINE @ R.transpose(0, 2, 1)).transpose(2, 0, 1)
    on_ramp = (x > RAMP_X[0]) & (x < RAMP_X[1]) & (np.abs(y - np.mean(RAMP_Y)) < 1.0)
    assert on_ramp.any()
    assert np.minimum(y - RAMP_Y[0], RAMP_Y[1] - y)[on_ramp].min() > KEPT_M


def test_no_node_printed_a_traceback(doors_run: Run) -> None:
    assert "Traceback" not in (doors_run[0] / "roslaunch.log").read_text()
