"""Where a bundle lies in the map: a maximum a posteriori estimate of six dimensions, with odometry as the prior.

Point to plane, robust weights, Gauss-Newton. Two things keep its covariance true. Points of one patch share an error, so that many of
them count little more than one. And a direction in which the geometry does not hold is told by the eigenvalues of the information in
the whitened prior: there the prior stands (solution remapping, Zhang, Kaess and Singh 2016). What errors of the normals alone would
tell of such a direction is taken off first (probabilistic degeneracy, Hatleskog and Alexis 2024).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scan_tracking.bundle import Bundle
from scan_tracking.config import ScanTrackingConfig
from scan_tracking.local_map import LocalMap, cell_keys
from scan_tracking.pose_error import error_between, moved_by, skew

Array = NDArray[np.float64]

_ROUNDS = 6
_COARSE_ROUNDS = 2  # with the whole reach, and robust weights that bend later
_LATER = 2.0 / 3.0  # of the reach
_STILL_M, _STILL_RAD = 2e-4, 1e-4  # a step that small ends the rounds


@dataclass(frozen=True, eq=False)
class Alignment:
    """The pose (4, 4) and its covariance (6, 6), of as many partners; `refused`: why the prior stands, "" where it does not."""

    T: Array
    covariance: Array
    partners: int
    refused: str = ""


@dataclass(frozen=True, eq=False)
class _Information:
    """Of a pose's error: `matrix` (6, 6), the part `faked` (6, 6) that errors of normals give, `pull` (6,) minus the gradient."""

    matrix: Array
    faked: Array
    pull: Array


def align(bundle: Bundle, surfaces: LocalMap, T_prior: Array, covariance: Array, config: ScanTrackingConfig) -> Alignment:
    """The bundle's pose in the map's frame, from a prior with its (6, 6) covariance of `pose_error`'s kind.

    When it is refused the prior comes back, and nothing is not finite.
    """
    L = np.asarray(np.linalg.cholesky(covariance), np.float64)
    T, whitened, after = T_prior, np.zeros(6), covariance
    count = 0
    for k in range(_ROUNDS):
        coarse = k < _COARSE_ROUNDS
        information, count = _information(bundle, surfaces, T, config, coarse)
        if count < config.min_points:
            return Alignment(T_prior, covariance, count, f"{count} of {len(bundle)} points have a partner in the map")
        whitened, after = _posterior(information, L, error_between(T_prior, T))
        step, T = T, moved_by(T_prior, L @ whitened)
        moved = np.abs(error_between(step, T))
        if not coarse and moved[:3].max() < _STILL_M and moved[3:].max() < _STILL_RAD:
            break
    sigmas = float(np.linalg.norm(whitened))
    if not sigmas <= config.most_sigmas:
        return Alignment(T_prior, covariance, count, f"a correction of {sigmas:.1f} sigmas of odometry")
    return Alignment(T, after, count)


def _information(bundle: Bundle, surfaces: LocalMap, T: Array, config: ScanTrackingConfig, coarse: bool) -> tuple[_Information, int]:
    """What the points tell at a pose, and how many of them have a partner on the right side."""
    points = bundle.points @ T[:3, :3].T + T[:3, 3]
    found = surfaces.partners(points, config.reach_m * (1.0 if coarse else _LATER))
    points, beams = points[found.which], (bundle.origins - bundle.points)[found.which] @ T[:3, :3].T
    facing = np.einsum("ij,ij->i", found.normals, beams) > config.facing_cos * np.linalg.norm(beams, axis=1)
    points, normals = points[facing], found.normals[facing]
    off = np.einsum("ij,ij->i", normals, points - found.points[facing])
    weights = _weights(points, off, config, (2.0 if coarse else 1.0) * config.half_weight_m)
    arms = points - T[:3, 3]
    rows = np.hstack([normals, np.cross(arms, normals)])
    weighted = rows * weights[:, None]
    matrix = weighted.T @ rows
    faked = config.normal_sigma_rad**2 * (_all_around(arms, weights) - matrix)
    return _Information(matrix, faked, -weighted.T @ off), len(points)


def _weights(points: Array, off: Array, config: ScanTrackingConfig, half_m: float) -> Array:
    """(K,) inverse variances: Cauchy's weight over what is a point's own error and its share of the patch's common one."""
    _, patch, counts = np.unique(cell_keys(points, config.patch_m), return_inverse=True, return_counts=True)
    variances = config.point_sigma_m**2 + counts[patch] * config.patch_sigma_m**2
    return np.asarray(1.0 / (variances * (1.0 + (off / half_m) ** 2)))


def _all_around(arms: Array, weights: Array) -> Array:
    """(6, 6) the information of points whose distances are known along all axes."""
    total, first = float(weights.sum()), weights @ arms
    second = (arms * weights[:, None]).T @ arms
    matrix = np.zeros((6, 6))
    matrix[:3, :3], matrix[3:, :3] = total * np.eye(3), skew(first)
    matrix[:3, 3:] = matrix[3:, :3].T
    matrix[3:, 3:] = np.trace(second) * np.eye(3) - second
    return matrix


def _posterior(information: _Information, L: Array, error: Array) -> tuple[Array, Array]:
    """(6,) the estimate in units of the prior L L', and its (6, 6) covariance; `error`: where `information` was taken.

    Along each eigenvector of the whitened information counts what is left of it without the faked part, and as much of the pull.
    """
    values, axes = np.linalg.eigh(L.T @ information.matrix @ L)
    whitening = L @ axes
    faked = np.einsum("ij,ij->j", whitening, information.faked @ whitening)
    true = np.maximum(values - faked, 0.0)
    share = np.divide(true, values, out=np.zeros(6), where=values > 0.0)
    here = np.linalg.solve(whitening, error)
    estimate = (true * here + share * (whitening.T @ information.pull)) / (1.0 + true)
    return axes @ estimate, np.asarray((whitening / (1.0 + true)) @ whitening.T)
