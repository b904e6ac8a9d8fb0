"""Corners of a path: shortcuts over the surface that cost no more than the staircase of voxels, and even spacing.

After the search of `path_search`, for `planner`.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.path_search import Index, Ways, edge_cost, neighbour
from octomap_server_3dnav.terrain.classify import Terrain

SHORTCUT_NODES = 80  # how far ahead a shortcut is looked for: 6 m at 8 cm, and keeps it linear in the length of the path


@njit(cache=True)
def _line(ways: Ways, a: int, b: int, out: NDArray[np.int32]) -> Index:
    """Number of nodes on the straight line over the surface from a to b, written to `out`; 0 when the surface has a gap on it."""
    ix, iy = ways.ix, ways.iy
    dx, dy = np.int64(ix[b] - ix[a]), np.int64(iy[b] - iy[a])
    steps = max(abs(dx), abs(dy))
    out[0], node, x, y = a, a, np.int64(ix[a]), np.int64(iy[a])
    for i in range(1, steps + 1):
        tx, ty = ix[a] + int(np.round(i * dx / steps)), iy[a] + int(np.round(i * dy / steps))
        mx, my = tx - x, ty - y
        if mx != 0 and my != 0:
            move = 4 + (0 if mx > 0 and my > 0 else 1 if mx < 0 and my > 0 else 2 if mx < 0 else 3)
        else:
            move = 0 if mx > 0 else 2 if mx < 0 else 1 if my > 0 else 3
        node = neighbour(ways.graph, ways.cost, node, move)
        if node < 0:
            return 0
        x, y = tx, ty
        out[i] = node
    return steps + 1 if node == b else 0


@njit(cache=True)
def _line_cost(ways: Ways, nodes: NDArray[np.int32], count: Index) -> float:
    """Cost of a straight line: that of its edges, scaled from the staircase of voxels to the length of the line."""
    ix, iy = ways.ix, ways.iy
    total, stairs = 0.0, 0.0
    for i in range(1, count):
        a, b = nodes[i - 1], nodes[i]
        length = np.sqrt(np.float64((ix[a] - ix[b]) ** 2 + (iy[a] - iy[b]) ** 2))
        stairs += length
        total += edge_cost(a, b, length, ways.z, ways.cost, ways.climb)
    a, b = nodes[0], nodes[count - 1]
    scaled: float = total * np.sqrt(np.float64((ix[a] - ix[b]) ** 2 + (iy[a] - iy[b]) ** 2)) / max(stairs, 1e-9)
    return scaled


@njit(cache=True)
def _shortcut(ways: Ways, chain: NDArray[np.int64], ahead: int) -> NDArray[np.int64]:
    """Indices into `chain` of the nodes that stay when straight lines that cost no more replace what lies between them."""
    ix, iy = ways.ix, ways.iy
    along = np.zeros(chain.size)
    for i in range(1, chain.size):
        a, b = chain[i - 1], chain[i]
        length = np.sqrt(np.float64((ix[a] - ix[b]) ** 2 + (iy[a] - iy[b]) ** 2))
        along[i] = along[i - 1] + edge_cost(a, b, length, ways.z, ways.cost, ways.climb)
    kept = [0]
    line = np.empty(chain.size + 1, np.int32)
    i = 0
    while i < chain.size - 1:
        best = i + 1
        for j in range(i + 2, min(i + ahead, chain.size - 1) + 1):
            count = _line(ways, chain[i], chain[j], line)
            if count > 0 and _line_cost(ways, line, count) <= along[j] - along[i] + 1e-9:
                best = j
        kept.append(best)
        i = best
    return np.array(kept)


def straightened(terrain: Terrain, ways: Ways, chain: NDArray[np.int64]) -> NDArray[np.float64]:
    """(K, 3) corners in map of the path over a chain of nodes after shortcuts, with the height of every voxel on the way."""
    kept = chain[_shortcut(ways, chain, SHORTCUT_NODES)]
    line = np.empty(chain.size + 1, dtype=np.int32)
    parts = [terrain.centers(kept[:1]).astype(np.float64)]
    for a, b in zip(kept[:-1], kept[1:], strict=True):
        count = _line(ways, a, b, line)
        ends = terrain.centers(np.array([a, b])).astype(np.float64)
        t = np.linspace(0.0, 1.0, count)[1:, None]
        xy = ends[0, :2] * (1 - t) + ends[1, :2] * t
        parts.append(np.column_stack([xy, terrain.centers(line[1:count])[:, 2]]))
    return np.concatenate(parts)


def resampled(corners: NDArray[np.float64], spacing_m: float) -> NDArray[np.float64]:
    """Evenly spaced points on a polyline, ends kept, heights averaged over a few voxels so that they do not jump by one."""
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(corners[:, :2], axis=0), axis=1))]
    if along[-1] < 1e-9:
        return corners[:1]
    window = min(5, corners.shape[0] - 1 + corners.shape[0] % 2)
    half = window // 2
    z = np.convolve(np.pad(corners[:, 2], half, mode="edge"), np.full(2 * half + 1, 1.0 / (2 * half + 1)), mode="valid")
    at = np.linspace(0.0, along[-1], max(2, math.ceil(along[-1] / spacing_m) + 1))
    return np.column_stack([np.interp(at, along, corners[:, 0]), np.interp(at, along, corners[:, 1]), np.interp(at, along, z)])
