"""Voxel means as GICP needs them, and the call that aligns two of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import small_gicp

from pose_graph_mapping.cloud import NORMAL_THREADS, Array, PointCloud, voxel_downsample


@dataclass(frozen=True, eq=False)
class Surface:
    """Points with GICP's covariances and their search tree."""

    points: Array
    cloud: small_gicp.PointCloud
    tree: small_gicp.KdTree

    @property
    def normals(self) -> Array:
        """(N, 3) unit normals, turned to neither side; zero where the neighbours did not tell."""
        return np.asarray(self.cloud.normals())[:, :3]


def surface_of(points: Array, neighbours: int) -> Surface:
    """The surface of points (N, 3)."""
    cloud = small_gicp.PointCloud(points)
    tree = small_gicp.KdTree(cloud, num_threads=1)
    small_gicp.estimate_normals_covariances(cloud, tree, num_neighbors=neighbours, num_threads=NORMAL_THREADS)
    return Surface(points, cloud, tree)


def coarse_surface(points: Array, voxel_m: float, neighbours: int) -> Surface:
    """The surface of the voxel means of points (N, 3)."""
    return surface_of(voxel_downsample(PointCloud(points), voxel_m).points, neighbours)


def overlap_of(target: small_gicp.KdTree, points_target: Array, distance_m: float) -> float:
    """Share of `points_target` (N, 3) with a point of the tree nearer than `distance_m`."""
    _, squared = target.batch_knn_search(points_target, 1, num_threads=1)
    return float(np.mean(np.asarray(squared)[:, 0] <= distance_m**2))


def align(target: Surface, source: Surface, T_start: Array, distance_m: float, iterations: int) -> small_gicp.RegistrationResult:
    """GICP of `source` to `target` from `T_start` (4, 4), points matched up to `distance_m`; one thread, so that bits repeat."""
    return small_gicp.align(
        target.cloud,
        source.cloud,
        target.tree,
        T_start,
        registration_type="GICP",
        max_correspondence_distance=distance_m,
        num_threads=1,
        max_iterations=iterations,
        rotation_epsilon=1e-4,
        translation_epsilon=1e-4,
    )
