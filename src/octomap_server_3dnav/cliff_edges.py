"""Where ground ends at cliffs: by the beams that ended on it, short of the edge.

Used by `barriers`. All places are in voxels of the window.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.hit_extent import Floats, Ints, middles, spread
from octomap_server_3dnav.surface_columns import DX, DY
from octomap_server_3dnav.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain_scene import Scene

BEFORE = 0.2  # voxels before the middle of its column that a slope gets too steep, where the slopes beside it do not tell
_FALLING = 0.25  # voxels from one column to the next, 14 degrees: less is the unevenness of a floor
_SURE = 2  # beams that ended on the floor before a cliff: of fewer it may begin a voxel nearer
_MANY = 6  # hits whose mean tells whether the ground fills a column
_ASIDE = 0.12  # voxels that it lies off the middle then where it does not


class CliffEdges(NamedTuple):
    """Places (M, 3) of x, y and level: of sharp edges, and of such that are rounded, as at the rim of a crater."""

    sharp: Floats
    rounded: Floats


def cliff_edges(heights: SurfaceHeights, scene: Scene, cliff: Ints) -> CliffEdges:
    """Where the ground ends at `cliff` nodes: where beams ended in their voxel, of those that less than two beams met a voxel nearer; in
    inner corners, too; of rounded ones before the middle of their column."""
    is_rounded, over = _is_rounded(scene, cliff), _way_over(scene, cliff)
    column, z = scene.surfaces.column[cliff].astype(np.int64), scene.surfaces.z[cliff].astype(np.int64)
    places = middles(column, z, scene.columns.ny)
    rounded = places[is_rounded]
    rounded[:, :2] -= BEFORE * over[is_rounded]
    sharp, met = places[~is_rounded], spread(heights, scene, column[~is_rounded], z[~is_rounded], z[~is_rounded])
    sharp[:, :2] += met[:, 1:3] - (met[:, :1] < _SURE) * over[~is_rounded]
    return CliffEdges(np.concatenate([sharp, _inner_corners(heights, scene, cliff[~is_rounded])]), rounded)


def _way_over(scene: Scene, cliff: Ints) -> Floats:
    """(M, 2) the last voxel before the edge of cliffs."""
    beyond = (scene.links.graph[cliff] < 0).astype(np.float64) @ np.stack([DX, DY], axis=1)
    return np.asarray(beyond / np.maximum(1.0, np.hypot(beyond[:, :1], beyond[:, 1:])))


def _is_rounded(scene: Scene, cliff: Ints) -> NDArray[np.bool_]:
    """(M,) cliffs towards which the ground falls already and beyond which it goes on little lower."""
    near, graph, level = scene.links.near[cliff], scene.links.graph[cliff], scene.surfaces.level
    behind = np.roll(graph, 2, axis=1)  # of every direction the node the other way
    fall = np.where((graph < 0) & (near >= 0) & (behind >= 0), level[behind] - level[cliff, None], -np.inf)
    return np.asarray(fall.max(axis=1, initial=-np.inf) > _FALLING)


def _inner_corners(heights: SurfaceHeights, scene: Scene, cliff: Ints) -> Floats:
    """(C, 3) where ground ends within a column that is no cliff itself but diagonally before a drop, at the end of an edge.

    Another edge begins there at a right angle, or the hits in the column say that ground does not fill it.
    """
    graph, ahead, is_cliff = scene.links.graph, np.stack([DX, DY], axis=1), np.zeros(len(scene.links.graph) + 1, np.bool_)
    is_cliff[cliff] = True  # and the last, that of no node, is none
    nodes, ways, meet = [], [], []
    for k in range(4):
        edge = cliff[graph[cliff, k] < 0]
        for aside in ((k + 1) % 4, (k + 3) % 4):
            back, beside = (aside + 2) % 4, graph[edge, aside]
            is_one = (beside >= 0) & ~is_cliff[beside]
            node, last = beside[is_one].astype(np.int64), edge[is_one]
            other = graph[node, k]
            nodes.append(node)
            ways.append(np.tile(ahead[k] - ahead[aside], (len(node), 1)))
            meet.append(is_cliff[other] & (graph[other, back] < 0) & (graph[other, k] >= 0) & (graph[last, back] >= 0))
    node, way = np.concatenate(nodes), np.concatenate(ways)
    column, z = scene.surfaces.column[node].astype(np.int64), scene.surfaces.z[node].astype(np.int64)
    met = spread(heights, scene, column, z, z)
    is_part = (met[:, 0] >= _MANY) & ((met[:, 1:3] * way).sum(axis=1) < -_ASIDE)
    places = middles(column, z, scene.columns.ny)
    places[:, :2] += met[:, 1:3]
    return np.asarray(places[is_part | np.concatenate(meet)])
