"""The flat grid for the local costmap (thesis 5.5.2): levels, raster, unknown."""

import numpy as np
import pytest
from terrain_worlds import BELOW, OCCUPIED, RESOLUTION, grid_of_heights, pose, terrain_of

from octomap_server_3dnav.navigation.local_grid import FREE, LETHAL, UNKNOWN, project
from octomap_server_3dnav.terrain.classify import TerrainClass


def flat():
    return grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 80, 80)


def test_wall_is_lethal_floor_and_inflation_are_free_and_the_rest_is_unknown():
    states = flat()
    states[50, :, BELOW:] = OCCUPIED
    grid = project(terrain_of(states, pose(2.0, 3.2)), (2.0, 3.2), 6.4)
    row = grid.cost[grid.cost.shape[0] // 2]
    first = round(grid.origin_xy[0] / RESOLUTION)
    assert row[50 - first] == LETHAL
    assert (row[-first : 50 - first] == FREE).all()
    assert (row[51 - first :] == UNKNOWN).all()


def test_every_cell_agrees_with_the_voxel_over_it_when_the_rasters_are_equal():
    states = flat()
    states[30:34, 20:60, BELOW : BELOW + 8] = OCCUPIED
    terrain = terrain_of(states, pose(1.0, 3.2))
    grid = project(terrain, (1.0, 3.2), 8.0)
    kx, ky = (round(v / RESOLUTION) for v in grid.origin_xy)
    lethal = np.isin(terrain.label, (TerrainClass.OBSTACLE, TerrainClass.CLIFF))
    expected = {(x - kx, y - ky) for x, y in zip(terrain.ix[lethal], terrain.iy[lethal], strict=True)}
    ny, nx = grid.cost.shape
    inside = {(x, y) for x, y in expected if 0 <= x < nx and 0 <= y < ny}
    assert set(zip(*np.nonzero(grid.cost.T == LETHAL), strict=True)) == inside


def test_bridge_above_is_no_obstacle():
    states = flat()
    states[30:50, :, BELOW + 20] = OCCUPIED
    grid = project(terrain_of(states, pose(1.0, 3.2)), (3.2, 3.2), 4.0)
    assert (grid.cost == FREE).all()


def test_distance_is_zero_in_the_wall_and_grows_with_the_way_from_it():
    states = flat()
    states[50, :, BELOW:] = OCCUPIED
    grid = project(terrain_of(states, pose(2.0, 3.2)), (3.2, 3.2), 6.4)
    row = grid.distance[40]
    np.testing.assert_allclose(row[40:51], np.arange(10, -1, -1) * RESOLUTION, atol=1e-6)
    assert np.isinf(row[20]) and np.isnan(row[52])


def test_middle_of_a_grid_lies_where_it_lay():
    grid = project(terrain_of(flat(), pose(3.2, 3.2)), (3.2, 3.2), 6.4)
    middle = grid.middle(2.0)
    assert middle.cost.shape == (24, 24)
    row, column = (round((m - g) / RESOLUTION) for m, g in zip(middle.origin_xy[::-1], grid.origin_xy[::-1], strict=True))
    for name in ("cost", "height", "distance"):
        there = getattr(grid, name)[row : row + len(middle.cost), column : column + len(middle.cost)]
        np.testing.assert_array_equal(getattr(middle, name), there)
    assert grid.middle(20.0).cost.shape == grid.cost.shape
    assert middle.origin_xy[0] + middle.cost.shape[1] * RESOLUTION / 2 == pytest.approx(3.2)


def test_robot_without_ground_beneath_it_has_no_grid():
    grid = project(terrain_of(flat(), pose(3.2, 3.2, ground=2.0)), (3.2, 3.2), 4.0)
    assert (grid.cost == UNKNOWN).all() and np.isnan(grid.distance).all()


def test_sizes_that_are_not_positive_are_refused():
    terrain = terrain_of(flat(), pose(3.2, 3.2))
    with pytest.raises(ValueError, match="size_m"):
        project(terrain, (3.2, 3.2), 0.0)
    with pytest.raises(ValueError, match="size_m"):
        project(terrain, (3.2, 3.2), 4.0).middle(-1.0)
