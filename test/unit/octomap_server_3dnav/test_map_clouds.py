"""A map of clouds that stay where they are, or of a file: what others placed, beside or in place of a pose graph's sweeps."""

import numpy as np
import pytest
from test_map_builder import NOTHING, SENSOR, builder, pose, state, wall

from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.octree.map_builder import MapBuilder, MapConfig
from octomap_server_3dnav.octree.octree import OctreeMap
from rigid_geometry import transform_points
from robot_body import RobotBody


def in_map(T: np.ndarray, x: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    """The wall's hits, and where their beams started, seen from `T`."""
    beams = wall(x)
    return transform_points(T, beams.points), transform_points(T, beams.origins)


def test_cloud_makes_the_map_that_a_sweep_of_the_same_beams_makes() -> None:
    swept, fed = builder(), builder()
    swept.add_sweep(wall(), 0, [pose(0.5, 0.3)])
    fed.add_cloud(*in_map(pose(0.5, 0.3)), pose(0.5, 0.3))
    assert fed.tree.to_full() == swept.tree.to_full()
    assert len(fed) == 0


def test_ground_under_the_robot_is_assumed_with_the_first_cloud_that_comes_with_its_pose() -> None:
    fed = builder()
    fed.add_cloud(*in_map(pose()), None)
    assert state(fed, 0.4, 0.3, -0.02) is VoxelState.UNKNOWN
    assert state(fed, 3.0, 0.0, 0.832) is VoxelState.OCCUPIED
    fed.add_cloud(*in_map(pose()), pose())
    assert state(fed, 0.4, 0.3, -0.02) is VoxelState.OCCUPIED
    fed.add_cloud(*in_map(pose(2.0)), pose(2.0))
    assert state(fed, 2.4, 0.3, -0.02) is VoxelState.UNKNOWN


def test_cloud_without_a_robot_is_cropped_around_its_sensor() -> None:
    fed = builder()
    points = np.float32([[*SENSOR[:2], 0.5], [SENSOR[0] + 6.9, 0.0, 0.5], [SENSOR[0] + 7.2, 0.0, 0.5]])
    fed.add_cloud(points, np.tile(np.float32(SENSOR), (3, 1)), None)
    assert [state(fed, *p) for p in points.tolist()] == [VoxelState.OCCUPIED, VoxelState.OCCUPIED, VoxelState.UNKNOWN]


def test_clouds_and_sweeps_are_not_mixed() -> None:
    swept, fed = builder(), builder()
    swept.add_sweep(wall(), 0, [pose()])
    fed.add_cloud(*in_map(pose()), pose())
    before = swept.tree.to_full(), fed.tree.to_full()
    with pytest.raises(ValueError, match=r"1 sweeps of a pose graph.*~reset"):
        swept.add_cloud(*in_map(pose()), pose())
    with pytest.raises(ValueError, match=r"of clouds.*~reset"):
        fed.add_sweep(wall(), 0, [pose()])
    with pytest.raises(ValueError, match="without points"):
        fed.add_cloud(NOTHING, NOTHING, pose())
    assert (swept.tree.to_full(), fed.tree.to_full()) == before


def test_box_of_a_map_of_clouds_is_cleared() -> None:
    fed = builder()
    fed.add_cloud(*in_map(pose()), pose())
    fed.clear_box((2.9, -0.1, 0.7), (3.1, 0.1, 0.9))
    assert state(fed, 3.0, 0.0, 0.832) is VoxelState.FREE


def test_map_goes_on_from_a_file_and_refuses_one_of_another_resolution() -> None:
    first = builder()
    first.add_cloud(*in_map(pose()), pose())
    copy = OctreeMap.from_full(first.tree.to_full(), 0.08)
    going_on = MapBuilder.of_tree(MapConfig(), copy, RobotBody())
    elsewhere = pose(20.0)
    going_on.add_cloud(*in_map(elsewhere), elsewhere)
    assert [state(going_on, x, 0.0, 0.832) for x in (3.0, 23.0)] == [VoxelState.OCCUPIED] * 2
    with pytest.raises(ValueError, match=r"of a file.*~reset"):
        going_on.add_sweep(wall(), 0, [pose()])
    with pytest.raises(ValueError, match=r"0\.05 m.*0\.08 m"):
        MapBuilder.of_tree(MapConfig(), OctreeMap(0.05), RobotBody())


def test_sweeps_that_are_fixed_lie_where_the_graph_had_them_last() -> None:
    fixed, fresh = builder(), builder()
    fixed.add_sweep(wall(), 0, [pose()])
    fixed.add_sweep(wall(2.0), 1, [pose(0.3), pose(0.5, 0.4)])
    fixed.fix("a session")
    fresh.add_sweep(wall(), 0, [pose(0.3)])
    fresh.add_sweep(wall(2.0), 1, [pose(0.3), pose(0.5, 0.4)])
    assert fixed.tree.to_full() == fresh.tree.to_full()
    elsewhere = pose(20.0)
    fixed.add_cloud(*in_map(elsewhere), elsewhere)
    assert state(fixed, 23.0, 0.0, 0.832) is VoxelState.OCCUPIED
    with pytest.raises(ValueError, match="of a session"):
        fixed.add_sweep(wall(), 2, [pose()] * 3)
