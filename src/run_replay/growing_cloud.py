"""The cloud of all sweeps so far, as it grows by one sweep after the other."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.registration.cloud import PointCloud, voxel_downsample
from rigid_geometry import transform_points

Floats = NDArray[np.float64]

_STILL_M = 0.005  # sweeps whose vertex moved less stay where they are


class GrowingCloud:
    """One point for every voxel of edge `voxel_m` that a sweep has seen, in the map frame."""

    def __init__(self, voxel_m: float) -> None:
        self._voxel_m = voxel_m
        self._sweeps: list[Floats] = []
        self._poses: Floats = np.zeros((0, 4, 4))
        self._merged: Floats = np.zeros((0, 3))

    def __len__(self) -> int:
        return len(self._sweeps)

    @property
    def points(self) -> Floats:
        """(N, 3) points in the map frame."""
        return self._merged

    def add(self, points_base: ArrayLike, T_map_base: ArrayLike) -> None:
        """Adds a sweep's (N, 3) points in base_link, with the (S, 4, 4) poses of all S sweeps including the new one.

        When older sweeps have moved, all are placed anew. ValueError when there is not one pose a sweep.
        """
        poses = np.asarray(T_map_base, dtype=np.float64)
        if poses.shape != (len(self._sweeps) + 1, 4, 4):
            raise ValueError(f"poses of shape {poses.shape} for {len(self._sweeps) + 1} sweeps")
        self._sweeps.append(self._thinned(PointCloud.of_finite(points_base).points))
        moved = bool((np.abs(poses[:-1] - self._poses) > _STILL_M).any())
        placed = [] if moved else [self._merged]
        for sweep, T in list(zip(self._sweeps, poses, strict=True))[0 if moved else -1 :]:
            placed.append(np.asarray(transform_points(T, sweep)))
        self._merged, self._poses = self._thinned(np.concatenate(placed)), poses

    def _thinned(self, points: Floats) -> Floats:
        return voxel_downsample(PointCloud(points), self._voxel_m).points
