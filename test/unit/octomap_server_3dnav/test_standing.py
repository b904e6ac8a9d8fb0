"""What stands over ground that was not seen, in the grid for the local costmap."""

import numpy as np
import pytest
from terrain_worlds import BELOW, OCCUPIED, grid_of_heights, pose, terrain_of

from octomap_server_3dnav.navigation.local_grid import LETHAL, UNKNOWN, project
from octomap_server_3dnav.navigation.standing import with_standing
from octomap_server_3dnav.octree.column_runs import VoxelState
from robot_body import RobotBody

FLOOR_ENDS, ALONG = 50, slice(30, 50)


def grids(low: int, high: int, ground_m: float = 0.0):
    """Of a floor that was seen up to a column, and of what was seen beyond from layer `low` to `high`, as the top of a box is."""
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 80, 80)
    states[FLOOR_ENDS:] = VoxelState.UNKNOWN
    states[FLOOR_ENDS : FLOOR_ENDS + 10, ALONG, BELOW + low : BELOW + high + 1] = OCCUPIED
    terrain = terrain_of(states, pose(2.0, 3.2, ground=ground_m))
    grid = project(terrain, (3.2, 3.2), 6.4)
    return grid, with_standing(grid, terrain, RobotBody())


def costs(low: int, high: int, ground_m: float = 0.0):
    """The costs of both; what was known before is known as it was."""
    before, after = (grid.cost for grid in grids(low, high, ground_m))
    np.testing.assert_array_equal(after[before != UNKNOWN], before[before != UNKNOWN])
    return before, after


@pytest.mark.parametrize("low, high", [pytest.param(7, 8, id="a box"), pytest.param(7, 21, id="a wall"), pytest.param(12, 12, id="a lath")])
def test_behind_its_front_it_is_lethal_as_far_as_the_ground_before_it_tells(low, high):
    before, after = costs(low, high)
    assert (before[ALONG, FLOOR_ENDS + 1 : FLOOR_ENDS + 5] == UNKNOWN).any()
    assert (after[ALONG, FLOOR_ENDS + 1 : FLOOR_ENDS + 5] == LETHAL).all()
    assert (after[35:45, FLOOR_ENDS + 6 : FLOOR_ENDS + 10] == UNKNOWN).any()


@pytest.mark.parametrize("low, high", [pytest.param(2, 2, id="as high as a slope may be"), pytest.param(15, 30, id="a beam of the roof")])
def test_what_is_not_as_high_as_the_robot_is_not_known(low, high):
    before, after = costs(low, high)
    np.testing.assert_array_equal(after, before)


def test_ground_is_as_far_from_it_as_from_the_middle_of_its_cell_where_the_terrain_knows_no_front():
    """A pillar beyond a corner of the floor, which none of its columns is in line with."""
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 80, 80)
    states[FLOOR_ENDS:], states[:, FLOOR_ENDS:] = VoxelState.UNKNOWN, VoxelState.UNKNOWN
    states[51:53, 51:53, BELOW + 7 : BELOW + 22] = OCCUPIED
    terrain = terrain_of(states, pose(2.0, 2.0))
    before = project(terrain, (3.2, 3.2), 6.4)
    after = with_standing(before, terrain, RobotBody())
    assert (before.cost[51:53, 51:53] == UNKNOWN).all() and (after.cost[51:53, 51:53] == LETHAL).all()
    assert np.isinf(before.distance[49, 49])
    assert after.distance[49, 49] == pytest.approx(2 * 2**0.5 * after.resolution)
    np.testing.assert_array_equal(np.isnan(after.distance), np.isnan(before.distance))


def test_before_a_front_ground_is_as_far_as_it_was():
    before, after = grids(7, 8)
    near = before.distance < 1.0
    assert near.any()
    np.testing.assert_array_equal(after.distance[near], before.distance[near])


def test_robot_without_ground_beneath_it_has_nothing_to_judge_by():
    _, after = costs(7, 21, ground_m=2.0)
    assert (after == UNKNOWN).all()
