"""What stands over ground that was not seen, in the grid for the local costmap."""

import numpy as np
import pytest
from terrain_worlds import BELOW, OCCUPIED, grid_of_heights, pose, terrain_of

from octomap_server_3dnav.navigation.local_grid import LETHAL, UNKNOWN, project
from octomap_server_3dnav.navigation.standing import with_standing
from octomap_server_3dnav.octree.column_runs import VoxelState
from robot_body import RobotBody

FLOOR_ENDS, ALONG = 50, slice(30, 50)


def costs(low: int, high: int, ground_m: float = 0.0):
    """Of a floor that was seen up to a column, and of what was seen beyond from layer `low` to `high`, as the top of a box is."""
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 80, 80)
    states[FLOOR_ENDS:] = VoxelState.UNKNOWN
    states[FLOOR_ENDS : FLOOR_ENDS + 10, ALONG, BELOW + low : BELOW + high + 1] = OCCUPIED
    terrain = terrain_of(states, pose(2.0, 3.2, ground=ground_m))
    grid = project(terrain, (3.2, 3.2), 6.4)
    before = grid.cost.copy()
    after = with_standing(grid, terrain, RobotBody()).cost
    np.testing.assert_array_equal(grid.cost, before)
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


def test_robot_without_ground_beneath_it_has_nothing_to_judge_by():
    _, after = costs(7, 21, ground_m=2.0)
    assert (after == UNKNOWN).all()
