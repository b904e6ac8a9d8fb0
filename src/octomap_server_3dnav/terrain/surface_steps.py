"""Which steps the robot climbs: edges between neighbouring surfaces over which the ground does not rise or fall too much (thesis 5.5.1).

Third step of `terrain.classify`. Heights of voxels lie: a flat floor alternates between two layers, a ramp is a staircase. An edge is
therefore never judged alone: a step compares the mean heights of the patches on both sides of it, or, where flat treads lie there, these.
Everything is in voxels.
"""

from typing import Any

import numpy as np
from numba import njit

from octomap_server_3dnav.octree.lean_kernels import lean_njit
from octomap_server_3dnav.terrain.surface_columns import slope_behind
from octomap_server_3dnav.terrain.surface_graph import gradient_at
from octomap_server_3dnav.terrain.surface_planes import is_gentle_plane

_DOUBTFUL = 0.7  # of the highest step: a lower one is none, however the ground lies in its voxels
_FACE = 2  # columns beside an edge in which its face was hit, too
_ROWS = 4  # of a tread
_FLAT = 0.03  # voxels by which the first half of a tread may be higher or lower than the second, in the mean
_SPREAD = 0.075  # voxels by which a surface of a tread may lie off its mean
STEP_REACH = _FACE + _ROWS + 2  # columns from a node that tell whether one can step to its neighbours
_BEYOND = 0.2  # voxels by which what lies between two treads may lie higher or lower than both


@lean_njit
def _off_tread(level: Any, measured: Any, row: Any, aside: Any, tread: Any) -> Any:
    """1 or -1 where a neighbour is measured to lie more than `tread` higher or lower than a node, else 0."""
    if aside < 0 or not (measured[aside] and measured[row]) or abs(level[aside] - level[row]) <= tread:
        return 0
    return 1 if level[aside] > level[row] else -1


@lean_njit
def _patch_mean(near: Any, level: Any, measured: Any, s: Any, k: Any, tread: Any) -> Any:
    """Mean height of s, the node beyond it in direction k, and the neighbours aside of both, where they exist; whether all are measured.

    A neighbour more than `tread` higher or lower than its row is not of the patch, as a kerb may run obliquely to the grid: unless it is so
    on both sides, where a beam or two went astray.
    """
    total, count, known = 0.0, 0, True
    row = s
    for _ in range(2):
        total += level[row]
        known &= measured[row]
        count += 1
        off = (
            _off_tread(level, measured, row, near[row, (k + 1) % 4], tread),
            _off_tread(level, measured, row, near[row, (k + 3) % 4], tread),
        )
        for i in range(2):
            aside = near[row, (k + 1 + 2 * i) % 4]
            if aside >= 0 and (off[i] == 0 or off[0] == off[1]):
                total += level[aside]
                known &= measured[aside]
                count += 1
        row = near[row, k]
        if row < 0:
            break
    return total / count, known


@lean_njit
def _is_on_slope(surfaces: Any, s: Any, n: Any, max_step: Any) -> Any:
    """Whether the rise or fall from node s to its neighbour n is that of a slope, which goes on behind and beyond."""
    a, b, reach = np.int64(surfaces.column[s]), np.int64(surfaces.column[n]), np.int64(np.ceil(max_step))
    rise = surfaces.slope_level[n] - surfaces.slope_level[s]
    behind, beyond = slope_behind(surfaces, s, 4 * a - 3 * b, reach), -slope_behind(surfaces, n, 4 * b - 3 * a, reach)
    return min(behind * np.sign(rise), beyond * np.sign(rise)) > 0 and 2 * abs(rise) <= max_step


@lean_njit
def _has_equal(near: Any, level: Any, measured: Any, s: Any, tread: Any) -> Any:
    """Whether a neighbour of node s is measured to lie about as high."""
    for k in range(4):
        if near[s, k] >= 0 and measured[near[s, k]] and abs(level[near[s, k]] - level[s]) <= tread:
            return True
    return False


@lean_njit
def _tread(near: Any, surfaces: Any, s: Any, k: Any) -> Any:
    """Height of the flat ground that begins _FACE columns from node s in direction k, three surfaces wide; NaN where it is not flat, or not
    measured."""
    level, measured = surfaces.slope_level, surfaces.measured
    node, total, tilt = np.int64(s), 0.0, 0.0
    low, high = np.inf, -np.inf
    for j in range(_FACE + _ROWS):
        node = np.int64(near[node, k])
        if node < 0:
            return np.nan
        if j < _FACE:
            continue
        row, wide = 0.0, 0
        for side in range(3):
            n = node if side == 2 else np.int64(near[node, (k + 1 + 2 * side) % 4])
            if n < 0:
                continue
            if not measured[n]:
                return np.nan
            row, wide = row + level[n], wide + 1
            low, high = min(low, level[n]), max(high, level[n])
        row /= wide
        total += row / _ROWS
        tilt += row if 2 * (j - _FACE) >= _ROWS else -row
    is_flat = abs(tilt) <= _FLAT * _ROWS / 2 and max(high - total, total - low) <= _SPREAD
    return total if is_flat else np.nan


@lean_njit
def _treads_around(near: Any, surfaces: Any, s: Any, n: Any, k: Any) -> Any:
    """Heights of the lower and the higher of the flat treads beyond node n in direction k and behind node s; NaN unless both are there."""
    behind, beyond = _tread(near, surfaces, s, (k + 2) % 4), _tread(near, surfaces, n, k)
    if np.isnan(behind) or np.isnan(beyond):
        return np.nan, np.nan
    return min(behind, beyond), max(behind, beyond)


@lean_njit
def _step_of(near: Any, surfaces: Any, s: Any, n: Any, k: Any, treads: Any) -> Any:
    """Height of the step between two treads, if that is what lies around the edge from node s in direction k to node n; NaN where something
    is higher or lower than both, as at a sill or a trench."""
    low, high = treads
    back, at, onward = (k + 2) % 4, np.int64(s), np.int64(n)
    for _ in range(_FACE + 1):
        for node in (at, onward):
            if node < 0 or not low - _BEYOND <= surfaces.slope_level[node] <= high + _BEYOND:
                return np.nan
        at, onward = np.int64(near[at, back]), np.int64(near[onward, k])
    return high - low


@lean_njit
def step_between_treads(near: Any, surfaces: Any, s: Any, n: Any, k: Any) -> Any:
    """Height of the step from node s in direction k to node n, or at s if it is n, between flat treads; NaN where there are none.

    Treads lie along k or, of a step that is crossed at a flat angle, aside.
    """
    step = _step_of(near, surfaces, s, n, k, _treads_around(near, surfaces, s, n, k))
    for node in (np.int64(s), np.int64(n)):
        if np.isnan(step):
            step = _step_of(near, surfaces, s, n, k, _treads_around(near, surfaces, node, node, (k + 1) % 4))
    return step


@lean_njit
def _is_step(near: Any, surfaces: Any, s: Any, n: Any, k: Any, limits: Any) -> Any:
    """Whether the ground on both sides of the edge from node s in direction k to node n differs too much; the same seen from n."""
    level, measured, tread = surfaces.level, surfaces.measured, limits.measured / 2
    beyond, known_beyond = _patch_mean(near, level, measured, n, k, tread)
    behind, known_behind = _patch_mean(near, level, measured, s, (k + 2) % 4, tread)
    is_measured = known_beyond and known_behind
    if is_measured and abs(beyond - behind) > _DOUBTFUL * limits.measured:
        step = step_between_treads(near, surfaces, s, n, k)
        if not np.isnan(step):
            return step > limits.treads
    limit = limits.measured if is_measured else limits.voxels
    if measured[s] and measured[n] and abs(level[n] - level[s]) > limits.measured:
        high, low = (n, s) if level[n] > level[s] else (s, n)
        if _has_equal(near, level, measured, high, tread) and _has_equal(near, level, measured, low, tread):
            return not _is_on_slope(surfaces, s, n, limit)
    return abs(beyond - behind) > limit and not _is_on_slope(surfaces, s, n, limit)


@njit(cache=True)
def steppable_neighbours(near: Any, surfaces: Any, limits: Any) -> Any:
    """`near` without the edges over which the ground rises or falls by more than the `limits` (StepLimits): but edges along a slope stay,
    which alone may have hits in two voxels of a column.

    Where a column has two surfaces, `near` need not lead back: such a way is judged on its own, all others once for there and back.
    """
    z, level = surfaces.z, surfaces.level
    out = near.copy()
    for s in range(z.size):
        for k in range(4):
            n = near[s, k]
            if n < 0 or (z[n] == z[s] and not abs(level[n] - level[s]) > limits.measured):
                continue
            leads_back = near[n, (k + 2) % 4] == s
            if leads_back and k >= 2:
                continue
            if _is_step(near, surfaces, s, n, k, limits):
                out[s, k] = -1
                if leads_back:
                    out[n, (k + 2) % 4] = -1
    return out


@njit(cache=True)
def _lacking(near: Any, graph: Any) -> Any:
    """The nodes with fewer edges in the `graph` than `near`."""
    every, left, out, n = near.reshape(-1), graph.reshape(-1), np.empty(len(near), np.int64), 0
    for s in range(len(near)):
        out[n] = s
        same = (every[4 * s] == left[4 * s]) & (every[4 * s + 1] == left[4 * s + 1])
        n += not (same & (every[4 * s + 2] == left[4 * s + 2]) & (every[4 * s + 3] == left[4 * s + 3]))
    return out[:n]


@njit(cache=True)
def restore_on_planes(near: Any, graph: Any, surfaces: Any, ny: Any, limits: Any) -> None:
    """Puts those edges back into the `graph`, there and back, that begin or end on a measured plane which the robot drives on: where its
    hits lie far apart heights are off by up to 2 cm."""
    for s in _lacking(near, graph):
        is_plane, is_asked = False, False
        for k in range(4):
            n = near[s, k]
            if n < 0 or graph[s, k] >= 0 or not surfaces.measured[s]:
                continue
            if not is_asked:
                gradient = gradient_at(near, surfaces.slope_level, s, limits.slope_reach)
                is_plane, is_asked = is_gentle_plane(surfaces, ny, s, gradient, limits.max_plane_slope), True
            if is_plane:
                graph[s, k] = n
                if near[n, (k + 2) % 4] == s:
                    graph[n, (k + 2) % 4] = s
