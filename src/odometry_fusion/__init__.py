"""Odometry (thesis 5.3, last paragraph): wheel encoders and IMU fused by an extended Kalman filter in six dimensions.

Stands between the robot's drivers and everything that asks where the robot is: `OdometryFilter` gives T_odom_base, its
covariance, the robot's twist, and whether it stands.
"""

from odometry_fusion.config import OdometryConfig
from odometry_fusion.displacement import SET_BACK
from odometry_fusion.fused_odometry import FusedOdometry
from odometry_fusion.imu_input import ImuInput
from odometry_fusion.odometry_filter import OdometryEstimate, OdometryFilter

__all__ = [
    "SET_BACK",
    "FusedOdometry",
    "ImuInput",
    "OdometryConfig",
    "OdometryEstimate",
    "OdometryFilter",
]
