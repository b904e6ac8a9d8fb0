"""What odometry and gravity say of a new vertex before its sweep is matched."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.graph.graph_measurements import unit_up
from rigid_geometry import rotation_angle

Array = NDArray[np.float64]


def levelled(T_odom_base: Array, up_base: Array) -> Array:
    """`T_odom_base` turned by the least rotation about its own origin that makes the measured up direction the map's z axis."""
    up = T_odom_base[:3, :3] @ unit_up(up_base)
    if up[2] < 0.0:
        raise ValueError(f"the robot would stand on its head: up in the odometry frame is {up}")
    T = T_odom_base.copy()
    axis = np.cross(up, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    if sine > 1e-12:
        T[:3, :3] = Rotation.from_rotvec(axis / sine * np.arctan2(sine, up[2])).as_matrix() @ T_odom_base[:3, :3]
    return T


def gravity_sigma(measured_rad: float | None, stamps_s: Sequence[float], vertex: int, config: MappingConfig) -> float:
    """Sigma in radians of what was up at a vertex, as a measurement of its own; measured_rad None: the caller gave none.

    While a robot drives, what is up is the attitude of its odometry, and that is off in the same direction for `gravity_time_s`. Sweeps
    within that time share one error: each counts for the share of it that has passed since the sweep before.
    """
    sigma = measured_rad or config.gravity_sigma_rad
    since_s = abs(stamps_s[vertex] - stamps_s[vertex - 1]) if vertex else math.inf
    return sigma * math.sqrt(max(1.0, config.gravity_time_s / since_s))


def odometry_covariance(T_last_current: Array, config: MappingConfig) -> Array:
    """(6, 6) covariance of an odometry edge, grown with the distance driven and the angle turned."""
    metres, radians = float(np.linalg.norm(T_last_current[:3, 3])), rotation_angle(T_last_current)
    shift = config.odometry_sigma_m + config.odometry_sigma_per_m * metres + config.odometry_sigma_per_rad * radians
    yaw = config.odometry_yaw_sigma_rad + config.odometry_yaw_per_rad * radians + config.odometry_yaw_per_m * metres
    tilt = config.odometry_tilt_sigma_rad
    return np.diag(np.square([tilt, tilt, yaw, shift, shift, shift]))
