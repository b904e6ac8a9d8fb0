"""Sweeps made of what a robot's drivers sent: scans or points, joint states, and IMU and wheels, or odometry of its own."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mapping_tools.bag_sweeps import gravity_of
from mapping_tools.messages import (
    CLOUD_TYPE,
    IMU_TYPE,
    JOINT_TYPE,
    ODOMETRY_TYPE,
    SCAN_TYPE,
    STATIC_TYPE,
    ImuMessage,
    JointMessage,
    OdometryMessage,
    ScanMessage,
    Stamped,
    StaticMessage,
    frame_of,
    odometry_pose,
    stamp_s_of,
    static_of,
)
from mapping_tools.recording import Recording
from mapping_tools.sensor_chain import MeasuredSweep, Pose, SensorChain, SensorConfig
from mapping_tools.sweep_sources import LeftOut, SourceSweep, Unreadable, never
from mount_calibration import TiltCalibration
from point_cloud2 import read_beams
from robot_body import FixedFrames, RobotBody, is_fixed, mount_from_urdf
from sweep_assembly import Revolution, Scan, ScanGeometry, TiltGeometry

STATIC_TOPIC = "/tf_static"
NODS = "windows=turning_points"


@dataclass(frozen=True)
class RawTopics:
    """Where a robot's drivers publish; the robot's own odometry stands in where IMU or wheels are absent, or where it alone is named.

    `named`: which of these somebody asked for by their topics.
    """

    scan: str = "/scan"
    points: str = "/points"
    joints: str = "/joint_states"
    imu: str = "/imu/data"
    wheels: str = "/wheel_odom"
    odometry: str = "/odom"
    named: frozenset[str] = frozenset()


@dataclass(frozen=True, eq=False)
class DescribedRobot:
    """The robot that recorded: what robot.yaml says of it, the text of its URDF, and how its mount differs from that."""

    body: RobotBody
    urdf: str
    calibration: TiltCalibration = field(default_factory=TiltCalibration)


class RawSweeps:
    """See `SweepSource`. Messages that cannot be used are left out and counted, as the nodes do it."""

    def __init__(self, recording: Recording, topics: RawTopics, robot: DescribedRobot, config: SensorConfig) -> None:
        """ValueError when what is needed is not there, naming topic, type and what there is; or for a wrong mount or configuration."""
        self._bag, self._topics = recording, topics
        self._spinning = self._is_spinning()
        self._odometry = self._check_topics()
        laser = robot.body.mount("laser")
        self._frame = laser.frame
        if is_fixed(robot.urdf, laser):
            raise ValueError(
                f"no joint tilts {laser.frame}: of a lidar that is fixed the finished clouds, /sweep_cloud, are mapped, without --raw"
            )
        self._joint, T_base_mount, T_tilt_laser = mount_from_urdf(robot.urdf, laser)
        self.mount = TiltGeometry(T_base_mount, T_tilt_laser, robot.calibration)
        self._frames = FixedFrames(robot.body, robot.urdf)
        self._chain = SensorChain(config, robot.body, self.mount, self._frames.rotation_in_base, spinning=self._spinning)
        self._left_out = LeftOut()
        self._read: Counter[str] = Counter()

    @property
    def problem(self) -> str | None:
        return self._bag.problem

    @property
    def progress(self) -> float:
        return self._bag.progress

    @property
    def notes(self) -> Sequence[str]:
        """What was left out, and why."""
        advice = {"sweep_too_long": f" (of a mount that nods: --set {NODS}, or the finished clouds of the bag)"}
        return self._left_out.notes + [f"{count} x {reason}{advice.get(reason, '')}" for reason, count in self._chain.dropped.items()]

    def sweeps(self, is_stopping: Callable[[], bool] = never) -> Iterator[SourceSweep | Unreadable]:
        """In the order in which the mount turned; ValueError when nothing of it becomes a sweep."""
        for number, found in enumerate(self.measured(is_stopping)):
            name = f"sweep {number}"
            yield replace(found, name=name) if isinstance(found, Unreadable) else _source_sweep(name, found)

    def measured(self, is_stopping: Callable[[], bool] = never) -> Iterator[MeasuredSweep | Unreadable]:
        """The same as the assembler gives them."""
        takes, number = self._takes(), 0
        for record in self._bag.messages(takes.keys(), is_stopping):
            self._read[record.topic] += 1
            try:
                takes[record.topic](record.message())
                found = list(self._chain.poll())
            except ValueError as error:
                self._left_out.add(record.topic, error)
                continue
            yield from found
            number += len(found)
        if not number:
            read = ", ".join(f"{self._read[topic]} of {topic}" for topic in takes)
            raise ValueError(
                f"no sweep came out of its messages ({read}): {'; '.join(self.notes) or 'the mount never turned and came back'}"
            )

    def _takes(self) -> dict[str, Callable[[Any], None]]:
        """What takes the messages of each topic."""
        topics = self._topics
        sensor = topics.points if self._spinning else topics.scan
        takes: dict[str, Callable[[Any], None]] = {
            sensor: self._take_points if self._spinning else self._take_scan,
            topics.joints: self._take_joints,
        }
        if self._odometry:
            return takes | {self._odometry: self._take_odometry}
        if self._bag.topics.get(STATIC_TOPIC) == STATIC_TYPE:
            takes[STATIC_TOPIC] = self._take_static
        return takes | {topics.imu: self._take_imu, topics.wheels: self._take_wheels}

    def _is_spinning(self) -> bool:
        """Whether points are mapped: those that were named, or where there are no scans."""
        if {"scan", "points"} & self._topics.named:
            return "points" in self._topics.named
        return self._topics.scan not in self._bag.topics and self._topics.points in self._bag.topics

    def _check_topics(self) -> str | None:
        """The topic of the robot's own odometry, or None where IMU and wheels are mapped by."""
        topics, there = self._topics, self._bag.topics
        if self._spinning:
            self._bag.check(topics.points, CLOUD_TYPE)
        else:
            self._bag.check(topics.scan, SCAN_TYPE, f"; nor is there {CLOUD_TYPE} on {topics.points}")
        self._bag.check(topics.joints, JOINT_TYPE)
        is_absent = not {topics.imu, topics.wheels} <= there.keys() and topics.odometry in there
        if "odometry" in topics.named or (is_absent and not {"imu", "wheels"} & topics.named):
            self._bag.check(topics.odometry, ODOMETRY_TYPE)
            return topics.odometry
        self._bag.check(topics.imu, IMU_TYPE, f"; nor is there {ODOMETRY_TYPE} on {topics.odometry}")
        self._bag.check(topics.wheels, ODOMETRY_TYPE)
        return None

    def _take_scan(self, message: ScanMessage) -> None:
        self._check_frame(message)
        geometry = ScanGeometry(message.angle_min, message.angle_increment, message.time_increment, len(message.ranges))
        scan = Scan(geometry, message.ranges, message.range_min, message.range_max, message.scan_time)
        self._chain.add_reading(stamp_s_of(message), scan)

    def _take_points(self, message: Any) -> None:
        self._check_frame(message)
        stamp_s = stamp_s_of(message)
        self._chain.add_reading(stamp_s, Revolution.of(read_beams(message, stamp_s)))

    def _check_frame(self, message: Stamped) -> None:
        frame = frame_of(message)
        if frame != self._frame:
            raise ValueError(f"frame {frame!r}, the robot's laser is {self._frame!r}: mounts/laser/frame of robot.yaml")

    def _take_joints(self, message: JointMessage) -> None:
        names = list(message.name)
        if self._joint not in names:
            return
        if names.index(self._joint) >= len(message.position):
            raise ValueError(f"it names {self._joint} and has no position of it")
        self._chain.add_joint(stamp_s_of(message), float(message.position[names.index(self._joint)]))

    def _take_static(self, message: StaticMessage) -> None:
        self._frames.add(static_of(t) for t in message.transforms)

    def _take_imu(self, message: ImuMessage) -> None:
        gyro, accel = message.angular_velocity, message.linear_acceleration
        self._chain.add_imu(stamp_s_of(message), frame_of(message), (gyro.x, gyro.y, gyro.z), (accel.x, accel.y, accel.z))

    def _take_wheels(self, message: OdometryMessage) -> None:
        self._chain.add_wheels(stamp_s_of(message), message.twist.twist.linear.x, message.twist.twist.angular.z)

    def _take_odometry(self, message: OdometryMessage) -> None:
        covariance = np.asarray(message.pose.covariance, np.float64).reshape(6, 6)
        self._chain.add_pose(Pose(stamp_s_of(message), odometry_pose(message), covariance))


def _source_sweep(name: str, found: MeasuredSweep) -> SourceSweep:
    sweep = found.sweep
    up, sigma_rad = gravity_of(found.pose.T_odom_base, found.pose.covariance.ravel()) or (None, None)
    free = sweep.free_ends, sweep.free_origins
    return SourceSweep(name, sweep.stamp_s, sweep.points, sweep.origins, found.T_odom_base, up, sigma_rad, free, found.lost)
