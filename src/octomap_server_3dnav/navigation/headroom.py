"""Ground over which not all of the robot's room was seen: while the robot explores a hope, in a map that is done a danger.

After `navigable_terrain`, for the map that people look at, keep, and plan in once nothing is explored any more. Until then the laser has
not looked up everywhere; a robot that drives there sees with every line what hangs in its way.
"""

from dataclasses import replace

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.passages import TerrainSettings
from octomap_server_3dnav.octree.columns import Columns
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass
from octomap_server_3dnav.terrain.config import Limits


def with_seen_headroom(terrain: Terrain, settings: TerrainSettings) -> Terrain:
    """The terrain in which ground is a frontier, and no path leads over it, where a voxel of the robot's room above was never seen.

    No passage does, either. Where the robot stands there is room for it.
    """
    clearance = Limits.of(settings.terrain, settings.robot, terrain.resolution).clearance
    unseen = _unseen(terrain, terrain.nodes_of(TerrainClass.TRAVERSABLE), clearance)
    unseen = np.setdiff1d(unseen, [node for node in (terrain.start, terrain.departure) if node is not None])
    label, cost = terrain.label.copy(), terrain.cost.copy()
    label[unseen], cost[unseen] = TerrainClass.FRONTIER, np.inf
    hidden = np.zeros(label.size, np.bool_)
    hidden[unseen], hidden[_unseen(terrain, np.flatnonzero(terrain.narrow), clearance)] = True, True
    passages = tuple(passage for passage in terrain.passages if not _leads_over(terrain, passage.line, hidden))
    return replace(terrain, label=label, cost=cost, passages=passages)


def _unseen(terrain: Terrain, node: NDArray[np.int64], clearance: int) -> NDArray[np.int64]:
    column = (terrain.ix[node] - terrain.window_key[0]).astype(np.int64) * terrain.columns.ny + terrain.iy[node] - terrain.window_key[1]
    return node[~_is_known(terrain.columns, column, terrain.z[node].astype(np.int64), clearance)]


def _leads_over(terrain: Terrain, line: NDArray[np.float64], nodes: NDArray[np.bool_]) -> bool:
    """Whether a line (K, 3) leads over one of these nodes (N,)."""
    return any(node is not None and nodes[node] for node in map(terrain.surface_near, line))


@njit(cache=True)
def _is_known(columns: Columns, column: NDArray[np.int64], z: NDArray[np.int64], clearance: int) -> NDArray[np.bool_]:
    """(K,) whether all of the `clearance` voxels above voxel z (K,) of columns (K,) were seen."""
    known = np.empty(column.size, np.bool_)
    for i in range(column.size):
        low, high, seen = z[i] + 1, z[i] + clearance, 0
        for r in range(columns.start[column[i]], columns.start[column[i] + 1]):
            seen += max(0, min(np.int64(columns.z_hi[r]), high) - max(np.int64(columns.z_lo[r]), low) + 1)
        known[i] = seen == clearance
    return known
