"""Where a bundle lies: a maximum a posteriori estimate, with odometry as the prior.

Point to plane, robust weights, Gauss-Newton, over the pose and the error of the own surfaces. Two things keep its covariance true.
Points of one patch share an error, so that many of them count little more than one. And a direction in which the geometry does not hold
is told by the eigenvalues of the information in the whitened prior: there the prior stands (solution remapping, Zhang, Kaess and Singh
2016). What errors of the normals alone would tell of such a direction is taken off first (probabilistic degeneracy, Hatleskog and
Alexis 2024).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import skew
from scan_tracking.bundle import Bundle
from scan_tracking.config import ScanTrackingConfig
from scan_tracking.estimate import OWN, POSE, Estimate
from scan_tracking.local_map import LocalMap, Partners, cell_keys
from scan_tracking.pose_error import moved_by

Array = NDArray[np.float64]

_ROUNDS = 6
_STILL_M, _STILL_RAD = 2e-4, 1e-4  # a step that small ends the rounds
_MAP, _RELATIVE = np.eye(6, 12), np.eye(6, 12) - np.eye(6, 12, 6)  # what surfaces of the map, and own ones, tell of both errors
FACING_COS = 0.1  # least cosine of a surface's normal with the beam back: the other side of a wall is no partner
PATCH_M = 0.5  # edge of the cubes that patches are told by
_HALF_WEIGHT_M = 0.04  # distance to the surface at which a point counts half
NORMAL_SIGMA_RAD = 0.08  # error of the map's normals; what they alone would tell is taken off
MIN_POINTS = 20  # fewer partners are no match, and fewer new points no own surface


@dataclass(frozen=True, eq=False)
class Alignment:
    """The estimate at a bundle's end, `own_error` (6,) by which own surfaces are off at its pose, and how many points had partners.

    `refused`: why the prior stands, "" where it does not. `alone`: (K,) points without a partner.
    """

    estimate: Estimate
    own_error: Array
    partners: int
    alone: NDArray[np.intp]
    refused: str = ""

    def with_estimate(self, estimate: Estimate) -> "Alignment":
        """The same with another estimate."""
        return replace(self, estimate=estimate)


@dataclass(frozen=True, eq=False)
class _Information:
    """Of both errors: `matrix` (12, 12), the part `faked` (12, 12) that errors of normals give, `pull` (12,) minus the gradient."""

    matrix: Array
    faked: Array
    pull: Array

    def __add__(self, other: "_Information") -> "_Information":
        return _Information(self.matrix + other.matrix, self.faked + other.faked, self.pull + other.pull)


@dataclass(frozen=True, eq=False)
class _Pairs:
    """(K, 3) points, their beams back to the sensor, their partners' normals, and (K,) distances off these surfaces."""

    points: Array
    beams: Array
    normals: Array
    off: Array

    def chosen(self, which: NDArray[np.bool_]) -> "_Pairs":
        """Some of them."""
        return _Pairs(self.points[which], self.beams[which], self.normals[which], self.off[which])


def align(bundle: Bundle, mapped: LocalMap, own: LocalMap, prior: Estimate, config: ScanTrackingConfig) -> Alignment:
    """The bundle's place in surfaces of the map, and in own ones for points that have no partner there, from a prior that odometry made.

    When it is refused the prior comes back.
    """
    L = np.asarray(np.linalg.cholesky(prior.joint), np.float64)
    state, whitened, joint = np.zeros(12), np.zeros(12), prior.joint
    for _ in range(_ROUNDS):
        information, alone = _told(bundle, (mapped, own), prior, state, config)
        partners = len(bundle) - len(alone)
        if partners < MIN_POINTS:
            return Alignment(prior, np.zeros(6), partners, alone, f"{partners} of {len(bundle)} points have a partner in the map")
        whitened, joint = _posterior(information, L, state)
        before, state = state, L @ whitened
        step = np.abs(state - before)[POSE]
        if step[:3].max() < _STILL_M and step[3:].max() < _STILL_RAD:
            break
    sigmas = float(np.linalg.norm(whitened))
    if not sigmas <= config.most_sigmas:
        return Alignment(prior, np.zeros(6), partners, alone, f"a correction of {sigmas:.1f} sigmas of odometry")
    return Alignment(Estimate(moved_by(prior.T, state[POSE]), joint), state[OWN], partners, alone)


def _told(
    bundle: Bundle, surfaces: tuple[LocalMap, LocalMap], prior: Estimate, state: Array, config: ScanTrackingConfig
) -> tuple[_Information, NDArray[np.intp]]:
    """What the points tell at the prior with (12,) errors, and which of them have no partner."""
    (mapped, own), T = surfaces, moved_by(prior.T, state[POSE])
    points, beams = bundle.points @ T[:3, :3].T + T[:3, 3], (bundle.origins - bundle.points) @ T[:3, :3].T
    pairs, alone = _pairs(points, beams, np.arange(len(points)), mapped.partners(points, config.reach_m))
    told = _information(pairs, T[:3, 3], _MAP, prior.joint, config)
    if not len(own) or not len(alone):
        return told, alone
    back = moved_by(np.eye(4), -state[OWN])  # own surfaces stay where they are, and points go the other way
    shifted = (points[alone] - prior.T[:3, 3]) @ back[:3, :3].T + back[:3, 3] + prior.T[:3, 3]
    pairs, alone = _pairs(shifted, beams[alone], alone, own.partners(shifted, config.reach_m))
    return told + _information(pairs, T[:3, 3], _RELATIVE, prior.joint, config), alone


def _pairs(points: Array, beams: Array, numbers: NDArray[np.intp], found: Partners) -> tuple[_Pairs, NDArray[np.intp]]:
    """Points with a partner on the side that they were seen from, and the `numbers` of the others."""
    back = beams[found.which]
    facing = np.einsum("ij,ij->i", found.normals, back) > FACING_COS * np.linalg.norm(back, axis=1)
    which, normals = found.which[facing], found.normals[facing]
    off = np.einsum("ij,ij->i", normals, points[which] - found.points[facing])
    return _Pairs(points[which], back[facing], normals, off), np.delete(numbers, which)


def _information(pairs: _Pairs, centre: Array, tells: Array, joint: Array, config: ScanTrackingConfig) -> _Information:
    """What pairs tell of the (6,) error of a pose at `centre`, as `tells` (6, 12) spreads it over both errors of covariance `joint`.

    Pairs that lie farther off than the prior lets them are none: an edge is no part of the surface behind it.
    """
    rows = _rows(pairs, centre)
    known = np.einsum("ij,ij->i", rows @ (tells @ joint @ tells.T), rows)
    common = config.patch_sigma_m**2 + config.beam_sigma_rad**2 * _across(pairs)
    pairs = pairs.chosen(pairs.off**2 <= config.gate_sigmas**2 * (known + common + config.point_sigma_m**2))
    rows, weights, arms = _rows(pairs, centre), _weights(pairs, config), pairs.points - centre
    weighted = rows * weights[:, None]
    matrix = weighted.T @ rows
    faked = NORMAL_SIGMA_RAD**2 * (_all_around(arms, weights) - matrix)
    return _Information(tells.T @ matrix @ tells, tells.T @ faked @ tells, -tells.T @ (weighted.T @ pairs.off))


def _rows(pairs: _Pairs, centre: Array) -> Array:
    """(K, 6) how the distances grow with the error of a pose at `centre`."""
    return np.hstack([pairs.normals, np.cross(pairs.points - centre, pairs.normals)])


def _across(pairs: _Pairs) -> Array:
    """(K,) square of how far a point moves off its surface, in metres, when its beam turns by a radian."""
    along = np.einsum("ij,ij->i", pairs.beams, pairs.normals)
    return np.asarray(np.einsum("ij,ij->i", pairs.beams, pairs.beams) - along**2)


def _weights(pairs: _Pairs, config: ScanTrackingConfig) -> Array:
    """(K,) inverse variances: Cauchy's weight over what is a point's own error and its share of the patch's common one."""
    _, patch, counts = np.unique(cell_keys(pairs.points, PATCH_M), return_inverse=True, return_counts=True)
    common = config.patch_sigma_m**2 + config.beam_sigma_rad**2 * _across(pairs)
    variances = config.point_sigma_m**2 + counts[patch] * common
    return np.asarray(1.0 / (variances * (1.0 + (pairs.off / _HALF_WEIGHT_M) ** 2)))


def _all_around(arms: Array, weights: Array) -> Array:
    """(6, 6) the information of points whose distances are known along all axes."""
    total, first = float(weights.sum()), weights @ arms
    second = (arms * weights[:, None]).T @ arms
    matrix = np.zeros((6, 6))
    matrix[:3, :3], matrix[3:, :3] = total * np.eye(3), skew(first)
    matrix[:3, 3:] = matrix[3:, :3].T
    matrix[3:, 3:] = np.trace(second) * np.eye(3) - second
    return matrix


def _posterior(information: _Information, L: Array, state: Array) -> tuple[Array, Array]:
    """(12,) the estimate in units of the prior L L', and its (12, 12) covariance; `state`: where `information` was taken.

    Along each eigenvector of the whitened information counts what is left of it without the faked part, and as much of the pull.
    """
    values, axes = np.linalg.eigh(L.T @ information.matrix @ L)
    whitening = L @ axes
    faked = np.einsum("ij,ij->j", whitening, information.faked @ whitening)
    true = np.maximum(values - faked, 0.0)
    share = np.divide(true, values, out=np.zeros(len(values)), where=values > 0.0)
    here = np.linalg.solve(whitening, state)
    estimate = (true * here + share * (whitening.T @ information.pull)) / (1.0 + true)
    return axes @ estimate, np.asarray((whitening / (1.0 + true)) @ whitening.T)
