"""Finished maps: an octree of a file, the sweeps of a session where its graph has them, and what cannot be loaded."""

from pathlib import Path

import numpy as np
import pytest

from finished_maps import load_map
from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.octree.map_builder import MapBuilder, MapConfig
from octomap_server_3dnav.octree.octree import OctreeMap, SensorModel
from pose_graph_mapping.graph.pose_graph import EdgeKind, PoseGraph
from pose_graph_mapping.registration.cloud import PointCloud
from pose_graph_mapping.session.session_record import Measured
from pose_graph_mapping.session.session_store import SessionStore
from rigid_geometry import inverse, transform_from_rpy, transform_points
from robot_body import RobotBody

POSES = [transform_from_rpy((x, 0.0, 0.132), (0.0, 0.0, yaw)) for x, yaw in ((0.0, 0.0), (1.0, 0.4))]
SENSOR = (0.2, 0.0, 0.75)


def builder() -> MapBuilder:
    return MapBuilder(MapConfig(), SensorModel(), RobotBody())


def wall() -> tuple[np.ndarray, np.ndarray]:
    """Hits on a wall ahead, in base_link, and where their beams started."""
    y, z = (v.ravel() for v in np.meshgrid(np.arange(-1.0, 1.0, 0.04), np.arange(0.2, 1.2, 0.04)))
    points = np.column_stack([np.full(y.size, 3.0), y, z]).astype(np.float32)
    return points, np.tile(np.float32(SENSOR), (y.size, 1))


def session(folder: Path, save: bool = True) -> SessionStore:
    """Two sweeps of a wall; the second beam of nothing goes past it."""
    store, graph = SessionStore(folder), PoseGraph()
    past = PointCloud(np.array([[3.0, 4.0, 0.75]]), np.array([SENSOR]))
    for k, T in enumerate(POSES):
        graph.add_vertex(T)
        if k:
            graph.add_edge(k - 1, k, inverse(graph.pose(k - 1)) @ T, np.eye(6) * 1e-4, EdgeKind.ODOMETRY)
        store.add_sweep(k, 2.0 * k, *wall(), graph, Measured(T, (0.0, 0.0, 1.0), 0.01), free=past)
    if save:
        store.save(graph)
    return store


def state(built: MapBuilder, xyz: np.ndarray) -> VoxelState:
    return VoxelState(int(built.tree.states_at([xyz])[0]))


def test_sweeps_of_a_session_lie_where_its_graph_has_them(tmp_path: Path) -> None:
    session(tmp_path)
    found = load_map(tmp_path, builder())
    for T in POSES:
        ahead, free = transform_points(T, np.array([[3.0, 0.0, 0.7], [1.6, 2.0, 0.75]]))
        assert state(found.builder, ahead) is VoxelState.OCCUPIED
        assert state(found.builder, free) is VoxelState.FREE
    assert found.T_map_base == pytest.approx(POSES[-1], abs=1e-6)
    assert found.described == f"2 sweeps of {tmp_path}"
    assert found.builder.content == "a session"


def test_damaged_sweep_is_named_and_the_others_are_there(tmp_path: Path) -> None:
    session(tmp_path)
    path = tmp_path / "sweeps" / "000000.npz"
    path.write_bytes(path.read_bytes()[:-10])
    found = load_map(tmp_path, builder())
    assert "1 sweeps of" in found.described and "000000.npz is damaged" in found.described


def test_folder_without_a_session_is_its_octree(tmp_path: Path) -> None:
    tree = OctreeMap(0.08)
    middles = tree.unknown_on_plane((0.0, 0.0, 0.0), 1.0)
    tree.insert_sweep(middles, middles)
    tree.write_ot(tmp_path / "map.ot")
    found = load_map(tmp_path, builder())
    assert found.builder.tree.to_full() == tree.to_full() and found.T_map_base is None
    assert not list(tmp_path.glob("sweeps"))  # nothing is made in a folder that is only read


def test_what_is_no_map_is_named_in_one_line(tmp_path: Path) -> None:
    session(tmp_path / "killed", save=False)
    (tmp_path / "empty").mkdir()
    (tmp_path / "text.bt").write_text("not a map")
    OctreeMap(0.05).write_bt(tmp_path / "fine.bt")
    for name, reason in {
        "killed": r"no graph\.g2o.*--resume",
        "empty": "no map there",
        "text.bt": "no octomap file",
        "fine.bt": r"0\.05 m, those of the map 0\.08 m",
        "absent.ot": "No such file",
    }.items():
        with pytest.raises(ValueError, match=reason) as error:
            load_map(tmp_path / name, builder())
        assert name in str(error.value) and "\n" not in str(error.value)
