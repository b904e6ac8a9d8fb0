"""What the drivers of a robot send that sweeps a room, drives on and sweeps again: each sensor on its own phase, for ROS 1 and ROS 2."""

from pathlib import Path
from typing import Any

import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from robot_body import RobotBody, mount_from_urdf, urdf_file
from sweep_assembly import ScanGeometry, TiltGeometry

ROS1, ROS2 = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
ROS1.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
HUSKY = RobotBody()
TILT_JOINT, *_MOUNT = mount_from_urdf(urdf_file(HUSKY).read_text(), HUSKY.mount("laser"))
MOUNT = TiltGeometry(*_MOUNT)
BEAMS = ScanGeometry(np.radians(-135.0), np.radians(1.0), 0.025 / 360, 271)
ROOM_LOW, ROOM_HIGH = np.array([-3.0, -2.0, -0.132]), np.array([5.0, 4.0, 3.0])
BEGIN_S, END_S = 1_700_000_010.0, 1_700_000_025.0
SWEEPS_S = (BEGIN_S + 2.0, BEGIN_S + 10.0)
SWEEP_S, DRIVE_S = 4.0, (BEGIN_S + 7.0, BEGIN_S + 9.0)
DISTANCE_M = 0.8
GRAVITY = 9.81
Messages = list[tuple[str, str, Any]]


def tilt_at(t: float) -> float:
    """Level, over the nose to behind, slowly back to above the horizon, and level."""
    for begin in SWEEPS_S:
        if begin <= t <= begin + SWEEP_S:
            return float(np.interp(t - begin, [0.0, 0.5, 3.5, 4.0], [0.0, 2.88, -0.61, 0.0]))
    return 0.0


def driven(t: float) -> tuple[float, float, float]:
    """Way, velocity and acceleration ahead: from rest to rest."""
    u, length = np.clip((t - DRIVE_S[0]) / np.ptp(DRIVE_S), 0.0, 1.0), float(np.ptp(DRIVE_S))
    turn = 2.0 * np.pi * u
    way = DISTANCE_M * (u - np.sin(turn) / (2.0 * np.pi))
    return float(way), float(DISTANCE_M / length * (1 - np.cos(turn))), float(DISTANCE_M / length**2 * 2 * np.pi * np.sin(turn))


def ranges_at(stamp: float, beams: ScanGeometry) -> np.ndarray:
    """(n,) distances to the walls of the room."""
    times = stamp + beams.beam_times
    T = MOUNT.base_from_laser(np.array([tilt_at(t) for t in times]))
    heading = np.einsum("nij,nj->ni", T[:, :3, :3], beams.directions)
    origin = T[:, :3, 3] + np.array([[driven(t)[0], 0.0, 0.0] for t in times])
    heading[heading == 0.0] = 1e-12
    return np.where(heading > 0, (ROOM_HIGH - origin) / heading, (ROOM_LOW - origin) / heading).min(axis=1).astype(np.float32)


class Drivers:
    """Makes the messages of one ROS's types."""

    def __init__(self, store: Typestore) -> None:
        self.store, self._t = store, store.types

    def header(self, stamp_s: float, frame: str) -> Any:
        seconds, nanoseconds = divmod(round(stamp_s * 1e9), 1_000_000_000)
        stamp = self._t["builtin_interfaces/msg/Time"](seconds, nanoseconds)
        header = self._t["std_msgs/msg/Header"]
        return header(0, stamp, frame) if "seq" in header.__dataclass_fields__ else header(stamp, frame)

    def _xyz(self, *values: float) -> Any:
        return self._t["geometry_msgs/msg/Vector3"](*values)

    def scan(self, t: float, beams: ScanGeometry = BEAMS) -> Any:
        angles = beams.angle_min, beams.angle_min + (beams.count - 1) * beams.angle_increment, beams.angle_increment
        limits = beams.time_increment, 0.025, 0.1, 30.0
        none = np.zeros(0, np.float32)
        return self._t["sensor_msgs/msg/LaserScan"](self.header(t, HUSKY.mount("laser").frame), *angles, *limits, ranges_at(t, beams), none)

    def joints(self, t: float) -> Any:
        return self._t["sensor_msgs/msg/JointState"](self.header(t, ""), [TILT_JOINT], np.array([tilt_at(t)]), np.zeros(1), np.zeros(0))

    def imu(self, t: float) -> Any:
        still = self._t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        force = self._xyz(driven(t)[2], 0.0, GRAVITY)
        kind, frame = self._t["sensor_msgs/msg/Imu"], HUSKY.mount("imu").frame
        return kind(self.header(t, frame), still, np.zeros(9), self._xyz(0.0, 0.0, 0.0), np.zeros(9), force, np.zeros(9))

    def static(self, parent: str, child: str, quat_xyzw: tuple[float, float, float, float]) -> Any:
        turn = self._t["geometry_msgs/msg/Transform"](self._xyz(0.0, 0.0, 0.1), self._t["geometry_msgs/msg/Quaternion"](*quat_xyzw))
        kind = self._t["geometry_msgs/msg/TransformStamped"]
        return self._t["tf2_msgs/msg/TFMessage"]([kind(self.header(BEGIN_S, parent), child, turn)])

    def wheels(self, t: float) -> Any:
        return self._odometry(t, "odom", 0.0, driven(t)[1])

    def pose(self, t: float) -> Any:
        return self._odometry(t, "odom", driven(t)[0], driven(t)[1])

    def _odometry(self, t: float, frame: str, x: float, speed: float) -> Any:
        at = self._t["geometry_msgs/msg/Pose"](
            self._t["geometry_msgs/msg/Point"](x, 0.0, 0.0), self._t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        )
        twist = self._t["geometry_msgs/msg/Twist"](self._xyz(speed, 0.0, 0.0), self._xyz(0.0, 0.0, 0.0))
        pose, moving = (self._t[f"geometry_msgs/msg/{name}WithCovariance"] for name in ("Pose", "Twist"))
        covariance = np.diag([1e-4, 1e-4, 1e-4, 1e-4, 1e-4, 1e-4]).ravel()
        return self._t["nav_msgs/msg/Odometry"](self.header(t, frame), "base_link", pose(at, covariance), moving(twist, covariance))


def ticks(period_s: float, phase_s: float, begin_s: float = BEGIN_S, end_s: float = END_S) -> np.ndarray:
    return np.arange(begin_s + phase_s, end_s, period_s)


def raw_messages(store: Typestore = ROS1, *, seed: int = 1) -> Messages:
    """(topic, type, message) of the drive in the order of time; scans vary in count and times from one to the next."""
    drivers, rng = Drivers(store), np.random.default_rng(seed)
    found: list[tuple[float, str, str, Any]] = []
    for begin in SWEEPS_S:
        for t in ticks(0.025, 0.004, begin - 0.3, begin + SWEEP_S + 0.5):
            beams = ScanGeometry(
                BEAMS.angle_min, BEAMS.angle_increment, BEAMS.time_increment * rng.uniform(0.99, 1.01), int(271 - rng.integers(3))
            )
            found.append((t, "/scan", "sensor_msgs/msg/LaserScan", drivers.scan(t, beams)))
    found += [(t, "/joint_states", "sensor_msgs/msg/JointState", drivers.joints(t)) for t in ticks(0.02, 0.011)]
    found += [(t, "/imu/data", "sensor_msgs/msg/Imu", drivers.imu(t)) for t in ticks(0.01, 0.003)]
    found += [(t, "/wheel_odom", "nav_msgs/msg/Odometry", drivers.wheels(t)) for t in ticks(0.05, 0.017)]
    return [row[1:] for row in sorted(found, key=lambda row: row[0])]


def poses(store: Typestore = ROS1) -> Messages:
    """The robot's own odometry."""
    return [("/odom", "nav_msgs/msg/Odometry", Drivers(store).pose(t)) for t in ticks(0.05, 0.009)]


def _recorded_ns(message: Any) -> int:
    message = message.transforms[0] if hasattr(message, "transforms") else message
    return int(message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec) + 2_000_000


def write_ros1(path: Path, messages: Messages) -> Path:
    with rosbag1.Writer(path) as writer:
        connections: dict[str, Any] = {}
        for topic, kind, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS1)
            writer.write(connections[topic], _recorded_ns(message), ROS1.serialize_ros1(message, kind))
    return path


def write_ros2(folder: Path, messages: Messages, storage: StoragePlugin) -> Path:
    with rosbag2.Writer(folder, version=9, storage_plugin=storage) as writer:
        connections: dict[str, Any] = {}
        for topic, kind, message in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS2)
            writer.write(connections[topic], _recorded_ns(message), ROS2.serialize_cdr(message, kind))
    return folder
