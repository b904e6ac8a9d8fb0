"""What the ground around the robot says of its mount: the wheels stand on it, so that it is level in base_link."""

from __future__ import annotations

import math

import numpy as np

from mount_calibration.plane_cells import FloatArray, IntArray
from robot_body import RobotBody

MAD = 1.4826  # sigma over the median of what is off
FIT_ROUNDS = 10
_GROUND_RADIUS_M = 2.5  # ground up to here from the laser says where the wheels stand
_GROUND_HEIGHT_M = 0.15  # hits count as ground up to so far from the wheels' plane
_GROUND_FLAT_M = 0.0003  # no ground is flatter than so much below the wheels
_PATCH_M = 0.1  # size of a patch of ground as a wheel feels it
_LEAST_PATCHES = 50  # patches of ground that say how uneven it is


def ground_equations(
    points: FloatArray, jacobian: FloatArray, centre_xy: FloatArray, robot: RobotBody
) -> tuple[FloatArray, FloatArray] | None:
    """(P, P) information and (P,) gradient of the ground's two slopes in base_link being zero; None where too little ground is seen.

    (N, 3) hits with (N, 3, P) derivatives. How well zero is believed follows from how uneven the ground is.
    """
    radius = np.hypot(points[:, 0] - centre_xy[0], points[:, 1] - centre_xy[1])
    near = np.flatnonzero((radius <= _GROUND_RADIUS_M) & (np.abs(points[:, 2] + robot.base_height_m) <= _GROUND_HEIGHT_M))
    ground = near[_of_ground(points[near] - np.array([*centre_xy, 0.0]))] if len(near) >= _LEAST_PATCHES else near
    _, patch = np.unique(np.floor(points[ground, :2] / _PATCH_M).astype(np.int64), axis=0, return_inverse=True)
    size = np.bincount(patch)
    if len(size) < _LEAST_PATCHES:
        return None
    mean = _mean(points[ground], patch, size) - np.array([*centre_xy, 0.0])
    fit = np.linalg.pinv(np.column_stack([np.ones(len(mean)), mean[:, :2]]))
    slopes, slopes_by = (fit @ mean[:, 2])[1:], (fit @ _mean(jacobian[ground, 2], patch, size))[1:]
    plane = np.column_stack([np.ones(len(mean)), mean[:, :2]]) @ (fit @ mean[:, 2])
    seen = (fit @ fit.T)[1:, 1:] * float(np.mean((mean[:, 2] - plane) ** 2))
    uneven_m = _unevenness(points[ground, 2] - plane[patch], mean[:, 2] - plane, patch, size)
    standing = (math.hypot(uneven_m, _GROUND_FLAT_M) / robot.standing_base_m) ** 2
    precision = np.linalg.inv(seen + standing * np.eye(2))
    return slopes_by.T @ precision @ slopes_by, slopes_by.T @ precision @ slopes


def _of_ground(points: FloatArray) -> IntArray:
    """Which of (N, 3) points lie on the plane of most of them: what stands on it is left out (Tukey's weights)."""
    basis, weights = np.column_stack([np.ones(len(points)), points[:, :2]]), np.ones(len(points))
    off, sigma_m = points[:, 2], 0.0
    for _ in range(FIT_ROUNDS):
        off = points[:, 2] - basis @ np.linalg.lstsq(basis * weights[:, None], points[:, 2] * weights, rcond=None)[0]
        sigma_m = max(MAD * float(np.median(np.abs(off))), 1e-6)
        weights = np.maximum(1.0 - (off / (4.0 * sigma_m)) ** 2, 0.0)
    return np.flatnonzero(np.abs(off) <= 3.0 * sigma_m)


def _unevenness(off_m: FloatArray, patch_off_m: FloatArray, patch: IntArray, size: IntArray) -> float:
    """Sigma of the heights of patches about the plane, less what the noise of their hits makes of it."""
    firm = size >= 5
    if firm.sum() < 10:
        return float(np.std(patch_off_m))
    within = off_m - patch_off_m[patch]
    noise = np.bincount(patch, within**2)[firm] / (size[firm] - 1) / size[firm]
    shown_m = MAD * float(np.median(np.abs(patch_off_m[firm])))  # on some patches something stands
    return math.sqrt(max(shown_m**2 - float(np.median(noise)), 0.0))


def _mean(values: FloatArray, group: IntArray, size: IntArray) -> FloatArray:
    """(G, K) means of (N, K) values by group."""
    return np.stack([np.bincount(group, column) for column in values.T], axis=1) / size[:, None]
