"""What odometry and gravity say of a new vertex before its sweep is matched."""

from __future__ import annotations

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


def odometry_covariance(T_last_current: Array, config: MappingConfig) -> Array:
    """(6, 6) covariance of an odometry edge, grown with the distance driven and the angle turned."""
    metres, radians = float(np.linalg.norm(T_last_current[:3, 3])), rotation_angle(T_last_current)
    shift = config.odometry_sigma_m + config.odometry_sigma_per_m * metres + config.odometry_sigma_per_rad * radians
    yaw = config.odometry_yaw_sigma_rad + config.odometry_yaw_per_rad * radians + config.odometry_yaw_per_m * metres
    tilt = config.odometry_tilt_sigma_rad
    return np.diag(np.square([tilt, tilt, yaw, shift, shift, shift]))
