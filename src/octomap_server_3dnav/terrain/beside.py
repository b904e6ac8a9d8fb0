"""One question beside ground: does it go on, does something stand there, does it drop, or does nobody know.

The third principle of docs/terrain.md. Asked by the flood of `classify`, of the runs of the columns alone. Everything is in voxels.
"""

import numpy as np
from numba import njit

from octomap_server_3dnav.octree.columns import DX, DY, NO_VOXEL, Columns, blocking_voxel, is_free_through, lowest_occupied, seen_down_to
from octomap_server_3dnav.octree.lean_kernels import Index, lean_njit
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.graph import Links
from octomap_server_3dnav.terrain.surfaces import Surfaces, find_node

GROUND, BLOCKED, DROP, UNKNOWN, EDGE = 0, 1, 2, 3, 4
"""What lies beside ground; an EDGE is unknown, and a beam passed where its floor would be."""


@lean_njit
def drivable_rise(j: Index, limits: Limits) -> Index:
    """Voxels by which drivable ground may differ in height j columns away."""
    return max(limits.step, 1 + int(np.floor(j * limits.max_slope)))


@njit(cache=True)
def _drops(columns: Columns, surfaces: Surfaces, s: Index, c: Index, stride: Index, limits: Limits, look: Index, assumed: bool) -> bool:
    """Whether from column c in `look` steps of `stride` all ground that node s could lead to lies too low, or free space below it.

    Where a drop is `assumed`, as the thesis does (7.3), it is enough that a beam passed where ground would be and none was seen.
    """
    step, level = limits.step, np.int64(surfaces.z[s])
    for j in range(1, look + 1):
        cj, rise = c + j * stride, drivable_rise(j, limits)
        n = find_node(surfaces.start, surfaces.z, cj, level, rise)
        if n >= 0:  # ground, but lower than any slope between would lead
            return bool(surfaces.height[s] - surfaces.height[n] > max(limits.max_step, (j + 1) * limits.max_slope))
        if lowest_occupied(columns, cj, level - step, level + step) != NO_VOXEL:
            return False
        seen = seen_down_to(columns, cj, level)
        if seen == NO_VOXEL:
            continue
        on_ground = lowest_occupied(columns, cj, seen - 2, seen - 1) != NO_VOXEL
        if (assumed and seen <= level) or seen < level - rise or (on_ground and seen <= level - rise):
            return True
    return False


@njit(cache=True)
def _beyond(columns: Columns, surfaces: Surfaces, s: Index, c: Index, k: Index, limits: Limits) -> Index:
    """What lies in direction k of node s of column c where no ground is near; over a drop that is seen below it nothing stands."""
    stride = DX[k] * columns.ny + DY[k]
    is_blocked = blocking_voxel(columns, c + stride, np.int64(surfaces.z[s]), limits.step, limits.clearance) != NO_VOXEL
    look = 1 if is_blocked else limits.look
    if _drops(columns, surfaces, s, c, stride, limits, look, limits.assumes_cliffs and not is_blocked):
        return DROP
    if is_blocked:
        return BLOCKED
    return EDGE if _drops(columns, surfaces, s, c, stride, limits, look, True) else UNKNOWN


@njit(cache=True)
def beside(columns: Columns, surfaces: Surfaces, links: Links, s: Index, k: Index, limits: Limits) -> Index:
    """GROUND, BLOCKED, DROP, UNKNOWN or EDGE: what lies in direction k of node s.

    Lower ground whose top was not seen may be higher than it looks: a wall under a deck that was seen from below only.
    """
    if links.graph[s, k] >= 0:
        return GROUND
    n, c = links.near[s, k], np.int64(surfaces.column[s])
    if n < 0:
        return _beyond(columns, surfaces, s, c, k, limits)
    if surfaces.height[n] >= surfaces.height[s]:
        return BLOCKED
    above = np.int64(surfaces.z[n]) + 1
    return DROP if is_free_through(columns, c + DX[k] * columns.ny + DY[k], above, above) else UNKNOWN


@lean_njit
def stands_beyond(columns: Columns, c: Index, stride: Index, level: Index, limits: Limits) -> bool:
    """Whether something stands in the way of a robot at `level`, `limits.side` strides on from column c or beside that place.

    What is unknown before it may be a side of it.
    """
    low, high, beyond = level + limits.step + 1, level + limits.clearance, c + limits.side * stride
    is_there = lowest_occupied(columns, beyond, low, high) != NO_VOXEL
    for k in range(4):
        is_there |= lowest_occupied(columns, beyond + DX[k] * columns.ny + DY[k], low, high) != NO_VOXEL
    return is_there
