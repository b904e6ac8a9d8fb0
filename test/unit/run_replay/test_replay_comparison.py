"""Two runs of one world lie on each other, however their map frames lie; without common truth they are left as they are."""

from pathlib import Path

import numpy as np
from recorded_runs import write_run

from rigid_geometry import transform_from_rpy
from run_replay.comparison import chessboard, compare_runs

OTHER_FRAME = transform_from_rpy((-1.0, 3.0, 0.132), (0.0, 0.0, -0.4))


def test_maps_of_one_world_coincide(tmp_path: Path) -> None:
    first, second = write_run(tmp_path / "a"), write_run(tmp_path / "b", OTHER_FRAME)
    found = compare_runs(first, second)
    assert found.why_not_aligned == ""
    np.testing.assert_allclose(found.second.points, found.first.points, atol=1e-3)
    np.testing.assert_allclose(found.second.path_poses, found.first.path_poses, atol=1e-3)
    np.testing.assert_allclose(found.middle, found.first.points.mean(axis=0), atol=1e-3)


def test_other_worlds_are_left_in_their_frames(tmp_path: Path) -> None:
    first, second = write_run(tmp_path / "a"), write_run(tmp_path / "b", OTHER_FRAME, world="moon")
    found = compare_runs(first, second)
    assert "rooms and moon" in found.why_not_aligned
    assert np.abs(found.second.points - found.first.points).max() > 1.0


def test_run_without_truth_is_left_in_its_frame(tmp_path: Path) -> None:
    first, second = write_run(tmp_path / "a"), write_run(tmp_path / "b", OTHER_FRAME)
    (second / "trajectory_truth.txt").unlink()
    found = compare_runs(first, second)
    assert "b has no truth" in found.why_not_aligned and "trajectory_truth.txt" in found.why_not_aligned
    assert len(found.second.path_poses) == 5


def test_run_that_does_not_say_its_world_is_left_in_its_frame(tmp_path: Path) -> None:
    first, second = write_run(tmp_path / "a"), write_run(tmp_path / "b", OTHER_FRAME)
    (first / "run.json").unlink()
    assert "run.json" in compare_runs(first, second).why_not_aligned


def test_shared_cells_are_drawn_once_and_by_turns() -> None:
    line = np.column_stack([np.arange(10) + 0.5, np.zeros(10), np.zeros(10)])
    first, second = chessboard(line, line, cell_m=1.0)
    assert (first ^ second).all() and (first[:-1] ^ first[1:]).all()


def test_cells_of_one_map_alone_are_all_drawn() -> None:
    line = np.column_stack([np.arange(10) + 0.5, np.zeros(10), np.zeros(10)])
    first, second = chessboard(line, line + [20.0, 0.0, 0.0], cell_m=1.0)
    assert first.all() and second.all()
