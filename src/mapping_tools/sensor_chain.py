"""From a robot's sensors to sweeps without a master: the filter, odometry and assembler of the nodes, in their order."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from mapping_tools.sweep_sources import UnknownWays, Unreadable
from odometry_fusion import FusedOdometry, OdometryConfig
from rigid_geometry import OdometryHistory
from robot_body import RobotBody
from sensor_checks import ImuLimits
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


@dataclass(frozen=True)
class SensorConfig:
    """Configurations of scan_filter_node, sweep_assembler_node and odometry_fusion_node."""

    scan_filter: ScanFilterConfig = field(default_factory=ScanFilterConfig)
    lidar: LidarConfig = field(default_factory=LidarConfig)
    assembly: SweepAssemblyConfig = field(default_factory=SweepAssemblyConfig)
    odometry: OdometryConfig = field(default_factory=OdometryConfig)
    imu: ImuLimits = field(default_factory=ImuLimits)


@dataclass(frozen=True, eq=False)
class Pose:
    """T_odom_base (4, 4), and the (6, 6) covariance of its position and rotation as nav_msgs/Odometry has it."""

    stamp_s: float
    T_odom_base: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class MeasuredSweep:
    """A sweep with the odometry at its stamp, between the poses around it, and the first pose from there on.

    lost: nobody knows the way since the sweep before.
    """

    sweep: Sweep
    T_odom_base: Array
    pose: Pose
    lost: bool


class SensorChain:
    """Takes what drivers send, in order within a topic, and gives out sweeps."""

    def __init__(
        self, config: SensorConfig, robot: RobotBody, mount: TiltGeometry, rotation_of: Callable[[str], Array], *, spinning: bool
    ) -> None:
        """`rotation_of(frame)`: the (3, 3) rotation R_base_imu of a frame, or ValueError; `spinning`: a lidar stands in the laser's place.

        ValueError when a configuration is wrong.
        """
        self._fused = FusedOdometry(config.odometry, config.imu, robot, rotation_of)
        self._scans = ScanChain(config.scan_filter, mount, robot)
        self._turns = RevolutionChain(config.scan_filter, config.lidar, mount, robot)
        self._turn_s = config.lidar.duration_s
        self._assembler = SweepAssembler(config.assembly, LidarRevolutions(config.lidar) if spinning else LaserScans(), mount)
        self._spinning = spinning
        self._history, self._ways = OdometryHistory[Pose](), UnknownWays()

    @property
    def dropped(self) -> dict[str, int]:
        """How many messages, scans and sweeps were given up, by reason."""
        own = Counter(self._turns.dropped if self._spinning else self._scans.dropped)
        return dict(own + Counter(self._assembler.dropped) + Counter(self._fused.dropped))

    def add_joint(self, stamp_s: float, tilt_rad: float) -> None:
        """Takes the tilt at a time."""
        (self._turns if self._spinning else self._scans).add_joint(stamp_s, tilt_rad)
        self._assembler.add_joint(stamp_s, tilt_rad)

    def add_imu(self, stamp_s: float, frame: str, gyro: Sequence[float], accel: Sequence[float]) -> None:
        """Takes rad/s and m/s^2 in `frame`; ValueError, one line with advice, for an IMU that cannot be right."""
        self._fused.add_imu(stamp_s, frame, gyro, accel)

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
        if not self._history.add_pose(pose.stamp_s, pose.T_odom_base):
            return
        self._history.add_up(pose.stamp_s, pose)
        self._assembler.add_odometry(pose.stamp_s, pose.T_odom_base)
        if self._ways.add(pose.stamp_s, pose.covariance.ravel()):
            self._assembler.break_at(pose.stamp_s)
        if self._spinning:
            self._turns.add_odometry(pose.stamp_s, pose.T_odom_base)

    def poll(self) -> Iterator[MeasuredSweep | Unreadable]:
        """The sweeps that are complete by now; `Unreadable`, without a name, where odometry was silent or is forgotten."""
        for estimate in self._fused.poll():
            self.add_pose(Pose(estimate.stamp_s, estimate.T_odom_base, estimate.pose_covariance))
        for stamp_s, reading in self._filtered():
            self._assembler.add_scan(stamp_s, reading)
        while (sweep := self._assembler.poll()) is not None:
            try:
                T_odom_base, after = self._history.at(sweep.stamp_s)
            except ValueError as error:
                yield Unreadable("", sweep.stamp_s, str(error))
                continue
            yield MeasuredSweep(sweep, np.asarray(T_odom_base), after, self._ways.until(sweep.stamp_s))

    def _filtered(self) -> Iterator[tuple[float, Scan | Revolution]]:
        if not self._spinning:
            yield from ((done.stamp_s, done.scan) for done in self._scans.poll())
            return
        for done in self._turns.poll():
            if done.revolution is not None:
                yield done.end_stamp_s - self._turn_s, done.revolution
