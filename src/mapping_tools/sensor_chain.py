"""From a robot's sensors to sweeps without a master: the filter, odometry and assembler of the nodes, in their order."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from odometry_fusion import OdometryConfig, OdometryFilter
from rigid_geometry import JUMP_BACK_S, PoseHistory
from robot_body import RobotBody
from sweep_assembly import (
    LaserScans,
    LidarConfig,
    LidarRevolutions,
    Revolution,
    RevolutionChain,
    Scan,
    ScanChain,
    ScanFilterConfig,
    Sweep,
    SweepAssembler,
    SweepAssemblyConfig,
    TiltGeometry,
)

Array = NDArray[np.float64]

_KEPT_GRAVITIES = 400


@dataclass(frozen=True)
class SensorConfig:
    """Configurations of scan_filter_node, sweep_assembler_node and odometry_fusion_node."""

    scan_filter: ScanFilterConfig = field(default_factory=ScanFilterConfig)
    lidar: LidarConfig = field(default_factory=LidarConfig)
    assembly: SweepAssemblyConfig = field(default_factory=SweepAssemblyConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)


@dataclass(frozen=True, eq=False)
class Pose:
    """T_odom_base (4, 4), and the (6, 6) covariance of its position and rotation as nav_msgs/Odometry has it."""

    stamp_s: float
    T_odom_base: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class MeasuredSweep:
    """A sweep with the odometry at its stamp, between the poses around it, and the first pose from there on."""

    sweep: Sweep
    T_odom_base: Array
    pose: Pose


class FusedOdometry:
    """An estimate for every message of the wheels, once the IMU reaches it."""

    def __init__(self, config: OdometryConfig, robot: RobotBody) -> None:
        """ValueError when the configuration is wrong."""
        self.filter = OdometryFilter(config, robot)
        self._due: deque[float] = deque(maxlen=100)
        self._last_s = -math.inf

    def add_wheels(self, stamp_s: float, forward_mps: float, yaw_rate: float) -> None:
        """Takes a message of the wheels."""
        self.filter.add_wheels(stamp_s, forward_mps, yaw_rate)
        if stamp_s <= self._last_s:
            if stamp_s > self._last_s - JUMP_BACK_S:
                return
            self._due.clear()
        self._last_s = stamp_s
        self._due.append(stamp_s)

    def poll(self) -> Iterator[Pose]:
        """The poses that are known by now."""
        complete_s = self.filter.complete_until_s
        while self._due and complete_s is not None and self._due[0] <= complete_s + 1e-6:
            estimate = self.filter.estimate(self._due.popleft())
            if estimate is not None:
                yield Pose(estimate.stamp_s, estimate.T_odom_base, estimate.pose_covariance)


class SensorChain:
    """Takes what drivers send, in order within a topic, and gives out sweeps."""

    def __init__(self, config: SensorConfig, robot: RobotBody, mount: TiltGeometry, *, spinning: bool) -> None:
        """`spinning`: a lidar stands in the laser's place. ValueError when a configuration is wrong."""
        self._fused = FusedOdometry(config.odometry, robot)
        self._scans = ScanChain(config.scan_filter, mount, robot)
        self._turns = RevolutionChain(config.scan_filter, config.lidar, mount, robot)
        self._turn_s = config.lidar.duration_s
        self._assembler = SweepAssembler(config.assembly, LidarRevolutions(config.lidar) if spinning else LaserScans(), mount)
        self._spinning = spinning
        self._history = PoseHistory()
        self._poses: deque[Pose] = deque(maxlen=_KEPT_GRAVITIES)

    @property
    def dropped(self) -> dict[str, int]:
        """How many messages, scans and sweeps were given up, by reason."""
        own = Counter(self._turns.dropped if self._spinning else self._scans.dropped)
        return dict(own + Counter(self._assembler.dropped) + Counter(self._fused.filter.dropped))

    def add_joint(self, stamp_s: float, tilt_rad: float) -> None:
        """Takes the tilt at a time."""
        (self._turns if self._spinning else self._scans).add_joint(stamp_s, tilt_rad)
        self._assembler.add_joint(stamp_s, tilt_rad)

    def add_imu(self, stamp_s: float, gyro: ArrayLike, accel: ArrayLike) -> None:
        """Takes (3,) rad/s and (3,) m/s^2 in base_link."""
        self._fused.filter.add_imu(stamp_s, gyro, accel)

    def add_wheels(self, stamp_s: float, forward_mps: float, yaw_rate: float) -> None:
        """Takes the wheels' velocities."""
        self._fused.add_wheels(stamp_s, forward_mps, yaw_rate)

    def add_reading(self, stamp_s: float, reading: Scan | Revolution) -> None:
        """Takes a scan, or a revolution of a lidar; ValueError when it is none of this sensor."""
        if isinstance(reading, Scan):
            self._scans.add_scan(stamp_s, reading)
        else:
            self._turns.add_revolution(stamp_s, reading)

    def add_pose(self, pose: Pose) -> None:
        """Takes odometry of the robot's own, in place of IMU and wheels."""
        if not self._history.add(pose.stamp_s, pose.T_odom_base):
            return
        if self._poses and pose.stamp_s < self._poses[-1].stamp_s:
            self._poses.clear()
        self._poses.append(pose)
        self._assembler.add_odometry(pose.stamp_s, pose.T_odom_base)
        if self._spinning:
            self._turns.add_odometry(pose.stamp_s, pose.T_odom_base)

    def poll(self) -> Iterator[MeasuredSweep]:
        """The sweeps that are complete by now."""
        for pose in self._fused.poll():
            self.add_pose(pose)
        for stamp_s, reading in self._filtered():
            self._assembler.add_scan(stamp_s, reading)
        while (sweep := self._assembler.poll()) is not None:
            after = next(pose for pose in self._poses if pose.stamp_s >= sweep.stamp_s - 1e-6)
            yield MeasuredSweep(sweep, np.asarray(self._history.at(sweep.stamp_s)), after)

    def _filtered(self) -> Iterator[tuple[float, Scan | Revolution]]:
        if not self._spinning:
            yield from ((done.stamp_s, done.scan) for done in self._scans.poll())
            return
        for done in self._turns.poll():
            if done.revolution is not None:
                yield done.end_stamp_s - self._turn_s, done.revolution
