"""Surfaces of a column map, the raw material of the terrain analysis: which voxel tops a robot fits above.

First step of `terrain.classify`: crop the columns around the robot, and list the surfaces of every column.
Everything here is in voxels. A direction 0, 1, 2, 3 is +x, +y, -x, -y, so that (k + 2) % 4 looks back and (k + 1) % 4, (k + 3) % 4 aside.
"""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.lean_kernels import lean_njit

DX = np.array([1, 0, -1, 0], dtype=np.int64)
DY = np.array([0, 1, 0, -1], dtype=np.int64)
NO_VOXEL = 32767
_STRIP = 3  # voxels from the end of one strip of a wall to the beginning of the next
_ASTRAY = 0.7  # voxels between the hits in a surface's voxel and its ground: the few above are beams that went astray
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

    is_open (N,) tells whether all space above was seen free as high as the robot is.

    level (N,) is the height of the surface in voxels: where beams hit it on average, or on a line over a hole between two such, which
    `measured` (N,) tells; else the voxel's middle. slope_level (N,) is the same with what was hit in the voxel below, too: a slope passes
    through both; offset (N, 2) is how far along x and y from the column's middle those hits lie on average.
    """

    start: NDArray[np.int32]
    column: NDArray[np.int32]
    z: NDArray[np.int16]
    bridged: NDArray[np.bool_]
    is_open: NDArray[np.bool_]
    level: NDArray[np.float32]
    slope_level: NDArray[np.float32]
    offset: NDArray[np.float32]
    measured: NDArray[np.bool_]

    def at_heights(self, heights: NDArray[np.float32]) -> "Surfaces":
        """The same with measured heights (N, 4) in voxels as `SurfaceHeights.at` gives them, NaN where there are none."""
        level, slope_level, offset, measured = _measured_or(heights, self.level, self.slope_level, self.offset)
        return self._replace(level=level, slope_level=slope_level, offset=offset, measured=measured)


@lean_njit
def ground_voxel(node: Any, near: Any, surfaces: Any) -> Any:
    """The voxel in which the ground of a drivable node lies: that of the surface, or a lower one if only beams gone astray ended in that.

    So they did in one that lies higher than all four ground that is `near` (N, 4); in one that lies lower, a thin deck's, those that are
    below its own ended at the underside.
    """
    if not surfaces.measured[node]:
        return surfaces.z[node]
    ground = np.float64(surfaces.slope_level[node])
    inside, lowest, highest, total = 0, np.float64(np.inf), np.float64(-np.inf), np.float64(0.0)
    for k in range(4):
        if near[node, k] >= 0:
            height = np.float64(surfaces.slope_level[near[node, k]])
            inside, lowest, highest, total = inside + 1, min(lowest, height), max(highest, height), total + height
    if inside == 4 and (ground - highest > _ASTRAY or lowest - ground > _ASTRAY):
        ground = total / inside
    return np.int16(np.floor(ground)) if surfaces.level[node] - ground > _ASTRAY else surfaces.z[node]


@njit(cache=True)
def _measured_or(heights: Any, level: Any, slope_level: Any, offset: Any) -> Any:
    """level, slope_level and offset of the surfaces out of `heights` (N, 4) where these are not NaN, else as given; and where they are."""
    measured = np.empty(level.size, np.bool_)
    level, slope_level, offset = level.copy(), slope_level.copy(), offset.copy()
    for n in range(level.size):
        measured[n] = np.isfinite(heights[n, 0])
        if measured[n]:
            level[n], slope_level[n], offset[n, 0], offset[n, 1] = heights[n]
    return level, slope_level, offset, measured


@njit(cache=True)
def _crop(start: Any, z_lo: Any, z_hi: Any, occupied: Any, rows: Any, wy: Any) -> Any:
    """Runs of a window wy columns wide: of row ix the columns rows[ix, 0] to before rows[ix, 1], in the map from column rows[ix, 2] on."""
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
    return Columns(len(spans), ny, *_crop(runs.start, runs.z_lo, runs.z_hi, runs.occupied, rows, ny))


@njit(cache=True)
def indices_of(column: Any, ny: Any, key: Any) -> Any:
    """(N,) int32 ix and iy of ascending columns of a window of index `key`."""
    ix, iy, x, first = np.empty(column.size, np.int32), np.empty(column.size, np.int32), 0, 0
    for i in range(column.size):
        while column[i] >= first + ny:
            x, first = x + 1, first + ny
        ix[i], iy[i] = key[0] + x, key[1] + column[i] - first
    return ix, iy


@lean_njit
def lowest_occupied(columns: Any, c: Any, low: Any, high: Any) -> Any:
    """Lowest occupied voxel of column c in low..high, NO_VOXEL when there is none."""
    for r in range(columns.start[c], columns.start[c + 1]):
        if columns.z_lo[r] > high:
            break
        if columns.occupied[r] and columns.z_hi[r] >= low:
            return max(np.int64(columns.z_lo[r]), low)
    return NO_VOXEL


@lean_njit
def top_near(columns: Any, c: Any, z: Any, reach: Any) -> Any:
    """Top of the occupied run of column c that ends nearest to z, within `reach`; NO_VOXEL when there is none."""
    best: Any = NO_VOXEL
    best_gap = reach + 1
    for r in range(columns.start[c], columns.start[c + 1]):
        gap = abs(np.int64(columns.z_hi[r]) - z)
        if columns.occupied[r] and gap < best_gap:
            best, best_gap = np.int64(columns.z_hi[r]), gap
    return best


@lean_njit
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


@lean_njit
def is_top_seen(columns: Any, c: Any, z: Any) -> Any:
    """Whether the voxel above voxel z of column c was seen free, so that what stands there ends at z, or below."""
    for r in range(columns.start[c], columns.start[c + 1]):
        if columns.z_hi[r] > z:
            return columns.z_lo[r] <= z + 1 and not columns.occupied[r]
    return False


@lean_njit
def find_node(start: Any, z: Any, c: Any, level: Any, reach: Any) -> Any:
    """Index of the node of column c nearest to `level` within `reach` voxels, -1 when there is none."""
    best, best_gap = -1, reach + 1
    for n in range(start[c], start[c + 1]):
        gap = abs(np.int64(z[n]) - level)
        if gap < best_gap:
            best, best_gap = n, gap
    return best


@lean_njit
def slope_behind(surfaces: Any, a: Any, back: Any, step: Any) -> Any:
    """Rise per column from the node of column `back`, three columns behind node a, to a; 0 where it is level or not measured."""
    n = find_node(surfaces.start, surfaces.z, back, np.int64(surfaces.z[a]), step)
    if n < 0 or not surfaces.measured[n]:
        return 0.0
    slope = (surfaces.slope_level[a] - surfaces.slope_level[n]) / 3.0
    return slope if abs(slope) > _SLOPED else 0.0


@lean_njit
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
def _tops(columns: Any, clearance: Any, step: Any) -> Any:
    """(start, column, z, is_open) of the tops of occupied runs with at least `clearance` voxels below the next occupied one.

    Not of those with something unknown directly above that are a wall, higher than a step, or an underside, with air below: their tops
    were not seen. Air may begin one voxel below, for the beams that hit an underside flatly leave its layer unknown. Above there is no such
    tolerance: a thin plate's unknown top would be taken for its underside, a few voxels too low. Of a wall a voxel or two between the
    laser's lines may be unknown.
    """
    runs, z_lo, z_hi, occupied = columns.start, columns.z_lo, columns.z_hi, columns.occupied  # named once: see terrain_kernels
    start = np.zeros(runs.size, np.int32)
    column, z, is_open = np.empty(z_lo.size, np.int32), np.empty(z_lo.size, np.int16), np.empty(z_lo.size, np.bool_)
    n = 0
    for c in range(runs.size - 1):
        first, last = np.int64(runs[c]), np.int64(runs[c + 1]) - 1
        below = -1  # the run that ends at the last top, until it is known how much room is above
        foot = 0  # of what stands, hit in strips perhaps
        for r in range(first, last + 1):
            if not occupied[r]:
                continue
            if below >= 0 and z_lo[r] - z_hi[below] <= clearance:
                n -= 1
            if not (r > first and occupied[r - 1] and z_lo[r] - z_hi[r - 1] <= _STRIP):
                foot = z_lo[r]
            is_dark = r == last or z_lo[r + 1] > z_hi[r] + 1
            hangs = r > first and not occupied[r - 1] and z_hi[r - 1] >= z_lo[r] - 2
            below = -1
            if not (is_dark and (hangs or z_hi[r] - foot >= step)):
                column[n], z[n], below = c, z_hi[r], r
                is_open[n] = not (is_dark or occupied[r + 1]) and z_hi[r + 1] >= z_hi[r] + clearance
                n += 1
        start[c + 1] = n
    return start, column[:n], z[:n], is_open[:n]


def tops_of(columns: Columns, clearance: int, step: int) -> Surfaces:
    """Every surface of the window with `clearance` voxels of room above, at the middle of its voxel."""
    start, column, z, is_open = _tops(columns, clearance, step)
    unknown = np.zeros(z.size, dtype=bool)
    middle = z.astype(np.float32) + np.float32(0.5)
    return Surfaces(start, column, z, unknown, is_open, middle, middle, np.zeros((z.size, 2), dtype=np.float32), unknown)
