"""What a match leaves over that is no noise, and the covariance that follows from it.

Range noise averages out in thousands of points; a mount that is not where it is thought to be does not. It bends the sweep. The fit takes
up what is rigid of that, unseen, and the rest stays: residuals that are alike in one direction and different in the next. How far the pose
is off goes with this rest, as measured on simulated sweeps with good and bad mounts (benchmarks/registration_consistency.py).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.config import RegistrationConfig
from rigid_geometry import transform_points

Array = NDArray[np.float64]

_SECTORS = 8
_ELEVATIONS_RAD = (-0.3, 0.1)  # limits of the bands: ground, what stands on it, what is above
_LEAST_POINTS = 30  # of a sector, in a band
_LEAST_RANGE_M = 1.0
_MAX_RESIDUAL_M = 0.1


def residual_pattern(points_body: Array, sensor_body: Array, T: Array, nearest: Array, normals: Array) -> float | None:
    """The angle (rad) by which a sweep is bent against its reference: root mean square over directions of the mean residual there.

    Reading points (N, 3), seen from `sensor_body` (3,), placed by `T` near reference points (N, 3) with normals (N, 3), which may point to
    either side. A residual counts by the angle at which it is seen, less what noise makes of it and what a rigid motion can take up.
    None when fewer than two directions hold points enough.
    """
    beams = points_body - sensor_body
    outward = np.einsum("ij,ij->i", normals, beams @ T[:3, :3].T)
    facing = np.where(outward[:, None] > 0.0, -normals, normals)
    residuals = np.einsum("ij,ij->i", facing, transform_points(T, points_body) - nearest)
    used = np.abs(residuals) < _MAX_RESIDUAL_M
    left = _without_rigid_part(points_body[used], facing[used] @ T[:3, :3], residuals[used])
    return _angle(beams[used], left)


def pattern_covariance(bend_rad: float, config: RegistrationConfig) -> Array:
    """(6, 6) rotation, translation of the body: the error that the fit of a sweep bent by so much has taken up unseen.

    A mount tilts about a level axis: where it is off, sweeps pitch, roll and shift, but hardly turn about the upright axis.
    """
    beyond = math.sqrt(max(0.0, bend_rad**2 - config.pattern_good_rad**2))
    level, upright, shift = config.pattern_rotation_factor, config.pattern_yaw_factor, config.pattern_translation_m
    return np.diag(np.square(beyond * np.array([level, level, upright, shift, shift, shift])))


def _without_rigid_part(points_body: Array, normals_body: Array, residuals: Array) -> Array:
    """Residuals after one step of point-to-plane, in the directions that the points hold."""
    jacobian = np.hstack([np.cross(points_body, normals_body), normals_body])
    step = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-6, hermitian=True) @ (jacobian.T @ residuals)
    return np.asarray(residuals - jacobian @ step)


def _angle(beams: Array, residuals: Array) -> float | None:
    ranges = np.linalg.norm(beams, axis=1)
    sector = np.floor((np.arctan2(beams[:, 1], beams[:, 0]) / (2.0 * math.pi) + 0.5) * _SECTORS).astype(np.int64) % _SECTORS
    band = np.digitize(np.arcsin(np.clip(beams[:, 2] / np.maximum(ranges, 1e-9), -1.0, 1.0)), _ELEVATIONS_RAD)
    return _beyond_noise(sector * (len(_ELEVATIONS_RAD) + 1) + band, residuals / np.maximum(ranges, _LEAST_RANGE_M))


def _beyond_noise(group: NDArray[np.int64], values: Array) -> float | None:
    """Root mean square of the groups' means, each weighed by its points and less the variance of its mean; None of fewer than two."""
    count = np.bincount(group)
    held = count >= _LEAST_POINTS
    if np.count_nonzero(held) < 2:
        return None
    weights = count[held] / count[held].sum()
    mean = np.bincount(group, values)[held] / count[held]
    spread = np.bincount(group, values**2)[held] / count[held] - mean**2
    return math.sqrt(max(0.0, float(weights @ (mean**2 - spread / count[held]))))
