"""How coverage grew: after every sweep the share of the reachable ground that was mapped, over time and over the way driven.

The sweeps are placed as the finished pose graph has them and divided into the map's voxels, so that a point of the curve
is the coverage that a map of the sweeps up to then would have. Voxels that a later sweep found free again, and the plane
that is put under the robot at its start, are in the map but not in the curve.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from exploration_evaluation.scores import COVERED_HORIZONTAL_M, COVERED_VERTICAL_M, covered_cells, motion
from rigid_geometry import inverse, transform_points

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Points = NDArray[np.floating]

_MARGIN_VOXELS = 2


@dataclass(frozen=True)
class CurvePoint:
    """Coverage after a sweep, so long after the first true pose and after so much of way."""

    time_s: float
    distance_m: float
    coverage: float


def coverage_curve(shares: ArrayLike, stamps: ArrayLike, stamps_truth: ArrayLike, T_truth: ArrayLike) -> tuple[CurvePoint, ...]:
    """The curve of (S,) shares after the sweeps of (S,) stamps, with time and distance from (M, 4, 4) true poses.

    ValueError when the numbers of shares and stamps differ, or a sweep was made before the first true pose.
    """
    values, at = np.asarray(shares, dtype=np.float64), np.asarray(stamps, dtype=np.float64)
    if values.shape != at.shape or values.ndim != 1:
        raise ValueError(f"every sweep has a stamp and a coverage, not {at.shape} stamps and {values.shape} shares")
    start_s = float(np.asarray(stamps_truth, dtype=np.float64)[0])
    way = driven_distances(stamps_truth, T_truth, at)
    return tuple(CurvePoint(float(t) - start_s, float(d), float(v)) for t, d, v in zip(at, way, values, strict=True))


@dataclass(frozen=True)
class SweptGround:
    """`first`: (N,) which of all `sweeps` showed each cell of ground first, -1 where none did."""

    first: Ints
    sweeps: int

    @property
    def shares(self) -> Floats:
        """(S,) share of the cells that are covered after each sweep."""
        return np.asarray(np.cumsum(np.bincount(self.first[self.first >= 0], minlength=self.sweeps)) / len(self.first))

    def shown_s(self, stamps: ArrayLike) -> Floats:
        """(N,) when each cell was shown, by the (S,) stamps of the sweeps; infinite where it never was."""
        return np.append(np.asarray(stamps, dtype=np.float64), np.inf)[self.first]


def swept_ground(ground: ArrayLike, sweeps_map: Iterable[Points], T_world_map: Floats, voxel_m: float) -> SweptGround:
    """Which sweep of (K, 3) points in the map frame covers each of the (N, 3) cells of ground, world frame, first.

    Covered is what `covered_cells` says of the centres of the map's voxels, `voxel_m` wide, that hold a point.
    ValueError without ground.
    """
    cells = np.asarray(ground, dtype=np.float64)
    if not len(cells):
        raise ValueError("coverage needs at least one cell of reachable ground, got none")
    voxels = _VoxelsAround(transform_points(inverse(T_world_map), cells), voxel_m)
    first, count = np.full(len(cells), -1), 0
    for count, points in enumerate(sweeps_map, start=1):
        left = np.flatnonzero(first < 0)
        if len(left):
            centres = transform_points(T_world_map, voxels.centres(points))
            first[left[covered_cells(cells[left], centres)]] = count - 1
    return SweptGround(first, count)


def placed_sweeps(sweeps_base: Iterable[Points], T_map_base: ArrayLike, crop_half_m: float) -> Iterator[Points]:
    """Each sweep's (K, 3) points in the map frame, by the (S, 4, 4) pose of its vertex.

    Those within a square of half side `crop_half_m` around the robot are left: the map takes no others. ValueError when there
    are not as many sweeps as poses.
    """
    for points, T in zip(sweeps_base, np.asarray(T_map_base, dtype=np.float64), strict=True):
        placed = transform_points(T, points)
        yield placed[(np.abs(placed[:, :2] - T[:2, 3]) <= crop_half_m).all(axis=1)]


def driven_distances(stamps_truth: ArrayLike, T_truth: ArrayLike, at: ArrayLike) -> Floats:
    """(K,) metres driven until each of (K,) times, as `motion` counts them; ValueError for a time before the first true pose."""
    stamps, poses = np.asarray(stamps_truth, dtype=np.float64), np.asarray(T_truth, dtype=np.float64)
    count = np.searchsorted(stamps, np.asarray(at, dtype=np.float64) + 1e-6, side="right")
    if (count < 1).any():
        raise ValueError(f"no true pose is known before {float(np.min(at)):.3f} s; the first is of {stamps[0]:.3f} s")
    return np.array([motion(stamps[:n], poses[:n]).distance_m for n in count])


class _VoxelsAround:
    """The map's voxels in a box around ground: voxel (i, j, k) spans i to i + 1 times the resolution along x, as an octree's does."""

    def __init__(self, ground_map: Points, voxel_m: float) -> None:
        self._size = voxel_m
        reach = max(COVERED_HORIZONTAL_M, COVERED_VERTICAL_M)
        # A tilted map turns the tolerances' box: its diagonal fits any turn.
        margin = np.sqrt(3.0) * reach + _MARGIN_VOXELS * self._size
        self._low = np.floor((ground_map.min(axis=0) - margin) / self._size).astype(np.int64)
        self._shape = np.floor((ground_map.max(axis=0) + margin) / self._size).astype(np.int64) - self._low + 1

    def centres(self, points: Points) -> Floats:
        """(K, 3) centres of the voxels in the box that hold any of the (N, 3) points."""
        keys = np.empty(len(points), dtype=np.int64)
        keys = np.sort(keys[: _voxel_keys(points, self._size, self._low, self._shape, keys)])
        held = keys[np.diff(keys, prepend=-1) > 0]
        return np.asarray((np.column_stack(np.unravel_index(held, self._shape)) + self._low + 0.5) * self._size)


@njit(cache=True)
def _voxel_keys(points: Points, size: float, low: Ints, shape: Ints, keys: Ints) -> int:
    """Writes the number of every point's voxel in the box, without immediate repetitions, and returns how many there are."""
    count = 0
    for n in range(points.shape[0]):
        i = int(math.floor(points[n, 0] / size)) - low[0]
        j = int(math.floor(points[n, 1] / size)) - low[1]
        k = int(math.floor(points[n, 2] / size)) - low[2]
        if 0 <= i < shape[0] and 0 <= j < shape[1] and 0 <= k < shape[2]:
            key = (i * shape[1] + j) * shape[2] + k
            if count == 0 or keys[count - 1] != key:
                keys[count] = key
                count += 1
    return count
