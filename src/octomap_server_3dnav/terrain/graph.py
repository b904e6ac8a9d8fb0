"""The navigation graph: which surfaces are neighbours, and over which steps the robot climbs (thesis 5.5, 5.5.1).

Fourth step of `classify`. A step is the jump between the two planes that fit the ground on both sides of an edge, with its sigma (second
principle of docs/terrain.md). Heights of single columns are never compared: a ramp is a staircase of voxels. Everything is in voxels.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.columns import DX, DY
from octomap_server_3dnav.octree.lean_kernels import Index, lean_njit
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.surfaces import VOXEL_SIGMA, Surfaces, find_node

ROWS = 5  # of columns beside an edge that its plane is fitted to, three wide: as long as the wheel base
_POINTS = 3 * ROWS
_ROUNDS = 4  # of reweighting
_PRIOR = 0.02  # weight of a level plane, in points at one column's distance: defined also where few points are


class Links(NamedTuple):
    """Neighbours of the surface nodes, (N, 4) int32 each: the `near` ones, and in `graph` those of them that can be stepped to."""

    near: NDArray[np.int32]
    graph: NDArray[np.int32]


@njit(cache=True)
def nearest_neighbours(
    start: NDArray[np.int32], z: NDArray[np.int16], ny: Index, spans: NDArray[np.int64], step: Index
) -> NDArray[np.int32]:
    """(N, 4) int32 node of each neighbouring column within `step` voxels in height, -1 where there is none.

    For the nodes of columns (ix, iy) with spans[ix, 0] <= iy < spans[ix, 1], which must not be at the window's rim; -1 for others.
    """
    out = np.full((z.size, 4), -1, np.int32)
    for ix in range(spans.shape[0]):
        for iy in range(spans[ix, 0], spans[ix, 1]):
            c = ix * ny + iy
            first, end = start[c], start[c + 1]
            for k in range(4):
                d = c + DX[k] * ny + DY[k]
                if end - first == 1 and start[d + 1] - start[d] == 1:
                    if abs(np.int64(z[first]) - z[start[d]]) <= step:
                        out[first, k] = start[d]
                    continue
                for s in range(first, end):
                    out[s, k] = find_node(start, z, d, np.int64(z[s]), step)
    return out


@njit(cache=True)
def centred_heights(near: NDArray[np.int32], surfaces: Surfaces) -> NDArray[np.float32]:
    """(N,) float32 heights of the nodes in the middle of their columns: on a slope what was hit beside it is higher or lower.

    The slope along an axis is the lesser of those to both neighbours, between the places where these were hit; none at an edge or a ridge.
    """
    height, offset = surfaces.height, surfaces.offset
    out = height.copy()
    for s in range(height.size):
        for k in range(2):
            ahead, behind = near[s, k], near[s, k + 2]
            if ahead < 0 or behind < 0 or offset[s, k] == 0.0:
                continue
            onward, back = 1.0 + offset[ahead, k] - offset[s, k], 1.0 + offset[s, k] - offset[behind, k]
            if min(onward, back) > 0.2:
                rise, fall = (height[ahead] - height[s]) / onward, (height[s] - height[behind]) / back
                if rise * fall > 0:
                    out[s] -= offset[s, k] * (rise if abs(rise) < abs(fall) else fall)
    return out


@lean_njit
def _points_beside(near: NDArray[np.int32], height: NDArray[np.float32], s: Index, k: Index, out: NDArray[np.float64]) -> Index:
    """How many nodes there are in the rows that begin at node s and go on in direction k; their places from the edge before s, along k and
    aside, and heights go into `out` (M, 3)."""
    n, row = 0, np.int64(s)
    for i in range(ROWS):
        for lane in range(-1, 2):
            node = row if lane == 0 else np.int64(near[row, (k + 2 + lane) % 4])
            if node >= 0:
                out[n, 0], out[n, 1], out[n, 2] = i + 0.5, lane, height[node]
                n += 1
        row = np.int64(near[row, k])
        if row < 0:
            break
    return n


@njit(cache=True)
def _height_at_edge(points: NDArray[np.float64], n: Index, first: float, sigma: float, limits: Limits) -> tuple[float, float, float]:
    """Height at the edge of a plane through (n, 3) points, its variance, and how far the plane lies off the `first` of them.

    Points that lie farther than a tenth of a step off the plane, and than a hit strays, count little: they are of something else. The
    first fit is without the row at the edge, in which its face was hit, too. Where fewer than half of the points lie on a plane the
    `first` counts. No plane leads farther beyond its points than a slope that is driven.
    """
    far = max(limits.max_step / 10, limits.noise)
    b0, b1, b2 = first, 0.0, 0.0
    w0, variance = 0.0, 0.0
    for i in range(_ROUNDS):
        w0, wu, wv, wuu, wuv, wvv = 1e-9, 0.0, 0.0, _PRIOR, 0.0, _PRIOR
        h0, hu, hv, square = 0.0, 0.0, 0.0, 0.0
        for j in range(n):
            u, v, h = points[j, 0], points[j, 1], points[j, 2]
            off = h - b0 - b1 * u - b2 * v
            weight = 1.0 / (1.0 + (off / far) ** 2) ** 2
            if i == 0:
                weight = 0.01 if u < 1.0 else 1.0
            w0, wu, wv = w0 + weight, wu + weight * u, wv + weight * v
            wuu, wuv, wvv = wuu + weight * u * u, wuv + weight * u * v, wvv + weight * v * v
            h0, hu, hv = h0 + weight * h, hu + weight * u * h, hv + weight * v * h
            square += weight * off * off
        det = w0 * (wuu * wvv - wuv * wuv) - wu * (wu * wvv - wuv * wv) + wv * (wu * wuv - wuu * wv)
        i00, i01, i02 = (wuu * wvv - wuv * wuv) / det, (wv * wuv - wu * wvv) / det, (wu * wuv - wv * wuu) / det
        i11, i12, i22 = (w0 * wvv - wv * wv) / det, (wv * wu - w0 * wuv) / det, (w0 * wuu - wu * wu) / det
        b0, b1, b2 = i00 * h0 + i01 * hu + i02 * hv, i01 * h0 + i11 * hu + i12 * hv, i02 * h0 + i12 * hu + i22 * hv
        variance = i00 * max(sigma**2, square / w0 if i else 0.0)
    if 2 * w0 < n:
        return first, sigma**2, 0.0
    off = abs(first - b0 - b1 * 0.5)
    lowest, highest = points[:n, 2].min() - limits.max_slope / 2, points[:n, 2].max() + limits.max_slope / 2
    return min(max(b0, lowest), highest), variance, off


@njit(cache=True)
def _is_too_high(
    near: NDArray[np.int32], surfaces: Surfaces, s: Index, n: Index, k: Index, limits: Limits, points: NDArray[np.float64]
) -> bool:
    """Whether the ground may jump by more than the highest step between node s and node n in direction k of it."""
    height = surfaces.height
    sigma = min(surfaces.sigma[s], surfaces.sigma[n])
    apart = abs(np.float64(height[n]) - height[s])
    count = _points_beside(near, height, s, (k + 2) % 4, points)
    behind, variance, off = _height_at_edge(points, count, height[s], surfaces.sigma[s], limits)
    count = _points_beside(near, height, n, k, points)
    beyond, more, beside = _height_at_edge(points, count, height[n], surfaces.sigma[n], limits)
    jump = abs(beyond - behind)
    if max(off, beside) > limits.max_step / 2:  # one of both is no part of its plane
        jump = max(jump, apart)
    # Between columns without hits only voxels are known, which may hide a step of any height below two.
    unsure = limits.confidence * np.sqrt(variance + more) if sigma < VOXEL_SIGMA else 0.0
    # Half a step is none, however little was seen. What is no number is too high.
    return not jump + min(unsure, limits.max_step / 2) <= limits.max_step


@njit(cache=True)
def steppable_neighbours(near: NDArray[np.int32], surfaces: Surfaces, limits: Limits) -> NDArray[np.int32]:
    """`near` without the edges over which the ground jumps by more than the robot climbs.

    Where a column has two surfaces, `near` need not lead back: such a way is judged on its own, all others once for there and back.
    """
    height, out, points = surfaces.height, near.copy(), np.empty((_POINTS, 3))
    for s in range(height.size):
        for k in range(4):
            n = np.int64(near[s, k])
            if n < 0 or abs(height[n] - height[s]) < limits.max_step / 5:
                continue
            behind, beyond = near[s, (k + 2) % 4], near[n, k]
            if behind >= 0 and beyond >= 0:  # a slope that goes on to both sides
                rise = height[n] - height[s]
                if max(abs(rise - height[s] + height[behind]), abs(rise - height[beyond] + height[n])) < limits.max_step / 5:
                    continue
            leads_back = near[n, (k + 2) % 4] == s
            if not (leads_back and k >= 2) and _is_too_high(near, surfaces, s, n, k, limits, points):
                out[s, k] = -1
                if leads_back:
                    out[n, (k + 2) % 4] = -1
    return out


@njit(cache=True)
def kerbs(graph: NDArray[np.int32], surfaces: Surfaces, rise: float, confidence: float) -> NDArray[np.bool_]:
    """(N,) bool: whether an edge of the graph leads over a sure rise or fall of more than `rise` voxels from one column to the next."""
    height, sigma = surfaces.height, surfaces.sigma
    out = np.zeros(height.size, np.bool_)
    for s in range(height.size):
        for k in range(4):
            n = graph[s, k]
            if n >= 0 and abs(height[n] - height[s]) - confidence * np.hypot(sigma[s], sigma[n]) > rise:
                out[s] = True
    return out
