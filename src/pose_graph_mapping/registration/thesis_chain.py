"""The thesis's registration (5.4, figure 5.7): a chain of filters around point-to-plane ICP, as libpointmatcher builds it.

Data filters (sensor noise and range, density, normals), matcher (nearest neighbour), outlier filters (maximum distance, trimmed, angle of
normals), error minimiser (point to plane with covariance), transformation checkers (counter, differential). Behind `match_clouds`.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np
import small_gicp
from numpy.typing import NDArray

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import (
    NORMAL_NEIGHBOURS,
    PointCloud,
    moved_points,
    reference_cloud,
    voxel_downsample,
    with_normals,
)
from pose_graph_mapping.registration.explanation import own_noise
from pose_graph_mapping.registration.gicp import in_reach
from pose_graph_mapping.registration.gicp_surface import Surface, nearest, surface_of
from pose_graph_mapping.registration.match_quality import (
    Degeneracy,
    degeneracy,
    exp_motion,
    free_space_contradiction,
    keep_guess,
    match_covariance,
)
from pose_graph_mapping.registration.matching import MAX_ITERATIONS, MIN_POINTS, RegistrationResult, asked, refused
from pose_graph_mapping.registration.verdict import fit_of, judge
from rigid_geometry import rotation_angle

Array = NDArray[np.float64]

_LEAST_SIGMA_M, _BEAM_ANGLE_RAD, _BEAM_SIGMA_M = 0.018, 0.0006, 0.0015
"""Noise of a UTM-30LX: the footprint of the beam grows with the range, under a constant electronic floor."""
_TRIM_RATIO = 0.7  # share of nearest matches that are used
_MAX_DISTANCE_M = 1.0  # matches farther apart are outliers
_MAX_NORMAL_ANGLE_RAD = math.radians(50)  # matches whose normals differ by more are outliers
_MIN_TRANSLATION_M = 0.0005  # smaller mean steps end the iteration
_MIN_ROTATION_RAD = 0.0001  # if they turn less than this, too
_SMOOTH_LENGTH = 3  # number of steps in that mean


def sensor_noise(ranges_m: Array) -> Array:
    """(N,) standard deviation of measured points in metres, from their ranges."""
    return np.maximum(_LEAST_SIGMA_M, _BEAM_ANGLE_RAD * ranges_m + _BEAM_SIGMA_M)


@dataclass(frozen=True, eq=False)
class _Matches:
    """Pairs that the outlier filters left: points and normals of the reading's body frame, residuals in metres along the normals."""

    points_body: Array
    normals_body: Array
    residuals: Array
    sigmas: Array

    def jacobian(self) -> Array:
        """(N, 6) derivative of the residuals by a motion of the body (rotation, translation)."""
        return np.hstack([np.cross(self.points_body, self.normals_body), self.normals_body])


@dataclass(frozen=True, eq=False)
class _Pair:
    """Both clouds behind the data filters, and the reference before sweeps were averaged: free space needs true origins."""

    reference: PointCloud
    reading: PointCloud
    reference_sweeps: PointCloud
    is_guess_known: bool


class _Differential:
    """libpointmatcher's DifferentialTransformationChecker: the mean of the last steps is small enough."""

    def __init__(self) -> None:
        self._steps: deque[tuple[float, float]] = deque(maxlen=_SMOOTH_LENGTH)

    def satisfied(self, T_step: Array) -> bool:
        self._steps.append((float(np.linalg.norm(T_step[:3, 3])), rotation_angle(T_step)))
        if len(self._steps) < _SMOOTH_LENGTH:
            return False
        metres, radians = np.mean(self._steps, axis=0)
        return bool(metres < _MIN_TRANSLATION_M and radians < _MIN_ROTATION_RAD)


class ThesisChainRegistration:
    """Point-to-plane ICP with a trimmed set of matches; its verdict is the same as the default registration's."""

    def __init__(self, config: RegistrationConfig) -> None:
        self._config = config

    def match(
        self,
        reference: PointCloud,
        reading: PointCloud,
        T_reference_reading_guess: Array,
        guess_covariance: Array | None = None,
    ) -> RegistrationResult:
        """See `Registration.match`; filters both clouds alike, as the thesis does."""
        config, T_guess = self._config, asked(reference, reading, T_reference_reading_guess)
        seen = in_reach(reference, reading, T_guess, _MAX_DISTANCE_M)
        seen = reference_cloud(seen, config.voxel_m, NORMAL_NEIGHBOURS)
        filtered = _Pair(self._filtered(seen), self._filtered(reading), seen, guess_covariance is not None)
        sizes = len(filtered.reference), len(filtered.reading)
        if min(sizes) < MIN_POINTS:
            return refused(T_guess, f"{sizes[0]} reference and {sizes[1]} reading points after filtering, {MIN_POINTS} wanted")
        return self._iterated(filtered, T_guess)

    def _filtered(self, cloud: PointCloud) -> PointCloud:
        """Range, density and normals, in this order."""
        config = self._config
        if cloud.origins is not None:
            ranges = np.linalg.norm(cloud.points - cloud.origins, axis=1)
            cloud = cloud.selected((ranges >= config.chain_min_range_m) & (ranges <= config.chain_max_range_m))
        cloud = voxel_downsample(cloud, config.voxel_m)
        return with_normals(PointCloud(cloud.points, cloud.origins), NORMAL_NEIGHBOURS)

    def _iterated(self, clouds: _Pair, T_guess: Array) -> RegistrationResult:
        reference, reading = clouds.reference, clouds.reading
        tree = small_gicp.KdTree(reference.points, num_threads=1)
        checker, T, iterations = _Differential(), T_guess, 0
        matches = self._inliers(reference, reading, tree, T)
        while iterations < MAX_ITERATIONS and len(matches.residuals) >= MIN_POINTS // 2:
            iterations += 1
            jacobian, weight = matches.jacobian(), matches.sigmas**-2
            hessian = (jacobian * weight[:, None]).T @ jacobian
            motion = np.linalg.lstsq(hessian, jacobian.T @ (weight * matches.residuals), rcond=1e-9)[0]
            step = exp_motion(-np.asarray(motion, dtype=np.float64))
            T = T @ step
            matches = self._inliers(reference, reading, tree, T)
            if checker.satisfied(step):
                break
        if len(matches.residuals) < MIN_POINTS // 2:
            return refused(T_guess, f"{len(matches.residuals)} matches after the outlier filters")
        return self._judged(clouds, tree, matches, (T_guess, T), iterations)

    def _inliers(self, reference: PointCloud, reading: PointCloud, tree: small_gicp.KdTree, T: Array) -> _Matches:
        """Nearest neighbours that pass the outlier filters at `T`."""
        moved = moved_points(T, reading.points)
        assert reference.normals is not None and reading.normals is not None
        found, squared = tree.batch_knn_search(moved, 1, num_threads=1)
        index, squared = np.asarray(found)[:, 0].astype(np.int64), np.asarray(squared)[:, 0]
        normals = reference.normals[index]
        cosine = np.einsum("ij,ij->i", normals, reading.normals @ T[:3, :3].T)
        if reference.origins is None or reading.origins is None:
            cosine = np.abs(cosine)
        trimmed = np.quantile(squared, _TRIM_RATIO)
        kept = (squared <= min(trimmed, _MAX_DISTANCE_M**2)) & (cosine >= math.cos(_MAX_NORMAL_ANGLE_RAD))
        residuals = np.einsum("ij,ij->i", normals, moved - reference.points[index])[kept]
        ranges = np.linalg.norm(reading.points if reading.origins is None else reading.points - reading.origins, axis=1)
        return _Matches(reading.points[kept], normals[kept] @ T[:3, :3], residuals, sensor_noise(ranges[kept]))

    def _judged(
        self, clouds: _Pair, tree: small_gicp.KdTree, matches: _Matches, guess_and_match: tuple[Array, Array], iterations: int
    ) -> RegistrationResult:
        config, reference, reading = self._config, clouds.reference, clouds.reading
        jacobian = matches.jacobian()
        weak = degeneracy(jacobian.T @ jacobian, len(jacobian), reading.points, config.chain_degenerate_share)
        T = keep_guess(*guess_and_match, weak)
        covariance = match_covariance(_censi(jacobian, matches.sigmas, weak), weak, config)
        index, squared = nearest(tree, moved_points(T, reading.points))
        assert reference.normals is not None
        is_sided = reference.origins is not None and reading.origins is not None
        seen = Surface(reference.points, reference.normals, tree, is_sided)
        noise = own_noise(surface_of(reading), config).or_worse(own_noise(seen, config))
        fit = fit_of(reading.transformed(T), reference.points[index], reference.normals[index], squared, is_sided, noise)
        contradiction = free_space_contradiction(clouds.reference_sweeps, reading, T, config)
        ratio = len(jacobian) / len(reading)
        verdict, reason = judge(ratio, fit, contradiction, weak, config, clouds.is_guess_known)
        return RegistrationResult(T, covariance, ratio, fit.overlap, contradiction, iterations, weak.directions, verdict, reason)


def _censi(jacobian: Array, sigmas: Array, weak: Degeneracy) -> Array:
    """Censi's covariance (2007) of point-to-plane: noise of both points of a pair, along the normal; zero in the open directions."""
    hessian = (jacobian * sigmas[:, None] ** -2).T @ jacobian
    held = np.eye(6) - weak.directions.T @ weak.directions
    scaled = held @ (hessian / np.outer(weak.scale, weak.scale)) @ held
    return np.asarray(2.0 * np.linalg.pinv(scaled, rcond=1e-9, hermitian=True) / np.outer(weak.scale, weak.scale))
