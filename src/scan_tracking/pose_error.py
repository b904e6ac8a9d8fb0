"""Errors of a pose, (6,): position along, and rotation about, the axes of the frame it is given in, at its own position.

p_true = p + e[:3] and R_true = Exp(e[3:]) R, as the covariance of nav_msgs/Odometry has it.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rigid_geometry import renormalised, rotation_angles

Array = NDArray[np.float64]

TURN_ARM_M = 0.3
"""A turn counts as the way that a point so far out makes."""


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
    """The (4, 4) transform with its rotation `renormalised`."""
    clean = T.copy()
    clean[:3, :3] = renormalised(T[:3, :3])
    return clean


def rotated_covariance(R: Array, covariance: Array) -> Array:
    """(6, 6) covariance in axes that R (3, 3) takes those of `covariance` to."""
    turn = np.kron(np.eye(2), R)
    return np.asarray(turn @ covariance @ turn.T)


def way_of(T_a_b: Array) -> float:
    """Metres from one pose to another, its turn counted by `TURN_ARM_M`."""
    return float(np.linalg.norm(T_a_b[:3, 3]) + TURN_ARM_M * rotation_angles(T_a_b[None])[0])
