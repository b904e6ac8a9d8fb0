"""Point clouds with the beam origin and normal of every point, and the voxel averaging that registration, mapper and store share.

Sums are serial, in the order of the points, so that the same input gives the same bits; normals, each on its own, take two threads.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import small_gicp
from numba import njit
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.registration.voxel_grid import voxel_index, voxel_mean
from rigid_geometry import transform_points

Array = NDArray[np.float64]

NORMAL_THREADS = 2
_MAX_CELL = 1 << 20
NORMAL_NEIGHBOURS = 20  # neighbours of a normal; fewer are useless at centimetres of noise


def _as_rows(name: str, values: ArrayLike) -> Array:
    rows = np.ascontiguousarray(values, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != 3:
        raise ValueError(f"{name} must have shape (N, 3), not {rows.shape}")
    return rows


def moved_points(T_target_points: Array, points: Array) -> Array:
    """(N, 3) points in the frame `target`."""
    return np.asarray(transform_points(T_target_points, points), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class PointCloud:
    """Points of one frame, metres; ValueError for a wrong shape or anything not finite.

    points (N, 3); origins (N, 3): where each beam started, or None when not known; normals (N, 3): unit, turned to the
    beam's origin, zero where the neighbours did not tell, or None when not estimated yet; dropped: points left out before.
    """

    points: Array
    origins: Array | None = None
    normals: Array | None = None
    dropped: int = 0

    def __post_init__(self) -> None:
        for name in ("points", "origins", "normals"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, self._checked(name))

    def _checked(self, name: str) -> Array:
        rows = _as_rows(name, getattr(self, name))
        if not np.isfinite(rows).all():
            bad = int(np.count_nonzero(~np.isfinite(rows).all(axis=1)))
            raise ValueError(f"{bad} of {len(rows)} {name} are not finite; PointCloud.of_finite drops and counts them")
        if len(rows) != len(self.points):
            raise ValueError(f"{len(rows)} {name} for {len(self.points)} points")
        return rows

    def singles(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(N, 3) points and origins, which are known, as they are sent and kept in a map."""
        assert self.origins is not None
        return self.points.astype(np.float32), self.origins.astype(np.float32)

    @classmethod
    def of_finite(cls, points: ArrayLike, origins: ArrayLike | None = None) -> PointCloud:
        """A cloud of the finite rows; `dropped` counts the others."""
        rows = _as_rows("points", points)
        starts = None if origins is None else _as_rows("origins", origins)
        if starts is not None and len(starts) != len(rows):
            raise ValueError(f"{len(starts)} origins for {len(rows)} points")
        if np.isfinite(rows).all() and (starts is None or np.isfinite(starts).all()):
            return cls(rows, starts)
        finite = np.isfinite(rows).all(axis=1)
        if starts is not None:
            finite &= np.isfinite(starts).all(axis=1)
        kept = cls(rows[finite], None if starts is None else starts[finite])
        return cls(kept.points, kept.origins, None, int(np.count_nonzero(~finite)))

    def __len__(self) -> int:
        return len(self.points)

    def transformed(self, T_target_cloud: Array) -> PointCloud:
        """The same cloud in the frame `target`."""
        origins = None if self.origins is None else moved_points(T_target_cloud, self.origins)
        normals = None if self.normals is None else self.normals @ T_target_cloud[:3, :3].T
        return PointCloud(moved_points(T_target_cloud, self.points), origins, normals, self.dropped)

    def selected(self, mask: NDArray[np.bool_]) -> PointCloud:
        """The points where `mask` (N,) is true; the cloud itself where that is everywhere."""
        if mask.all():
            return self
        return PointCloud(
            self.points[mask],
            None if self.origins is None else self.origins[mask],
            None if self.normals is None else self.normals[mask],
            self.dropped,
        )

    def thinned(self, most: int) -> PointCloud:
        """Every so manieth point, at most `most`."""
        step = -(-len(self) // most)
        if step <= 1:
            return self
        origins, normals = (None if rows is None else rows[::step] for rows in (self.origins, self.normals))
        return PointCloud(self.points[::step], origins, normals, self.dropped)


def merged(clouds: Sequence[PointCloud]) -> PointCloud:
    """One cloud of many in the same frame; origins and normals survive only when all have them. ValueError for none."""
    if not clouds:
        raise ValueError("merged needs at least one cloud")
    origins = [c.origins for c in clouds if c.origins is not None]
    normals = [c.normals for c in clouds if c.normals is not None]
    return PointCloud(
        np.concatenate([c.points for c in clouds]),
        np.concatenate(origins) if len(origins) == len(clouds) else None,
        np.concatenate(normals) if len(normals) == len(clouds) else None,
        sum(c.dropped for c in clouds),
    )


@njit(cache=True)
def within(points: Array, centre: Array, radius_m: float) -> NDArray[np.bool_]:
    """(N,) whether points (N, 3) lie at most `radius_m` from `centre` (3,)."""
    found = np.empty(len(points), dtype=np.bool_)
    for i in range(len(points)):
        x, y, z = points[i, 0] - centre[0], points[i, 1] - centre[1], points[i, 2] - centre[2]
        found[i] = x * x + y * y + z * z <= radius_m * radius_m
    return found


def farthest(points: Array) -> float:
    """Largest distance of points (N, 3) from the origin of their frame."""
    return math.sqrt(float(np.einsum("ij,ij->i", points, points).max()))


def voxel_downsample(cloud: PointCloud, voxel_m: float) -> PointCloud:
    """The mean point, beam origin and direction of the normal of every occupied voxel, in order of first appearance.

    ValueError when `voxel_m` is not positive or a point lies more than 2^20 voxels from the origin.
    """
    if not voxel_m > 0.0:
        raise ValueError(f"voxel_m must be positive, not {voxel_m}")
    if len(cloud) and np.abs(cloud.points).max() >= (_MAX_CELL - 1) * voxel_m:
        raise ValueError(f"points up to {np.abs(cloud.points).max():.3g} m away do not fit a grid of {voxel_m} m voxels")
    voxel_of = np.empty(len(cloud), dtype=np.int32)
    count = voxel_index(cloud.points, 1.0 / voxel_m, voxel_of)
    return PointCloud(
        voxel_mean(cloud.points, voxel_of, count),
        None if cloud.origins is None else voxel_mean(cloud.origins, voxel_of, count),
        None if cloud.normals is None else normalised(voxel_mean(cloud.normals, voxel_of, count)),
        cloud.dropped,
    )


def normalised(vectors: Array) -> Array:
    """(N, 3) vectors of length one; those near zero, and of no direction therefore, become zero."""
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(lengths > 1e-6, vectors / np.maximum(lengths, 1e-6), 0.0)


def with_normals(cloud: PointCloud, neighbours: int, threads: int = NORMAL_THREADS) -> PointCloud:
    """The cloud with the normal of the plane through each point's neighbours, turned to the beam's origin where that is known."""
    if len(cloud) == 0:
        return PointCloud(cloud.points, cloud.origins, np.zeros((0, 3)), cloud.dropped)
    estimate = small_gicp.PointCloud(cloud.points)
    small_gicp.estimate_normals_covariances(estimate, num_neighbors=neighbours, num_threads=threads)
    normals = np.asarray(estimate.normals())[:, :3]
    if cloud.origins is not None:
        away = np.einsum("ij,ij->i", normals, cloud.origins - cloud.points) < 0.0
        normals = np.where(away[:, None], -normals, normals)
    return PointCloud(cloud.points, cloud.origins, normals, cloud.dropped)


def vertex_cloud(cloud: PointCloud, voxel_m: float, neighbours: int) -> PointCloud:
    """What is kept of a sweep for later matches: voxel means with normals, so that areas are merged without new estimates."""
    return with_normals(voxel_downsample(cloud, voxel_m), neighbours)


def reference_cloud(reference: PointCloud, voxel_m: float, neighbours: int) -> PointCloud:
    """`vertex_cloud` of every standpoint in a merged cloud on its own: averaging over sweeps would mix origins and both sides of walls.

    A cloud that has normals, and so went through this as sweeps, is returned as it is.
    """
    if reference.normals is not None or len(reference) == 0:
        return reference
    if reference.origins is None:
        return vertex_cloud(reference, voxel_m, neighbours)
    _, index = viewpoints(reference.origins)
    return merged([vertex_cloud(reference.selected(index == k), voxel_m, neighbours) for k in np.unique(index)])


@njit(cache=True)
def _standpoints(origins: Array, radius_m: float, most: int) -> tuple[Array, NDArray[np.int32]]:
    """Sums and numbers (K, 4) of the origins of every standpoint, and the (N,) standpoint of every origin: the first within reach."""
    index = np.full(len(origins), -1, dtype=np.int32)
    first = np.empty((most, 3))
    sums = np.zeros((most, 4))
    found = 0
    for i in range(len(origins)):
        for k in range(found + 1):
            if k == most:
                break
            if k == found:
                first[k] = origins[i]
                found += 1
            dx, dy, dz = origins[i, 0] - first[k, 0], origins[i, 1] - first[k, 1], origins[i, 2] - first[k, 2]
            if dx * dx + dy * dy + dz * dz <= radius_m * radius_m:
                index[i] = k
                sums[k, :3] += origins[i]
                sums[k, 3] += 1.0
                break
    return sums[:found], index


def viewpoints(origins: Array, radius_m: float = 0.5) -> tuple[Array, NDArray[np.int32]]:
    """The standpoints that beams were sent from: centres (K, 3), and for every origin the index of its standpoint, -1 beyond the 64th.

    Greedy in the order of the origins; a sweep's own origins lie within centimetres, sweeps metres apart.
    """
    sums, index = _standpoints(origins, radius_m, 64)
    return np.asarray(sums[:, :3] / sums[:, 3:]), index


def compile_kernels() -> None:
    """Compiles the kernels of this module for the types that a sweep passes."""
    one = np.zeros((1, 3))
    viewpoints(one)
    within(one, np.zeros(3), 1.0)
    voxel_downsample(PointCloud(one, one, one), 1.0)
