"""How far ground is from where it ends: one distance, over the ground, for inflation, narrow ways and costs.

The fourth principle of docs/terrain.md, seventh step of `classify`. Barriers are what is blocked, a drop, or too steep, each at the mean
place of its hits. The distance is taken straight, to the barriers that are near by way of the ground: never to those of another storey.
Everything is in voxels.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.columns import DX, DY, NO_VOXEL, Columns, blocking_voxel, lowest_occupied, top_near
from octomap_server_3dnav.octree.lean_kernels import Index, lean_njit
from octomap_server_3dnav.octree.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain.beside import BLOCKED, DROP, EDGE, UNKNOWN, stands_beyond
from octomap_server_3dnav.terrain.classified_terrain import CLIFF, OBSTACLE, TRAVERSABLE, UNREACHED, Barriers
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.graph import Links
from octomap_server_3dnav.terrain.scene import Scene
from octomap_server_3dnav.terrain.surfaces import Surfaces, find_node

_FOOT = 1  # voxels above the ground's, from which the hits of what stands there are taken


@lean_njit
def _stands_across(columns: Columns, surfaces: Surfaces, label: NDArray[np.uint8], s: Index, stride: Index, limits: Limits) -> Index:
    """The column of what stands in the way of node s in steps of `stride`, across what is unknown; -1 where nothing does.

    It is looked for within the distance that is kept, and before ground that was reached.
    """
    level = np.int64(surfaces.z[s])
    for j in range(1, int(np.ceil(limits.keep_off)) + 1):
        c = np.int64(surfaces.column[s]) + j * stride
        n = find_node(surfaces.start, surfaces.z, c, level, max(limits.step, 1 + int(np.floor(j * limits.max_slope))))
        if n < 0 and blocking_voxel(columns, c, level, limits.step, limits.clearance) != NO_VOXEL:
            return c
        if n >= 0 and label[n] != UNREACHED:
            return -1
    return -1


class _Found(NamedTuple):
    """Barriers (B,): node of the ground that they were seen from; x, y of the window; level of that ground; column and voxel of an
    obstacle, -1 of others; whether hits tell its place; and whether it is a drop."""

    node: NDArray[np.int64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    level: NDArray[np.int64]
    column: NDArray[np.int64]
    voxel: NDArray[np.int64]
    is_hit: NDArray[np.bool_]
    falls: NDArray[np.bool_]


@njit(cache=True)
def _barriers(
    columns: Columns, surfaces: Surfaces, links: Links, label: NDArray[np.uint8], seen: NDArray[np.uint8], limits: Limits
) -> tuple[NDArray, ...]:
    """The fields of `_Found`; what is UNKNOWN right before something that stands is BLOCKED in `seen` from now on."""
    ny, at = columns.ny, [(0.0, 0.0) for _ in range(0)]
    found: list[tuple[Index, Index, Index, Index, bool, bool]] = [(0, 0, 0, 0, False, False) for _ in range(0)]
    for s in np.flatnonzero(label == TRAVERSABLE):
        c, level = np.int64(surfaces.column[s]), np.int64(surfaces.z[s])
        for k in range(4):
            n, stride = np.int64(links.near[s, k]), DX[k] * ny + DY[k]
            cx, cy = (c + stride) // ny + 0.5, (c + stride) % ny + 0.5
            if links.graph[s, k] >= 0:
                n = np.int64(links.graph[s, k])
                if label[n] == OBSTACLE or label[n] == CLIFF:
                    falls = bool((seen[n] == DROP).any())  # also where from its foot it is a step
                    found.append((s, level, np.int64(-1), np.int64(-1), False, falls))
                    if falls:
                        at.append((cx + surfaces.offset[n, 0], cy + surfaces.offset[n, 1]))
                    else:  # planes tell too steep ground one column late
                        at.append((cx - DX[k], cy - DY[k]))
                continue
            if n >= 0 and seen[s, k] == BLOCKED:  # a step is where both columns meet
                found.append((s, level, np.int64(-1), np.int64(-1), False, False))
                at.append((cx - 0.5 * DX[k], cy - 0.5 * DY[k]))
                continue
            is_unknown = seen[s, k] == UNKNOWN or seen[s, k] == EDGE
            if is_unknown and stands_beyond(columns, c, stride, level, limits):
                seen[s, k] = BLOCKED
                found.append((s, level, c + stride, level, False, False))
                at.append((cx, cy))
            if n < 0:
                across = _stands_across(columns, surfaces, label, s, stride, limits)
                if across >= 0:
                    floor = top_near(columns, across, level, limits.step)
                    voxel = blocking_voxel(columns, across, level, limits.step, limits.clearance) if floor == NO_VOXEL else floor
                    way = lowest_occupied(columns, across, level + limits.step + 1, level + limits.clearance)
                    found.append((s, level, across, np.int64(voxel), way != NO_VOXEL, False))
                    at.append((across // ny + 0.5, across % ny + 0.5))
    out, places = np.empty((4, len(found)), np.int64), np.empty((2, len(found)))
    is_hit, is_drop = np.empty(len(found), np.bool_), np.empty(len(found), np.bool_)
    for i in range(len(found)):
        out[0, i], out[1, i], out[2, i], out[3, i], is_hit[i], is_drop[i] = found[i]
        places[0, i], places[1, i] = at[i]
    return out[0], places[0], places[1], out[1], out[2], out[3], is_hit, is_drop


def barriers_of(
    scene: Scene, heights: SurfaceHeights | None, label: NDArray[np.uint8], seen: NDArray[np.uint8], limits: Limits
) -> Barriers:
    """Where the ground ends, at the mean place of the hits; `seen` as `_barriers` changes it."""
    found = _Found(*_barriers(scene.columns, scene.surfaces, scene.links, label, seen, limits))
    x, y, ny, at = found.x, found.y, scene.columns.ny, np.flatnonzero(found.is_hit)
    if heights is not None and at.size:
        low, high = found.level[at] + _FOOT, found.level[at] + limits.clearance
        hits = heights.spread(found.column[at] // ny + scene.key[0], found.column[at] % ny + scene.key[1], low, high)
        x[at] += hits[:, 1]
        y[at] += hits[:, 2]
    return Barriers(found.node, x, y, found.level, found.column, found.voxel, found.falls)


@lean_njit
def _apart(dx: float, dy: float, square: bool) -> float:
    """How far places are apart: straight, or the larger of the distances along x and y."""
    return max(abs(dx), abs(dy)) if square else np.sqrt(dx * dx + dy * dy)


@njit(cache=True)
def distances(
    node: NDArray[np.int64],
    x: NDArray[np.float64],
    y: NDArray[np.float64],
    scene: tuple[NDArray, NDArray, int],
    within: float,
    square: bool,
) -> NDArray[np.float32]:
    """(N,) float32 distance of the middle of every node's column from the nearest of places (x, y), `within` at most, else inf.

    Place i lies beside `node[i]`. `scene` is the column of every node, its neighbours (N, 4), -1 where no ground goes on, and the ny of
    the window. Every node passes its nearest place on to its neighbours. `square`: the larger of the distances along x and y.
    """
    column, graph, ny = scene
    out, source = np.full(column.size, np.inf, np.float32), np.full(column.size, -1, np.int64)
    at_x, at_y = np.empty(column.size, np.float32), np.empty(column.size, np.float32)
    for s in range(column.size):
        at_x[s], at_y[s] = column[s] // ny + 0.5, column[s] % ny + 0.5
    queue, is_queued = np.empty(column.size + 1, np.int64), np.zeros(column.size, np.bool_)
    head, tail = 0, 0
    for i in range(node.size):
        far = _apart(at_x[node[i]] - x[i], at_y[node[i]] - y[i], square)
        if far <= within and np.float32(far) < out[node[i]]:
            out[node[i]], source[node[i]] = far, i
            if not is_queued[node[i]]:
                queue[tail], is_queued[node[i]], tail = node[i], True, tail + 1
    while head != tail:
        s, head = queue[head], (head + 1) % queue.size
        is_queued[s] = False
        for k in range(4):
            n = np.int64(graph[s, k])
            if n < 0 or source[n] == source[s]:
                continue
            far = _apart(at_x[n] - x[source[s]], at_y[n] - y[source[s]], square)
            if far <= within and np.float32(far) < out[n]:
                out[n], source[n] = far, source[s]
                if not is_queued[n]:
                    queue[tail], is_queued[n], tail = n, True, (tail + 1) % queue.size
    return out
