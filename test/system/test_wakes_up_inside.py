"""A robot that starts in a dead end too narrow to turn in: straight out, and then it explores."""

from pathlib import Path

import numpy as np
import trimesh
from box_worlds import box, walled_floor
from exploring import ExploreRun, summary

LIMIT_S = 240.0
INSIDE_Y = (-0.5, 0.5)
START = 0.7, 0.03, 0.06  # nose towards the end


def world() -> trimesh.Trimesh:
    """A walled room with a dead end of 1 m by 3 m."""
    sides = [box((0.0, 4.0), y, (-0.1, 1.6)) for y in ((-3.0, INSIDE_Y[0]), (INSIDE_Y[1], 3.0))]
    return trimesh.util.concatenate([walled_floor((-5.0, 4.0), (-3.0, 3.0)), *sides, box((3.0, 4.0), INSIDE_Y, (-0.1, 1.6))])


def test_robot_leaves_backwards_and_explores(tmp_path: Path) -> None:
    out = tmp_path / "run"
    world().export(tmp_path / "world.obj")
    with ExploreRun("--world", tmp_path / "world.obj", "--start", *START, "--headless", "--out", out) as explore:
        code = explore.wait(LIMIT_S)
    assert code == 0, explore.text
    result, truth = summary(out), np.loadtxt(out / "trajectory_truth.txt")
    assert result["collisions"] == 0 and float(str(result["coverage"])) > 0.99, result
    assert "out of a place without room to turn" in (out / "events.csv").read_text()
    yaw = 2.0 * np.arctan2(truth[:, 6], truth[:, 7])
    inside = truth[:, 1] > 0.0
    assert inside.any() and truth[-1, 1] < 0.0 and np.abs(yaw[inside]).max() < 0.2
