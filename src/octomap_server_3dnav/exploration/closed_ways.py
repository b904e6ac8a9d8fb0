"""Ways that bend to where floor is to be seen that nothing else shows: floor that closes a way to known ground, or lies beside a way.

Beside `lookouts`, for `goals` when nothing else is left.
"""

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.frontier_gain import unknown_area_m2
from octomap_server_3dnav.exploration.frontiers import Frontier, FrontierConfig
from octomap_server_3dnav.exploration.lookouts import NEAR_END_M, Lookout, unreached_floor
from octomap_server_3dnav.navigation.passages import TerrainSettings, under_outline, ways_if_floor, ways_near
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass


def closed_ways(terrain: Terrain, of: FrontierConfig, settings: TerrainSettings) -> list[Lookout]:
    """Each way as far as the outline passes over floor that was seen, the shortest first."""
    found = []
    for way, unknown in ways_if_floor(terrain, settings):
        places = terrain.centers(unknown).astype(np.float64)
        middle = int(np.argmin(np.linalg.norm(places - places.mean(axis=0), axis=1)))
        gain = float(unknown_area_m2(terrain, unknown[middle : middle + 1], of.gain_radius_m)[0])
        clear = [k for k in range(2, len(way.line) + 1) if not under_outline(way.line[:k], places, settings.robot).any()]
        line = way.line[: max(clear, default=1)]
        nodes = [node for point in line if (node := terrain.surface_near(point)) is not None]
        if len(nodes) == len(line):
            x, y, z = places[middle].tolist()
            found.append(Lookout((x, y, z), gain, np.array(nodes, dtype=np.int32), line, tuple(unknown.tolist()), is_stand=True))
    return found


def stands(terrain: Terrain, of: FrontierConfig, settings: TerrainSettings) -> list[Lookout]:
    """Ways that bend to beside unknown floor that no straight one leads to, where a look may show most first."""
    floor = sorted(unreached_floor(terrain, of), key=lambda found: (-round(found[2], 6), found[1]))
    places = terrain.centers(np.array([middle for _, middle, _ in floor], dtype=np.int64)).astype(np.float64)
    found = []
    for (_, _, gain), (x, y, z), way in zip(floor, places.tolist(), ways_near(terrain, settings, places, NEAR_END_M), strict=True):
        nodes = [] if way is None else [node for point in way.line if (node := terrain.surface_near(point)) is not None]
        if way is not None and len(nodes) == len(way.line):
            found.append(Lookout((x, y, z), gain, np.array(nodes, dtype=np.int32), way.line, is_stand=True))
    return found


def entrance(terrain: Terrain, way: Lookout, distance_m: NDArray[np.float64]) -> Frontier | None:
    """The last place on a way with room to turn, to look in from; None where no way over the ground, (N,) `distance_m`, leads there."""
    is_open = (terrain.label[way.nodes] == TerrainClass.TRAVERSABLE) & np.isfinite(distance_m[way.nodes])
    if not is_open.any():
        return None
    node = int(way.nodes[np.flatnonzero(is_open)[-1]])
    length = float(distance_m[node])
    return Frontier(way.xyz, node, way.voxels, length, length, last=True, potential_cliff=False, gain_m2=way.gain_m2)
