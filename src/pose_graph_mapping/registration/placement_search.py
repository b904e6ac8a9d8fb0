"""Placements far from the guess: each refined roughly, ranked, and, where several are left, told apart by the guess or not at all.

Between the correlation, which says where to look, and GICP, which places and judges.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import NORMAL_NEIGHBOURS, Array, PointCloud, moved_points
from pose_graph_mapping.registration.correlative import SEARCH_APART_M, SEARCH_APART_RAD, SEARCH_CELL_M, Window, coarse_placements
from pose_graph_mapping.registration.explanation import Noise
from pose_graph_mapping.registration.gicp_alignment import Stage, align
from pose_graph_mapping.registration.gicp_surface import Surface, overlap_of, surface_of, voxel_cloud
from pose_graph_mapping.registration.match_quality import (
    DEGENERATE_GUESS_SIGMA_M,
    Degeneracy,
    FreeSpace,
    degeneracy,
    known_directions,
    offset_between,
)
from pose_graph_mapping.registration.matching import RegistrationResult, Verdict

ROUGH_POINTS = 5000
_PRECISION = 1e-3  # metres and radians: a shorter step ends the refinement of a rough placement
_CHOOSING_ODDS = 13.8  # a likelihood ratio of 1000, as a difference of squared Mahalanobis distances
_IDENTICAL = 0.05  # metres, and radians nearly
_MAINLY = 0.7  # share of a unit direction that makes it one of translation, or of rotation
_EQUALLY_WELL = 0.004  # a placement that free space contradicts by so much more is no rival
_ALIKE = 0.002  # contradictions that differ by less say the same
_SEARCH_REFINE_VOXEL_M = 0.4  # voxels of the first refinement of a placement
_SEARCH_REFINE_POINTS = 1500  # most points of the reading in it
_SEARCH_ITERATIONS = 12  # most iterations of it
SEARCH_REFINED = 4  # most placements that are refined in full
_SEARCH_MAX_CONTRADICTION = 0.015  # points in free space above which a rough placement comes last
_SEARCH_RIVAL_SHARE = 0.4  # share of the best overlap that makes a rival


@dataclass(frozen=True, eq=False)
class Pair:
    """What every placement of one match shares; the reading has normals and shows `noise`; the answer lies in `window`, if nowhere else
    because the guess says so. `covers_truth` as `judge` asks it.
    """

    reference: PointCloud
    reading: PointCloud
    noise: Noise
    free_space: FreeSpace
    T_guess: Array
    guess_covariance: Array | None
    window: Window
    covers_truth: bool


@dataclass(frozen=True, eq=False)
class Rough:
    """A placement after its first refinement on coarse clouds; open_directions (K, 6) as in `RegistrationResult`."""

    T: Array
    overlap: float
    contradiction: float
    open_directions: Array


@dataclass(frozen=True, eq=False)
class _RoughSearch:
    """Coarse clouds of a pair, and the places that they were laid at so far, each once."""

    pair: Pair
    window: Window
    config: RegistrationConfig
    target: Surface
    source: PointCloud
    places: list[Rough]

    def look_at(self, T_start: Array) -> None:
        """Refine a placement; it becomes a place of its own, or takes that of a worse one of the same place."""
        pair, config = self.pair, self.config
        found = align(self.target, self.source, T_start, Stage(config.coarse_distance_m, _SEARCH_ITERATIONS, _PRECISION))
        twin = next((k for k, place in enumerate(self.places) if same_place(place.T, place.open_directions, found.T)), None)
        if twin is not None and _is_no_better(found.T, self._overlap(found.T), self.places[twin], pair):
            return
        weak = degeneracy(found.hessian, max(1.0, found.weight), self.source.points, config.degenerate_eigenvalue)
        T = _slid(found.T, weak, pair, self.window)
        rough = Rough(T, self._overlap(T), pair.free_space.contradiction(T, ROUGH_POINTS), weak.directions)
        if twin is None:
            self.places.append(rough)
        else:
            self.places[twin] = rough

    def _overlap(self, T: Array) -> float:
        return overlap_of(self.target.tree, moved_points(T, self.source.points), _SEARCH_REFINE_VOXEL_M)


def rough_placements(pair: Pair, window: Window, config: RegistrationConfig) -> list[Rough]:
    """Where the reading may lie within the window, each place once; those that free space allows first, then by overlap."""
    voxel_m, neighbours = _SEARCH_REFINE_VOXEL_M, NORMAL_NEIGHBOURS
    target = surface_of(voxel_cloud(PointCloud(pair.reference.points), voxel_m, neighbours))
    source = voxel_cloud(pair.reading, voxel_m, neighbours).thinned(_SEARCH_REFINE_POINTS)
    search = _RoughSearch(pair, window, config, target, source, [])
    likely, more = coarse_placements(pair.reference, pair.reading, pair.T_guess, window, config)
    for T_start in (pair.T_guess, *likely):  # where little overlaps, as through a door, the guess may still be the best start
        search.look_at(T_start)
    if not any(place.contradiction <= _SEARCH_MAX_CONTRADICTION for place in search.places):
        for T_start in more:
            search.look_at(T_start)
    return sorted(search.places, key=lambda rough: (not rough.contradiction <= _SEARCH_MAX_CONTRADICTION, -rough.overlap))


def _is_no_better(T: Array, overlap: float, place: Rough, pair: Pair) -> bool:
    """Whether a placement of the same place as one before need not be looked at; one that hardly overlaps is never the better one."""
    if np.abs(place.T - T).max() < _IDENTICAL:
        return True
    if place.overlap < _SEARCH_RIVAL_SHARE * overlap:
        return False
    return not pair.free_space.contradiction(T, ROUGH_POINTS) < place.contradiction


def _slid(T: Array, weak: Degeneracy, pair: Pair, window: Window) -> Array:
    """Along the one direction that surfaces leave open, as in a corridor, free space may still tell: where it objects least.

    The nearest to the guess where it says the same everywhere; a guess that knows the direction is let alone.
    """
    along = Degeneracy(weak.scale, weak.directions[np.linalg.norm(weak.directions[:, 3:], axis=1) > _MAINLY])
    known = known_directions(along, pair.guess_covariance, DEGENERATE_GUESS_SIGMA_M)
    if len(along.directions) != 1 or len(known.directions):
        return T
    axis = T[:3, :3] @ along.directions[0, 3:] / np.linalg.norm(along.directions[0, 3:])
    cell = SEARCH_CELL_M
    rough = _least_contradicted(T, axis, np.arange(-2.0 * window.shift_m, 2.0 * window.shift_m + cell, cell), pair, window.shift_m + cell)
    return _least_contradicted(rough, axis, np.linspace(-cell, cell, 7), pair, window.shift_m + cell)


def _least_contradicted(T: Array, axis: Array, shifts: Array, pair: Pair, reach_m: float) -> Array:
    """Of `T` shifted along an axis (3,) the placement within reach of the guess that free space objects to least."""
    origins = T[:3, 3] + shifts[:, None] * axis
    away = np.linalg.norm(origins - pair.T_guess[:3, 3], axis=1)
    origins, away = origins[away <= reach_m], away[away <= reach_m]
    if not len(origins):
        return T
    placements = np.tile(T, (len(origins), 1, 1))
    placements[:, :3, 3] = origins
    against = np.array([pair.free_space.contradiction(placement, ROUGH_POINTS) for placement in placements])
    against = np.where(np.isnan(against), 1.0, against)
    alike = np.flatnonzero(against <= against.min() + _ALIKE)
    return np.asarray(placements[alike[np.argmin(away[alike])]])


def is_worth_refining(rough: Rough, best: Rough, tried: int, found: Sequence[RegistrationResult], config: RegistrationConfig) -> bool:
    """The first always; then what is not hopeless, nor found already, and, once there is one, only what may rival it."""
    if tried == 0:
        return True
    if tried == SEARCH_REFINED or not rough.contradiction <= config.max_changed:
        return False
    if any(is_found(result, rough.T) for result in found):
        return False
    may_rival = rough.contradiction <= _SEARCH_MAX_CONTRADICTION and rough.overlap >= _SEARCH_RIVAL_SHARE * best.overlap
    return may_rival or not found


def is_found(result: RegistrationResult, T: Array) -> bool:
    """Whether `T` is the place of a result."""
    return same_place(result.T_reference_reading, result.degenerate_directions, T)


def same_place(T_known: Array, open_directions: Array, T: Array) -> bool:
    """Whether `T` is `T_known`, or slid from it along directions that the clouds do not hold."""
    offset = offset_between(T_known, T)
    for direction in open_directions:
        for part in (slice(0, 3), slice(3, 6)):
            length = np.linalg.norm(direction[part])
            if length > _MAINLY:
                axis = direction[part] / length
                offset[part] -= axis * (axis @ offset[part])
    return bool(np.linalg.norm(offset[:3]) <= SEARCH_APART_RAD and np.linalg.norm(offset[3:]) <= SEARCH_APART_M)


def decided(found: Sequence[RegistrationResult], T_guess: Array, guess_covariance: Array | None) -> RegistrationResult:
    """The one placement, or the one that the guess makes far likelier than its rivals; else the best with verdict ambiguous."""
    against = np.array([result.free_space_contradiction for result in found])
    known = against[np.isfinite(against)]  # without beam origins free space says nothing, and only a judge of match ratios accepts
    found = [result for result, share in zip(found, against, strict=True) if not (known.size and share > known.min() + _EQUALLY_WELL)]
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
