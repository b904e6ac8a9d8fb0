"""What stands over ground that was not seen: the map knows it, and no ground of the storey explains it.

After `local_grid.project`, before the costmap. The terrain classifies what stands beside ground: a box by its front. Without its top the
costmap takes what lines meet there for somebody who came, and the collision monitor stops the robot before it.
"""

import math
from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from octomap_server_3dnav.navigation.local_grid import LETHAL, UNKNOWN, TerrainGrid
from octomap_server_3dnav.octree.columns import NO_VOXEL, Columns, lowest_occupied
from octomap_server_3dnav.terrain.classified_terrain import Terrain
from robot_body import RobotBody

_REACH_M = 0.4  # it is judged by ground that is so near, as lines of the laser are (_GROUND_REACH_M), and a cell more


def with_standing(grid: TerrainGrid, terrain: Terrain, robot: RobotBody) -> TerrainGrid:
    """The grid of a terrain, with 100 where it does not know the column and something in the robot's way stands there.

    Higher than a step over the nearest ground, or over as much as a slope may rise from there, and no higher than the robot. Ground is no
    farther from it than from its cell's middle; behind a front, which the terrain knows exactly, that says nothing new.
    """
    if np.isnan(grid.height).all():
        return grid
    off_m, (near_row, near_column) = ndimage.distance_transform_edt(np.isnan(grid.height), grid.resolution, return_indices=True)
    row, column = np.nonzero((grid.cost == UNKNOWN) & (off_m <= _REACH_M + 1e-6))
    first = [round(o / grid.resolution) - k for o, k in zip(grid.origin_xy, terrain.window_key, strict=True)]
    x, y = column + first[0], row + first[1]
    known = (x >= 0) & (x < terrain.columns.nx) & (y >= 0) & (y < terrain.columns.ny)
    row, column, x, y = row[known], column[known], x[known], y[known]
    ground_m = grid.height[near_row[row, column], near_column[row, column]]
    low_m = ground_m + robot.max_step_m + off_m[row, column] * math.tan(robot.max_slope_rad)
    low, high = (np.floor(z / grid.resolution + 1e-6).astype(np.int64) for z in (low_m, ground_m + robot.height_m))
    met = _met(terrain.columns, x * terrain.columns.ny + y, low, high)
    if not met.any():
        return grid
    cost, is_free = grid.cost.copy(), np.ones(grid.cost.shape, dtype=np.bool_)
    cost[row[met], column[met]], is_free[row[met], column[met]] = LETHAL, False
    away_m = ndimage.distance_transform_edt(is_free, grid.resolution).astype(np.float32)
    return replace(grid, cost=cost, distance=np.where(np.isnan(grid.height), grid.distance, np.minimum(grid.distance, away_m)))


@njit(cache=True)
def _met(columns: Columns, column: NDArray[np.int64], low: NDArray[np.int64], high: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(K,) whether something is occupied in voxels low..high of columns (K,)."""
    met = np.empty(column.size, np.bool_)
    for i in range(column.size):
        met[i] = lowest_occupied(columns, column[i], low[i], high[i]) != NO_VOXEL
    return met
