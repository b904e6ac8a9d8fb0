"""Where floor is looked at that no way leads to: the reached ground that is nearest to it over the surface, whatever class that has.

Beside `lookouts`, for `goals` when nothing else is left. What was seen from afar only may look like a step that is none.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import dijkstra

from octomap_server_3dnav.exploration.frontiers import Frontier, FrontierConfig
from octomap_server_3dnav.exploration.lookouts import unreached_floor
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass


def nearest_ground(terrain: Terrain, of: FrontierConfig, distance_m: NDArray[np.float64]) -> list[Frontier]:
    """Unknown floor that no way leads to, what may show most first, each with the node that it is looked at from.

    That lies within `of.gain_radius_m` of the floor over the surface, and has a way over the ground, (N,) `distance_m`.
    """
    count = terrain.surface_count
    is_open = (terrain.label == TerrainClass.TRAVERSABLE) & terrain.reached & ~terrain.near_kerb & np.isfinite(distance_m)
    surface, found = _surface(terrain), []
    for members, middle, gain in unreached_floor(terrain, of):
        beside = np.unique(terrain.neighbours[members])
        beside = beside[(beside >= 0) & (beside < count)]
        if not beside.size:
            continue
        away = dijkstra(surface, directed=False, indices=beside, min_only=True, limit=of.gain_radius_m / terrain.resolution)
        node = int(np.argmin(np.where(is_open[:count], away, np.inf)))
        if is_open[node] and np.isfinite(away[node]):
            x, y, z = terrain.centers(np.array([middle]))[0].astype(np.float64).tolist()
            length = float(distance_m[node])
            found.append(Frontier((x, y, z), node, tuple(members.tolist()), length, length, last=True, potential_cliff=False, gain_m2=gain))
    return sorted(found, key=lambda frontier: (-round(frontier.gain_m2, 6), frontier.xyz))


def _surface(terrain: Terrain) -> csr_array:
    """Which surface nodes are neighbours, a voxel apart."""
    count = terrain.surface_count
    neighbours = terrain.neighbours[:count]
    rows, sides = np.nonzero((neighbours >= 0) & (neighbours < count))
    return coo_array((np.ones(len(rows)), (rows, neighbours[rows, sides])), shape=(count, count)).tocsr()
