"""Shortest ways over the navigation graph, in the terrain's own arrays: A* to a goal, Dijkstra to everywhere (thesis 5.5.1).

Everything is in voxels. A node of infinite cost is closed, and no diagonal cuts its corner.
"""

import heapq
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.lean_kernels import lean_njit

Index = int | np.integer
"""Of a node, in whichever width it is kept."""

_OPEN, _CLOSED = 1, 2
_OUT = -2  # of a node that waits in no bucket


class Ways(NamedTuple):
    """What a search goes over: `graph` (N, 4), where its nodes are, their `cost` factors (N,) float32, what a voxel of height costs, and
    `links` (P, 2) besides the graph, each one way, with the `link_cost` (P,) of their whole length."""

    graph: NDArray[np.int32]
    ix: NDArray[np.int32]
    iy: NDArray[np.int32]
    z: NDArray[np.int16]
    cost: NDArray[np.float32]
    climb: float
    links: NDArray[np.int64]
    link_cost: NDArray[np.float64]


@lean_njit
def neighbour(graph: NDArray[np.int32], cost: NDArray[np.float32], s: Index, move: int) -> int:
    """Node beside s in direction `move` (0-3) or diagonally after it (4-7), -1 where there is none that is open."""
    a: int = graph[s, move & 3]
    if a < 0 or not cost[a] < np.inf:
        return -1
    if move < 4:
        return a
    aside = (move + 1) & 3
    b = graph[s, aside]
    if b < 0 or not cost[b] < np.inf or graph[a, aside] != graph[b, move & 3]:
        return -1
    n: int = graph[a, aside]
    return n if n >= 0 and cost[n] < np.inf else -1


@lean_njit
def edge_cost(a: Index, b: Index, length: float, z: NDArray[np.int16], cost: NDArray[np.float32], climb: float) -> float:
    """Cost of an edge in voxels: its length in space times the mean factor of its ends, and what its climb costs."""
    rise = abs(np.float64(z[b]) - np.float64(z[a]))
    total: float = np.sqrt(length * length + rise * rise) * 0.5 * (cost[a] + cost[b]) + climb * rise
    return total


@lean_njit
def _ahead(ways: Ways, n: int, goal: int) -> float:
    """The least that a way from n to the goal can cost: over a grid it turns by half right angles only."""
    dx, dy = abs(np.float64(ways.ix[n]) - ways.ix[goal]), abs(np.float64(ways.iy[n]) - ways.iy[goal])
    across, rise = max(dx, dy) + (np.sqrt(2.0) - 1.0) * min(dx, dy), abs(np.float64(ways.z[n]) - ways.z[goal])
    least: float = np.sqrt(across * across + rise * rise) + ways.climb * rise
    return least


@njit(cache=True)
def _linked(ways: Ways) -> NDArray[np.bool_]:
    """(N,) bool nodes that links lead on from."""
    out = np.zeros(ways.cost.size, np.bool_)
    for link in ways.links:
        out[link[0]] = True
    return out


@lean_njit
def _edge(ways: Ways, s: Index, move: int) -> tuple[int, float]:
    """The node that a move (0-7) or a link (8 and on) leads to from s, -1 for none, and what it costs."""
    if move < 8:
        n = neighbour(ways.graph, ways.cost, s, move)
        length = 1.0 if move < 4 else np.sqrt(2.0)
        return n, edge_cost(s, n, length, ways.z, ways.cost, ways.climb) if n >= 0 else 0.0
    n = ways.links[move - 8, 1]
    return n if ways.links[move - 8, 0] == s and ways.cost[n] < np.inf else -1, ways.link_cost[move - 8]


@njit(cache=True)
def _grow(
    ways: Ways,
    source: int,
    goal: int,
    weight: float,
    left: NDArray[np.float64],
    most: int,
    total: NDArray[np.float64],
    before: NDArray[np.int32],
    state: NDArray[np.uint8],
) -> None:
    """Costs and predecessors from `source`, until `goal` or `most` nodes are closed; only nodes with a `state` have any.

    Equal costs are settled by the smaller node index, so that the result is the same every time.
    """
    linked, links = _linked(ways), len(ways.links)
    total[source], state[source] = 0.0, _OPEN
    heap = [(0.0, np.int64(source))]
    while len(heap) > 0 and most > 0:
        _, s = heapq.heappop(heap)
        if state[s] == _CLOSED:
            continue
        state[s] = _CLOSED
        most -= 1
        if s == goal:
            break
        for move in range(8 + (links if linked[s] else 0)):
            n, length = _edge(ways, s, move)
            if n < 0 or state[n] == _CLOSED:
                continue
            reached = total[s] + length
            if state[n] != _OPEN or reached < total[n]:
                total[n], before[n], state[n] = reached, s, _OPEN
                ahead = _ahead(ways, n, goal)
                if left.size:
                    ahead = max(ahead, left[n])
                heapq.heappush(heap, (reached + weight * ahead, np.int64(n)))


@njit(cache=True)
def cheapest_way(ways: Ways, source: int, goal: int, weight: float, left: NDArray[np.float64], most: int) -> tuple[NDArray[np.int64], bool]:
    """(K,) int64 nodes from `source` to `goal`, none where no way was found, which costs at most `weight` times what the cheapest does; and
    whether the search ended because `most` nodes were tried.

    `left` (N,) is what the way from every node to the goal costs at least, or empty. With a weight above 1 what lies towards the goal is
    tried first (weighted A*, Pohl 1970).
    """
    total, before, state = np.empty(ways.cost.size), np.empty(ways.cost.size, np.int32), np.zeros(ways.cost.size, np.uint8)
    _grow(ways, source, goal, weight, left, most, total, before, state)
    if state[goal] != _CLOSED:
        return np.empty(0, np.int64), bool(np.count_nonzero(state == _CLOSED) >= most)
    count, node = 1, np.int64(goal)
    while node != source:
        node = np.int64(before[node])
        count += 1
    way, node = np.empty(count, np.int64), np.int64(goal)
    for i in range(count - 1, -1, -1):
        way[i] = node
        node = np.int64(before[node]) if i else node
    return way, False


@njit(cache=True)
def distances(ways: Ways, source: int) -> NDArray[np.float64]:
    """(N,) float64 cost of the cheapest way from `source` to every node, inf where there is none.

    Nodes wait in buckets one voxel wide (Dial 1969): where no edge is cheaper all that wait in the nearest are settled, in any order. A
    cheaper one may lead to a node again.
    """
    total, linked, links = np.full(ways.cost.size, np.inf), _linked(ways), len(ways.links)
    following, previous = np.empty(total.size, np.int32), np.empty(total.size, np.int32)  # in the same bucket, -1 for none
    first = np.full(1024, -1, np.int32)
    total[source], first[0], following[source], previous[source] = 0.0, source, -1, -1
    nearest, farthest = 0, 0
    while nearest <= farthest:
        s = np.int64(first[nearest])
        if s < 0:
            nearest += 1
            continue
        _take(first, following, previous, s, nearest)
        for move in range(8 + (links if linked[s] else 0)):
            n, length = _edge(ways, s, move)
            if n < 0 or not total[s] + length < total[n]:
                continue
            if total[n] < np.inf and previous[n] != _OUT:
                _take(first, following, previous, n, int(total[n]))
            total[n] = total[s] + length
            bucket = int(total[n])
            while bucket >= first.size:
                first = np.concatenate((first, np.full(first.size, -1, np.int32)))
            following[n], previous[n], first[bucket] = first[bucket], -1, n
            if following[n] >= 0:
                previous[following[n]] = n
            farthest = max(farthest, bucket)
    return total


@lean_njit
def _take(first: NDArray[np.int32], following: NDArray[np.int32], previous: NDArray[np.int32], n: Index, bucket: int) -> None:
    """Takes node n out of its bucket."""
    if previous[n] >= 0:
        following[previous[n]] = following[n]
    else:
        first[bucket] = following[n]
    if following[n] >= 0:
        previous[following[n]] = previous[n]
    previous[n] = _OUT
