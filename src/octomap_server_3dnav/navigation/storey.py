"""The robot's storey: of the surfaces above each other in a column the one that is nearest by way of the ground.

After `terrain.classify`, before `local_grid`. On a ramp the floor below it is far away, and so is what stands on that floor.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass

STOREY_M = 0.5  # ground that differs by less in height is of one storey: between two the robot fits
GROUND, LETHAL = (TerrainClass.TRAVERSABLE, TerrainClass.INFLATION), (TerrainClass.OBSTACLE, TerrainClass.CLIFF)
_FAR = np.iinfo(np.int32).max  # steps to where no way leads


class Storey(NamedTuple):
    """Nodes of the ground, and of the obstacles and cliffs, of the robot's storey."""

    ground: NDArray[np.int64]
    lethal: NDArray[np.int64]


def robot_storey(terrain: Terrain) -> Storey:
    """What the robot's storey is made of; nothing where no ground is beneath the robot.

    In every column the node that is the fewest steps over the ground from the robot decides, and all nodes of about its height belong to
    the storey. Obstacles, cliffs and frontiers are as far as the ground that they were seen from, or that lies beside them.
    """
    if terrain.start is None:
        return Storey(np.empty(0, dtype=np.int64), np.empty(0, dtype=np.int64))
    steps = _steps_from(terrain.start, terrain.neighbours)
    before = _ground_before(terrain, steps)
    nodes = np.flatnonzero(before >= 0)
    level = terrain.z[np.where(nodes < terrain.surface_count, nodes, before[nodes])].astype(np.int64)
    is_of_storey = np.abs(level - _level_of_nearest(terrain, nodes, steps[before[nodes]], level)) * terrain.resolution < STOREY_M
    nodes = nodes[is_of_storey]
    return Storey(nodes[np.isin(terrain.label[nodes], GROUND)], nodes[np.isin(terrain.label[nodes], LETHAL)])


def _level_of_nearest(terrain: Terrain, nodes: NDArray[np.int64], away: NDArray[np.int32], level: NDArray[np.int64]) -> NDArray[np.int64]:
    """(M,) of some nodes the level of that of their column which is the fewest steps away."""
    column = (terrain.ix[nodes].astype(np.int64) << 32) + terrain.iy[nodes]
    order = np.lexsort((level, away, column))
    _, first, group = np.unique(column[order], return_index=True, return_inverse=True)
    nearest = np.empty_like(level)
    nearest[order] = level[order][first][group]
    return nearest


def _ground_before(terrain: Terrain, steps: NDArray[np.int32]) -> NDArray[np.int32]:
    """(N,) the ground, to which a way leads, from which each node is seen or that lies beside it; ground itself; -1 where there is none."""
    size, rise = np.array([terrain.columns.nx, terrain.columns.ny]), int(STOREY_M / terrain.resolution)
    at = np.stack([terrain.ix - terrain.window_key[0], terrain.iy - terrain.window_key[1], terrain.z], axis=1).astype(np.int64)
    before = np.where(steps < _FAR, np.arange(steps.size), terrain.seen_from).astype(np.int32)
    before[(before >= 0) & (steps[before] == _FAR)] = -1
    _look_beside(before, at, steps, terrain.column_start, size, rise)
    return before


@njit(cache=True)
def _steps_from(start: Any, neighbours: Any) -> Any:
    """(N,) int32 edges of the navigation graph from a node to each other one; `_FAR` where no way leads."""
    steps, queue = np.full(len(neighbours), _FAR, np.int32), np.empty(len(neighbours), np.int32)
    steps[start], queue[0], head, tail = 0, start, 0, 1
    while head < tail:
        s = queue[head]
        head += 1
        for k in range(4):
            n = neighbours[s, k]
            if n >= 0 and steps[n] == _FAR:
                steps[n] = steps[s] + 1
                queue[tail] = n
                tail += 1
    return steps


@njit(cache=True)
def _look_beside(before: Any, at: Any, steps: Any, column_start: Any, size: Any, rise: Any) -> None:
    """Fill in where `before` (N,) is -1: in the four columns beside the ground that is the fewest steps away.

    `at` (N, 3) voxels in a window of `size` (2,) columns; that ground is at most `rise` voxels higher or lower.
    """
    for n in range(len(at)):
        if before[n] >= 0:
            continue
        least = np.int64(_FAR)
        for dx, dy in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            x, y = at[n, 0] + dx, at[n, 1] + dy
            if x < 0 or y < 0 or x >= size[0] or y >= size[1]:
                continue
            for m in range(column_start[x * size[1] + y], column_start[x * size[1] + y + 1]):
                if steps[m] < least and abs(at[m, 2] - at[n, 2]) <= rise:
                    least, before[n] = steps[m], m
