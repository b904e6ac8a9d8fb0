"""Where ground ends at cliffs: by the beams that ended on it, short of the edge.

Used by `barriers`. All places are in voxels of the window.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from octomap_server_3dnav.hit_extent import Floats, Ints, middles, spread, unmet
from octomap_server_3dnav.surface_columns import DX, DY
from octomap_server_3dnav.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain_config import Limits
from octomap_server_3dnav.terrain_scene import Scene

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
    (fall, before), over = _falls(scene, cliff), _way_over(scene, cliff)
    is_rounded = fall > _FALLING
    column, z = scene.surfaces.column[cliff].astype(np.int64), scene.surfaces.z[cliff].astype(np.int64)
    places = middles(column, z, scene.columns.ny)
    rounded = places[is_rounded]
    gets_steep = _gets_steep(fall[is_rounded], before[is_rounded], limits.steepest[1])
    rounded[:, :2] -= gets_steep[:, None] * over[is_rounded]
    sharp, met = places[~is_rounded], spread(heights, scene, column[~is_rounded], z[~is_rounded], z[~is_rounded])
    nearer = np.where(met[:, 0] < _SURE, 1.0, unmet(met[:, 0], _FEW))
    sharp[:, :2] += met[:, 1:3] - nearer[:, None] * over[~is_rounded]
    corners = _inner_corners(heights, scene, cliff[~is_rounded])
    reach = np.zeros((len(sharp) + len(corners), 3))
    reach[: len(sharp), :2] = _HALF * over[~is_rounded][:, ::-1] * (-1.0, 1.0)
    return CliffEdges(np.concatenate([sharp, corners]), rounded, reach)


def _way_over(scene: Scene, cliff: Ints) -> Floats:
    """(M, 2) the last voxel before the edge of cliffs."""
    beyond = (scene.links.graph[cliff] < 0).astype(np.float64) @ np.stack([DX, DY], axis=1)
    return np.asarray(beyond / np.maximum(1.0, np.hypot(beyond[:, :1], beyond[:, 1:])))


def _falls(scene: Scene, cliff: Ints) -> tuple[Floats, Floats]:
    """(M,) by how much the ground falls from the column before to cliffs beyond which it goes on little lower, -inf where it does not, and
    (M,) by how much to that column from the one before."""
    near, graph, level = scene.links.near[cliff], scene.links.graph, scene.surfaces.level
    behind = np.roll(graph[cliff], 2, axis=1)  # of every direction the node the other way
    last = np.where(behind >= 0, graph[behind, [2, 3, 0, 1]], -1)
    falls = np.where((graph[cliff] < 0) & (near >= 0) & (behind >= 0), level[behind] - level[cliff, None], -np.inf)
    most = falls.argmax(axis=1)[:, None]
    behind, last = np.take_along_axis(behind, most, 1)[:, 0], np.take_along_axis(last, most, 1)[:, 0]
    return np.take_along_axis(falls, most, 1)[:, 0], np.where(last >= 0, level[last] - level[behind], 0.0)


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
