"""Surfaces of a column map, the raw material of the terrain analysis: which voxel tops a robot fits above.

First step of `terrain.classify`: crop the columns around the robot, and list the surfaces of every column.
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
_SLOPED = np.tan(np.deg2rad(10.0))  # what is less steep is level: a slope that is none leads farther astray than it tells


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

    level (N,) is the height of the surface in voxels: where beams hit it on average, or on a line over a hole between two such, which
    `measured` (N,) tells; else the voxel's middle. slope_level (N,) is the same with what was hit in the voxel below, too: a slope passes
    through both.
    """

    start: NDArray[np.int32]
    column: NDArray[np.int32]
    z: NDArray[np.int16]
    bridged: NDArray[np.bool_]
    level: NDArray[np.float32]
    slope_level: NDArray[np.float32]
    measured: NDArray[np.bool_]

    def at_heights(self, heights: NDArray[np.float32]) -> "Surfaces":
        """The same with measured heights (N, 2) in voxels as `SurfaceHeights.at` gives them, NaN where there are none."""
        measured = np.isfinite(heights[:, 0])
        level, slope_level = (np.where(measured, heights[:, i], self.level) for i in (0, 1))
        return self._replace(level=level, slope_level=slope_level, measured=measured)


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
def slope_behind(surfaces: Any, a: Any, back: Any, step: Any) -> Any:
    """Rise per column from the node of column `back`, three columns behind node a, to a; 0 where it is level or not measured."""
    n = find_node(surfaces.start, surfaces.z, back, np.int64(surfaces.z[a]), step)
    if n < 0 or not surfaces.measured[n]:
        return 0.0
    slope = (surfaces.slope_level[a] - surfaces.slope_level[n]) / 3.0
    return slope if abs(slope) > _SLOPED else 0.0


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


def tops_of(columns: Columns, clearance: int, step: int) -> Surfaces:
    """Every surface of the window with `clearance` voxels of room above, at the middle of its voxel."""
    start, column, z = _tops(columns, clearance, step)
    unknown = np.zeros(z.size, dtype=bool)
    middle = z.astype(np.float32) + np.float32(0.5)
    return Surfaces(start, column, z, unknown, middle, middle, unknown)
