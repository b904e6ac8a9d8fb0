"""Errors of a pose, (6,): position along, and rotation about, the axes of the frame it is given in, at its own position.

p_true = p + e[:3] and R_true = Exp(e[3:]) R, as the covariance of nav_msgs/Odometry has it.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rigid_geometry import rotation_angles
from scan_tracking.config import ScanTrackingConfig

Array = NDArray[np.float64]

_ARM_M = 0.3


def skew(v: Array) -> Array:
    """(3, 3) matrix of the cross product with v from the left."""
    x, y, z = v.tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def moved_by(T: Array, error: Array) -> Array:
    """The (4, 4) pose with an error added."""
    moved = np.eye(4)
    moved[:3, :3] = Rotation.from_rotvec(error[3:]).as_matrix() @ T[:3, :3]
    moved[:3, 3] = T[:3, 3] + error[:3]
    return moved


def error_between(T_from: Array, T_to: Array) -> Array:
    """(6,) error that takes one pose to the other."""
    turned = Rotation.from_matrix(T_to[:3, :3] @ T_from[:3, :3].T).as_rotvec()
    return np.concatenate([T_to[:3, 3] - T_from[:3, 3], turned])


def orthonormal(T: Array) -> Array:
    """The rigid transform nearest to a product of many: one Newton step, enough where rounding is all that is wrong."""
    R, clean = T[:3, :3], T.copy()
    clean[:3, :3] = R @ (1.5 * np.eye(3) - 0.5 * R.T @ R)
    return clean


def rotated_covariance(R: Array, covariance: Array) -> Array:
    """(6, 6) covariance in axes that R (3, 3) takes those of `covariance` to."""
    turn = np.kron(np.eye(2), R)
    return np.asarray(turn @ covariance @ turn.T)


def predicted_covariance(covariance: Array, T_a: Array, T_b: Array, config: ScanTrackingConfig) -> Array:
    """(6, 6) after the robot drove from pose a to b: the error of a carried along, and what odometry adds on the way."""
    step = T_b[:3, 3] - T_a[:3, 3]
    carry = np.eye(6)
    carry[:3, 3:] = -skew(step)
    way = float(np.linalg.norm(step))
    turn = float(rotation_angles((T_a[:3, :3].T @ T_b[:3, :3])[None])[0])
    position = config.along_walk**2 * way + config.skid_walk**2 * turn
    attitude = config.turn_walk**2 * way + config.gyro_walk**2 * turn
    return np.asarray(carry @ covariance @ carry.T + np.diag([position] * 3 + [attitude] * 3))


def spread_poses(T_begin: Array, T_begin_samples: Array, T_end: Array) -> Array:
    """(K, 4, 4) poses from (4, 4) `T_begin` by (K, 4, 4) measured motions, whose last is to end at `T_end`.

    The difference is spread over them in proportion to the way and the turn so far, an arm of 0.3 m standing for the turn.
    """
    raw = T_begin @ T_begin_samples
    gone = np.linalg.norm(T_begin_samples[:, :3, 3], axis=1) + _ARM_M * rotation_angles(T_begin_samples)
    share = np.minimum(gone / gone[-1], 1.0) if gone[-1] > 0.0 else np.ones(len(gone))
    error = error_between(raw[-1], T_end)
    return np.array([orthonormal(moved_by(T, part * error)) for T, part in zip(raw, share, strict=True)])
