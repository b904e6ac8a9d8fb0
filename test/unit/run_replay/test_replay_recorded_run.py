"""A run folder is read into its map frame; what it lacks is said, and only sweeps and their poses are needed."""

from pathlib import Path

import numpy as np
import pytest
from recorded_runs import LAST_S, SWEEP_STAMPS_S, T_WORLD_MAP, write_run

from octomap_server_3dnav.terrain.classify import TerrainClass
from pose_graph_mapping.session.session_store import SessionStore, tum_text
from run_replay.recorded_run import driven_path, read_run
from run_replay.timeline import frames


def test_true_path_is_in_the_map_frame(tmp_path: Path) -> None:
    run = read_run(write_run(tmp_path))
    assert run.path.T_world_map is not None
    np.testing.assert_allclose(run.path.T_world_map, T_WORLD_MAP, atol=1e-5)
    np.testing.assert_allclose(run.path.poses[-1][:3, 3], [0.5 * (LAST_S - 1.0), 0.0, 0.0], atol=1e-4)
    np.testing.assert_allclose(run.sweep_stamps_s, SWEEP_STAMPS_S)
    assert run.notes == ()


def test_voxels_have_their_classes_and_their_size(tmp_path: Path) -> None:
    run = read_run(write_run(tmp_path))
    assert run.terrain is not None and run.occupied is not None
    assert run.terrain.resolution == pytest.approx(0.08, abs=1e-4)
    assert len(run.terrain.nodes_of(TerrainClass.TRAVERSABLE)) == 3
    assert run.terrain.centers(run.terrain.nodes_of(TerrainClass.CLIFF)).shape == (2, 3)
    assert run.occupied.occupied_voxels()[0].shape == (12, 3)


def test_edges_have_their_kinds(tmp_path: Path) -> None:
    assert read_run(write_run(tmp_path)).edges == [(k, k + 1, "match") for k in range(4)]


def test_without_truth_the_path_joins_the_sweeps(tmp_path: Path) -> None:
    write_run(tmp_path)
    (tmp_path / "trajectory_truth.txt").unlink()
    run = read_run(tmp_path)
    assert run.path.T_world_map is None and len(run.path.poses) == len(SWEEP_STAMPS_S)
    assert len(run.notes) == 1 and "trajectory_truth.txt is not there" in run.notes[0]


@pytest.mark.parametrize("name", ["terrain.npz", "occupied.npz", "graph.g2o"])
def test_what_is_not_there_is_said_and_the_rest_is_shown(tmp_path: Path, name: str) -> None:
    write_run(tmp_path)
    (tmp_path / name).unlink()
    (note,) = read_run(tmp_path).notes
    assert name in note


def test_damaged_map_is_said(tmp_path: Path) -> None:
    write_run(tmp_path)
    (tmp_path / "terrain.npz").write_bytes((tmp_path / "terrain.npz").read_bytes()[:100])
    run = read_run(tmp_path)
    assert run.terrain is None and "terrain.npz" in run.notes[0]


def test_poses_of_other_sweeps_are_refused(tmp_path: Path) -> None:
    write_run(tmp_path)
    lines = (tmp_path / "trajectory.txt").read_text().splitlines(keepends=True)
    (tmp_path / "trajectory.txt").write_text("".join(lines[1:]))
    with pytest.raises(ValueError, match=r"sweeps/index\.json"):
        read_run(tmp_path)


def test_sweeps_after_the_last_saved_pose_are_left_out(tmp_path: Path) -> None:
    write_run(tmp_path)
    lines = (tmp_path / "trajectory.txt").read_text().splitlines(keepends=True)
    (tmp_path / "trajectory.txt").write_text("".join(lines[:3]))
    run = read_run(tmp_path)
    assert len(run.vertex_poses) == 3 and run.edges == [(0, 1, "match"), (1, 2, "match")]


def test_run_whose_clock_was_set_back_is_shown_sweep_by_sweep(tmp_path: Path) -> None:
    write_run(tmp_path / "whole")
    whole, store = read_run(tmp_path / "whole"), SessionStore(tmp_path / "set_back")
    stamps = [100.0, 102.0, 60.0, 62.0, 64.0]
    for k, stamp_s in enumerate(stamps):
        cloud = whole.sweeps.load_sweep(k)
        store.add_sweep(k, stamp_s, cloud.points, cloud.origins)
    (tmp_path / "set_back" / "trajectory.txt").write_text(tum_text(stamps, whole.vertex_poses))
    run = read_run(tmp_path / "set_back")
    assert run.sweep_stamps_s.tolist() == [100.0, 102.0, 103.0, 105.0, 107.0]
    shown = frames(run.path.stamps_s, run.path.poses, run.sweep_stamps_s, 0.5)
    assert [frame.sweeps for frame in shown] == sorted(frame.sweeps for frame in shown) and shown[-1].sweeps == 5
    assert driven_path(tmp_path / "set_back").stamps_s.tolist() == run.path.stamps_s.tolist()
