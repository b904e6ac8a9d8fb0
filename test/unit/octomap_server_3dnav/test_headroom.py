"""Ground of a finished map over which not all of the robot's room was seen."""

import numpy as np
import pytest
from terrain_worlds import BELOW, FREE, OCCUPIED, UNKNOWN, grid_of_heights, pose, runs_of

from octomap_server_3dnav.navigation.headroom import with_seen_headroom
from octomap_server_3dnav.navigation.passages import TerrainSettings, navigable_terrain
from octomap_server_3dnav.navigation.planner import PlannerConfig, plan_path
from octomap_server_3dnav.terrain.classified_terrain import TerrainClass

BEHIND, ACROSS = slice(61, 70), slice(30, 50)
"""Columns of a shelf whose front, at column 60, was seen, and through which nobody looked."""
SETTINGS = TerrainSettings()
ROOM = 14  # voxels wanted above ground


def terrains(low: int, high: int):
    """Of a floor with such a shelf, unknown from `low` to `high` voxels above the floor: as it is while exploring, and at the end."""
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 100, 80)
    states[60, ACROSS, BELOW + low : BELOW + high + 1] = OCCUPIED
    states[BEHIND, ACROSS, BELOW + low : BELOW + high + 1] = UNKNOWN
    terrain = navigable_terrain(runs_of(states), pose(2.0, 3.2), SETTINGS, None)
    return terrain, with_seen_headroom(terrain, SETTINGS)


def under(terrain) -> np.ndarray:
    """Which nodes are ground under the shelf."""
    is_ground = np.arange(terrain.ix.size) < terrain.surface_count
    return is_ground & (terrain.ix >= BEHIND.start) & (terrain.ix < BEHIND.stop) & (terrain.iy >= 30) & (terrain.iy < 50)


@pytest.mark.parametrize("low, high", [pytest.param(9, 20, id="a shelf"), pytest.param(ROOM, ROOM, id="one voxel as high as it may be")])
def test_it_is_no_ground_at_the_end(low, high):
    before, after = terrains(low, high)
    hoped = under(before) & (before.label == TerrainClass.TRAVERSABLE)
    assert hoped.any()
    assert (after.label[hoped] == TerrainClass.FRONTIER).all() and np.isinf(after.cost[hoped]).all()
    np.testing.assert_array_equal(after.label[~hoped], before.label[~hoped])
    np.testing.assert_array_equal(after.cost[~hoped], before.cost[~hoped])


def test_what_was_not_seen_above_the_robot_says_nothing():
    before, after = terrains(ROOM + 1, 30)
    assert (before.label[under(before)] == TerrainClass.TRAVERSABLE).any()
    np.testing.assert_array_equal(after.label, before.label)


def test_path_from_where_nobody_looked_up_is_the_shortest_all_the_same():
    """A robot that stands there has room; to a search that cannot leave its first node all ways are equally bad."""
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 100, 80)
    states[24:27, 39:42, BELOW + ROOM] = UNKNOWN
    whole = navigable_terrain(runs_of(states), pose(2.0, 3.2), SETTINGS, None)
    terrain = with_seen_headroom(whole, SETTINGS)
    assert (terrain.label == TerrainClass.FRONTIER).any()
    goal = terrain.surface_near(np.array([6.0, 3.2, 0.04]))
    path = plan_path(terrain, goal, PlannerConfig())
    assert path is not None and np.linalg.norm(np.diff(path.points, axis=0), axis=1).sum() < 4.2


@pytest.mark.parametrize("is_seen", [True, False])
def test_passage_under_what_nobody_saw_is_none(is_seen):
    """A door of 0.88 m, and a voxel of the robot's room amid it."""
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 100, 80)
    states[50:52, :, BELOW:] = OCCUPIED
    states[50:52, 35:46, BELOW:] = FREE
    states[50:52, 35:46, BELOW] = OCCUPIED
    if not is_seen:
        states[50:52, 39:42, BELOW + ROOM] = UNKNOWN
    terrain = navigable_terrain(runs_of(states), pose(2.0, 3.2), SETTINGS, None)
    assert len(terrain.passages) == 1
    assert len(with_seen_headroom(terrain, SETTINGS).passages) == is_seen
