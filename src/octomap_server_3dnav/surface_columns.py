"""Surfaces of a column map, the raw material of the terrain analysis: which voxel tops a robot fits above, and small holes between them.

First step of `terrain.classify`: crop the columns around the robot, list the surface of every column, bridge holes of a few voxels.
Everything here is in voxels. A direction 0, 1, 2, 3 is +x, +y, -x, -y, so that (k + 2) % 4 looks back and (k + 1) % 4, (k + 3) % 4 aside.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.column_runs import ColumnRuns

DX = np.array([1, 0, -1, 0], dtype=np.int64)
DY = np.array([0, 1, 0, -1], dtype=np.int64)
NO_VOXEL = 32767


class Columns(NamedTuple):
    """Runs of a window of (nx, ny) columns: ascending (z_lo, z_hi, occupied) at start[c]:start[c + 1], c = ix * ny + iy."""

    nx: int
    ny: int
    start: NDArray[np.int32]
    z_lo: NDArray[np.int16]
    z_hi: NDArray[np.int16]
    occupied: NDArray[np.bool_]


class Surfaces(NamedTuple):
    """Surface nodes sorted by column and height: column (N,), z (N,) of the voxel, bridged (N,), and start per column.

    level (N,) is the height of the surface in voxels: where beams hit it on average, which `measured` (N,) tells, else the voxel's middle.
    """

    start: NDArray[np.int32]
    column: NDArray[np.int32]
    z: NDArray[np.int16]
    bridged: NDArray[np.bool_]
    level: NDArray[np.float32]
    measured: NDArray[np.bool_]

    def at_heights(self, height: NDArray[np.float32]) -> "Surfaces":
        """The same with measured heights (N,) in voxels, NaN where there are none."""
        measured = np.isfinite(height)
        return self._replace(level=np.where(measured, height, self.level), measured=measured)


@njit(cache=True)
def _crop(start: Any, z_lo: Any, z_hi: Any, occupied: Any, ny: Any, x0: Any, x1: Any, y0: Any, y1: Any, margin: Any) -> Any:
    """Runs of columns [x0, x1) x [y0, y1) with `margin` empty columns around them."""
    wx, wy = x1 - x0 + 2 * margin, y1 - y0 + 2 * margin
    total = 0
    for ix in range(x0, x1):
        total += start[ix * ny + y1] - start[ix * ny + y0]
    out_start = np.zeros(wx * wy + 1, np.int32)
    lo, hi, occ = np.empty(total, np.int16), np.empty(total, np.int16), np.empty(total, np.bool_)
    n = 0
    for ix in range(x0, x1):
        first, last = start[ix * ny + y0], start[ix * ny + y1]
        begin = (ix - x0 + margin) * wy + margin
        out_start[begin - margin : begin] = n
        for j in range(y1 - y0):
            out_start[begin + j] = start[ix * ny + y0 + j] - first + n
        lo[n : n + last - first] = z_lo[first:last]
        hi[n : n + last - first] = z_hi[first:last]
        occ[n : n + last - first] = occupied[first:last]
        n += last - first
        out_start[begin + y1 - y0 : begin + y1 - y0 + margin] = n
    out_start[(x1 - x0 + margin) * wy :] = n
    return wx, wy, out_start, lo, hi, occ


def crop_columns(runs: ColumnRuns, low: tuple[int, int], high: tuple[int, int], margin: int) -> tuple[Columns, tuple[int, int]]:
    """The columns of voxel indices low..high (inclusive) that exist, `margin` unknown ones around, and the first one's index."""
    x0, y0 = (int(np.clip(low[a] - runs.origin_key[a], 0, n)) for a, n in enumerate((runs.nx, runs.ny)))
    x1, y1 = (int(np.clip(high[a] + 1 - runs.origin_key[a], 0, n)) for a, n in enumerate((runs.nx, runs.ny)))
    x1, y1 = max(x0, x1), max(y0, y1)
    window = _crop(runs.start, runs.z_lo, runs.z_hi, runs.occupied, runs.ny, x0, x1, y0, y1, margin)
    return Columns(*window), (runs.origin_key[0] + x0 - margin, runs.origin_key[1] + y0 - margin)


@njit(cache=True)
def lowest_occupied(columns: Any, c: Any, low: Any, high: Any) -> Any:
    """Lowest occupied voxel of column c in low..high, NO_VOXEL when there is none."""
    for r in range(columns.start[c], columns.start[c + 1]):
        if columns.z_lo[r] > high:
            break
        if columns.occupied[r] and columns.z_hi[r] >= low:
            return max(np.int64(columns.z_lo[r]), low)
    return NO_VOXEL


@njit(cache=True)
def top_near(columns: Any, c: Any, z: Any, reach: Any) -> Any:
    """Top of the occupied run of column c that ends nearest to z, within `reach`; NO_VOXEL when there is none."""
    best: Any = NO_VOXEL
    best_gap = reach + 1
    for r in range(columns.start[c], columns.start[c + 1]):
        gap = abs(np.int64(columns.z_hi[r]) - z)
        if columns.occupied[r] and gap < best_gap:
            best, best_gap = np.int64(columns.z_hi[r]), gap
    return best


@njit(cache=True)
def seen_down_to(columns: Any, c: Any, z: Any) -> Any:
    """Lowest voxel of the free space seen from level z of column c downwards, NO_VOXEL when level z itself was not seen.

    One unknown voxel in between is allowed. Space under a floor that was seen only from below does not count: it must open at z.
    """
    lowest: Any = NO_VOXEL
    for r in range(columns.start[c + 1] - 1, columns.start[c] - 1, -1):
        lo, hi = np.int64(columns.z_lo[r]), np.int64(columns.z_hi[r])
        if lo > z + 1:
            continue
        if columns.occupied[r] or hi < (z - 1 if lowest == NO_VOXEL else lowest - 2):
            break
        lowest = lo
    return lowest


@njit(cache=True)
def is_top_seen(columns: Any, c: Any, z: Any) -> Any:
    """Whether the voxel above voxel z of column c was seen free, so that what stands there ends at z."""
    for r in range(columns.start[c], columns.start[c + 1]):
        if columns.z_lo[r] > z:
            return columns.z_lo[r] == z + 1 and not columns.occupied[r]
    return False


@njit(cache=True)
def find_node(start: Any, z: Any, c: Any, level: Any, reach: Any) -> Any:
    """Index of the node of column c nearest to `level` within `reach` voxels, -1 when there is none."""
    best, best_gap = -1, reach + 1
    for n in range(start[c], start[c + 1]):
        gap = abs(np.int64(z[n]) - level)
        if gap < best_gap:
            best, best_gap = n, gap
    return best


@njit(cache=True)
def blocking_voxel(columns: Any, c: Any, level: Any, step: Any, clearance: Any) -> Any:
    """Lowest occupied voxel of column c where something stands in the way of a robot at `level`, NO_VOXEL when nothing does.

    It stands higher than a step, or it leaves too little room above a floor near the level. What was only seen from below does not block.
    """
    blocked = lowest_occupied(columns, c, level + step + 1, level + clearance) != NO_VOXEL
    top = top_near(columns, c, level, step)
    if not blocked and top != NO_VOXEL:
        blocked = lowest_occupied(columns, c, top + 1, top + clearance) != NO_VOXEL
    return lowest_occupied(columns, c, level - step, level + step + clearance) if blocked else NO_VOXEL


@njit(cache=True)
def _seen_only_from_below(z_lo: Any, z_hi: Any, occupied: Any, first: Any, r: Any, last: Any) -> Any:
    """Whether occupied run r of a column's first..last is the underside of something with unknown top: air below it, none directly above.

    Air may begin one voxel below, for the beams that hit an underside flatly leave its layer unknown. Above there is no such tolerance:
    a thin plate's unknown top would be taken for its underside, a few voxels too low.
    """
    if r == first or occupied[r - 1] or z_hi[r - 1] < z_lo[r] - 2:
        return False
    return r == last or z_lo[r + 1] > z_hi[r] + 1


@njit(cache=True)
def _seen_only_from_aside(z_lo: Any, z_hi: Any, r: Any, last: Any, step: Any) -> Any:
    """Whether occupied run r is a wall, higher than a step, whose top was not seen: what lies directly above is unknown."""
    return z_hi[r] - z_lo[r] >= step and (r == last or z_lo[r + 1] > z_hi[r] + 1)


@njit(cache=True)
def _tops(columns: Any, clearance: Any, step: Any) -> Any:
    """(start, column, z) of the tops of occupied runs with at least `clearance` voxels below the next occupied one."""
    runs, z_lo, z_hi, occupied = columns.start, columns.z_lo, columns.z_hi, columns.occupied  # named once: see terrain_kernels
    start = np.zeros(runs.size, np.int32)
    column, z = np.empty(z_lo.size, np.int32), np.empty(z_lo.size, np.int16)
    n = 0
    for c in range(runs.size - 1):
        first, last = np.int64(runs[c]), np.int64(runs[c + 1]) - 1
        ceiling = NO_VOXEL + clearance
        begin = n
        for r in range(last, first - 1, -1):
            if not occupied[r]:
                continue
            unseen = _seen_only_from_below(z_lo, z_hi, occupied, first, r, last) or _seen_only_from_aside(z_lo, z_hi, r, last, step)
            if ceiling - z_hi[r] > clearance and not unseen:
                column[n], z[n] = c, z_hi[r]
                n += 1
            ceiling = np.int64(z_lo[r])
        for k in range((n - begin) // 2):
            z[begin + k], z[n - 1 - k] = z[n - 1 - k], z[begin + k]
        start[c + 1] = n
    return start, column[:n], z[:n]


@njit(cache=True)
def _level_agrees(start: Any, z: Any, a: Any, b: Any, gap: Any, back: Any, front: Any, reach: Any) -> Any:
    """Whether nodes a and b, `gap` columns apart, are one floor: level, or on a slope that goes on behind a or b."""
    rise = np.int64(z[b]) - np.int64(z[a])
    if abs(rise) <= 1:
        return True
    if abs(rise) > 2:
        return False
    behind, ahead = find_node(start, z, back, z[a], reach), find_node(start, z, front, z[b], reach)
    sign = 1 if rise > 0 else -1
    return (behind >= 0 and (z[a] - z[behind]) * sign >= 1) or (ahead >= 0 and (z[ahead] - z[b]) * sign >= 1)


@njit(cache=True)
def _spans(columns: Any, start: Any, z: Any, a: Any, b: Any, c: Any, stride: Any, gap: Any, step: Any, clearance: Any, drop: Any) -> Any:
    """Whether floor between nodes a, of column c, and b, `gap` columns on, contradicts nothing that is known there."""
    for j in range(1, gap):
        level = _level_between(z, a, b, j, gap)
        between = c + j * stride
        if find_node(start, z, between, level, step) >= 0 or blocking_voxel(columns, between, level, step, clearance) != NO_VOXEL:
            return False
        seen = seen_down_to(columns, between, level)
        if seen != NO_VOXEL and seen <= level - drop:
            return False
    return True


@njit(cache=True)
def _level_between(z: Any, a: Any, b: Any, j: Any, gap: Any) -> Any:
    """Layer of the floor j of `gap` columns on the way from node a to node b."""
    return (2 * (np.int64(z[a]) * (gap - j) + np.int64(z[b]) * j) + gap) // (2 * gap)


@njit(cache=True)
def _beyond_hole(start: Any, z: Any, a: Any, c: Any, stride: Any, gap: Any, step: Any) -> Any:
    """Node that goes on the floor of node a of column c `gap` columns further, -1 for none, -2 where ground lies before it."""
    if find_node(start, z, c + (gap - 1) * stride, np.int64(z[a]), step) >= 0:
        return -2
    b = find_node(start, z, c + gap * stride, np.int64(z[a]), 2)
    return b if b >= 0 and _level_agrees(start, z, a, b, gap, c - 3 * stride, c + (gap + 3) * stride, step) else -1


@njit(cache=True)
def _bridge(columns: Any, start: Any, column: Any, z: Any, limits: Any) -> Any:
    """(M, 3) int64 of (column, z, gap) of virtual floor between two nodes of one level with at most `hole` columns unknown.

    `limits` is (hole, step, clearance, drop) in voxels.
    """
    hole, step, clearance, drop = limits
    nx, ny = columns.nx, columns.ny
    found = [(np.int64(0), np.int64(0), np.int64(0)) for _ in range(0)]
    for a in range(z.size):
        c = np.int64(column[a])
        for k in range(2):
            stride = ny if k == 0 else 1
            if find_node(start, z, c + stride, np.int64(z[a]), step) >= 0:
                continue
            ix, iy = c // ny, c % ny
            room = min(hole + 1, (nx - ix - 4 if k == 0 else ny - iy - 4)) if ix >= 3 and iy >= 3 else 0
            for gap in range(2, room + 1):
                b = _beyond_hole(start, z, a, c, stride, gap, step)
                if b == -2:
                    break
                if b >= 0 and _spans(columns, start, z, a, b, c, stride, gap, step, clearance, drop):
                    for j in range(1, gap):
                        found.append((c + j * stride, _level_between(z, a, b, j, gap), np.int64(gap)))
    out = np.empty((len(found), 3), np.int64)
    for i in range(len(found)):
        out[i, 0], out[i, 1], out[i, 2] = found[i]
    return out


def _one_per_hole(found: NDArray[np.int64], step: int) -> NDArray[np.int64]:
    """(M, 2) column and z: of the bridges that meet in one column at one level the narrowest stays, the higher when they tie."""
    if not len(found):
        return found[:, :2]
    found = found[np.lexsort((found[:, 1], found[:, 0]))]
    new = np.r_[True, (np.diff(found[:, 0]) != 0) | (np.diff(found[:, 1]) > step)]
    group = np.cumsum(new)
    found = found[np.lexsort((-found[:, 1], found[:, 2], group))]
    return found[np.r_[True, np.diff(np.sort(group)) != 0]][:, :2]


@njit(cache=True)
def _with_holes(start: Any, z: Any, hole_column: Any, hole_z: Any) -> Any:
    """(start, column, z, bridged) of the surfaces and the sorted holes among them."""
    size = z.size + hole_z.size
    out_start = np.empty_like(start)
    column, out_z, bridged = np.empty(size, np.int32), np.empty(size, np.int16), np.zeros(size, np.bool_)
    s, h = 0, 0
    for c in range(start.size - 1):
        out_start[c] = s + h
        while s < start[c + 1] or (h < hole_z.size and hole_column[h] == c):
            is_hole = h < hole_z.size and hole_column[h] == c and (s == start[c + 1] or hole_z[h] < z[s])
            n = s + h
            column[n], bridged[n] = c, is_hole
            if is_hole:
                out_z[n] = hole_z[h]
                h += 1
            else:
                out_z[n] = z[s]
                s += 1
    out_start[-1] = size
    return out_start, column, out_z, bridged


def surfaces_of(columns: Columns, clearance: int, hole: int, step: int) -> Surfaces:
    """Every surface of the window with `clearance` voxels of room above, and virtual ones over holes of at most `hole` unknown columns."""
    start, column, z = _tops(columns, clearance, step)
    holes = _one_per_hole(_bridge(columns, start, column, z, (hole, step, clearance, step + 1)), step)
    bridged = np.zeros(z.size, dtype=bool)
    if len(holes):
        start, column, z, bridged = _with_holes(start, z, holes[:, 0].copy(), holes[:, 1].copy())
    return Surfaces(start, column, z, bridged, z.astype(np.float32) + np.float32(0.5), np.zeros(z.size, dtype=bool))
