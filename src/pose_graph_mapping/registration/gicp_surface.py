"""Voxel means with normals as GICP needs them, and the search tree over those that are matched to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import small_gicp
from numpy.typing import NDArray

from pose_graph_mapping.registration.cloud import Array, PointCloud, voxel_downsample, with_normals


@dataclass(frozen=True, eq=False)
class Surface:
    """Points (N, 3) with unit normals (N, 3), zero where nobody knows them, and their search tree.

    is_sided: whether the normals point to the side that was seen.
    """

    points: Array
    normals: Array
    tree: small_gicp.KdTree
    is_sided: bool


def surface_of(cloud: PointCloud) -> Surface:
    """The surface of a cloud that has normals."""
    assert cloud.normals is not None
    return Surface(cloud.points, cloud.normals, small_gicp.KdTree(cloud.points, num_threads=1), cloud.origins is not None)


def voxel_cloud(cloud: PointCloud, voxel_m: float, neighbours: int) -> PointCloud:
    """Voxel means with normals: the mean of those that are turned to a sensor; others, which may cancel out, are estimated anew."""
    is_sided = cloud.origins is not None and cloud.normals is not None
    means = voxel_downsample(cloud if is_sided else PointCloud(cloud.points), voxel_m)
    return means if is_sided else with_normals(means, neighbours)


def nearest(tree: small_gicp.KdTree, points: Array) -> tuple[NDArray[np.uint64], Array]:
    """(N,) indices of the tree's points nearest to points (N, 3), and (N,) squared distances."""
    index, squared = tree.batch_knn_search(points, 1, num_threads=1)
    return index[:, 0], squared[:, 0]


def overlap_of(target: small_gicp.KdTree, points_target: Array, distance_m: float) -> float:
    """Share of `points_target` (N, 3) with a point of the tree nearer than `distance_m`."""
    return float(np.mean(nearest(target, points_target)[1] <= distance_m**2))
