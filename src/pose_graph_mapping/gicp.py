"""Default registration: GICP in two stages on voxel means, against the reference points that face the predicted sensor.

Behind `match_clouds`. A guess that is known well is refined directly. One that is not, or that leads nowhere, only centres a search: the
best placements are refined and judged alike, and two that explain the clouds equally well are told apart by the guess, or not at all.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import small_gicp
from numpy.typing import NDArray

from pose_graph_mapping.cloud import NORMAL_THREADS, PointCloud, moved_points, reference_cloud, voxel_downsample
from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.correlative import Window, coarse_placements, window_of
from pose_graph_mapping.match_quality import FreeSpace, degeneracy, judge, keep_guess, match_covariance, offset_between
from pose_graph_mapping.registration import RegistrationResult, Verdict, refused
from rigid_geometry import as_transform

Array = NDArray[np.float64]

_ROUGH_POINTS = 5000
_CHOOSING_ODDS = 13.8  # a likelihood ratio of 1000, as a difference of squared Mahalanobis distances


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

    @property
    def normals(self) -> Array:
        return np.asarray(self.cloud.normals())[:, :3]


def _surface(points: Array, neighbours: int) -> _Surface:
    cloud = small_gicp.PointCloud(points)
    tree = small_gicp.KdTree(cloud, num_threads=1)
    small_gicp.estimate_normals_covariances(cloud, tree, num_neighbors=neighbours, num_threads=NORMAL_THREADS)
    return _Surface(points, cloud, tree)


def overlap_of(target: small_gicp.KdTree, points_target: Array, distance_m: float) -> float:
    """Share of `points_target` (N, 3) with a point of the tree nearer than `distance_m`."""
    _, squared = target.batch_knn_search(points_target, 1, num_threads=1)
    return float(np.mean(np.asarray(squared)[:, 0] <= distance_m**2))


@dataclass(frozen=True, eq=False)
class _Pair:
    """What every placement of one match shares."""

    reference: PointCloud
    reading: PointCloud
    source: _Surface
    free_space: FreeSpace
    T_guess: Array


@dataclass(frozen=True, eq=False)
class _Rough:
    """A placement after its first refinement on coarse clouds."""

    T: Array
    overlap: float
    contradiction: float


class GicpRegistration:
    """Generalised ICP (Segal et al., 2009) with solution remapping (Zhang et al., 2016), a coarse search and a free-space verdict."""

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
        window = window_of(guess_covariance, T_guess, config)
        reading = voxel_downsample(reading, config.voxel_m)
        reference = in_reach(reference, reading, T_guess, window.shift_m + config.coarse_distance_m)
        reference = reference_cloud(reference, config.voxel_m, config.normal_neighbours)
        if min(len(reference), len(reading)) < config.min_points:
            return refused(T_guess, f"{len(reference)} reference and {len(reading)} reading voxels in reach, {config.min_points} wanted")
        source = _surface(reading.points, config.normal_neighbours)
        reading = dataclasses.replace(reading, normals=source.normals)
        pair = _Pair(reference, reading, source, FreeSpace(reference, reading, T_guess[:3, 3], config), T_guess)
        if window.is_wide(config):
            return self._searched(pair, window, guess_covariance)
        direct = self._refined(pair, T_guess, config.coarse_distance_m)
        return direct if direct.usable else self._searched(pair, window, guess_covariance)

    def _searched(self, pair: _Pair, window: Window, guess_covariance: Array | None) -> RegistrationResult:
        """The placement in `window` that explains the clouds, where there is one and the guess can tell it from its rivals."""
        config = self._config
        starts = self._roughly(pair, coarse_placements(pair.reference, pair.reading, pair.T_guess, window, config))
        tried, found = 0, list[RegistrationResult]()
        first = refused(pair.T_guess, "no placement within the search")
        for start in starts:
            if not self._is_worth_refining(start, starts[0], tried, found):
                continue
            result = self._refined(pair, start.T, None)
            tried += 1
            if result.usable and not any(_same(other, result.T_reference_reading, config) for other in found):
                found.append(result)
            first = result if tried == 1 else first
        return _decided(found, pair.T_guess, guess_covariance) if found else first

    def _roughly(self, pair: _Pair, placements: Array) -> list[_Rough]:
        """The placements refined on coarse clouds, each place once; those that free space allows first, then by overlap."""
        config = self._config
        source = _surface(voxel_downsample(PointCloud(pair.reading.points), config.search_refine_voxel_m).points, config.normal_neighbours)
        target = _surface(
            voxel_downsample(PointCloud(pair.reference.points), config.search_refine_voxel_m).points, config.normal_neighbours
        )
        places = list[_Rough]()
        for T_start in placements:
            T = np.asarray(self._align(target, source, T_start, config.coarse_distance_m, config.search_iterations).T_target_source)
            if any(_near(offset_between(other.T, T), config) for other in places):
                continue
            overlap = overlap_of(target.tree, moved_points(T, source.points), config.search_refine_voxel_m)
            places.append(_Rough(T, overlap, pair.free_space.contradiction(T, _ROUGH_POINTS)))
        return sorted(places, key=lambda rough: (not rough.contradiction <= config.search_max_contradiction, -rough.overlap))

    def _is_worth_refining(self, rough: _Rough, best: _Rough, tried: int, found: Sequence[RegistrationResult]) -> bool:
        """The first always; then what is not hopeless, nor found already, and, once there is one, only what may rival it."""
        config = self._config
        if tried == 0:
            return True
        if tried == config.search_refined or not rough.contradiction <= config.search_hopeless_contradiction:
            return False
        if any(_same(other, rough.T, config) for other in found):
            return False
        may_rival = rough.contradiction <= config.search_max_contradiction and rough.overlap >= config.search_rival_share * best.overlap
        return may_rival or not found

    def _refined(self, pair: _Pair, T_start: Array, coarse_distance_m: float | None) -> RegistrationResult:
        """From `T_start`, with a coarse stage where it is given its distance; in directions that nothing holds the guess stands."""
        config = self._config
        sensor = sensor_of(pair.reading)
        visible = facing(pair.reference, None if sensor is None else moved_points(T_start, sensor[None])[0], config.facing_away_cos)
        points = voxel_downsample(PointCloud(visible.points), config.voxel_m).points
        if len(points) < config.min_points:
            return refused(pair.T_guess, f"{len(points)} reference voxels face the sensor, {config.min_points} wanted")
        target = _surface(points, config.normal_neighbours)
        iterations = 0
        if coarse_distance_m is not None:
            coarse = self._align(target, pair.source, T_start, coarse_distance_m, config.max_iterations)
            T_start, iterations = np.asarray(coarse.T_target_source), coarse.iterations
        fine = self._align(target, pair.source, T_start, config.fine_distance_m, config.max_iterations)
        if fine.num_inliers < config.min_points // 2:
            return refused(pair.T_guess, f"{fine.num_inliers} points within {config.fine_distance_m} m of each other")
        return self._judged(pair, target, fine, iterations + fine.iterations)

    def _align(self, target: _Surface, source: _Surface, T_start: Array, distance_m: float, most: int) -> small_gicp.RegistrationResult:
        return small_gicp.align(
            target.cloud,
            source.cloud,
            target.tree,
            T_start,
            registration_type="GICP",
            max_correspondence_distance=distance_m,
            num_threads=1,
            max_iterations=most,
            rotation_epsilon=1e-4,
            translation_epsilon=1e-4,
        )

    def _judged(self, pair: _Pair, target: _Surface, found: small_gicp.RegistrationResult, iterations: int) -> RegistrationResult:
        config, points = self._config, pair.reading.points
        hessian, inliers = np.asarray(found.H), int(found.num_inliers)
        weak = degeneracy(hessian, inliers, points, config.degenerate_eigenvalue)
        T = keep_guess(pair.T_guess, np.asarray(found.T_target_source), weak)
        covariance = match_covariance(config.covariance_scale * np.linalg.inv(hessian), weak, config)
        overlap = overlap_of(target.tree, moved_points(T, points), config.overlap_distance_m)
        contradiction = pair.free_space.contradiction(T)
        ratio = inliers / len(points)
        verdict, reason = judge(ratio, overlap, contradiction, weak, config)
        return RegistrationResult(T, covariance, ratio, overlap, contradiction, iterations, weak.directions, verdict, reason)


def _near(offset: Array, config: RegistrationConfig) -> bool:
    return bool(np.linalg.norm(offset[:3]) <= config.search_apart_rad and np.linalg.norm(offset[3:]) <= config.search_apart_m)


def _same(found: RegistrationResult, T: Array, config: RegistrationConfig) -> bool:
    """Whether `T` is the place of `found`, or slid from it along directions that the clouds do not hold."""
    offset = offset_between(found.T_reference_reading, T)
    weak = found.degenerate_directions
    if len(weak):
        turning = np.abs(weak[:, :3]).max() > 0.5
        offset[3:] -= weak[:, 3:].T @ (weak[:, 3:] @ offset[3:])
        offset[:3] *= not turning
    return _near(offset, config)


def _decided(found: Sequence[RegistrationResult], T_guess: Array, guess_covariance: Array | None) -> RegistrationResult:
    """The one placement, or the one that the guess makes far likelier than its rivals; else the best with verdict ambiguous."""
    if len(found) == 1:
        return found[0]
    rivals = np.array([result.T_reference_reading for result in found])
    if guess_covariance is not None:
        information = np.linalg.inv(guess_covariance)
        offsets = [offset_between(T_guess, T) for T in rivals]
        odds = np.array([offset @ information @ offset for offset in offsets])
        nearest, second = np.argsort(odds, kind="stable")[:2]
        if odds[second] - odds[nearest] >= _CHOOSING_ODDS:
            chosen = found[int(nearest)]
            return dataclasses.replace(chosen, reason=f"{chosen.reason}; of {len(found)} placements the guess chose this")
    others = offset_between(rivals[0], rivals[1])
    apart = f"{np.linalg.norm(others[3:]):.1f} m and {np.degrees(np.linalg.norm(others[:3])):.0f} deg apart"
    reason = f"{len(found)} placements explain the clouds equally well, the first two {apart}"
    return dataclasses.replace(found[0], verdict=Verdict.AMBIGUOUS, reason=reason, rivals=rivals[1:])
