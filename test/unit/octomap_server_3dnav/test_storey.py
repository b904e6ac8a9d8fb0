"""One storey in the flat grid: what lies above or below the robot's ground does not show on it, wherever the robot stands (issue 37, 3)."""

import numpy as np
import pytest
from storey_worlds import BLOCK, HIGH, ROUND_M, TURN_M, WAY, around, bridge, floor, ramp_to_drive_under, spiral
from terrain_worlds import BELOW, OCCUPIED, RESOLUTION, UNKNOWN, pose, terrain_of

from octomap_server_3dnav.navigation.local_grid import FREE, LETHAL, TerrainGrid, project

MIDDLE = (WAY.start + WAY.stop) // 2


def grid_around(states: np.ndarray, x: int, y: int, level: int, size_m: float = 30.0) -> TerrainGrid:
    """The grid of a robot in column x, y on the ground of a level, in which cell [y, x] is column x, y."""
    at = pose((x + 0.5) * RESOLUTION, (y + 0.5) * RESOLUTION, (level + 1) * RESOLUTION)
    grid = project(terrain_of(states, at), (size_m / 2, size_m / 2), size_m)
    assert grid.origin_xy == pytest.approx((0.0, 0.0))
    return grid


def level_at(grid: TerrainGrid, x: int, y: int) -> int:
    """Level of the ground that shows in a cell."""
    return round(float(grid.height[y, x]) / RESOLUTION) - 1


def test_ramp_is_free_above_the_floor_that_is_too_low_below_it():
    grid, inner = grid_around(ramp_to_drive_under(), 40, MIDDLE, 6), slice(WAY.start + 2, WAY.stop - 2)
    assert (grid.cost[inner, 20:136] == FREE).all()
    assert [level_at(grid, x, MIDDLE) for x in (25, 50, 74, 92, 120)] == [1, 10, 18, 24, 24]
    assert (grid.cost[[WAY.start, WAY.stop - 1], 40:136] == LETHAL).all()  # its edges


def test_block_below_the_deck_shows_to_a_robot_below_and_not_to_one_above():
    states = ramp_to_drive_under()
    above, below = grid_around(states, 100, MIDDLE, HIGH), grid_around(states, 100, MIDDLE, 0)
    assert (above.cost[36:42, 112:120] == FREE).all() and level_at(above, 115, 38) == HIGH
    assert (below.cost[36:42, [112, 119]] == LETHAL).all()
    assert (below.cost[WAY, 121:136] == FREE).all() and level_at(below, 130, MIDDLE) == 0


def test_low_part_of_the_ramp_is_lethal_to_a_robot_below_it():
    below = grid_around(ramp_to_drive_under(), 100, MIDDLE, 0)
    lethal = np.flatnonzero(below.cost[MIDDLE] == LETHAL)
    assert lethal.size and 20 + 3 * 14 <= lethal.max() <= 20 + 3 * 16


def test_bridge_shows_its_own_block_above_and_the_floor_s_below():
    states, on_bridge, on_floor = bridge(), np.s_[36:41, 96], np.s_[49:54, 104]
    above, below = grid_around(states, 80, MIDDLE, HIGH), grid_around(states, 80, MIDDLE, 0)
    assert (above.cost[on_bridge] == LETHAL).all() and (above.cost[on_floor] == FREE).all()
    assert (below.cost[on_floor] == LETHAL).all() and (below.cost[on_bridge] == FREE).all()
    assert (below.cost[WAY.start, 84:96] == FREE).all() and (above.cost[WAY.start, 84:96] == LETHAL).all()


@pytest.mark.parametrize("turns", [0.5, 1.0, 1.5])
def test_spiral_shows_the_turn_that_is_nearest_along_it(turns):
    middle_m = sum(TURN_M) / 2
    angle = 2 * np.pi * turns
    x, y = (int((at + middle_m * part) / RESOLUTION) for at, part in zip(ROUND_M, (np.cos(angle), np.sin(angle)), strict=True))
    grid = grid_around(spiral(), x, y, int(turns * HIGH))
    compared = 0
    for cell_x, cell_y in np.ndindex(*grid.cost.shape[::-1]):
        radius, turn = around(cell_x, cell_y)
        if abs(radius - middle_m) > 0.3 or min(turn, 1 - turn) < 0.08:
            continue
        away = [abs(turn - turns), abs(turn + 1 - turns)]
        if abs(away[0] - away[1]) > 0.2 and grid.cost[cell_y, cell_x] == FREE:
            compared += 1
            assert level_at(grid, cell_x, cell_y) == pytest.approx((turn + int(np.argmin(away))) * HIGH, abs=1.5)
    assert compared
    if turns != 1.0:  # from there its block is as near on both turns
        assert (grid.cost[54:58, 17:22] == LETHAL).any() == (turns == 0.5)


def test_distance_is_that_over_the_robot_s_own_ground():
    states = ramp_to_drive_under()
    above, below = grid_around(states, 100, MIDDLE, HIGH), grid_around(states, 100, MIDDLE, 0)
    assert above.distance[MIDDLE - 8, 120] == pytest.approx(5 * RESOLUTION, abs=RESOLUTION)  # the deck's edge
    assert below.distance[MIDDLE - 8, 120] == pytest.approx(RESOLUTION, abs=RESOLUTION)  # the block
    assert above.distance[WAY.start, 100] == 0.0 and np.isnan(above.distance[140, 300])


def test_thing_that_hangs_into_the_way_of_the_same_storey_wins_over_the_ground_below_it():
    states = floor(80, 80)
    states[40, 30:50, BELOW + 6 : BELOW + 6 + BLOCK] = OCCUPIED
    assert (grid_around(states, 20, 40, 0).cost[30:50, 40] == LETHAL).all()


@pytest.mark.parametrize("seen_from_floor", [True, False])
def test_obstacle_is_of_the_storey_that_it_was_seen_from_whatever_its_own_height(seen_from_floor):
    at = pose(100.5 * RESOLUTION, (MIDDLE + 0.5) * RESOLUTION, RESOLUTION)
    terrain = terrain_of(ramp_to_drive_under(), at)
    x, y = 125, MIDDLE
    middle_m = (x + 0.5) * RESOLUTION, (y + 0.5) * RESOLUTION
    floor_node, deck_node = (terrain.surface_near((*middle_m, (level + 0.5) * RESOLUTION)) for level in (0, HIGH))
    obstacle = terrain.surface_count
    assert terrain.seen_from[obstacle] >= 0
    terrain.ix[obstacle], terrain.iy[obstacle], terrain.z[obstacle] = x, y, 10 if seen_from_floor else 0
    terrain.seen_from[obstacle] = floor_node if seen_from_floor else deck_node
    grid = project(terrain, (8.0, 8.0), 16.0)
    assert grid.cost[y, x] == (LETHAL if seen_from_floor else FREE)


def test_floor_that_was_not_seen_is_not_the_deck_above_it():
    states = ramp_to_drive_under()
    states[100:110, WAY, : BELOW + 6] = UNKNOWN
    grid = grid_around(states, 125, MIDDLE, 0)
    assert (grid.cost[MIDDLE, 109] == -1) and (grid_around(states, 125, MIDDLE, HIGH).cost[MIDDLE, 100:110] == FREE).all()
