"""Default registration: GICP in two stages on voxel means, against the reference points that face the predicted sensor.

Behind `match_clouds`. When the direct match is refused, several headings around the guess are tried on coarse clouds, the
best one is refined and judged again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import small_gicp
from numpy.typing import NDArray

from pose_graph_mapping.cloud import NORMAL_THREADS, PointCloud, moved_points, reference_cloud, voxel_downsample
from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.match_quality import degeneracy, free_space_contradiction, judge, keep_guess, match_covariance
from pose_graph_mapping.registration import RegistrationResult, Verdict, refused
from rigid_geometry import as_transform, transform_from_rpy

Array = NDArray[np.float64]


def sensor_of(cloud: PointCloud) -> Array | None:
    """(3,) mean of the beam origins; None where they are not known."""
    return None if cloud.origins is None or len(cloud) == 0 else np.asarray(cloud.origins.mean(axis=0))


def facing(reference: PointCloud, sensor: Array | None, least_cos: float) -> PointCloud:
    """The reference without points whose normal faces away from `sensor`: the far side of a thin wall pulls the near one."""
    if sensor is None or reference.normals is None or reference.origins is None:
        return reference
    to_sensor = sensor - reference.points
    cosine = np.einsum("ij,ij->i", reference.normals, to_sensor) / np.maximum(np.linalg.norm(to_sensor, axis=1), 1e-9)
    return reference.selected(cosine >= least_cos)


def in_reach(reference: PointCloud, reading: PointCloud, T_guess: Array, margin_m: float) -> PointCloud:
    """The reference points that the reading could have seen from where it is thought to be."""
    reach = float(np.linalg.norm(reading.points, axis=1).max()) + margin_m
    return reference.selected(np.linalg.norm(reference.points - T_guess[:3, 3], axis=1) <= reach)


@dataclass(frozen=True, eq=False)
class _Surface:
    """Voxel means with GICP's covariances and their search tree."""

    points: Array
    cloud: small_gicp.PointCloud
    tree: small_gicp.KdTree


def _surface(points: Array, neighbours: int) -> _Surface:
    cloud = small_gicp.PointCloud(points)
    tree = small_gicp.KdTree(cloud, num_threads=1)
    small_gicp.estimate_normals_covariances(cloud, tree, num_neighbors=neighbours, num_threads=NORMAL_THREADS)
    return _Surface(points, cloud, tree)


def overlap_of(target: small_gicp.KdTree, points_target: Array, distance_m: float) -> float:
    """Share of `points_target` (N, 3) with a point of the tree nearer than `distance_m`."""
    _, squared = target.batch_knn_search(points_target, 1, num_threads=1)
    return float(np.mean(np.asarray(squared)[:, 0] <= distance_m**2))


class GicpRegistration:
    """Generalised ICP (Segal et al., 2009) with solution remapping (Zhang et al., 2016) and a free-space verdict."""

    def __init__(self, config: RegistrationConfig) -> None:
        self._config = config

    def match(
        self,
        reference: PointCloud,
        reading: PointCloud,
        T_reference_reading_guess: Array,
        guess_covariance: Array | None = None,
    ) -> RegistrationResult:
        """See `Registration.match`; voxel means are made here, so clouds of any density may come."""
        config, T_guess = self._config, as_transform(T_reference_reading_guess)
        if len(reference) == 0 or len(reading) == 0:
            raise ValueError(f"clouds to match must hold points: reference has {len(reference)}, reading {len(reading)}")
        reading = voxel_downsample(reading, config.voxel_m)
        reference = in_reach(reference, reading, T_guess, config.yaw_start_distance_m)
        reference = reference_cloud(reference, config.voxel_m, config.normal_neighbours)
        if min(len(reference), len(reading)) < config.min_points:
            return refused(T_guess, f"{len(reference)} reference and {len(reading)} reading voxels in reach, {config.min_points} wanted")
        source = _surface(reading.points, config.normal_neighbours)
        direct = self._refined(reference, reading, source, T_guess, T_guess)
        if direct.verdict is not Verdict.REFUSED or not config.yaw_starts_rad:
            return direct
        widened = self._refined(reference, reading, source, self._best_heading(reference, reading, T_guess), T_guess)
        return direct if widened.verdict is Verdict.REFUSED else widened

    def _refined(self, reference: PointCloud, reading: PointCloud, source: _Surface, T_start: Array, T_guess: Array) -> RegistrationResult:
        """Both stages from `T_start`; in directions that nothing holds `T_guess` stands."""
        config = self._config
        sensor = sensor_of(reading)
        visible = facing(reference, None if sensor is None else moved_points(T_start, sensor[None])[0], config.facing_away_cos)
        points = voxel_downsample(PointCloud(visible.points), config.voxel_m).points
        if len(points) < config.min_points:
            return refused(T_guess, f"{len(points)} reference voxels face the sensor, {config.min_points} wanted")
        target = _surface(points, config.normal_neighbours)
        coarse = self._align(target, source, T_start, config.coarse_distance_m)
        fine = self._align(target, source, coarse.T_target_source, config.fine_distance_m)
        if fine.num_inliers < config.min_points // 2:
            return refused(T_guess, f"{fine.num_inliers} points within {config.fine_distance_m} m of each other")
        return self._judged(reference, reading, target, fine, coarse.iterations + fine.iterations, T_guess)

    def _align(self, target: _Surface, source: _Surface, T_start: Array, distance_m: float) -> small_gicp.RegistrationResult:
        return small_gicp.align(
            target.cloud,
            source.cloud,
            target.tree,
            T_start,
            registration_type="GICP",
            max_correspondence_distance=distance_m,
            num_threads=1,
            max_iterations=self._config.max_iterations,
            rotation_epsilon=1e-4,
            translation_epsilon=1e-4,
        )

    def _judged(
        self,
        reference: PointCloud,
        reading: PointCloud,
        target: _Surface,
        found: small_gicp.RegistrationResult,
        iterations: int,
        T_guess: Array,
    ) -> RegistrationResult:
        config = self._config
        hessian, inliers = np.asarray(found.H), int(found.num_inliers)
        weak = degeneracy(hessian, inliers, reading.points, config.degenerate_eigenvalue)
        T = keep_guess(T_guess, np.asarray(found.T_target_source), weak)
        covariance = match_covariance(config.covariance_scale * np.linalg.inv(hessian), weak, config)
        overlap = overlap_of(target.tree, moved_points(T, reading.points), config.overlap_distance_m)
        contradiction = free_space_contradiction(reference, reading, T, config)
        ratio = inliers / len(reading)
        verdict, reason = judge(ratio, overlap, contradiction, weak, config)
        return RegistrationResult(T, covariance, ratio, overlap, contradiction, iterations, weak.directions, verdict, reason)

    def _best_heading(self, reference: PointCloud, reading: PointCloud, T_guess: Array) -> Array:
        """Of the coarse matches from `yaw_starts_rad` the one with the most overlap."""
        config = self._config
        source = _surface(voxel_downsample(reading, config.yaw_start_voxel_m).points, config.normal_neighbours)
        target = _surface(voxel_downsample(reference, config.yaw_start_voxel_m).points, config.normal_neighbours)
        best, T_best = -1.0, T_guess
        for yaw in config.yaw_starts_rad:
            T_start = T_guess @ transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw))
            T = np.asarray(self._align(target, source, T_start, config.yaw_start_distance_m).T_target_source)
            share = overlap_of(target.tree, moved_points(T, source.points), config.yaw_start_voxel_m)
            if share > best:
                best, T_best = share, T
        return T_best
