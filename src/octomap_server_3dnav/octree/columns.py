"""A window of columns around the robot, and what the runs of a column tell (thesis 5.5).

Between the octree and the terrain, whose first step crops them. Everything is in voxels. A direction 0, 1, 2, 3 is +x, +y, -x, -y, so that
(k + 2) % 4 looks back and (k + 1) % 4, (k + 3) % 4 aside. Kernels take columns by their number c = ix * ny + iy.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.lean_kernels import Index, lean_njit

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


@njit(cache=True)
def _crop(runs: tuple[NDArray, ...], rows: NDArray[np.int64], wy: Index) -> tuple[NDArray, ...]:
    """Runs of a window wy columns wide: of row ix the columns rows[ix, 0] to before rows[ix, 1], in the map from column rows[ix, 2] on."""
    start, z_lo, z_hi, occupied = runs
    total = 0
    for ix in range(rows.shape[0]):
        total += start[rows[ix, 2] + rows[ix, 1] - rows[ix, 0]] - start[rows[ix, 2]]
    out_start = np.empty(rows.shape[0] * wy + 1, np.int32)
    lo, hi, occ = np.empty(total, np.int16), np.empty(total, np.int16), np.empty(total, np.bool_)
    n = 0
    for ix in range(rows.shape[0]):
        y0, y1, c = rows[ix]
        first, last = start[c], start[c + y1 - y0]
        out_start[ix * wy : ix * wy + y0] = n
        for iy in range(y0, y1):
            out_start[ix * wy + iy] = start[c + iy - y0] - first + n
        lo[n : n + last - first] = z_lo[first:last]
        hi[n : n + last - first] = z_hi[first:last]
        occ[n : n + last - first] = occupied[first:last]
        n += last - first
        out_start[ix * wy + y1 : (ix + 1) * wy] = n
    out_start[-1] = n
    return out_start, lo, hi, occ


def crop_columns(runs: ColumnRuns, key: tuple[int, int], ny: int, spans: NDArray[np.int64]) -> Columns:
    """The window from column index `key` on, ny wide: of row ix the columns from spans[ix, 0] to before spans[ix, 1], unknown ones around.

    `spans` (nx, 2) must lie within what `runs` hold.
    """
    rows = np.empty((len(spans), 3), dtype=np.int64)
    rows[:, :2] = spans
    rows[:, 2] = (np.arange(len(spans)) + key[0] - runs.origin_key[0]) * runs.ny + key[1] - runs.origin_key[1] + spans[:, 0]
    rows[spans[:, 0] >= spans[:, 1]] = 0
    return Columns(len(spans), ny, *_crop((runs.start, runs.z_lo, runs.z_hi, runs.occupied), rows, ny))


@njit(cache=True)
def indices_of(column: NDArray[np.int32], ny: Index, key: tuple[int, int]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """(N,) int32 ix and iy of ascending columns of a window of index `key`."""
    ix, iy, x, first = np.empty(column.size, np.int32), np.empty(column.size, np.int32), 0, 0
    for i in range(column.size):
        while column[i] >= first + ny:
            x, first = x + 1, first + ny
        ix[i], iy[i] = key[0] + x, key[1] + column[i] - first
    return ix, iy


@lean_njit
def lowest_occupied(columns: Columns, c: Index, low: Index, high: Index) -> Index:
    """Lowest occupied voxel of column c in low..high, NO_VOXEL when there is none."""
    for r in range(columns.start[c], columns.start[c + 1]):
        if columns.z_lo[r] > high:
            break
        if columns.occupied[r] and columns.z_hi[r] >= low:
            return max(np.int64(columns.z_lo[r]), low)
    return NO_VOXEL


@lean_njit
def top_near(columns: Columns, c: Index, z: Index, reach: Index) -> Index:
    """Top of the occupied run of column c that ends nearest to z, within `reach`; NO_VOXEL when there is none."""
    best: Index = NO_VOXEL
    best_gap = reach + 1
    for r in range(columns.start[c], columns.start[c + 1]):
        gap = abs(np.int64(columns.z_hi[r]) - z)
        if columns.occupied[r] and gap < best_gap:
            best, best_gap = np.int64(columns.z_hi[r]), gap
    return best


@lean_njit
def seen_down_to(columns: Columns, c: Index, z: Index) -> Index:
    """Lowest voxel of the free space seen from level z of column c downwards, NO_VOXEL when level z itself was not seen.

    One unknown voxel in between is allowed. Space under a floor that was seen only from below does not count: it must open at z.
    """
    lowest: Index = NO_VOXEL
    for r in range(columns.start[c + 1] - 1, columns.start[c] - 1, -1):
        lo, hi = np.int64(columns.z_lo[r]), np.int64(columns.z_hi[r])
        if lo > z + 1:
            continue
        if columns.occupied[r] or hi < (z - 1 if lowest == NO_VOXEL else lowest - 2):
            break
        lowest = lo
    return lowest


@lean_njit
def is_free_through(columns: Columns, c: Index, low: Index, high: Index) -> bool:
    """Whether every voxel of column c was seen free in low..high."""
    for r in range(columns.start[c], columns.start[c + 1]):
        if columns.z_lo[r] <= low and columns.z_hi[r] >= high and not columns.occupied[r]:
            return True
    return False


@lean_njit
def blocking_voxel(columns: Columns, c: Index, level: Index, step: Index, clearance: Index) -> Index:
    """Lowest occupied voxel of column c where something stands in the way of a robot at `level`, NO_VOXEL when nothing does.

    It stands higher than a step, or it leaves too little room above a floor near the level. What was only seen from below does not block.
    """
    blocked = lowest_occupied(columns, c, level + step + 1, level + clearance) != NO_VOXEL
    top = top_near(columns, c, level, step)
    if not blocked and top != NO_VOXEL:
        blocked = lowest_occupied(columns, c, top + 1, top + clearance) != NO_VOXEL
    return lowest_occupied(columns, c, level - step, level + step + clearance) if blocked else NO_VOXEL
