"""How much ground a look at a frontier may show: the information gain beside its distance (thesis 6.2.2 knows distance and angle only).

Called by `frontiers.find_frontiers`. From the frontier rays go out over the surface, as far as a sweep is dense; what they cross of columns
without ground counts, up to the first obstacle, or to where air was seen in the ground's place: beyond the edge of a deck there is none.
Air under a deck that a ramp leads up to is none: the ground is on top, where nobody looked.
"""

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.columns import NO_VOXEL, lowest_occupied, seen_down_to
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass
from octomap_server_3dnav.terrain.surfaces import find_node

_RAYS = 64
_LEVEL_M = 0.5  # ground that differs by no more is seen from here, and as much more as a slope of a half leads
_NOTHING = -32768


@njit(cache=True)
def _unknown_area(columns: Any, start: Any, z: Any, obstacle: Any, robot: Any, far: Any, targets: Any, reach: Any, level: Any) -> Any:
    """(F,) voxels of unknown ground around each of (F, 3) targets; `obstacle` (C,) the level of one in every column.

    Rays end at `reach` voxels, at obstacles, at air, and `far` voxels from the robot (2,), beyond which nothing was classified.
    """
    area = np.zeros(len(targets))
    for t in range(len(targets)):
        x0, y0, z0 = targets[t]
        for ray in range(_RAYS):
            dx, dy = math.cos(2 * math.pi * ray / _RAYS), math.sin(2 * math.pi * ray / _RAYS)
            for r in range(1, reach + 1):
                x, y = x0 + int(round(r * dx)), y0 + int(round(r * dy))
                if math.hypot(x - robot[0], y - robot[1]) > far:
                    break
                c, band = x * columns.ny + y, level + r // 2
                if 0 <= x < columns.nx and 0 <= y < columns.ny:
                    if obstacle[c] != _NOTHING and abs(obstacle[c] - z0) <= band:
                        break
                    if find_node(start, z, c, z0, band) >= 0:
                        continue
                    is_open = lowest_occupied(columns, c, z0 + 1, z0 + band) == NO_VOXEL
                    if is_open and seen_down_to(columns, c, z0) <= z0 - band:
                        break
                area[t] += 2 * math.pi * r / _RAYS
    return area


def unknown_area_m2(terrain: Terrain, nodes: NDArray[np.integer], reach_m: float) -> NDArray[np.float64]:
    """(F,) m2 of ground not known yet that could be seen from frontier voxels (F,) within `reach_m`: 0 where walls stand all around."""
    stands = terrain.nodes_of(TerrainClass.OBSTACLE)
    x, y = (np.asarray(axis, dtype=np.int64) - key for axis, key in zip((terrain.ix, terrain.iy), terrain.window_key, strict=True))
    obstacle = np.full(terrain.column_start.size - 1, _NOTHING, dtype=np.int64)
    obstacle[x[stands] * terrain.columns.ny + y[stands]] = terrain.z[stands]
    targets = np.stack([x[nodes], y[nodes], terrain.z[nodes].astype(np.int64)], axis=1)
    robot = np.array(terrain.robot_xyz[:2]) / terrain.resolution - terrain.window_key
    far = math.inf if terrain.radius_m is None else terrain.radius_m / terrain.resolution
    reach, level = round(reach_m / terrain.resolution), round(_LEVEL_M / terrain.resolution)
    surfaces = terrain.z[: terrain.surface_count]
    return np.asarray(
        _unknown_area(terrain.columns, terrain.column_start, surfaces, obstacle, robot, far, targets, reach, level) * terrain.resolution**2
    )
