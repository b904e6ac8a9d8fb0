"""The flood over the ground from the robot: which surfaces it reaches, and what they are (thesis 5.5, algorithm 3 lines 8-16).

Sixth step of `classify`. What a node is depends on the map around it alone, never on the way the flood came: labels do not depend on the
order of the flood. Everything is in voxels.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.columns import Columns
from octomap_server_3dnav.octree.lean_kernels import Index, lean_njit
from octomap_server_3dnav.terrain.beside import BLOCKED, DROP, beside
from octomap_server_3dnav.terrain.classified_terrain import CLIFF, OBSTACLE, TRAVERSABLE, UNREACHED
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.graph import Links
from octomap_server_3dnav.terrain.planes import steepness
from octomap_server_3dnav.terrain.surfaces import Surfaces

ROW_LAST = (0, 2, 1, 3)  # a stack filled in this order is worked off along y, where neighbours are neighbours in memory


@lean_njit
def _is_too_steep(surfaces: Surfaces, links: Links, ny: Index, s: Index, limits: Limits) -> bool:
    """Whether node s is too steep, or may be within its sigma, amid known ground, and so may a neighbour.

    Alone it is a hit or two gone astray, and at the rim of what is known too little was seen to tell.
    """
    here, is_shared = steepness(surfaces, links, ny, s, limits), False
    if here != 1:
        return here == 2
    for k in range(4):
        n = np.int64(links.graph[s, k])
        if n < 0:
            return False
        is_shared |= bool(steepness(surfaces, links, ny, n, limits) > 0)
    return is_shared


@njit(cache=True)
def flood(
    columns: Columns, surfaces: Surfaces, links: Links, first: Index, inside: NDArray[np.bool_], limits: Limits
) -> tuple[NDArray[np.uint8], int, NDArray[np.uint8]]:
    """(N,) uint8 labels of all nodes reached from `first`, UNREACHED elsewhere, the number of traversable ones, and (N, 4) uint8 of what
    lies beside those that are traversable or cliffs.

    Nodes are cliffs, obstacles or traversable. Only traversable ones are expanded, and only into columns that are `inside` (bool each).
    """
    column, graph = surfaces.column, links.graph
    label, seen = np.full(column.size, UNREACHED, np.uint8), np.zeros((column.size, 4), np.uint8)
    queued = np.zeros(column.size, np.bool_)
    waiting = np.empty(column.size, np.int32)
    waiting[0], left, traversable = first, 1, 0
    queued[first] = True
    while left:
        left -= 1
        s = np.int64(waiting[left])
        label[s] = TRAVERSABLE
        for k in range(4):
            if graph[s, k] < 0:
                seen[s, k] = beside(columns, surfaces, links, s, k, limits)
                if seen[s, k] == DROP:
                    label[s] = CLIFF
        if label[s] == CLIFF:
            continue
        if _is_too_steep(surfaces, links, columns.ny, s, limits):
            label[s] = OBSTACLE
            continue
        traversable += 1
        for k in ROW_LAST:
            n = graph[s, k]
            if n >= 0 and not queued[n] and inside[column[n]]:
                queued[n] = True
                waiting[left] = n
                left += 1
    return label, traversable, seen


@njit(cache=True)
def mark_steps(label: NDArray[np.uint8], seen: NDArray[np.uint8], near: NDArray[np.int32]) -> None:
    """Make the upper side of every step that is too high an obstacle, where the flood stood at its foot."""
    for s in np.flatnonzero(label == TRAVERSABLE):
        for k in range(4):
            if seen[s, k] == BLOCKED and near[s, k] >= 0:
                label[near[s, k]] = OBSTACLE


@njit(cache=True)
def components(
    label: NDArray[np.uint8], graph: NDArray[np.int32], first: Index, enough: Index
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """(N,) int32 component of every traversable node, -1 elsewhere, and the (C,) size of each, that of the node `first` before others.

    Where that has `enough` nodes it is the only one that is looked for.
    """
    component = np.full(label.size, -1, np.int32)
    waiting = np.empty(label.size, np.int32)
    sizes = [0 for _ in range(0)]
    for i in range(-1, label.size):
        seed = first if i < 0 else i
        if label[seed] != TRAVERSABLE or component[seed] >= 0:
            continue
        waiting[0], left, size = seed, 1, 1
        component[seed] = len(sizes)
        while left:
            left -= 1
            s = waiting[left]
            for k in ROW_LAST:
                n = graph[s, k]
                if n >= 0 and label[n] == TRAVERSABLE and component[n] < 0:
                    component[n] = len(sizes)
                    waiting[left] = n
                    left += 1
                    size += 1
        sizes.append(size)
        if i < 0 and size >= enough:
            break
    return component, np.array(sizes, dtype=np.int64)


@njit(cache=True)
def hops_from(seeds: NDArray[np.bool_], passable: NDArray[np.bool_], graph: NDArray[np.int32], most: Index) -> NDArray[np.int32]:
    """(N,) int32 number of edges from the nearest seed through passable nodes, `most` where it is farther."""
    hops = np.full(passable.size, most, np.int32)
    queue = np.empty(passable.size, np.int32)
    first = np.flatnonzero(seeds)
    hops[first] = 0
    queue[: first.size] = first
    head, tail = 0, first.size
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
