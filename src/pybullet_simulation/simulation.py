"""The simulation: advances robot and world by a tick under one command and hands out what the sensors measured.

It stands in for the robot: commands and requests for a sweep go in, laser scans, joint states, IMU samples and wheel odometry come
out, and the truth, which only the evaluation may see. The same world, seed and commands give the same data, bit for bit.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.drive import Drive, SlipModel
from pybullet_simulation.imu import Imu
from pybullet_simulation.laser import Laser, Motion
from pybullet_simulation.lidar_config import SpinningLidarConfig
from pybullet_simulation.physics import BodyState, Physics
from pybullet_simulation.records import Contact, ImuSample, JointSample, Scan, ScanGeometry, TickData, Truth, WheelOdometry
from pybullet_simulation.robot_model import TILT_JOINT, WHEELS, read_robot_model
from pybullet_simulation.spinning_lidar import SpinningLidar
from pybullet_simulation.sweep_profile import spinning_sweep_profile, sweep_profile
from pybullet_simulation.world import World
from robot_body import RobotBody

Array = NDArray[np.float64]

TICK_S = 0.05
FIRST_TICK = 20  # the clock never reads zero, which ROS takes for "no time"
TICKS_PER_S = 20
IMU_PER_TICK = 5
SCANS_PER_TICK = 2  # and joint samples
SIDE_OF_WHEEL = np.array([0, 1, 0, 1])  # of WHEELS: left, right, left, right


@dataclass(frozen=True)
class _Trace:
    """A tick of physics: states at every step, first and last included; how far the wheels turned in each half (2, 4); contacts."""

    states: list[BodyState]
    wheel_turns: Array
    contacts: tuple[Contact, ...]


class Simulation:
    """A Husky in a world, in ticks of 0.05 s; the first one ends at 1.0 s."""

    def __init__(
        self,
        config: SimulationConfig,
        world: World,
        seed: int,
        robot: RobotBody | None = None,
        lidar: SpinningLidarConfig | None = None,
    ) -> None:
        """The robot stands at the world's start, settled, laser level; with a `lidar` that one sits in the laser's place.

        ValueError lists what is wrong with the configs or the robot.
        """
        problems = config.validate() + (lidar.validate() if lidar else [])
        if problems:
            raise ValueError("; ".join(problems))
        laser_rng, imu_rng, slip_rng, self._joint_rng = (np.random.default_rng([seed, stream]) for stream in (11, 12, 13, 14))
        body = robot or RobotBody()
        self._config, self._robot = config, read_robot_model(body)
        self._physics = Physics(config, body, self._robot, world)
        self._drive, self._slip = Drive(config, body), SlipModel(config, slip_rng)
        self._imu = Imu(config, imu_rng)
        self._laser = None if lidar else Laser(config, self._robot, world, laser_rng)
        self._lidar = SpinningLidar(config, lidar, self._robot, world, laser_rng) if lidar else None
        self._profile = spinning_sweep_profile(config, lidar) if lidar else sweep_profile(config)
        self._tick, self._sweep_start_s = FIRST_TICK - 1 + round(config.clock_start_s * TICKS_PER_S), math.nan
        self._steps, self._dt_s = config.physics_rate_hz // TICKS_PER_S, 1.0 / config.physics_rate_hz
        self._settle()
        self._encoders, self._angles = np.zeros(4), self._physics.wheel_angles()

    def _settle(self) -> None:
        self._physics.set_tilt(0.0)
        self._physics.set_wheel_speeds(np.zeros(4))
        self._state = self._physics.state()
        for _ in range(round(self._config.settle_time_s * self._config.physics_rate_hz)):
            self._state = self._physics.step()

    def close(self) -> None:
        """Frees the physics; the simulation cannot be used after it."""
        self._physics.close()

    @property
    def stamp_s(self) -> float:
        """End of the last tick, 0.95 before the first."""
        return self._tick / TICKS_PER_S

    @property
    def T_world_base(self) -> Array:
        """(4, 4) true pose of base_link now."""
        return _pose(self._state)

    @property
    def sweeping(self) -> bool:
        """Whether a sweep was asked for and is not over."""
        return not math.isnan(self._sweep_start_s)

    @property
    def sweep_left_s(self) -> float:
        """What is left of the sweep under way, in seconds; 0 when there is none."""
        return self._profile.duration_s - (self.stamp_s - self._sweep_start_s) if self.sweeping else 0.0

    @property
    def sweep_duration_s(self) -> float:
        """How long a sweep takes, from level to level."""
        return self._profile.duration_s

    @property
    def spinning(self) -> bool:
        """Whether a spinning lidar is in the laser's place."""
        return self._lidar is not None

    @property
    def scan_geometry(self) -> ScanGeometry:
        """Angles, times and limits of the laser."""
        return ScanGeometry(range_min=self._config.range_min_m, range_max=self._config.range_max_m)

    def start_sweep(self) -> None:
        """Begin a sweep with the next tick. ValueError when one is running."""
        if self.sweeping:
            raise ValueError(f"a sweep is running since {self._sweep_start_s:.2f} s")
        self._sweep_start_s = self.stamp_s

    def tick(self, v: float, w: float) -> TickData:
        """Advance by 0.05 s under a command (m/s, rad/s); the data measured meanwhile. ValueError when the command is not finite."""
        begin_s = self.stamp_s
        times_s = begin_s + np.arange(self._steps + 1, dtype=np.float64) * self._dt_s
        tilts, rates = self._tilts(times_s)
        slip = 1.0 + self._slip.step(TICK_S)[SIDE_OF_WHEEL]
        trace = self._advance(self._drive.step(v, w, TICK_S)[SIDE_OF_WHEEL] / slip, float(tilts[-1]))
        self._tick += 1
        turns = trace.wheel_turns * slip
        motion = self._motion(trace.states, tilts)
        return TickData(
            stamp_s=self.stamp_s,
            scans=self._scans(begin_s, motion),
            joints=self._joint_samples(begin_s, turns, tilts, rates),
            imu=self._imu_samples(begin_s, trace.states),
            wheel_odometry=self._wheel_odometry(turns),
            truth=_truth(self.stamp_s, trace.states[-1]),
            contacts=trace.contacts,
            sweeping=self._still_sweeping(),
            revolution=self._lidar.half_turn(motion, begin_s) if self._lidar else None,
        )

    def _tilts(self, times_s: Array) -> tuple[Array, Array]:
        if not self.sweeping:
            return np.zeros(times_s.size), np.zeros(times_s.size)
        elapsed = times_s - self._sweep_start_s
        return self._profile.tilt_at(elapsed), self._profile.rate_at(elapsed)

    def _still_sweeping(self) -> bool:
        if self.sweeping and self.stamp_s - self._sweep_start_s >= self._profile.duration_s - 1e-9:
            self._sweep_start_s = math.nan
        return self.sweeping

    def _advance(self, wheel_speeds_rps: Array, tilt_rad: float) -> _Trace:
        """One tick of physics; contacts are looked at whenever the IMU samples, wheels at half and at all of it."""
        self._physics.set_wheel_speeds(wheel_speeds_rps)
        self._physics.set_tilt(tilt_rad)
        states, contacts, turns = [self._state], [], []
        for step in range(1, self._steps + 1):
            states.append(self._physics.step())
            if step % (self._steps // IMU_PER_TICK) == 0:
                contacts += self._physics.contacts(float(np.linalg.norm(states[-2].linear)))
            if step % (self._steps // SCANS_PER_TICK) == 0:
                before, self._angles = self._angles, self._physics.wheel_angles()
                turns.append(self._angles - before)
        self._state = states[-1]
        return _Trace(states, np.array(turns), _strongest(contacts))

    def _motion(self, states: list[BodyState], tilts: Array) -> Motion:
        return Motion(np.array([s.R_world_base for s in states]), np.array([s.position for s in states]), tilts, self._dt_s)

    def _scans(self, begin_s: float, motion: Motion) -> tuple[Scan, ...]:
        if self._laser is None:
            return ()
        starts = np.arange(SCANS_PER_TICK, dtype=np.float64) * (TICK_S / SCANS_PER_TICK)
        ranges = self._laser.scans(motion, starts)
        return tuple(Scan(begin_s + float(start), one) for start, one in zip(starts, ranges, strict=True))

    def _joint_samples(self, begin_s: float, turns: Array, tilts: Array, rates: Array) -> tuple[JointSample, ...]:
        samples, period_s = [], TICK_S / SCANS_PER_TICK
        for i in range(SCANS_PER_TICK):
            self._encoders = self._encoders + turns[i]
            at = (i + 1) * self._steps // SCANS_PER_TICK
            tilt = tilts[at] + self._config.tilt_encoder_sigma_rad * self._joint_rng.standard_normal()
            positions, velocities = (float(tilt), *self._encoders.tolist()), (float(rates[at]), *(turns[i] / period_s).tolist())
            samples.append(JointSample(begin_s + (i + 1) * period_s, (TILT_JOINT, *WHEELS), positions, velocities))
        return tuple(samples)

    def _imu_samples(self, begin_s: float, states: list[BodyState]) -> tuple[ImuSample, ...]:
        stride, T_base_imu = self._steps // IMU_PER_TICK, self._robot.T_base_imu
        velocities = [_velocity_at(s, T_base_imu[:3, 3]) for s in states[::stride]]
        samples, period_s = [], TICK_S / IMU_PER_TICK
        for i in range(1, IMU_PER_TICK + 1):
            state, acceleration = states[i * stride], (velocities[i] - velocities[i - 1]) / period_s
            R_world_imu = state.R_world_base @ T_base_imu[:3, :3]
            samples.append(self._imu.sample(begin_s + i * period_s, R_world_imu, state.angular, acceleration))
        return tuple(samples)

    def _wheel_odometry(self, turns: Array) -> WheelOdometry:
        speeds = turns.sum(axis=0) / TICK_S
        left, right = speeds[SIDE_OF_WHEEL == 0].mean(), speeds[SIDE_OF_WHEEL == 1].mean()
        return WheelOdometry(self.stamp_s, *self._drive.velocity(float(left), float(right)))


def _pose(state: BodyState) -> Array:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = state.R_world_base, state.position
    return T


def _velocity_at(state: BodyState, point_base: Array) -> Array:
    """(3,) velocity in world axes of a point (3,) fixed in base_link."""
    arm = state.position + state.R_world_base @ point_base - state.centre_of_mass
    (wx, wy, wz), (x, y, z) = state.angular.tolist(), arm.tolist()  # numpy's cross takes 40 us
    return np.asarray(state.linear + np.array([wy * z - wz * y, wz * x - wx * z, wx * y - wy * x]))


def _truth(stamp_s: float, state: BodyState) -> Truth:
    R_t = state.R_world_base.T
    return Truth(stamp_s, _pose(state), R_t @ _velocity_at(state, np.zeros(3)), R_t @ state.angular)


def _strongest(contacts: list[Contact]) -> tuple[Contact, ...]:
    """The strongest contact of each link, in the order of first touch."""
    best: dict[str, Contact] = {}
    for contact in contacts:
        if contact.link not in best or contact.force_n > best[contact.link].force_n:
            best[contact.link] = contact
    return tuple(best.values())
