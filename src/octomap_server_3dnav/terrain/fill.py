"""Unknown columns between surfaces that one plane explains are floor (first principle of docs/terrain.md).

Third step of `classify`. A few columns of floor are missed by every laser. A missing plate is wider, and stays a question; so does what was
seen free below from above, or is occupied above. Everything is in voxels.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.columns import NO_VOXEL, Columns, blocking_voxel, is_free_through, seen_down_to
from octomap_server_3dnav.octree.lean_kernels import Index, lean_njit
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.surfaces import Surfaces, find_node

_BEHIND = 3  # columns behind an edge to where the slope is taken that leads over a gap
_MOST_RISE = 2  # voxels from one side of a gap to the other


class _Floor(NamedTuple):
    """Floor that is assumed: column, z, gap, height and sigma (M,), and offset (M, 2) of where the height holds."""

    column: NDArray[np.int64]
    z: NDArray[np.int64]
    gap: NDArray[np.int64]
    height: NDArray[np.float32]
    sigma: NDArray[np.float32]
    offset: NDArray[np.float32]


@lean_njit
def slope_behind(surfaces: Surfaces, a: Index, back: Index, limits: Limits) -> float:
    """Rise per column from the node of column `back`, _BEHIND columns behind node a, to a; 0 where there is none."""
    n = find_node(surfaces.start, surfaces.z, back, np.int64(surfaces.z[a]), limits.step + 1)
    return 0.0 if n < 0 else (surfaces.height[a] - surfaces.height[n]) / _BEHIND


@lean_njit
def _is_one_floor(surfaces: Surfaces, a: Index, b: Index, gap: Index, stride: Index, limits: Limits) -> bool:
    """Whether nodes a and b, `gap` columns of `stride` apart, are level, or on a slope that goes on behind a or beyond b, within a step."""
    rise = np.float64(surfaces.height[b]) - surfaces.height[a]
    behind = slope_behind(surfaces, a, surfaces.column[a] - _BEHIND * stride, limits)
    beyond = -slope_behind(surfaces, b, surfaces.column[b] + _BEHIND * stride, limits)
    return bool(min(abs(rise), abs(rise - gap * behind), abs(rise - gap * beyond)) <= limits.max_step)


@lean_njit
def _level_between(z: NDArray[np.int16], a: Index, b: Index, j: Index, gap: Index) -> Index:
    """Layer of the floor j of `gap` columns on the way from node a to node b."""
    return (2 * (np.int64(z[a]) * (gap - j) + np.int64(z[b]) * j) + gap) // (2 * gap)


@lean_njit
def _met(columns: Columns, surfaces: Surfaces, c: Index, level: Index, reach: Index, floor: float, limits: Limits) -> Index:
    """The node as of `find_node`; more than a step below a `floor`, only one that was seen from there and is no plate with air below it."""
    n = find_node(surfaces.start, surfaces.z, c, level, reach)
    if n < 0 or surfaces.height[n] >= floor - limits.max_step:
        return n
    r = np.int64(columns.start[c])
    while columns.z_hi[r] != surfaces.z[n]:
        r += 1
    hangs = r > columns.start[c] and not columns.occupied[r - 1] and columns.z_hi[r - 1] >= columns.z_lo[r] - 2
    is_seen = is_free_through(columns, c, np.int64(surfaces.z[n]) + 1, level)
    return n if is_seen and not hangs else -1


@lean_njit
def _spans(columns: Columns, surfaces: Surfaces, a: Index, b: Index, stride: Index, gap: Index, limits: Limits) -> bool:
    """Whether floor between nodes a and b, `gap` columns of `stride` apart, contradicts nothing that is known there."""
    z, step, low = surfaces.z, limits.step, min(surfaces.height[a], surfaces.height[b])
    for j in range(1, gap):
        between, level = np.int64(surfaces.column[a]) + j * stride, _level_between(z, a, b, j, gap)
        for near in (level, np.int64(z[b])):
            if _met(columns, surfaces, between, near, step + 1, low, limits) >= 0:
                return False
        is_hole = is_free_through(columns, between, level - step - 1, level)
        if is_hole or seen_down_to(columns, between, level + step + 1) == NO_VOXEL:  # where something may stand
            return False
        if blocking_voxel(columns, between, level, step, limits.clearance) != NO_VOXEL:
            return False
    return True


@lean_njit
def _other_side(columns: Columns, surfaces: Surfaces, a: Index, stride: Index, room: Index, limits: Limits) -> tuple[Index, Index]:
    """The node across unknown columns beyond node a that is one floor with it, and how many `stride`s on; -1, 0: none within `room`."""
    z, step, c, level, floor = surfaces.z, limits.step, np.int64(surfaces.column[a]), np.int64(surfaces.z[a]), surfaces.height[a]
    if _met(columns, surfaces, c + stride, level, step, floor, limits) >= 0:
        return -1, 0
    for gap in range(2, room + 1):
        b = _met(columns, surfaces, c + gap * stride, level, max(step, _MOST_RISE), floor, limits)
        if b < 0:
            continue
        is_floor = abs(np.int64(z[b]) - level) <= _MOST_RISE and _is_one_floor(surfaces, a, b, gap, stride, limits)
        if is_floor and _spans(columns, surfaces, a, b, stride, gap, limits):
            return b, gap
        if abs(np.int64(z[b]) - level) <= step:
            return -1, 0
    return -1, 0


@njit(cache=True)
def _find_floor(columns: Columns, surfaces: Surfaces, limits: Limits) -> tuple[NDArray, ...]:
    """The fields of `_Floor`: lines between the sides of every gap along x and along y."""
    nx, ny = columns.nx, columns.ny
    found: list[tuple[Index, Index, Index]] = [(0, 0, 0) for _ in range(0)]
    estimates = [(0.0, 0.0, 0.0, 0.0) for _ in range(0)]
    for a in range(surfaces.z.size):
        ix, iy = surfaces.column[a] // ny, surfaces.column[a] % ny
        for k in range(2):
            room = min(limits.fill + 1, nx - ix - _BEHIND - 1 if k == 0 else ny - iy - _BEHIND - 1)
            if ix < _BEHIND or iy < _BEHIND:
                continue
            stride = ny if k == 0 else 1
            b, gap = _other_side(columns, surfaces, a, stride, room, limits)
            for j in range(1, gap):
                share = j / gap
                found.append((surfaces.column[a] + j * stride, _level_between(surfaces.z, a, b, j, gap), np.int64(gap)))
                height = surfaces.height[a] + share * (surfaces.height[b] - surfaces.height[a])
                x, y = (1 - share) * surfaces.offset[a] + share * surfaces.offset[b]
                estimates.append((height, gap * max(surfaces.sigma[a], surfaces.sigma[b]), x, y))
    column, z, gaps = np.empty(len(found), np.int64), np.empty(len(found), np.int64), np.empty(len(found), np.int64)
    values = np.empty((len(found), 4), np.float32)
    for i in range(len(found)):
        column[i], z[i], gaps[i] = found[i]
        values[i, 0], values[i, 1], values[i, 2], values[i, 3] = estimates[i]
    return column, z, gaps, values[:, 0].copy(), values[:, 1].copy(), values[:, 2:].copy()


@njit(cache=True)
def _kept(found: _Floor, order: NDArray[np.int64], step: Index) -> NDArray[np.int64]:
    """Those of the lines in `order` whose column has none before them at about their level."""
    kept, n = np.empty(order.size, np.int64), 0
    for i in order:
        j, is_new = n - 1, True
        while j >= 0 and found.column[kept[j]] == found.column[i]:
            is_new &= abs(found.z[kept[j]] - found.z[i]) > step
            j -= 1
        if is_new:
            kept[n] = i
            n += 1
    return kept[:n]


def _one_per_hole(found: _Floor, step: int) -> _Floor:
    """Where lines meet in one column at one level that over the narrowest gap stays, and of these the highest; sorted by column and z."""
    which = _kept(found, np.lexsort((-found.z, found.gap, found.column)), step)
    which = which[np.lexsort((found.z[which], found.column[which]))]
    return _Floor._make(field[which] for field in found)


def fill_gaps(columns: Columns, surfaces: Surfaces, limits: Limits) -> Surfaces:
    """The surfaces, and floor over gaps of at most `limits.fill` unknown columns among them, with a sigma that grows with the gap."""
    floor = _Floor(*_find_floor(columns, surfaces, limits)) if limits.fill else None
    if floor is None or not floor.column.size:
        return surfaces
    floor = _one_per_hole(floor, limits.step)
    keys = [of.column.astype(np.int64) << 17 | (of.z.astype(np.int64) + (1 << 16)) for of in (surfaces, floor)]
    at = np.searchsorted(keys[0], keys[1], side="right")  # the node before which each floor comes
    added = np.concatenate([[0], np.cumsum(np.bincount(floor.column, minlength=surfaces.start.size - 1))])
    return Surfaces(
        (surfaces.start + added).astype(np.int32),
        np.insert(surfaces.column, at, floor.column),
        np.insert(surfaces.z, at, floor.z),
        np.insert(surfaces.height, at, floor.height),
        np.insert(surfaces.sigma, at, floor.sigma),
        np.insert(surfaces.offset, at, floor.offset, axis=0),
        np.insert(surfaces.filled, at, True),
    )
