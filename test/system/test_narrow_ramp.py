"""Up a ramp on which the robot cannot turn, to see a block that is too high to be seen from below, and out again backwards."""

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from box_worlds import box, walled_floor
from exploring import ExploreRun, summary
from scipy.spatial.transform import Rotation

LIMIT_S = 400.0
ROOM = (-3.2, 5.8), (-2.6, 2.6)
FOOT_X, BLOCK_X, BLOCK_Y, BLOCK_M, RAMP_Y = -0.4, (4.08, 5.6), (-0.8, 0.8), 1.2, (-0.5, 0.5)
HIGH_X = FOOT_X + 0.1 / math.tan(math.radians(15.0))  # from where the ramp is 10 cm high
OUTLINE = np.array([(x, y) for x in np.linspace(-0.495, 0.495, 9) for y in (-0.335, 0.335)])  # of the robot, in base_link
KEPT_M = 0.05  # from a drop

Run = tuple[Path, int, str]


def world() -> trimesh.Trimesh:
    """A walled room with a ramp of 1 m up to a block; 15 degrees."""
    corners = [(x, y, z) for y in RAMP_Y for x, z in ((FOOT_X, 0.0), (BLOCK_X[0], 0.0), (BLOCK_X[0], BLOCK_M))]
    ramp = trimesh.convex.convex_hull(np.array(corners))
    return trimesh.util.concatenate([walled_floor(*ROOM), ramp, box(BLOCK_X, BLOCK_Y, (-0.1, BLOCK_M))])


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Folder, exit code and terminal of one run."""
    folder = tmp_path_factory.mktemp("narrow_ramp")
    world().export(folder / "world.obj")
    with ExploreRun("--world", folder / "world.obj", "--start", -2.2, -1.2, 0.3, "--headless", "--out", folder / "run") as explore:
        return folder / "run", explore.wait(LIMIT_S), explore.text


def truth_of(run: Run) -> np.ndarray:
    """(T, 8) stamps and poses of the robot."""
    return np.loadtxt(run[0] / "trajectory_truth.txt")


def test_run_ends_explored_without_a_touch_and_off_the_ramp(run: Run) -> None:
    out, code, text = run
    assert code == 0, text
    result = summary(out)
    assert str(result["stop_reason"]).startswith("explored") and result["collisions"] == 0, result
    assert truth_of(run)[-1, 3] < 0.2


def test_block_was_looked_at_from_the_ramp(run: Run) -> None:
    x, y, z = truth_of(run)[:, 1:4].T
    assert z[(np.abs(y) < 0.3) & (x > HIGH_X)].max() > 0.6
    assert "out of a place without room to turn" in (run[0] / "events.csv").read_text()


def test_judge_knows_the_shortest_way_there(run: Run) -> None:
    assert 1.0 <= summary(run[0])["path_ratio"] < 2.0


def test_outline_stays_over_the_ramp(run: Run) -> None:
    truth = truth_of(run)
    R = Rotation.from_quat(truth[:, 4:8]).as_matrix()[:, :2, :2]
    x, y = (truth[:, None, 1:3] + OUTLINE @ R.transpose(0, 2, 1)).transpose(2, 0, 1)
    on_ramp = (x > HIGH_X) & (x < BLOCK_X[0]) & (truth[:, 3:4] > 0.18) & (np.abs(truth[:, 2:3]) < 0.6)
    assert on_ramp.any()
    assert np.minimum(y - RAMP_Y[0], RAMP_Y[1] - y)[on_ramp].min() > KEPT_M
