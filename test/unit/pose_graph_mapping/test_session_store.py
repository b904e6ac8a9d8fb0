"""The session on disk: round trips, files that others open, and what is left after crashes, damage and a full disk."""

import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest

from pose_graph_mapping.graph.pose_graph import EdgeKind, PoseGraph
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.session import session_index, session_store
from pose_graph_mapping.session.session_files import pcd_bytes
from pose_graph_mapping.session.session_record import Measured
from pose_graph_mapping.session.session_store import (
    DamagedSweepError,
    NotOnDiskError,
    SessionStore,
    copy_session,
    ply_bytes,
    tum_text,
)
from rigid_geometry import inverse, quat_xyzw_from_transform, transform_from_rpy

INDEX = Path("sweeps/index.json")
UP = (0.0, 0.1, 1.0)


def sweep_of(seed, count=500):
    rng = np.random.default_rng(seed)
    return rng.uniform(-2, 2, (count, 3)).astype(np.float32), rng.normal(0, 0.1, (count, 3)).astype(np.float32)


def add_vertex(graph):
    """Another vertex 10 m on, with an edge from the last one."""
    k = len(graph)
    graph.add_vertex(transform_from_rpy((10.0 * k, 0, 0), (0, 0, 0.3 * k)))
    if k:
        graph.add_edge(k - 1, k, inverse(graph.pose(k - 1)) @ graph.pose(k), np.diag(np.arange(1.0, 7.0)), EdgeKind.ODOMETRY)


def graph_of(count):
    graph = PoseGraph()
    for _ in range(count):
        add_vertex(graph)
    return graph


def add(store, graph, seed=None):
    """The next vertex, with everything that a session keeps."""
    add_vertex(graph)
    k = len(graph) - 1
    return store.add_sweep(k, 1.5 * k, *sweep_of(k if seed is None else seed), graph, Measured(graph.pose(k), UP, 0.01))


def filled(directory, count=3):
    store, graph = SessionStore(directory), PoseGraph()
    for _ in range(count):
        add(store, graph)
    return store


def lines_of(directory):
    return (directory / INDEX).read_text().splitlines()


def test_sweeps_come_back_bit_for_bit(tmp_path):
    filled(tmp_path)
    again = SessionStore(tmp_path)
    assert [s.stamp_s for s in again.sweeps] == [0.0, 1.5, 3.0] and again.notes == ()
    for k in range(3):
        points, origins = sweep_of(k)
        cloud = again.load_sweep(k)
        np.testing.assert_array_equal(cloud.points, points)
        np.testing.assert_array_equal(cloud.origins, origins)


def test_graph_comes_back_bit_for_bit(tmp_path):
    store, graph = SessionStore(tmp_path), PoseGraph()
    for _ in range(4):
        add(store, graph)
    for held in (store, SessionStore(tmp_path)):
        again = held.graph_on_disk()
        np.testing.assert_allclose(again.poses(), graph.poses(), atol=1e-15)
        for a, b in zip(again.measurements(), graph.measurements(), strict=True):
            assert (a.i, a.j, a.kind) == (b.i, b.j, b.kind)
            np.testing.assert_array_equal(a.T_i_j, b.T_i_j)
            np.testing.assert_array_equal(a.covariance, b.covariance)
    measured = SessionStore(tmp_path).sweeps[2].measured
    np.testing.assert_array_equal(measured.T_odom_base, graph.pose(2))
    np.testing.assert_allclose(measured.gravity_base, UP / np.linalg.norm(UP))
    assert measured.gravity_sigma_rad == 0.01


def test_vertices_that_moved_are_written_with_the_next_sweep(tmp_path):
    store, graph = SessionStore(tmp_path), PoseGraph()
    for _ in range(3):
        add(store, graph)
    moved = PoseGraph()
    for k, T in enumerate(graph.poses()):
        moved.add_vertex(T @ transform_from_rpy((0.5 if k == 1 else 0.001, 0, 0)))
    for edge in graph.measurements():
        moved.add_edge(edge.i, edge.j, edge.T_i_j, edge.covariance, edge.kind)
    moved.add_vertex(transform_from_rpy((30, 0, 0)))
    moved.add_edge(0, 3, transform_from_rpy((30, 0, 0)), np.eye(6), EdgeKind.LOOP)
    change = store.add_sweep(3, 9.0, *sweep_of(3), moved, Measured(np.eye(4))).change
    assert sorted(change.poses) == [1, 3] and len(change.added) == 1
    again = SessionStore(tmp_path).graph_on_disk()
    assert again.edges() == moved.edges()
    np.testing.assert_allclose(again.poses(), moved.poses(), atol=2e-3)


def test_edge_that_was_left_out_comes_back_and_is_judged_again(tmp_path):
    store, graph = SessionStore(tmp_path), PoseGraph()
    for k in range(5):
        graph.add_vertex(transform_from_rpy((k, 0, 0)))
        if k:
            graph.add_edge(k - 1, k, transform_from_rpy((1, 0, 0)), 1e-4 * np.eye(6), EdgeKind.ODOMETRY)
        if k == 4:
            graph.add_edge(0, 4, transform_from_rpy((40, 0, 0)), 1e-4 * np.eye(6), EdgeKind.LOOP)
            graph.optimise()
        store.add_sweep(k, float(k), *sweep_of(k), graph, Measured(graph.pose(k)))
    assert len(graph.rejected()) == 1
    again = SessionStore(tmp_path).graph_on_disk()
    assert len(again.measurements()) == 5
    again.optimise()
    assert [(e.i, e.j) for e in again.rejected()] == [(0, 4)] and again.edges() == graph.edges()


def test_beams_that_met_nothing_come_back_where_they_were_stored(tmp_path):
    store, free = SessionStore(tmp_path), PointCloud(*sweep_of(9, 20))
    store.add_sweep(0, 0.0, *sweep_of(0), free=free)
    store.add_sweep(1, 1.0, *sweep_of(1))
    again = SessionStore(tmp_path)
    np.testing.assert_array_equal(again.load_free(0).points, free.points)
    np.testing.assert_array_equal(again.load_free(0).origins, free.origins)
    assert again.load_free(1) is None and len(again.load_sweep(0)) == 500
    with pytest.raises(ValueError, match="need their origins"):
        store.add_sweep(2, 2.0, *sweep_of(2), free=PointCloud(np.zeros((3, 3))))


def test_copied_session_goes_on_without_changing_the_first(tmp_path):
    filled(tmp_path / "a", 3)
    (tmp_path / "a/sweeps/000001.npz").unlink()
    before = (tmp_path / "a" / INDEX).read_bytes()
    copy = copy_session(tmp_path / "a", tmp_path / "b")
    add(copy, graph_of(3))
    again = SessionStore(tmp_path / "b")
    assert len(again.sweeps) == 4 and again.graph_on_disk().edges() == graph_of(4).edges()
    np.testing.assert_array_equal(again.load_sweep(2).points, sweep_of(2)[0])
    assert (tmp_path / "a" / INDEX).read_bytes() == before and len(SessionStore(tmp_path / "a").sweeps) == 3
    with pytest.raises(ValueError, match="holds a session of 4 sweeps"):
        copy_session(tmp_path / "a", tmp_path / "b")


def test_index_is_json_and_a_line_costs_the_same_however_many_there_are(tmp_path):
    store, graph, sizes = SessionStore(tmp_path), PoseGraph(), []
    for _ in range(40):
        add(store, graph)
        sizes.append((tmp_path / INDEX).stat().st_size)
    entries = json.loads((tmp_path / INDEX).read_text())
    assert [e["vertex_id"] for e in entries] == list(range(40))
    growth = np.diff(sizes)
    assert growth[-1] < 1.2 * growth[0]


def test_saved_graph_trajectory_and_clouds_are_read_by_others(tmp_path):
    store, graph = filled(tmp_path), graph_of(3)
    assert store.save(graph, map_voxel_m=0.05) == ()
    np.testing.assert_allclose(PoseGraph.load_g2o(tmp_path / "graph.g2o").poses(), graph.poses(), atol=1e-9)
    trajectory = np.loadtxt(tmp_path / "trajectory.txt")
    np.testing.assert_allclose(trajectory[:, 0], [0.0, 1.5, 3.0])
    np.testing.assert_allclose(trajectory[:, 1:4], graph.poses()[:, :3, 3], atol=1e-8)
    np.testing.assert_allclose(trajectory[2, 4:], quat_xyzw_from_transform(graph.pose(2)), atol=1e-8)
    for name in ("cloud.ply", "cloud.pcd"):
        points = np.asarray(o3d.io.read_point_cloud(str(tmp_path / name)).points)
        np.testing.assert_allclose(points, store.merged_points(graph.poses(), 0.05), atol=1e-5)
        assert points[:, 0].min() < 0 and points[:, 0].max() > 19


def test_pcl_opens_the_cloud(tmp_path):
    points, _ = sweep_of(0)
    (tmp_path / "cloud.pcd").write_bytes(pcd_bytes(points))
    subprocess.run(["pcl_convert_pcd_ascii_binary", tmp_path / "cloud.pcd", tmp_path / "ascii.pcd", "0"], check=True)
    np.testing.assert_allclose(np.loadtxt(tmp_path / "ascii.pcd", skiprows=11), points, atol=1e-4)


def test_saving_twice_replaces_and_leaves_no_other_file(tmp_path):
    store = filled(tmp_path, 2)
    store.save(graph_of(2))
    add(store, graph_of(2))
    store.save(graph_of(3))
    assert sorted(os.listdir(tmp_path)) == ["cloud.pcd", "cloud.ply", "graph.g2o", "sweeps", "trajectory.txt"]
    assert sorted(os.listdir(tmp_path / "sweeps")) == ["000000.npz", "000001.npz", "000002.npz", "index.json"]
    assert len(np.loadtxt(tmp_path / "trajectory.txt")) == 3


def test_index_cut_anywhere_gives_the_sweeps_before_the_cut_and_can_be_gone_on_with(tmp_path):
    filled(tmp_path, 3)
    data = (tmp_path / INDEX).read_bytes()
    for vertex in range(3):  # without the files of their own that lines can be had from again
        (tmp_path / f"sweeps/{vertex:06d}.npz").rename(tmp_path / f"{vertex}.kept")
    ends = np.flatnonzero(np.frombuffer(data, np.uint8) == ord("\n"))[1:4]
    for cut in range(len(data)):
        (tmp_path / INDEX).write_bytes(data[:cut])
        assert len(SessionStore(tmp_path).sweeps) == np.count_nonzero(ends <= cut), cut
    (tmp_path / INDEX).write_bytes(data[: ends[1] + 100])
    store = SessionStore(tmp_path)
    assert "line 4 of sweeps/index.json is damaged: it has no checksum" in store.notes
    add(store, graph_of(2), seed=7)
    assert [e["vertex_id"] for e in json.loads((tmp_path / INDEX).read_text())] == [0, 1, 2]
    np.testing.assert_array_equal(SessionStore(tmp_path).load_sweep(2).points, sweep_of(7)[0])


def test_any_byte_of_the_index_that_changes_loses_nothing_and_is_named(tmp_path):
    filled(tmp_path, 3)
    data = (tmp_path / INDEX).read_bytes()
    rng = np.random.default_rng(1)
    for at in rng.integers(0, len(data), 60):
        changed = bytearray(data)
        changed[at] ^= 1 << rng.integers(0, 7)
        (tmp_path / INDEX).write_bytes(changed)
        store = SessionStore(tmp_path)
        assert len(store.sweeps) == 3 and any(note.startswith("line ") for note in store.notes), at
        np.testing.assert_allclose(store.graph_on_disk().poses(), graph_of(3).poses(), atol=1e-12)


def test_line_in_the_middle_that_is_damaged_like_its_sweep_is_an_error_that_names_both(tmp_path):
    filled(tmp_path, 3)
    lines = lines_of(tmp_path)
    lines[2] = lines[2].replace("1.5", "1.6")
    (tmp_path / INDEX).write_text("\n".join(lines) + "\n")
    (tmp_path / "sweeps/000001.npz").write_bytes(b"")
    with pytest.raises(ValueError, match=r"line 3 of sweeps/index.json is damaged.*000001.npz is damaged"):
        SessionStore(tmp_path)


def test_lost_index_is_told_again_by_the_sweeps(tmp_path):
    filled(tmp_path, 3)
    before = (tmp_path / INDEX).read_bytes()
    (tmp_path / INDEX).unlink()
    store = SessionStore(tmp_path)
    assert len(store.sweeps) == 3 and len(store.notes) == 3
    add(store, graph_of(3))
    assert (tmp_path / INDEX).read_bytes().startswith(before[:-2]) and SessionStore(tmp_path).notes == ()


def test_sweeps_of_a_session_without_records_are_read(tmp_path):
    (tmp_path / "sweeps").mkdir()
    points, origins = sweep_of(0)
    np.savez(tmp_path / "sweeps/000000.npz", points=points, origins=origins, stamp_s=4.0)
    (tmp_path / INDEX).write_text('[\n {\n  "vertex_id": 0\n }\n]\n')
    store = SessionStore(tmp_path)
    assert (store.sweeps[0].stamp_s, store.sweeps[0].points, store.sweeps[0].change) == (4.0, 500, None)
    with pytest.raises(ValueError, match="no pose of vertex 0"):
        store.graph_on_disk()


def test_crash_before_the_index_loses_nothing(tmp_path, monkeypatch):
    store = filled(tmp_path, 2)
    monkeypatch.setattr(session_index.SessionIndex, "append", lambda *a: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        add(store, graph_of(2))
    monkeypatch.undo()
    again = SessionStore(tmp_path)
    assert len(again.sweeps) == 3 and "sweep 2 has no line" in again.notes[0]
    add(again, graph_of(3))
    assert len(SessionStore(tmp_path).sweeps) == 4


def steps_of_writing(monkeypatch, step):
    """Has `step(name)` called before whatever changes the disk; a call of it that returns True does half of a write instead."""
    replace, pwrite, fsync = os.replace, os.pwrite, os.fsync
    monkeypatch.setattr(os, "replace", lambda a, b: (step("replace"), replace(a, b)))
    monkeypatch.setattr(os, "fsync", lambda descriptor: (step("fsync"), fsync(descriptor)))
    monkeypatch.setattr(os, "pwrite", lambda d, data, at: pwrite(d, data[: len(data) // 2] if step("pwrite") else data, at))


def test_kill_before_any_step_and_amid_any_write_leaves_every_accepted_sweep(tmp_path, monkeypatch):
    taken = []
    steps_of_writing(monkeypatch, lambda name: taken.append(name))
    filled(tmp_path / "whole")
    monkeypatch.undo()
    assert {"replace", "pwrite", "fsync"} <= set(taken) and len(taken) > 12
    for last, torn in [(k, False) for k in range(len(taken))] + [(k, True) for k, name in enumerate(taken) if name == "pwrite"]:
        folder, accepted = tmp_path / f"{last}{torn}", tmp_path / f"{last}{torn}.accepted"
        child = os.fork()
        if not child:
            _write_and_die(folder, accepted, last, torn)
        os.waitpid(child, 0)
        store = SessionStore(folder)
        said = len(accepted.read_text()) if accepted.exists() else 0
        assert said <= len(store.sweeps) <= said + 1, (last, torn)
        for k in range(len(store.sweeps)):
            np.testing.assert_array_equal(store.load_sweep(k).points, sweep_of(k)[0])
        graph = graph_of(len(store.sweeps))
        assert store.graph_on_disk().edges() == graph.edges()
        add(store, graph)
        assert SessionStore(folder).notes == ()


def _write_and_die(folder, accepted, last, torn):
    """In a process of its own: writes three sweeps, notes each that is accepted, and ends before step number `last`, or half way in it."""
    count = 0

    def step(name):
        nonlocal count
        number, count = count, count + 1
        if number == last + torn:
            os._exit(9)
        return number == last

    patch = pytest.MonkeyPatch()
    try:
        steps_of_writing(patch, step)
        store, graph = SessionStore(folder), PoseGraph()
        for _ in range(3):
            add(store, graph)
            with open(accepted, "a") as file:
                file.write("x")
    finally:
        os._exit(0)


def test_data_are_on_disk_before_the_index_names_them(tmp_path, monkeypatch):
    order, write, append = [], session_store.write_whole, session_index.SessionIndex.append
    monkeypatch.setattr(session_store, "write_whole", lambda path, data: (order.append(path.name), write(path, data)))
    monkeypatch.setattr(session_index.SessionIndex, "append", lambda self, s: (order.append("index"), append(self, s)))
    filled(tmp_path, 2)
    assert order == ["000000.npz", "index", "000001.npz", "index"]


def test_sweep_that_was_cut_or_changed_is_named_and_never_loaded(tmp_path):
    filled(tmp_path, 3)
    cut, changed = tmp_path / "sweeps/000000.npz", tmp_path / "sweeps/000001.npz"
    cut.write_bytes(cut.read_bytes()[:-10])
    data = bytearray(changed.read_bytes())
    data[3000] ^= 1
    changed.write_bytes(data)
    store = SessionStore(tmp_path)
    assert len(store.sweeps) == 3 and store.notes[0].startswith("sweeps/000000.npz is damaged: ")
    for vertex in (0, 1):
        with pytest.raises(DamagedSweepError, match=f"sweeps/00000{vertex}.npz is damaged"):
            store.load_sweep(vertex)
    assert len(store.load_sweep(2)) == 500


def test_sweep_that_is_gone_is_left_out_of_the_clouds_and_named(tmp_path):
    store = filled(tmp_path, 2)
    (tmp_path / "sweeps/000001.npz").unlink()
    assert [text.split()[0] for text in store.save(graph_of(2))] == ["sweeps/000001.npz"]
    assert np.asarray(o3d.io.read_point_cloud(str(tmp_path / "cloud.ply")).points)[:, 0].max() < 5
    with pytest.raises(DamagedSweepError):
        store.merged_points(graph_of(2).poses(), 0.05)


def test_full_disk_keeps_sweeps_in_memory_until_there_is_room(tmp_path, monkeypatch):
    store, graph = filled(tmp_path, 1), graph_of(1)
    before = (tmp_path / INDEX).read_bytes()

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(session_index.SessionIndex, "append", full)
    for which in ("sweep 1 is", "sweeps 1 to 2 are"):
        with pytest.raises(NotOnDiskError, match=f"{which} not on disk: .* is full: make room there"):
            add(store, graph)
    with pytest.raises(OSError, match="is full"):
        store.save(graph)
    assert (len(store.sweeps), store.not_on_disk) == (1, 2) and len(store.load_sweep(2)) == 500
    assert (tmp_path / INDEX).read_bytes() == before
    monkeypatch.undo()
    add(store, graph)
    again = SessionStore(tmp_path)
    assert (len(again.sweeps), store.not_on_disk, again.notes) == (4, 0, ())
    assert again.graph_on_disk().edges() == graph.edges()


def test_write_that_the_system_cuts_short_leaves_the_index_whole(tmp_path):
    """With a limit on the size of files in a process of its own: the line begins, and does not fit."""
    filled(tmp_path, 2)
    before = (tmp_path / INDEX).read_bytes()
    limit = max(len(before) + 100, 40_000)
    code = (
        "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "from test_session_store import *\n"
        "store, graph = SessionStore(sys.argv[1]), graph_of(2)\n"
        f"resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit}))\n"
        "for _ in range(400):\n"
        "    try: add(store, graph)\n"
        "    except NotOnDiskError as error: sys.exit(str(error) and 7)\n"
    )
    path = os.pathsep.join(p for p in (str(Path(__file__).parent), *sys.path) if p)
    ended = subprocess.run([sys.executable, "-c", code, str(tmp_path)], env={**os.environ, "PYTHONPATH": path}, check=False)
    again = SessionStore(tmp_path)
    assert ended.returncode == 7 and len(again.sweeps) > 2
    json.loads((tmp_path / INDEX).read_text())


def test_two_writers_are_noticed(tmp_path):
    first = filled(tmp_path, 1)
    add(SessionStore(tmp_path), graph_of(1))
    with pytest.raises(ValueError, match="changed by another program"):
        add(first, graph_of(1))


def test_place_that_is_no_folder_is_an_error_with_the_reason(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="Not a directory"):
        SessionStore(tmp_path / "file" / "session")


def test_vertex_out_of_turn_is_refused(tmp_path):
    with pytest.raises(ValueError, match="vertex 5 where 0 is next"):
        SessionStore(tmp_path).add_sweep(5, 0.0, *sweep_of(0))
    with pytest.raises(ValueError, match="no sweep of vertex 0"):
        SessionStore(tmp_path).load_sweep(0)
    with pytest.raises(ValueError, match="go together"):
        SessionStore(tmp_path).add_sweep(0, 0.0, *sweep_of(0), graph_of(1))
    with pytest.raises(ValueError, match="2 vertices with sweep 0"):
        SessionStore(tmp_path).add_sweep(0, 0.0, *sweep_of(0), graph_of(2), Measured(np.eye(4)))


@pytest.mark.parametrize("vertices", [2, 4])
def test_sweeps_that_are_there_are_saved_with_the_vertices_that_belong_to_them(tmp_path, vertices):
    (said,) = filled(tmp_path, 3).save(graph_of(vertices))
    saved = min(vertices, 3)
    assert said == f"{vertices} vertices for 3 stored sweeps: the first {saved} are saved"
    graph = PoseGraph.load_g2o(tmp_path / "graph.g2o")
    assert len(graph) == saved and len(graph.measurements()) == saved - 1
    stamps = [float(line.split()[0]) for line in (tmp_path / "trajectory.txt").read_text().splitlines()]
    assert stamps == [1.5 * k for k in range(saved)]
    assert np.asarray(o3d.io.read_point_cloud(str(tmp_path / "cloud.ply")).points)[:, 0].max() > 10 * (saved - 1)


def test_empty_session_saves_an_empty_cloud(tmp_path):
    SessionStore(tmp_path).save(PoseGraph())
    assert b"element vertex 0\n" in (tmp_path / "cloud.ply").read_bytes()
    assert ply_bytes(np.zeros((0, 3))).endswith(b"end_header\n")


def test_tum_line_is_stamp_position_and_quaternion():
    assert tum_text([1.25], np.eye(4)[None]).split() == ["1.250000", *["0.000000000"] * 6, "1.000000000"]
