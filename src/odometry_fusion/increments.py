"""How far the robot moved between two odometry poses, and how sure that is: what an odometry edge of a pose graph holds."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import inverse

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PoseIncrement:
    """`T_a_b` (4, 4) and the `covariance` (6, 6) of its error e, T_true = T_a_b Exp(e): x, y, z, rotation x, y, z in axes of b."""

    T_a_b: FloatArray
    covariance: FloatArray


def carried(lever: FloatArray) -> FloatArray:
    """(6, 6) matrix that takes the error of a pose to that of a pose (3,) `lever` metres away in odom: a turn moves it along."""
    carry = np.eye(6)
    carry[:3, 3:] = np.cross(np.eye(3), lever).T
    return carry


def pose_increment(
    T_odom_a: FloatArray,
    covariance_a: FloatArray,
    T_odom_b: FloatArray,
    covariance_b: FloatArray,
    *,
    position_floor_m: float = 0.002,
    rotation_floor_rad: float = 0.001,
) -> PoseIncrement:
    """The movement from pose a to the later pose b of one track of the odometry.

    Covariances are (6, 6) as in nav_msgs/Odometry: x, y, z, rotation x, y, z, about the axes of odom. A track's error at a is
    carried on to b, so what was gained in between is b's covariance minus a's carried over. The filter's `pose_covariance` is made
    for this: from stop to stop the difference is exact. Where it is smaller than the floor, or negative, it is raised to the floor.
    """
    carry = carried(T_odom_b[:3, 3] - T_odom_a[:3, 3])
    gained = covariance_b - carry @ covariance_a @ carry.T
    to_b = np.kron(np.eye(2), T_odom_b[:3, :3].T)
    floor = np.repeat([position_floor_m, rotation_floor_rad], 3)
    return PoseIncrement(inverse(T_odom_a) @ T_odom_b, _at_least(to_b @ gained @ to_b.T, floor))


def _at_least(covariance: FloatArray, sigma_floor: FloatArray) -> FloatArray:
    """`covariance` with every variance, in units of the floor's, raised to one."""
    scaled = covariance / np.outer(sigma_floor, sigma_floor)
    values, vectors = np.linalg.eigh(0.5 * (scaled + scaled.T))
    raised = (vectors * np.maximum(values, 1.0)) @ vectors.T
    return np.asarray(raised * np.outer(sigma_floor, sigma_floor), dtype=np.float64)
