"""The floods of the terrain analysis over the surface graph: judge, inflate, second flood, frontiers (thesis 5.5, algorithm 3).

Third step of `terrain.classify`. What a node is depends on the map around it alone, never on the way the flood came: labels
do not depend on the order of the flood. Everything is in voxels.
"""

from typing import Any

import numpy as np
from numba import njit

from octomap_server_3dnav.surface_columns import DX, DY, NO_VOXEL, blocking_voxel, find_node, lowest_occupied, seen_down_to, top_near
from octomap_server_3dnav.surface_graph import slope_at

UNREACHED, TRAVERSABLE, OBSTACLE, CLIFF, INFLATION, FRONTIER = 255, 0, 1, 2, 3, 4
SEES_UNKNOWN, SEES_OBSTACLE, SEES_DROP = 0, 1, 2


@njit(cache=True)
def _limit(j: Any, step: Any, max_slope: Any) -> Any:
    """Voxels by which drivable ground may differ in height j columns away."""
    return max(step, 1 + int(np.floor(j * max_slope)))


@njit(cache=True)
def _drop_along(columns: Any, start: Any, z: Any, c: Any, stride: Any, level: Any, shape: Any) -> Any:
    """Whether free space was seen below all ground that could be driven to from column c in steps of `stride`.

    Where a drop is assumed, as the thesis does (7.3), it is enough that a beam passed at this level and no ground was seen.
    """
    step, _, look, max_slope, assumed = shape
    for j in range(1, look + 1):
        cj = c + j * stride
        limit = _limit(j, step, max_slope)
        if find_node(start, z, cj, level, limit) >= 0:
            return False
        if lowest_occupied(columns, cj, level - step, level + step) != NO_VOXEL:
            return False
        seen = seen_down_to(columns, cj, level)
        if seen == NO_VOXEL:
            continue
        on_ground = lowest_occupied(columns, cj, seen - 2, seen - 1) != NO_VOXEL
        if assumed or seen < level - limit or (on_ground and seen <= level - limit):
            return True
    return False


@njit(cache=True)
def _ground_aside(start: Any, z: Any, c: Any, stride: Any, aside: Any, level: Any, shape: Any) -> Any:
    """Whether the area beside the ray (thesis figure 5.12) holds ground at about this level."""
    step, half_width, max_slope = shape[0], shape[1], shape[3]
    for offset in range(-half_width, half_width + 1):
        for j in range(1, 4):
            if find_node(start, z, c + offset * aside + j * stride, level, _limit(j, step, max_slope)) >= 0:
                return True
    return False


@njit(cache=True)
def look(columns: Any, start: Any, z: Any, c: Any, level: Any, k: Any, clearance: Any, shape: Any) -> Any:
    """What lies in direction k of a node of column c where no ground goes on: obstacle, drop that was seen, or the unknown.

    `shape` is (step, cliff area half width, cliff look, tangent of the steepest drivable slope, whether unseen drops are assumed).
    """
    step, half_width = shape[0], shape[1]
    stride, aside = DX[k] * columns.ny + DY[k], DX[(k + 1) % 4] * columns.ny + DY[(k + 1) % 4]
    if blocking_voxel(columns, c + stride, level, step, clearance) != NO_VOXEL:
        return SEES_OBSTACLE
    if _drop_along(columns, start, z, c, stride, level, shape):
        return SEES_DROP
    if _ground_aside(start, z, c, stride, aside, level, shape):
        return SEES_UNKNOWN
    for offset in range(1, half_width + 1):
        for side in (-offset, offset):
            if _drop_along(columns, start, z, c + side * aside, stride, level, shape):
                return SEES_DROP
    return SEES_UNKNOWN


@njit(cache=True)
def _judge(columns: Any, start: Any, column: Any, z: Any, near: Any, graph: Any, s: Any, clearance: Any, reach: Any, shape: Any) -> Any:
    """Traversable, obstacle (too steep) or cliff (a drop was seen beside it)."""
    if slope_at(graph, z, s, reach) > shape[3]:
        return OBSTACLE
    for k in range(4):
        n = near[s, k]
        if n < 0 and look(columns, start, z, np.int64(column[s]), np.int64(z[s]), k, clearance, shape) == SEES_DROP:
            return CLIFF
        if n >= 0 and graph[s, k] < 0 and z[n] < z[s]:
            return CLIFF
    return TRAVERSABLE


@njit(cache=True)
def flood(columns: Any, surfaces: Any, near: Any, graph: Any, first: Any, inside: Any, clearance: Any, reach: Any, shape: Any) -> Any:
    """(N,) uint8 labels of all nodes reached from `first`, UNREACHED elsewhere, and the number of traversable ones.

    Only traversable nodes are expanded, and only into columns that are `inside` (bool per column).
    """
    start, column, z = surfaces.start, surfaces.column, surfaces.z
    label = np.full(z.size, UNREACHED, np.uint8)
    queued = np.zeros(z.size, np.bool_)
    queue = np.empty(z.size, np.int32)
    queue[0], head, tail, traversable = first, 0, 1, 0
    queued[first] = True
    while head < tail:
        s = queue[head]
        head += 1
        label[s] = _judge(columns, start, column, z, near, graph, s, clearance, reach, shape)
        if label[s] != TRAVERSABLE:
            continue
        traversable += 1
        for k in range(4):
            n = graph[s, k]
            if n >= 0 and not queued[n] and inside[column[n]]:
                queued[n] = True
                queue[tail] = n
                tail += 1
    return label, traversable


@njit(cache=True)
def mark_steps(label: Any, near: Any, graph: Any, z: Any) -> None:
    """Make the upper side of every step that is too high an obstacle, where the flood stood at its foot."""
    foot = np.flatnonzero(label == TRAVERSABLE)
    for s in foot:
        for k in range(4):
            n = near[s, k]
            if n >= 0 and graph[s, k] < 0 and z[n] > z[s]:
                label[n] = OBSTACLE


@njit(cache=True)
def obstacles_seen(columns: Any, surfaces: Any, label: Any, near: Any, clearance: Any, step: Any, far: Any, max_slope: Any) -> Any:
    """(M, 3) int64 (column, voxel, level of the ground in front) of obstacles beside the traversable ground.

    Across unknown ground the view goes on for `far` columns: a wall behind a strip that was not seen still needs its distance.
    """
    start, column, z = surfaces.start, surfaces.column, surfaces.z
    found = []
    for s in range(z.size):
        if label[s] != TRAVERSABLE:
            continue
        level = np.int64(z[s])
        for k in range(4):
            if near[s, k] >= 0:
                continue
            stride = DX[k] * columns.ny + DY[k]
            for j in range(1, far + 1):
                c = column[s] + j * stride
                if find_node(start, z, c, level, _limit(j, step, max_slope)) >= 0:
                    break
                voxel = blocking_voxel(columns, c, level, step, clearance)
                if voxel != NO_VOXEL:
                    floor = top_near(columns, c, level, step)  # under a low ceiling it is the floor that cannot be driven on
                    found.append((np.int64(c), np.int64(voxel if floor == NO_VOXEL else floor), level))
                    break
    out = np.empty((len(found), 3), np.int64)
    for i in range(len(found)):
        out[i, 0], out[i, 1], out[i, 2] = found[i]
    return out


@njit(cache=True)
def inflate(label: Any, surfaces: Any, barrier_column: Any, barrier_level: Any, offsets: Any, band: Any, nx: Any, ny: Any) -> None:
    """Turn traversable nodes into inflation around each barrier: (K, 2) `offsets` of columns, and at most `band` voxels up or down."""
    start, z = surfaces.start, surfaces.z
    for i in range(barrier_column.size):
        ix, iy = barrier_column[i] // ny, barrier_column[i] % ny
        for o in range(offsets.shape[0]):
            jx, jy = ix + offsets[o, 0], iy + offsets[o, 1]
            if not (0 <= jx < nx and 0 <= jy < ny):
                continue
            c = jx * ny + jy
            for n in range(start[c], start[c + 1]):
                if label[n] == TRAVERSABLE and abs(np.int64(z[n]) - barrier_level[i]) <= band:
                    label[n] = INFLATION


@njit(cache=True)
def components(label: Any, graph: Any) -> Any:
    """(N,) int32 component of every traversable node, -1 elsewhere, and the (C,) size of each."""
    component = np.full(label.size, -1, np.int32)
    queue = np.empty(label.size, np.int32)
    sizes: list[int] = []
    for seed in range(label.size):
        if label[seed] != TRAVERSABLE or component[seed] >= 0:
            continue
        queue[0], head, tail = seed, 0, 1
        component[seed] = len(sizes)
        while head < tail:
            s = queue[head]
            head += 1
            for k in range(4):
                n = graph[s, k]
                if n >= 0 and label[n] == TRAVERSABLE and component[n] < 0:
                    component[n] = len(sizes)
                    queue[tail] = n
                    tail += 1
        sizes.append(tail)
    return component, np.array(sizes, dtype=np.int64)


@njit(cache=True)
def hops_from(seeds: Any, passable: Any, graph: Any, most: Any) -> Any:
    """(N,) int32 number of edges from the nearest seed through passable nodes, `most` where it is farther."""
    hops = np.full(passable.size, most, np.int32)
    queue = np.empty(passable.size, np.int32)
    tail = 0
    for s in range(passable.size):
        if seeds[s]:
            hops[s] = 0
            queue[tail] = s
            tail += 1
    head = 0
    while head < tail:
        s = queue[head]
        head += 1
        if hops[s] + 1 >= most:
            continue
        for k in range(4):
            n = graph[s, k]
            if n >= 0 and passable[n] and hops[n] > hops[s] + 1:
                hops[n] = hops[s] + 1
                queue[tail] = n
                tail += 1
    return hops


@njit(cache=True)
def _ends_at(columns: Any, surfaces: Any, label: Any, c: Any, level: Any, step: Any, clearance: Any) -> Any:
    """Whether the unknown ends at column c: at something that stands there, or at ground that the flood reached some other way."""
    if lowest_occupied(columns, c, level + step + 1, level + clearance) != NO_VOXEL:
        return True
    node = find_node(surfaces.start, surfaces.z, c, level, step + 1)
    return node >= 0 and label[node] != UNREACHED


@njit(cache=True)
def _ends_around(columns: Any, surfaces: Any, label: Any, c: Any, level: Any, step: Any, clearance: Any) -> Any:
    """The same for column c and its four neighbours."""
    if _ends_at(columns, surfaces, label, c, level, step, clearance):
        return True
    for k in range(4):
        if _ends_at(columns, surfaces, label, c + DX[k] * columns.ny + DY[k], level, step, clearance):
            return True
    return False


@njit(cache=True)
def frontier_edges(columns: Any, surfaces: Any, label: Any, near: Any, sources: Any, clearance: Any, shape: Any) -> Any:
    """(M, 4) int64 (column, z, node it was seen from, direction) of frontier voxels beside the `sources` (bool per node).

    The two-step test of thesis figure 5.13: no ground in a direction, and nothing occupied around one step further. Ground that the flood
    did not reach does not count as occupied here, it is what the look is for: a deck seen from below only, a slope behind a gap.
    """
    start, column, z = surfaces.start, surfaces.column, surfaces.z
    step = shape[0]
    found = []
    for s in range(z.size):
        if not sources[s]:
            continue
        c, level = np.int64(column[s]), np.int64(z[s])
        for k in range(4):
            if near[s, k] >= 0 or look(columns, start, z, c, level, k, clearance, shape) != SEES_UNKNOWN:
                continue
            stride = DX[k] * columns.ny + DY[k]
            if not _ends_around(columns, surfaces, label, c + 2 * stride, level, step, clearance):
                found.append((c + stride, level, np.int64(s), np.int64(k)))
    out = np.empty((len(found), 4), np.int64)
    for i in range(len(found)):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = found[i]
    return out
