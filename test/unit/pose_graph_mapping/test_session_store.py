"""The session on disk: round trips, files that others open, and crashes between two steps."""

import json
import os

import numpy as np
import open3d as o3d
import pytest

from pose_graph_mapping import session_store
from pose_graph_mapping.pose_graph import EdgeKind, PoseGraph
from pose_graph_mapping.session_store import SessionStore, ply_bytes, tum_text, write_atomically
from rigid_geometry import inverse, quat_xyzw_from_transform, transform_from_rpy


def sweep_of(seed, count=500):
    rng = np.random.default_rng(seed)
    return rng.uniform(-2, 2, (count, 3)).astype(np.float32), rng.normal(0, 0.1, (count, 3)).astype(np.float32)


def graph_of(count):
    graph = PoseGraph()
    for k in range(count):
        graph.add_vertex(transform_from_rpy((10.0 * k, 0, 0), (0, 0, 0.3 * k)))
        if k:
            graph.add_edge(k - 1, k, inverse(graph.pose(k - 1)) @ graph.pose(k), np.eye(6), EdgeKind.ODOMETRY)
    return graph


def filled(directory, count=3):
    store = SessionStore(directory)
    for k in range(count):
        store.add_sweep(k, 1.5 * k, *sweep_of(k))
    return store


def test_sweeps_come_back_bit_for_bit(tmp_path):
    filled(tmp_path)
    again = SessionStore(tmp_path)
    assert [s.stamp_s for s in again.sweeps] == [0.0, 1.5, 3.0]
    for k in range(3):
        points, origins = sweep_of(k)
        cloud = again.load_sweep(k)
        np.testing.assert_array_equal(cloud.points, points)
        np.testing.assert_array_equal(cloud.origins, origins)


def test_saved_graph_trajectory_and_cloud_are_read_by_others(tmp_path):
    store, graph = filled(tmp_path), graph_of(3)
    store.save(graph, map_voxel_m=0.05)
    np.testing.assert_allclose(PoseGraph.load_g2o(tmp_path / "graph.g2o").poses(), graph.poses(), atol=1e-9)
    trajectory = np.loadtxt(tmp_path / "trajectory.txt")
    np.testing.assert_allclose(trajectory[:, 0], [0.0, 1.5, 3.0])
    np.testing.assert_allclose(trajectory[:, 1:4], graph.poses()[:, :3, 3], atol=1e-8)
    np.testing.assert_allclose(trajectory[2, 4:], quat_xyzw_from_transform(graph.pose(2)), atol=1e-8)
    points = np.asarray(o3d.io.read_point_cloud(str(tmp_path / "cloud.ply")).points)
    np.testing.assert_allclose(points, store.merged_points(graph.poses(), 0.05), atol=1e-5)
    assert points[:, 0].min() < 0 and points[:, 0].max() > 19


def test_saving_twice_replaces_and_leaves_no_other_file(tmp_path):
    store = filled(tmp_path, 2)
    store.save(graph_of(2))
    store.add_sweep(2, 9.0, *sweep_of(2))
    store.save(graph_of(3))
    assert sorted(os.listdir(tmp_path)) == ["cloud.ply", "graph.g2o", "sweeps", "trajectory.txt"]
    assert sorted(os.listdir(tmp_path / "sweeps")) == ["000000.npz", "000001.npz", "000002.npz", "index.json"]
    assert len(np.loadtxt(tmp_path / "trajectory.txt")) == 3


def test_crash_before_the_index_leaves_the_sweeps_that_were_whole(tmp_path, monkeypatch):
    store = filled(tmp_path, 2)
    write = session_store.write_atomically

    def dies_at_the_index(path, data):
        if path.name == "index.json":
            raise OSError("the plug is pulled")
        write(path, data)

    monkeypatch.setattr(session_store, "write_atomically", dies_at_the_index)
    with pytest.raises(OSError, match="plug"):
        store.add_sweep(2, 9.0, *sweep_of(2))
    monkeypatch.undo()
    again = SessionStore(tmp_path)
    assert len(again.sweeps) == 2
    again.add_sweep(2, 9.0, *sweep_of(2))
    assert len(SessionStore(tmp_path).sweeps) == 3


def test_crash_while_replacing_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "graph.g2o"
    write_atomically(path, b"old")
    monkeypatch.setattr(os, "replace", lambda a, b: (_ for _ in ()).throw(OSError("no")))
    with pytest.raises(OSError, match="no"):
        write_atomically(path, b"new")
    assert path.read_bytes() == b"old" and os.listdir(tmp_path) == ["graph.g2o"]


def test_data_are_on_disk_before_the_index_names_them(tmp_path, monkeypatch):
    order, write = [], session_store.write_atomically
    monkeypatch.setattr(session_store, "write_atomically", lambda path, data: (order.append(path.name), write(path, data)))
    filled(tmp_path, 1)
    assert order == ["000000.npz", "index.json"]


def test_index_that_names_a_truncated_file_is_an_error(tmp_path):
    filled(tmp_path, 1)
    path = tmp_path / "sweeps" / "000000.npz"
    path.write_bytes(path.read_bytes()[:-10])
    with pytest.raises(ValueError, match="000000.npz is not the file"):
        SessionStore(tmp_path)


def test_unreadable_index_is_an_error(tmp_path):
    filled(tmp_path, 1)
    (tmp_path / "sweeps" / "index.json").write_text(json.dumps([{"vertex": 0}]))
    with pytest.raises(ValueError, match="cannot be read"):
        SessionStore(tmp_path)


def test_vertex_out_of_turn_is_refused(tmp_path):
    with pytest.raises(ValueError, match="vertex 5 where 0 is next"):
        SessionStore(tmp_path).add_sweep(5, 0.0, *sweep_of(0))
    with pytest.raises(ValueError, match="no sweep of vertex 0"):
        SessionStore(tmp_path).load_sweep(0)


def test_graph_of_another_length_is_refused(tmp_path):
    with pytest.raises(ValueError, match="2 vertices for 3 stored sweeps"):
        filled(tmp_path).save(graph_of(2))


def test_empty_session_saves_an_empty_cloud(tmp_path):
    SessionStore(tmp_path).save(PoseGraph())
    assert b"element vertex 0\n" in (tmp_path / "cloud.ply").read_bytes()
    assert ply_bytes(np.zeros((0, 3))).endswith(b"end_header\n")


def test_tum_line_is_stamp_position_and_quaternion():
    assert tum_text([1.25], np.eye(4)[None]).split() == ["1.250000", *["0.000000000"] * 6, "1.000000000"]
