"""Where ground ends at cliffs: by the beams that ended on it, short of the edge.

Used by `barriers`. All places are in voxels of the window.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from octomap_server_3dnav.octree.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.hit_extent import Floats, Ints, middles, spread, unmet
from octomap_server_3dnav.terrain.scene import Scene
from octomap_server_3dnav.terrain.surface_columns import DX, DY

BEFORE = 0.2  # voxels before the middle of its column that a slope gets too steep, where the slopes beside it do not tell
_FALLING = 0.25  # voxels from one column to the next, 14 degrees: less is the unevenness of a floor
_SURE = 2  # beams that ended on the floor before a cliff: of fewer it may begin a voxel nearer
_FEW = 1.0  # voxels, divided by their number, that it may begin nearer else: of few that met a sliver some belong to the floor before it
_MANY = 6  # hits whose mean tells whether the ground fills a column; half as many, if clearly
_ASIDE = 0.12  # voxels that it lies off the middle then where it does not
_CLEARLY = 0.3
_HALF = 0.5  # voxels that a sharp edge goes on to both sides, as wide as its column


class CliffEdges(NamedTuple):
    """Places (M, 3) of x, y and level: of sharp edges, and of such that are rounded, as at the rim of a crater; and how far the sharp ones
    extend, `reach` (M, 3) as `terrain_kernels.inflate` takes it: where two meet in an inner corner no place of either may be at its tip."""

    sharp: Floats
    rounded: Floats
    reach: Floats


def cliff_edges(heights: SurfaceHeights, scene: Scene, cliff: Ints, limits: Limits) -> CliffEdges:
    """Where the ground ends at `cliff` nodes: where beams ended in their voxel, nearer if they were few, by a voxel of less than two; in
    inner corners, too; of rounded ones before the middle of their column, where they get too steep."""
    fall, before, over = _ways_over(cliff, scene.links.near, scene.links.graph, scene.surfaces.level)
    is_rounded = fall > _FALLING
    column, z = scene.surfaces.column[cliff].astype(np.int64), scene.surfaces.z[cliff].astype(np.int64)
    places = middles(column, z, scene.columns.ny)
    rounded = places[is_rounded]
    gets_steep = _gets_steep(fall[is_rounded], before[is_rounded], limits.steepest[1])
    rounded[:, :2] -= gets_steep[:, None] * over[is_rounded]
    sharp, met = places[~is_rounded], spread(heights, scene, column[~is_rounded], z[~is_rounded], z[~is_rounded])
    _move_to_hits(sharp, met, over[~is_rounded])
    corners = _inner_corners(heights, scene, cliff[~is_rounded])
    reach = np.zeros((len(sharp) + len(corners), 3))
    reach[: len(sharp), :2] = _HALF * over[~is_rounded][:, ::-1] * (-1.0, 1.0)
    return CliffEdges(np.concatenate([sharp, corners]), rounded, reach)


@njit(cache=True)
def _ways_over(cliff: Any, near: Any, graph: Any, level: Any) -> Any:
    """Of cliffs (M,): by how much the ground falls from the column before to them, if it goes on little lower beyond, -inf where it does
    not; by how much to that column from the one before; and (M, 2) the last voxel before the edge."""
    fall, before, over = np.full(cliff.size, -np.inf), np.zeros(cliff.size), np.zeros((cliff.size, 2))
    for i, s in enumerate(cliff):
        for k in range(4):
            if graph[s, k] >= 0:
                continue
            over[i, 0], over[i, 1] = over[i, 0] + DX[k], over[i, 1] + DY[k]
            back = (k + 2) % 4
            behind = graph[s, back]
            if near[s, k] < 0 or behind < 0 or level[behind] - level[s] <= fall[i]:
                continue
            last = graph[behind, back]
            fall[i], before[i] = level[behind] - level[s], level[last] - level[behind] if last >= 0 else 0.0
        over[i] /= max(1.0, np.hypot(over[i, 0], over[i, 1]))
    return fall, before, over


@njit(cache=True)
def _move_to_hits(places: Any, met: Any, over: Any) -> None:
    """Moves edges (M, 3) from the middle of their column to where beams met it, less what few may have missed on the way `over` it."""
    for i in range(len(places)):
        nearer = 1.0 if met[i, 0] < _SURE else unmet(met[i, 0], _FEW)
        places[i, 0] += met[i, 1] - nearer * over[i, 0]
        places[i, 1] += met[i, 2] - nearer * over[i, 1]


def _gets_steep(fall: Floats, before: Floats, steepest: float) -> Floats:
    """(M,) voxels before the middle of their columns at which rounded edges get steeper than that, by their last two falls."""
    turns = np.clip((fall - steepest) / np.maximum(fall - before, 1e-6), 0.0, 1.0)
    return np.where(fall > steepest, 0.5 + turns, BEFORE)


def _inner_corners(heights: SurfaceHeights, scene: Scene, cliff: Ints) -> Floats:
    """(C, 3) where ground ends within a column that is no cliff itself but diagonally before a drop, at the end of an edge.

    Another edge begins there at a right angle, or the hits in the column say that ground does not fill it.
    """
    node, way, meet = _ends_of_edges(cliff, scene.links.graph)
    column, z = scene.surfaces.column[node].astype(np.int64), scene.surfaces.z[node].astype(np.int64)
    met = spread(heights, scene, column, z, z)
    least = np.where(met[:, 0] >= _MANY, _ASIDE, np.where(met[:, 0] >= _MANY / 2, _CLEARLY, np.inf))
    is_part = (met[:, 1:3] * way).sum(axis=1) < -least
    places = middles(column, z, scene.columns.ny)
    places[:, :2] += met[:, 1:3]
    return np.asarray(places[is_part | meet])


@njit(cache=True)
def _ends_of_edges(cliff: Any, graph: Any) -> Any:
    """Nodes that are no `cliff` but beside the last of an edge, (C,); the way (C, 2) from them over the edge and on along it; and whether
    another edge begins beyond them at a right angle, (C,)."""
    is_cliff, ends = np.zeros(len(graph), np.bool_), 8 * cliff.size
    node, way, meet = np.empty(ends, np.int64), np.empty((ends, 2), np.float64), np.empty(ends, np.bool_)
    is_cliff[cliff] = True
    count = 0
    for last in cliff:
        for k in range(4):
            for aside in ((k + 1) % 4, (k + 3) % 4):
                beside = graph[last, aside]
                if graph[last, k] >= 0 or beside < 0 or is_cliff[beside]:
                    continue
                back, other = (aside + 2) % 4, graph[beside, k]
                node[count], way[count, 0], way[count, 1] = beside, DX[k] - DX[aside], DY[k] - DY[aside]
                goes_on = other >= 0 and is_cliff[other] and graph[other, back] < 0 and graph[other, k] >= 0
                meet[count] = goes_on and graph[last, back] >= 0
                count += 1
    return node[:count], way[:count], meet[:count]
