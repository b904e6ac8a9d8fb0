"""Default registration: GICP in two stages on voxel means, against the reference points that face the predicted sensor.

Behind `match_clouds`. A guess that is known well is refined directly. One that is not, or that leads nowhere, only centres a search: the
best placements are refined and judged alike, and two that explain the clouds equally well are told apart by the guess, or not at all.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import (
    NORMAL_NEIGHBOURS,
    PointCloud,
    farthest,
    moved_points,
    reference_cloud,
    vertex_cloud,
    within,
)
from pose_graph_mapping.registration.correlative import Window, window_of
from pose_graph_mapping.registration.explanation import OVERLAP_DISTANCE_M, agreeing_surfaces, least_explained, own_noise
from pose_graph_mapping.registration.gicp_alignment import Alignment, Stage, align
from pose_graph_mapping.registration.gicp_surface import Surface, nearest, surface_of, voxel_cloud
from pose_graph_mapping.registration.match_quality import (
    DEGENERATE_GUESS_SIGMA_M,
    FreeSpace,
    degeneracy,
    keep_guess,
    known_directions,
    match_covariance,
)
from pose_graph_mapping.registration.matching import MAX_ITERATIONS, MIN_POINTS, RegistrationResult, asked, refused
from pose_graph_mapping.registration.placement_search import (
    ROUGH_POINTS,
    SEARCH_REFINED,
    Pair,
    Rough,
    decided,
    is_found,
    is_worth_refining,
    rough_placements,
    same_place,
)
from pose_graph_mapping.registration.residual_pattern import pattern_covariance, residual_pattern
from pose_graph_mapping.registration.verdict import Explained, Fit, fit_of, judge, judged_despite_changes, least_surfaces, may_have_changed
from rigid_geometry import as_covariance, inverse, rotation_angle, translation_distance

Array = NDArray[np.float64]

_EARLY_PRECISION, _PRECISION = 1e-3, 1e-4  # metres and radians: a shorter step ends a stage
_LEAST_EARLY = 10  # points; fewer may leave the normal equations without a solution
_EARLY_POINTS = 4000  # points of the reading that are matched until all of them are, for the last iterations
_HALF_WEIGHT_M = 0.05  # distance across a surface at which a matched point counts half in the last iterations
_FACING_AWAY_COS = -0.1  # reference points whose normal makes a cosine below this with the sensor are left out
_COVARIANCE_SCALE = 0.5  # factor of the inverse Hessian


def sensor_of(cloud: PointCloud) -> Array | None:
    """(3,) mean of the beam origins; None where they are not known."""
    return None if cloud.origins is None or len(cloud) == 0 else np.asarray(cloud.origins.mean(axis=0))


def facing(reference: PointCloud, sensor: Array | None, least_cos: float) -> PointCloud:
    """The reference without points whose normal faces away from `sensor`: the far side of a thin wall pulls the near one."""
    if sensor is None or reference.normals is None or reference.origins is None:
        return reference
    return reference.selected(_faces(reference.points, reference.normals, sensor, least_cos))


@njit(cache=True)
def _faces(points: Array, normals: Array, sensor: Array, least_cos: float) -> NDArray[np.bool_]:
    """(N,) whether the normal makes a cosine of `least_cos` or more with the direction to the sensor."""
    found = np.empty(len(points), dtype=np.bool_)
    for i in range(len(points)):
        x, y, z = sensor[0] - points[i, 0], sensor[1] - points[i, 1], sensor[2] - points[i, 2]
        along = normals[i, 0] * x + normals[i, 1] * y + normals[i, 2] * z
        found[i] = along >= least_cos * math.sqrt(x * x + y * y + z * z)
    return found


def in_reach(reference: PointCloud, reading: PointCloud, T_guess: Array, margin_m: float) -> PointCloud:
    """The reference points that the reading could have seen from where it is thought to be."""
    return reference.selected(within(reference.points, T_guess[:3, 3], farthest(reading.points) + margin_m))


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
        config, T_guess = self._config, asked(reference, reading, T_reference_reading_guess)
        guess_covariance = None if guess_covariance is None else as_covariance(guess_covariance)
        reading = vertex_cloud(reading, config.voxel_m, NORMAL_NEIGHBOURS)
        window = window_of(guess_covariance, T_guess, config)
        result = self._matched(reference, reading, T_guess, guess_covariance, window)
        if guess_covariance is None and self._overlaps_little(result):
            wide = dataclasses.replace(window, shift_m=config.search_wide_m)
            result = self._matched(reference, reading, result.T_reference_reading, None, wide)
        return result

    def _overlaps_little(self, result: RegistrationResult) -> bool:
        """Whether a refused placement is one to ask again of, for it might only have wanted more overlap."""
        config = self._config
        is_free = result.free_space_contradiction <= config.max_contradiction
        return not result.usable and is_free and config.min_overlap <= result.overlap < config.min_overlap_unguided

    def _matched(
        self, reference: PointCloud, reading: PointCloud, T_guess: Array, guess_covariance: Array | None, window: Window
    ) -> RegistrationResult:
        """Directly, or by a search of the window."""
        config = self._config
        reference = in_reach(reference, reading, T_guess, window.shift_m + config.coarse_distance_m)
        reference = reference_cloud(reference, config.voxel_m, NORMAL_NEIGHBOURS)
        if min(len(reference), len(reading)) < MIN_POINTS:
            return refused(T_guess, f"{len(reference)} reference and {len(reading)} reading voxels in reach, {MIN_POINTS} wanted")
        free_space = FreeSpace(reference, reading, T_guess[:3, 3], config)
        covers_truth = guess_covariance is not None or window.shift_m >= config.search_wide_m
        noise = own_noise(surface_of(reading), config)
        pair = Pair(reference, reading, noise, free_space, T_guess, guess_covariance, window, covers_truth)
        direct = [] if window.is_wide() else [self._refined(pair, T_guess, config.coarse_distance_m)]
        return direct[0] if direct and direct[0].usable else self._searched(pair, window, direct)

    def _searched(self, pair: Pair, window: Window, before: list[RegistrationResult]) -> RegistrationResult:
        """The placement in `window` that explains the clouds, where there is one and the guess can tell it from its rivals.

        Where there is none, of these and of those `before` the one that explains them but for what has changed, or the first refusal.
        """
        config = self._config
        starts = rough_placements(pair, window, config)
        tried, found = list[RegistrationResult](), list[RegistrationResult]()
        for start in starts:
            if not is_worth_refining(start, starts[0], len(tried), found, config):
                continue
            result = self._refined(pair, start.T, None)
            tried.append(result)
            if result.usable and not any(is_found(other, result.T_reference_reading) for other in found):
                found.append(result)
        if found:
            return decided(found, pair.T_guess, pair.guess_covariance)
        return self._despite_changes(pair, [*tried, *before], starts) if tried else refused(pair.T_guess, "no placement within the search")

    def _despite_changes(self, pair: Pair, refusals: list[RegistrationResult], starts: list[Rough]) -> RegistrationResult:
        """Of refused placements the one that explains most, accepted if no other explains nearly as much; else refused with the reason."""
        config, is_guess_known = self._config, pair.guess_covariance is not None
        likely = [result for result in refusals if may_have_changed(result, is_guess_known, config)]
        if not likely:
            return refusals[0]
        explained = [self._explained(pair, result.T_reference_reading) for result in likely]
        best = int(np.argmax([of.reading for of in explained]))
        tells = explained[best].compared >= config.min_explained and explained[best].surfaces >= least_surfaces(config, is_guess_known)
        rival = self._most_of_rivals(pair, likely[best].T_reference_reading, starts) if tells else math.nan
        return judged_despite_changes(likely[best], explained[best], rival, is_guess_known, config)

    def _most_of_rivals(self, pair: Pair, T: Array, starts: list[Rough]) -> float:
        """The most of the reading that any placement but `T` explains: of `starts` where the guess allows no other, else near `T`."""
        config, around = self._config, pair
        if pair.guess_covariance is None:
            around = dataclasses.replace(pair, T_guess=T)
            starts = rough_placements(around, Window(config.search_shift_m, config.search_height_m, math.pi), config)
        rivals = [rough.T for rough in starts if not same_place(T, np.zeros((0, 6)), rough.T)][:SEARCH_REFINED]
        placed = [self._refined(around, start, None).T_reference_reading for start in rivals]
        return max((self._explained(pair, at).reading for at in placed if not same_place(T, np.zeros((0, 6)), at)), default=0.0)

    def _explained(self, pair: Pair, T: Array) -> Explained:
        """What the reading, placed by `T`, explains by its points on the reference that do not lie in space seen free."""
        fit, _, _ = self._fit(pair, self._target(pair, T), T)
        in_front = pair.free_space.in_reference_free_space(T)
        agrees, compared = fit.on_surface(self._config) & ~in_front, fit.level | in_front
        everything = np.ones(len(pair.reading), dtype=np.bool_)
        of_compared, of_reading = (least_explained(pair.reading, agrees, asked) for asked in (compared, everything))
        return Explained(of_compared, of_reading, agreeing_surfaces(pair.reading, agrees))

    def _refined(self, pair: Pair, T_start: Array, coarse_distance_m: float | None) -> RegistrationResult:
        """From `T_start`, with a coarse stage where it is given its distance; in directions that nothing holds the guess stands."""
        config = self._config
        target = self._target(pair, T_start)
        if len(target.points) < MIN_POINTS:
            return refused(pair.T_guess, f"{len(target.points)} reference voxels face the sensor, {MIN_POINTS} wanted")
        few, most, T, before = pair.reading.thinned(_EARLY_POINTS), MAX_ITERATIONS, T_start, 0
        if coarse_distance_m is not None:
            coarse = align(target, few, T, Stage(coarse_distance_m, most, _EARLY_PRECISION))
            T, before = coarse.T, coarse.iterations
        early = align(target, few, T, Stage(config.fine_distance_m, most, _EARLY_PRECISION))
        if early.inliers < _LEAST_EARLY:
            return refused(pair.T_guess, f"{early.inliers} of {len(few.points)} points within {config.fine_distance_m} m of each other")
        if pair.free_space.contradiction(early.T, ROUGH_POINTS) > config.max_changed:
            return self._judged(dataclasses.replace(pair, reading=few), target, early, before + early.iterations)
        last = Stage(config.fine_distance_m, max(1, most - early.iterations), _PRECISION, _HALF_WEIGHT_M)
        fine = align(target, pair.reading, early.T, last)
        if fine.inliers < MIN_POINTS // 2:
            return refused(pair.T_guess, f"{fine.inliers} points within {config.fine_distance_m} m of each other")
        return self._judged(pair, target, fine, before + early.iterations + fine.iterations)

    def _target(self, pair: Pair, T_start: Array) -> Surface:
        """What of the reference faces the reading's sensor, placed by `T_start`."""
        config, sensor = self._config, sensor_of(pair.reading)
        visible = facing(pair.reference, None if sensor is None else moved_points(T_start, sensor[None])[0], _FACING_AWAY_COS)
        return surface_of(voxel_cloud(visible, config.voxel_m, NORMAL_NEIGHBOURS))

    def _judged(self, pair: Pair, target: Surface, found: Alignment, iterations: int) -> RegistrationResult:
        config, points = self._config, pair.reading.points
        hessian = found.hessian
        weak = degeneracy(hessian, found.weight, points, config.degenerate_eigenvalue)
        known = known_directions(weak, pair.guess_covariance, DEGENERATE_GUESS_SIGMA_M)
        T = keep_guess(pair.T_guess, found.T, known)
        if pair.guess_covariance is not None and not pair.window.holds(pair.T_guess, T):
            metres, degrees = translation_distance(T, pair.T_guess), math.degrees(rotation_angle(inverse(pair.T_guess) @ T))
            return refused(pair.T_guess, f"placed {metres:.1f} m and {degrees:.0f} deg from the guess, where it says that the truth is not")
        fit, at, normals = self._fit(pair, target, T)
        bent = self._bend(pair, T, at, normals)
        covariance = match_covariance(_COVARIANCE_SCALE * np.linalg.inv(hessian) + bent, weak, config)
        contradiction = pair.free_space.contradiction(T)
        ratio = found.inliers / len(points)
        verdict, reason = judge(ratio, fit, contradiction, weak, config, pair.covers_truth)
        return RegistrationResult(T, covariance, ratio, fit.overlap, contradiction, iterations, weak.directions, verdict, reason)

    def _fit(self, pair: Pair, target: Surface, T: Array) -> tuple[Fit, Array, Array]:
        """How the reading lies on the reference, and (N, 3) its points there with their normals (N, 3)."""
        placed = pair.reading.transformed(T)
        index, squared = nearest(target.tree, placed.points)
        at, normals = target.points[index], target.normals[index]
        is_sided = target.is_sided and pair.reading.origins is not None
        noise = pair.noise.or_worse(own_noise(target, self._config))
        return fit_of(placed, at, normals, squared, is_sided, noise), at, normals

    def _bend(self, pair: Pair, T: Array, at: Array, normals: Array) -> Array:
        """(6, 6) covariance that what is left between a reading and the points (N, 3) nearest to it makes."""
        reading, sensor = pair.reading, sensor_of(pair.reading)
        near = np.linalg.norm(moved_points(T, reading.points) - at, axis=1) <= OVERLAP_DISTANCE_M
        if sensor is None or not near.any():
            return np.zeros((6, 6))
        pattern = residual_pattern(reading.points[near], sensor, T, at[near], normals[near])
        return np.zeros((6, 6)) if pattern is None else pattern_covariance(pattern, self._config)


def compile_kernels() -> None:
    """Compiles the kernel of this module for the types that a match passes."""
    one = np.zeros((1, 3))
    facing(PointCloud(one, one, one), np.zeros(3), 0.0)
