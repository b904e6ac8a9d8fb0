"""Surfaces: the tops of what is occupied, with room for the robot above, each an estimate of a height (first principle of docs/terrain.md).

Second step of `classify`. The height is the mean of the hits in the surface's voxel and in the one below where these are of one slope; its
sigma follows from their number. Everything is in voxels.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.columns import Columns, indices_of
from octomap_server_3dnav.octree.lean_kernels import Index, lean_njit
from octomap_server_3dnav.octree.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain.config import Limits

VOXEL_SIGMA = float(np.float32(12.0**-0.5))  # of a place that may be anywhere in a voxel


class Surfaces(NamedTuple):
    """Surface nodes sorted by column and height.

    start (C + 1,) first node of every column; column (N,); z (N,) of the voxel; height (N,) and its sigma (N,), float32; offset (N, 2) how
    far along x and y from the column's middle the hits lie on average; filled (N,) whether the surface is assumed over unknown columns.
    """

    start: NDArray[np.int32]
    column: NDArray[np.int32]
    z: NDArray[np.int16]
    height: NDArray[np.float32]
    sigma: NDArray[np.float32]
    offset: NDArray[np.float32]
    filled: NDArray[np.bool_]


@lean_njit
def find_node(start: NDArray[np.int32], z: NDArray[np.int16], c: Index, level: Index, reach: Index) -> Index:
    """Index of the node of column c nearest to `level` within `reach` voxels, -1 when there is none."""
    best, best_gap = -1, reach + 1
    for n in range(start[c], start[c + 1]):
        gap = abs(np.int64(z[n]) - level)
        if gap < best_gap:
            best, best_gap = n, gap
    return best


@njit(cache=True)
def _tops(columns: Columns, clearance: Index, step: Index, gap: Index) -> tuple[NDArray, ...]:
    """(start, column, z) of the tops of occupied runs with at least `clearance` voxels below the next occupied one.

    Not of those with something unknown directly above that are a wall, higher than a step, or an underside, with air below: their tops
    were not seen. Air may begin one voxel below, for the beams that hit an underside flatly leave its layer unknown. Above there is no such
    tolerance: a thin plate's unknown top would be taken for its underside, a few voxels too low. Of a wall up to `gap` voxels between the
    laser's lines may be unknown.
    """
    runs, z_lo, z_hi, occupied = columns.start, columns.z_lo, columns.z_hi, columns.occupied  # arrays of a tuple are counted at every use
    start = np.zeros(runs.size, np.int32)
    column, z = np.empty(z_lo.size, np.int32), np.empty(z_lo.size, np.int16)
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
            if not (r > first and occupied[r - 1] and z_lo[r] - z_hi[r - 1] <= gap):
                foot = z_lo[r]
            is_dark = r == last or z_lo[r + 1] > z_hi[r] + 1
            hangs = r > first and not occupied[r - 1] and z_hi[r - 1] >= z_lo[r] - 2
            below = -1
            if not (is_dark and (hangs or z_hi[r] - foot >= step)):
                column[n], z[n], below = c, z_hi[r], r
                n += 1
        start[c + 1] = n
    return start, column[:n], z[:n]


@njit(cache=True)
def _estimates(hits: NDArray[np.float32], z: NDArray[np.int16], noise: float, pose: float) -> tuple[NDArray, ...]:
    """height, sigma (N,) and offset (N, 2) out of `hits` (N, 4) of `SurfaceHeights.at`; a voxel's middle where one is no number."""
    height, sigma = np.empty(z.size, np.float32), np.empty(z.size, np.float32)
    offset = np.zeros((z.size, 2), np.float32)
    for n in range(z.size):
        if np.isfinite(hits[n].sum()):
            height[n], offset[n, 0], offset[n, 1] = hits[n, 0], hits[n, 1], hits[n, 2]
            sigma[n] = np.sqrt(noise**2 / hits[n, 3] + pose**2)
        else:
            height[n], sigma[n] = z[n] + 0.5, VOXEL_SIGMA
    return height, sigma, offset


def surfaces_of(columns: Columns, key: tuple[int, int], heights: SurfaceHeights | None, limits: Limits) -> Surfaces:
    """Every surface of the window whose first column has index `key`, with room for the robot above."""
    start, column, z = _tops(columns, limits.clearance, limits.step, limits.strip)
    hits = np.full((z.size, 4), np.nan, dtype=np.float32)
    if heights is not None:
        hits = heights.at(*indices_of(column, columns.ny, key), z)
    height, sigma, offset = _estimates(hits, z, limits.noise, limits.pose_noise)
    return Surfaces(start, column, z, height, sigma, offset, np.zeros(z.size, dtype=bool))
