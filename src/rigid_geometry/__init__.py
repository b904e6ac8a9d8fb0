"""Rigid-body geometry that every stage may call: 4x4 transforms, angles, point arrays, and stamped samples to look them up in.

A transform `T_a_b` is a (4, 4) float64 array that takes coordinates in frame b to frame a, so that inner letters cancel:
`T_a_c = T_a_b @ T_b_c` and `points_a = transform_points(T_a_b, points_b)`. Angles are radians, roll-pitch-yaw is ROS's
fixed-axis x, y, z, and quaternions are x, y, z, w (REP 103).
"""

from rigid_geometry.clock_leap import LONGEST_SILENCE_S, clock_leap_s
from rigid_geometry.far_origin import FAR_M, FARTHEST_M, lost_digits_m, origin_bytes, origin_near, origin_text, read_origin
from rigid_geometry.leap_watch import LeapWatch
from rigid_geometry.odometry_history import OdometryHistory
from rigid_geometry.polyline import legs_of
from rigid_geometry.pose_history import PoseHistory
from rigid_geometry.rotations import renormalised, skew
from rigid_geometry.skid_steering import slide_per_rad
from rigid_geometry.stamped_buffer import JUMP_BACK_S, STAMP_TOLERANCE_S, StampedBuffer
from rigid_geometry.transforms import (
    angle_difference,
    as_covariance,
    as_transform,
    as_transforms,
    interpolate_transforms,
    inverse,
    quat_xyzw_from_transform,
    rotation_angle,
    rotation_angles,
    rotation_from_quat,
    rotation_from_rpy,
    rpy_from_rotation,
    tilt_angle,
    transform_from_quat,
    transform_from_rpy,
    transform_points,
    translation_distance,
    yaw_of,
)

__all__ = [
    "FARTHEST_M",
    "FAR_M",
    "JUMP_BACK_S",
    "LONGEST_SILENCE_S",
    "STAMP_TOLERANCE_S",
    "LeapWatch",
    "OdometryHistory",
    "PoseHistory",
    "StampedBuffer",
    "angle_difference",
    "as_covariance",
    "as_transform",
    "as_transforms",
    "clock_leap_s",
    "interpolate_transforms",
    "inverse",
    "legs_of",
    "lost_digits_m",
    "origin_bytes",
    "origin_near",
    "origin_text",
    "quat_xyzw_from_transform",
    "read_origin",
    "renormalised",
    "rotation_angle",
    "rotation_angles",
    "rotation_from_quat",
    "rotation_from_rpy",
    "rpy_from_rotation",
    "skew",
    "slide_per_rad",
    "tilt_angle",
    "transform_from_quat",
    "transform_from_rpy",
    "transform_points",
    "translation_distance",
    "yaw_of",
]
