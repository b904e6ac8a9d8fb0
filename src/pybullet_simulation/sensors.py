"""The robot's sensors: each measures at the instants of its own clock what the trace of physics was then, and delivers it later."""

import heapq
import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.drive import Drive
from pybullet_simulation.imu import Imu
from pybullet_simulation.laser import Laser
from pybullet_simulation.lidar_config import SpinningLidarConfig
from pybullet_simulation.records import Delivery, ImuSample, JointSample, LidarGeometry, Revolution, Sample, Scan, WheelOdometry
from pybullet_simulation.robot_model import RobotModel
from pybullet_simulation.sensor_clock import SensorClock, SensorTimes, nanoseconds
from pybullet_simulation.sensor_faults import faulty
from pybullet_simulation.spinning_lidar import SpinningLidar
from pybullet_simulation.timing_config import SENSOR_TOPICS, TimingConfig
from pybullet_simulation.trace import Trace
from pybullet_simulation.world import World

SCAN_PERIOD_S = JOINT_PERIOD_S = 0.025
IMU_PERIOD_S = 0.01
WHEEL_PERIOD_S = 0.05
_LASER, _IMU, _JOINTS, _CLOCKS = 11, 12, 14, 15  # random streams of a seed


@dataclass(frozen=True)
class SensorParts:
    """What the sensors are mounted on, and what they see."""

    robot: RobotModel
    drive: Drive
    world: World
    lidar: SpinningLidarConfig | None


class Sensors:
    """All sensors of a robot, each with random streams of its own."""

    def __init__(self, config: SimulationConfig, timing: TimingConfig, parts: SensorParts, seed: int, begin_ns: int) -> None:
        """Their first measurements begin with `begin_ns` or after it."""
        laser_rng, imu_rng, self._joint_rng = (np.random.default_rng([seed, stream]) for stream in (_LASER, _IMU, _JOINTS))
        self._config, self._parts, self._imu = config, parts, Imu(config, imu_rng)
        self._laser = Laser(config, parts.robot, parts.world, laser_rng)
        self._lidar = SpinningLidar(config, parts.lidar, parts.robot, parts.world, laser_rng) if parts.lidar else None
        self._measure: dict[str, Callable[[Trace, int], Sample]] = {
            "/imu/data": self._imu_sample,
            "/wheel_odom": self._wheel_odometry,
            "/joint_states": self._joint_sample,
            **({"/points": self._revolution} if self._lidar else {"/scan": self._scan}),
        }
        self._clocks = {
            sensor.topic: SensorClock(timing, sensor, begin_ns, (seed, _CLOCKS, i), i)
            for i, sensor in ((SENSOR_TOPICS.index(s.topic), s) for s in self._times(timing))
            if sensor.topic in self._measure
        }
        self._under_way: list[tuple[int, int, Delivery]] = []
        self._numbers = itertools.count()

    def _times(self, timing: TimingConfig) -> tuple[SensorTimes, ...]:
        geometry, turn_s = self._laser.geometry, LidarGeometry.duration_s
        return (
            SensorTimes("/imu/data", IMU_PERIOD_S, 0.0, timing.imu_latency_s),
            SensorTimes("/wheel_odom", WHEEL_PERIOD_S, 0.0, timing.wheel_latency_s),
            SensorTimes("/joint_states", JOINT_PERIOD_S, 0.0, timing.joint_latency_s),
            SensorTimes("/scan", SCAN_PERIOD_S, (geometry.beams - 1) * geometry.time_increment, timing.scan_latency_s),
            SensorTimes("/points", turn_s, turn_s, timing.points_latency_s),
        )

    def deliveries(self, trace: Trace, until_ns: int) -> tuple[Delivery, ...]:
        """What is delivered by then and was not before, in order; `trace` reaches until then."""
        for topic, clock in self._clocks.items():
            for one in clock.measured(until_ns):
                sample = faulty(self._measure[topic](trace, one.stamp_ns), one.fault)
                delivery = Delivery(one.delivery_ns / 1e9, topic, sample)
                for _ in range(one.copies):
                    heapq.heappush(self._under_way, (one.delivery_ns, next(self._numbers), delivery))
        found = []
        while self._under_way and self._under_way[0][0] <= until_ns:
            found.append(heapq.heappop(self._under_way)[2])
        return tuple(found)

    def _scan(self, trace: Trace, stamp_ns: int) -> Scan:
        motion, start_s = trace.motion_from(stamp_ns)
        return Scan(stamp_ns / 1e9, self._laser.scans(motion, np.array([start_s]))[0])

    def _revolution(self, trace: Trace, stamp_ns: int) -> Revolution:
        assert self._lidar is not None
        return self._lidar.revolution(*trace.motion_from(stamp_ns), stamp_ns / 1e9)

    def _joint_sample(self, trace: Trace, stamp_ns: int) -> JointSample:
        now, turned = trace.at(stamp_ns), trace.turned(stamp_ns - nanoseconds(JOINT_PERIOD_S), stamp_ns)
        tilt = now.tilt_measured + self._config.tilt_encoder_sigma_rad * self._joint_rng.standard_normal()
        tilting = [] if self._parts.robot.tilt_joint is None else [(self._parts.robot.tilt_joint, float(tilt), now.tilt_rate)]
        forward, wheels = self._parts.robot.forward_of_wheel, [wheel.joint for wheel in self._parts.robot.wheels]
        turns, rates = (forward * trace.encoders(stamp_ns)).tolist(), (forward * turned / JOINT_PERIOD_S).tolist()
        names, positions, velocities = zip(*tilting, *zip(wheels, turns, rates, strict=True), strict=True)
        return JointSample(stamp_ns / 1e9, names, positions, velocities)

    def _imu_sample(self, trace: Trace, stamp_ns: int) -> ImuSample:
        before, now = trace.at(stamp_ns - nanoseconds(IMU_PERIOD_S)), trace.at(stamp_ns)
        acceleration = (now.imu_velocity - before.imu_velocity) / IMU_PERIOD_S
        R_world_imu = now.R_world_base @ self._parts.robot.T_base_imu[:3, :3]
        return self._imu.sample(stamp_ns / 1e9, R_world_imu, now.angular, acceleration)

    def _wheel_odometry(self, trace: Trace, stamp_ns: int) -> WheelOdometry:
        speeds = trace.turned(stamp_ns - nanoseconds(WHEEL_PERIOD_S), stamp_ns) / WHEEL_PERIOD_S
        side = self._parts.robot.side_of_wheel
        left, right = speeds[side == 0].mean(), speeds[side == 1].mean()
        return WheelOdometry(stamp_ns / 1e9, *self._parts.drive.velocity(float(left), float(right)))
