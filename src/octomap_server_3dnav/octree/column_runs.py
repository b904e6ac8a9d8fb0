"""A voxel map as sorted vertical runs, column by column: what the octree hands to the terrain analysis.

Every (x, y) column lists its known voxels from below to above as runs of one state, free or occupied; what no run covers is
unknown. Space that the octree pruned into big leaves stays a handful of numbers, and the next surface below or above is the
neighbouring entry.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

KEY_OFFSET = 32768  # octomap's keys are voxel indices plus this, 16 bits an axis: a tree is 16 levels deep


class VoxelState(IntEnum):
    """What is known about a voxel; the values are those of dense grids and of `OctreeMap.states_at`."""

    UNKNOWN = 0
    FREE = 1
    OCCUPIED = 2


@njit(cache=True)
def _first_wrong(start: Any, z_lo: Any, z_hi: Any, occupied: Any) -> Any:
    """First run that the next one of its column does not lie above, or touches in the same state; -1 when there is none."""
    is_wrong = np.zeros(z_lo.size + 1, np.bool_)
    for r in range(1, z_lo.size):
        gap = np.int32(z_lo[r]) - z_hi[r - 1] - 1
        is_wrong[r] = (gap < 0) | ((gap == 0) & (occupied[r] == occupied[r - 1]))
    is_wrong[start] = False  # the one before is of another column
    return np.argmax(is_wrong) - 1 if is_wrong.any() else -1


@dataclass(frozen=True, eq=False)
class ColumnRuns:
    """The known voxels of an nx by ny block of columns, as runs along z.

    Voxel index i spans [i * resolution, (i + 1) * resolution) metres on each axis of the map frame. Column (ix, iy) holds
    the voxels of index (origin_key[0] + ix, origin_key[1] + iy) and has the id c = ix * ny + iy; its runs are the
    entries start[c]:start[c + 1] of `z_lo`, `z_hi` and `occupied`. The arrays must not be changed.

    Fields: `resolution` in metres; `origin_key` (kx0, ky0); `nx`, `ny` columns; `start` (nx * ny + 1,) int64; `z_lo`, `z_hi`
    (R,) int16, inclusive absolute voxel indices, ascending in a column; `occupied` (R,) bool. Two runs that touch differ in
    state. ValueError when any of this does not hold.
    """

    resolution: float
    origin_key: tuple[int, int]
    nx: int
    ny: int
    start: NDArray[np.int64]
    z_lo: NDArray[np.int16]
    z_hi: NDArray[np.int16]
    occupied: NDArray[np.bool_]

    def __post_init__(self) -> None:
        if not (np.isfinite(self.resolution) and self.resolution > 0):
            raise ValueError(f"resolution must be positive metres, not {self.resolution!r}")
        if self.nx < 0 or self.ny < 0:
            raise ValueError(f"nx and ny must not be negative: {self.nx}, {self.ny}")
        self._check_arrays()
        self._check_starts()
        self._check_runs()

    def _check_arrays(self) -> None:
        runs = self.z_lo.size
        wanted = {
            "start": (np.int64, self.nx * self.ny + 1),
            "z_lo": (np.int16, runs),
            "z_hi": (np.int16, runs),
            "occupied": (np.bool_, runs),
        }
        for name, (dtype, size) in wanted.items():
            array = getattr(self, name)
            if array.dtype != dtype or array.shape != (size,):
                raise ValueError(f"{name} must be ({size},) {np.dtype(dtype).name}, not {array.shape} {array.dtype.name}")

    def _check_starts(self) -> None:
        if self.start[0] != 0 or self.start[-1] != self.z_lo.size or (self.start[1:] < self.start[:-1]).any():
            raise ValueError(f"start must ascend from 0 to the number of runs, {self.z_lo.size}: {self.start}")

    def _check_runs(self) -> None:
        if (self.z_hi < self.z_lo).any():
            raise ValueError(f"run {int(np.argmax(self.z_hi < self.z_lo))} ends below its beginning")
        wrong = _first_wrong(self.start, self.z_lo, self.z_hi, self.occupied)
        if wrong >= 0:
            raise ValueError(f"runs {wrong} and the next overlap, descend, or touch in the same state")

    @classmethod
    def from_dense(cls, states: NDArray[np.uint8], origin: Sequence[int] = (0, 0, 0), resolution: float = 0.08) -> "ColumnRuns":
        """The runs of an (nx, ny, nz) array of VoxelState values whose element [0, 0, 0] is the voxel of index `origin`.

        ValueError when the array is not three-dimensional, holds another value, or leaves the index range of int16.
        """
        states = np.asarray(states)
        if states.ndim != 3 or not np.isin(states, (0, 1, 2)).all():
            raise ValueError(
                f"expected an (nx, ny, nz) array of 0 unknown, 1 free, 2 occupied, not shape {states.shape}, dtype {states.dtype}"
            )
        nx, ny, nz = states.shape
        if not -32768 <= origin[2] <= origin[2] + nz <= 32768:
            raise ValueError(f"z indices {origin[2]}..{origin[2] + nz - 1} leave the range -32768..32767")
        padded = np.zeros((nx * ny, nz + 2), dtype=np.uint8)
        padded[:, 1:-1] = states.reshape(nx * ny, nz)
        below, above = padded[:, :-1], padded[:, 1:]  # on both sides of every boundary between voxels
        column, z_lo = np.nonzero((below != above) & (above != VoxelState.UNKNOWN))
        z_end = np.nonzero((below != above) & (below != VoxelState.UNKNOWN))[1]
        return cls(
            resolution=float(resolution),
            origin_key=(int(origin[0]), int(origin[1])),
            nx=nx,
            ny=ny,
            start=np.concatenate([[0], np.cumsum(np.bincount(column, minlength=nx * ny))]).astype(np.int64),
            z_lo=(z_lo + origin[2]).astype(np.int16),
            z_hi=(z_end - 1 + origin[2]).astype(np.int16),
            occupied=above[column, z_lo] == VoxelState.OCCUPIED,
        )

    @property
    def columns(self) -> NDArray[np.int64]:
        """(R,) id of the column of every run."""
        return np.repeat(np.arange(self.nx * self.ny, dtype=np.int64), np.diff(self.start))

    @property
    def z_range(self) -> tuple[int, int] | None:
        """Lowest and highest known voxel index, inclusive; None when nothing is known."""
        return (int(self.z_lo.min()), int(self.z_hi.max())) if self.z_lo.size else None
