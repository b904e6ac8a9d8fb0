"""From placed sweeps to the octree: insertion, the plane at the start, moved vertices, lost sweeps, beams that met nothing."""

import math

import numpy as np
import pytest

from octomap_server_3dnav.column_runs import VoxelState
from octomap_server_3dnav.map_builder import Beams, MapBuilder, MapConfig
from octomap_server_3dnav.octree import SensorModel
from rigid_geometry import transform_from_rpy

SENSOR = (0.2, 0.0, 0.75)
NOTHING = np.zeros((0, 3), np.float32)


def wall(x: float = 3.0, free_ends: np.ndarray = NOTHING) -> Beams:
    """Beams from the laser to a wall across the x axis of base_link."""
    y, z = (v.ravel() for v in np.meshgrid(np.arange(-1.0, 1.0, 0.04), np.arange(0.2, 1.2, 0.04)))
    points = np.column_stack([np.full(y.size, x), y, z]).astype(np.float32)
    origins = np.tile(np.float32(SENSOR), (y.size, 1))
    return Beams(points, origins, free_ends, np.tile(np.float32(SENSOR), (len(free_ends), 1)))


def pose(x: float = 0.0, yaw: float = 0.0) -> np.ndarray:
    return transform_from_rpy((x, 0.0, 0.132), (0.0, 0.0, yaw))


def builder() -> MapBuilder:
    return MapBuilder(MapConfig(), SensorModel())


def state(built: MapBuilder, *xyz: float) -> VoxelState:
    return VoxelState(int(built.tree.states_at([xyz])[0]))


def test_sweep_makes_the_wall_occupied_the_way_to_it_free_and_the_ground_at_the_start_known():
    built = builder()
    assert not built.add_sweep(wall(), 0, [pose()])
    assert state(built, 3.0, 0.0, 0.832) is VoxelState.OCCUPIED
    assert state(built, 1.5, 0.0, 0.882) is VoxelState.FREE
    assert state(built, 0.4, 0.3, -0.02) is VoxelState.OCCUPIED


def test_beam_that_met_nothing_frees_its_way_and_occupies_nothing():
    down_a_hole = np.array([[6.0, 0.0, -6.0]], np.float32)
    built = builder()
    built.add_sweep(wall(free_ends=down_a_hole), 0, [pose()])
    halfway = (np.array(SENSOR) + (down_a_hole[0] - SENSOR) * 0.3 + [0, 0, 0.132]).tolist()
    assert state(built, *halfway) is VoxelState.FREE
    centers, _ = built.tree.occupied_voxels()
    assert centers[:, 2].min() > -0.1


def test_moved_vertices_build_the_same_tree_as_from_scratch():
    moved, fresh = builder(), builder()
    moved.add_sweep(wall(), 0, [pose()])
    assert moved.add_sweep(wall(2.0), 1, [pose(0.3), pose(0.5, 0.4)])
    fresh.add_sweep(wall(), 0, [pose(0.3)])
    fresh.add_sweep(wall(2.0), 1, [pose(0.3), pose(0.5, 0.4)])
    assert moved.tree.to_full() == fresh.tree.to_full()


def test_heights_follow_moved_vertices():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    before, after = (np.array([[math.floor(x / 0.08)], [0], [10]]) for x in (3.0, 3.3))
    assert not np.isnan(built.heights.at(*before)) and np.isnan(built.heights.at(*after))
    built.add_sweep(wall(1.0), 1, [pose(0.3), pose(0.5)])
    assert np.isnan(built.heights.at(*before)) and not np.isnan(built.heights.at(*after))


def test_vertices_that_moved_less_than_half_a_voxel_leave_the_tree_as_it_is():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    assert not built.add_sweep(wall(), 1, [pose(0.01), pose(0.2)])


def test_lost_sweep_is_no_trouble_for_the_next():
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    built.add_sweep(wall(2.0), 2, [pose(), pose(0.2), pose(0.4)])
    assert len(built) == 2 and state(built, 2.4, 0.0, 0.832) is VoxelState.OCCUPIED


@pytest.mark.parametrize("vertex_id", [0, 1, -1])
def test_repeated_or_unplaced_sweep_is_refused_and_changes_nothing(vertex_id):
    built = builder()
    built.add_sweep(wall(), 0, [pose()])
    before = built.tree.to_full()
    with pytest.raises(ValueError, match="sweep of vertex"):
        built.add_sweep(wall(), vertex_id, [pose()])
    assert built.tree.to_full() == before and len(built) == 1
