"""The flat grid for the local costmap (thesis 5.5.2): levels, raster, unknown."""

import numpy as np
import pytest
from terrain_worlds import BELOW, OCCUPIED, RESOLUTION, grid_of_heights, pose, terrain_of

from octomap_server_3dnav.terrain.classify import TerrainClass
from octomap_server_3dnav.terrain.local_grid import FREE, LETHAL, UNKNOWN, project


def flat():
    return grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 80, 80)


def test_wall_is_lethal_floor_and_inflation_are_free_and_the_rest_is_unknown():
    states = flat()
    states[50, :, BELOW:] = OCCUPIED
    grid = project(terrain_of(states, pose(2.0, 3.2)), pose(2.0, 3.2), 6.4, RESOLUTION)
    row = grid.cost[grid.cost.shape[0] // 2]
    first = round(grid.origin_xy[0] / RESOLUTION)
    assert row[50 - first] == LETHAL
    assert (row[-first : 50 - first] == FREE).all()
    assert (row[51 - first :] == UNKNOWN).all()


def test_every_cell_agrees_with_the_voxel_over_it_when_the_rasters_are_equal():
    states = flat()
    states[30:34, 20:60, BELOW : BELOW + 8] = OCCUPIED
    terrain = terrain_of(states, pose(1.0, 3.2))
    grid = project(terrain, pose(1.0, 3.2), 8.0, RESOLUTION)
    kx, ky = (round(v / RESOLUTION) for v in grid.origin_xy)
    lethal = np.isin(terrain.label, (TerrainClass.OBSTACLE, TerrainClass.CLIFF))
    expected = {(x - kx, y - ky) for x, y in zip(terrain.ix[lethal], terrain.iy[lethal], strict=True)}
    ny, nx = grid.cost.shape
    inside = {(x, y) for x, y in expected if 0 <= x < nx and 0 <= y < ny}
    assert set(zip(*np.nonzero(grid.cost.T == LETHAL), strict=True)) == inside


def test_bridge_above_is_no_obstacle():
    states = flat()
    states[30:50, :, BELOW + 20] = OCCUPIED
    grid = project(terrain_of(states, pose(1.0, 3.2)), pose(3.2, 3.2), 4.0, 0.05)
    assert (grid.cost == FREE).all()


@pytest.mark.parametrize("resolution", [0.05, 0.1, 0.2])
def test_floor_has_no_holes_at_any_resolution(resolution):
    grid = project(terrain_of(flat(), pose(3.2, 3.2)), pose(3.23, 3.17), 4.0, resolution)
    assert (grid.cost == FREE).all()
    assert abs(grid.origin_xy[0] - 1.23) <= resolution


def test_sizes_that_are_not_positive_are_refused():
    with pytest.raises(ValueError, match="size_m"):
        project(terrain_of(flat(), pose(3.2, 3.2)), pose(3.2, 3.2), 0.0, 0.1)
