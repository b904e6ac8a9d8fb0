"""Messages as rosbags gives them: the parts that are read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import transform_from_quat
from robot_body import StaticTransform

Array = NDArray[np.float64]

CLOUD_TYPE, ODOMETRY_TYPE = "sensor_msgs/msg/PointCloud2", "nav_msgs/msg/Odometry"
STATIC_TYPE = "tf2_msgs/msg/TFMessage"
SCAN_TYPE, JOINT_TYPE, IMU_TYPE = "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/JointState", "sensor_msgs/msg/Imu"


class _Time(Protocol):
    sec: int
    nanosec: int


class _Header(Protocol):
    stamp: _Time
    frame_id: str


class Stamped(Protocol):
    """A message with a header."""

    header: _Header


class _Vector(Protocol):
    x: float
    y: float
    z: float


class _Quaternion(_Vector, Protocol):
    w: float


class _Pose(Protocol):
    position: _Vector
    orientation: _Quaternion


class _PoseWithCovariance(Protocol):
    pose: _Pose
    covariance: Array


class _Twist(Protocol):
    linear: _Vector
    angular: _Vector


class _TwistWithCovariance(Protocol):
    twist: _Twist


class OdometryMessage(Stamped, Protocol):
    """A nav_msgs/Odometry."""

    child_frame_id: str
    pose: _PoseWithCovariance
    twist: _TwistWithCovariance


class _Transform(Protocol):
    translation: _Vector
    rotation: _Quaternion


class TransformMessage(Stamped, Protocol):
    """A geometry_msgs/TransformStamped."""

    child_frame_id: str
    transform: _Transform


class StaticMessage(Protocol):
    """A tf2_msgs/TFMessage."""

    transforms: Sequence[TransformMessage]


class ImuMessage(Stamped, Protocol):
    """A sensor_msgs/Imu."""

    angular_velocity: _Vector
    linear_acceleration: _Vector


class JointMessage(Stamped, Protocol):
    """A sensor_msgs/JointState."""

    name: Sequence[str]
    position: Array


class ScanMessage(Stamped, Protocol):
    """A sensor_msgs/LaserScan."""

    angle_min: float
    angle_increment: float
    time_increment: float
    scan_time: float
    range_min: float
    range_max: float
    ranges: NDArray[np.float32]


def stamp_s_of(message: Stamped) -> float:
    """Seconds of a message's header stamp."""
    return float(message.header.stamp.sec) + 1e-9 * float(message.header.stamp.nanosec)


def frame_of(message: Stamped) -> str:
    """The message's frame, without the slash that old drivers put before it."""
    return message.header.frame_id.lstrip("/")


def odometry_pose(message: OdometryMessage) -> Array:
    """(4, 4) pose of base_link in the odometry's frame; ValueError when it is none."""
    p, q = message.pose.pose.position, message.pose.pose.orientation
    return np.asarray(transform_from_quat((p.x, p.y, p.z), (q.x, q.y, q.z, q.w)))


def static_of(message: TransformMessage) -> StaticTransform:
    """A transform of /tf_static."""
    p, q = message.transform.translation, message.transform.rotation
    return StaticTransform(message.header.frame_id, message.child_frame_id, (p.x, p.y, p.z), (q.x, q.y, q.z, q.w))
