"""The simulation: advances robot and world by a tick under one command and hands out what came of the sensors.

It stands in for the robot: commands and requests for a sweep go in, laser scans, joint states, IMU samples and wheel odometry come
out, and the truth, which only the evaluation may see. The same world, seed and commands give the same data, bit for bit.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.disturbances import Done
from pybullet_simulation.drive import Drive, SlipModel
from pybullet_simulation.ground import Ground
from pybullet_simulation.lidar_config import SpinningLidarConfig
from pybullet_simulation.mount_drive import MountDrive
from pybullet_simulation.open_ground import crowd_in, hands_in
from pybullet_simulation.physics import BodyState, Physics
from pybullet_simulation.records import Contact, ScanGeometry, TickData, Truth, strongest
from pybullet_simulation.robot_model import read_robot_model
from pybullet_simulation.sensors import IMU_PERIOD_S, SensorParts, Sensors
from pybullet_simulation.sweep_profile import nod_moves, spinning_sweep_profile, sweep_profile, within_limits
from pybullet_simulation.tilt_mount import TiltMount
from pybullet_simulation.timing_config import TimingConfig
from pybullet_simulation.trace import PhysicsTick, Tilts, Trace
from pybullet_simulation.world import World
from robot_body import RobotBody
from simulated_movers import Crowd, MovingParts, RobotSeen

Array = NDArray[np.float64]

TICK_S = 0.05
FIRST_TICK = 20  # the clock never reads zero, which ROS takes for "no time"
TICKS_PER_S = 20
TICK_NS = 50_000_000
ENCODERS_PER_TICK = 2  # instants at which the wheels' angles are taken
IMU_PER_TICK = round(TICK_S / IMU_PERIOD_S)
_SLIP, _GROUND, _MOUNT, _HANDS = 13, 16, 17, 18  # random streams of a seed, beside those of the sensors
_SETTLE_TIME_S = 1.0  # time the robot gets to come to rest on its wheels before the first tick


class Simulation:
    """A robot in a world, in ticks of 0.05 s; the first one ends at 1.0 s."""

    def __init__(
        self,
        config: SimulationConfig,
        world: World,
        seed: int,
        robot: RobotBody | None = None,
        lidar: SpinningLidarConfig | None = None,
        timing: TimingConfig | None = None,
    ) -> None:
        """The robot stands at the world's start, settled, laser level; with a `lidar` that one sits in the laser's place.

        ValueError lists what is wrong with the configs or the robot.
        """
        timing = timing or TimingConfig()
        problems = config.validate() + timing.validate() + (lidar.validate() if lidar else [])
        if problems:
            raise ValueError("; ".join(problems))
        slip_rng, ground_rng, mount_rng = (np.random.default_rng([seed, stream]) for stream in (_SLIP, _GROUND, _MOUNT))
        body = robot or RobotBody()
        self._config, self._body, self._robot = config, body, read_robot_model(body)
        if not self._robot.tilts and lidar is None:
            raise ValueError(f"robot {body.name}: a laser that is fixed has to be a spinning lidar")
        self._physics = Physics(config, body, self._robot, world)
        self._drive, self._slip, self._ground = Drive(body), SlipModel(config, slip_rng), Ground(config, ground_rng)
        self._mount = TiltMount(config, mount_rng)
        within, lidar_within = within_limits(config, lidar, self._robot.tilt_limits_rad)
        self._profile = spinning_sweep_profile(within, lidar_within) if lidar_within else sweep_profile(within)
        self._mount_drive = MountDrive(self._profile, nod_moves(within))
        self._tick = FIRST_TICK - 1 + round(config.clock_start_s * TICKS_PER_S)
        self._steps, self._dt_s = config.physics_rate_hz // TICKS_PER_S, 1.0 / config.physics_rate_hz
        self._command, self._command_age = (0.0, 0.0), 0
        self._crowd, self._hands = self._crowd_of(world, seed), hands_in(world, config, body, np.random.default_rng([seed, _HANDS]))
        self._begin_s = self.stamp_s
        self._settle()
        self._encoders, self._angles = np.zeros(len(self._robot.wheels)), self._physics.wheel_angles()
        self._trace = Trace(TICK_NS, config.physics_rate_hz)
        self._trace.append(self._stood())
        self._sensors, self.spinning = (
            Sensors(config, timing, SensorParts(self._robot, self._drive, world, lidar), seed, self._now_ns),
            bool(lidar),
        )

    def _crowd_of(self, world: World, seed: int) -> Crowd | None:
        """The world's movers, at their starts; ValueError for one that cannot be there."""
        crowd = crowd_in(world, self._body, seed)
        if crowd is None:
            return None
        self._physics.add_movers(crowd.parts)
        self._physics.place_movers(crowd.part_poses())
        return crowd

    def _seen(self) -> RobotSeen:
        x, y = self._state.position[:2].tolist()
        forward = self._state.R_world_base[:, 0]
        speed = float(self._state.linear @ forward)
        return RobotSeen(x, y, math.atan2(forward[1], forward[0]), speed, self._body.half_length_m, self._body.half_width_m)

    @property
    def crowd(self) -> Crowd | None:
        """What moves beside the robot, for the judge; None where nothing does."""
        return self._crowd

    @property
    def disturbances(self) -> Sequence[Done]:
        """What was done to the robot so far, for the judge."""
        return self._hands.done if self._hands is not None else ()

    def _settle(self) -> None:
        self._physics.set_tilt(0.0)
        self._physics.set_wheel_speeds(np.zeros(len(self._robot.wheels)))
        self._state = self._physics.state()
        for _ in range(round(_SETTLE_TIME_S * self._config.physics_rate_hz)):
            self._state = self._physics.step()

    def close(self) -> None:
        """Frees the physics; the simulation cannot be used after it."""
        self._physics.close()

    @property
    def stamp_s(self) -> float:
        """End of the last tick, 0.95 before the first."""
        return self._tick / TICKS_PER_S

    @property
    def _now_ns(self) -> int:
        return self._tick * TICK_NS

    @property
    def T_world_base(self) -> Array:
        """(4, 4) true pose of base_link now."""
        return _pose(self._state)

    @property
    def sweeping(self) -> bool:
        """Whether a sweep was asked for and is not over."""
        return self._mount_drive.sweeping

    @property
    def sweep_left_s(self) -> float:
        """What is left of the sweep under way, in seconds; 0 when there is none."""
        return self._mount_drive.sweep_left_s(self.stamp_s)

    @property
    def scan_geometry(self) -> ScanGeometry:
        """Angles, times and limits of the laser."""
        return ScanGeometry(range_min=self._config.range_min_m, range_max=self._config.range_max_m)

    def start_sweep(self) -> None:
        """Begin a sweep with the next tick. ValueError while the mount moves, and where it cannot."""
        self._check_mount()
        self._mount_drive.start_sweep(self.stamp_s)

    def nod(self, wanted: bool) -> None:
        """Have the mount nod from the next tick on, or come to rest level. ValueError while a sweep is made, and where it cannot."""
        self._check_mount()
        self._mount_drive.nod(wanted, self.stamp_s)

    def _check_mount(self) -> None:
        if not self._robot.tilts:
            raise ValueError("the lidar is fixed")

    def tick(self, v: float | None = None, w: float = 0.0) -> TickData:
        """Advance by 0.05 s under a new command (m/s, rad/s), or under the last one until it is `command_timeout_s` old.

        What came of the sensors meanwhile. ValueError when the command is not finite.
        """
        begin_s = self.stamp_s
        tilts = self._tilts(begin_s + np.arange(self._steps + 1, dtype=np.float64) * self._dt_s)
        self._trace.append(self._advance(self._obeyed(v, w), tilts))
        self._tick += 1
        return TickData(
            stamp_s=self.stamp_s,
            deliveries=self._sensors.deliveries(self._trace, self._now_ns),
            truth=_truth(self.stamp_s, self._state),
            contacts=self._trace.ticks[-1].contacts,
            sweeping=self._still_sweeping(),
        )

    def _obeyed(self, v: float | None, w: float) -> tuple[float, float]:
        """The command that the drive follows: the newest, or to stand when that is too old."""
        if v is not None:
            self._command, self._command_age = (v, w), 0
        age_s, self._command_age = self._command_age * TICK_S, self._command_age + 1
        return self._command if age_s < self._config.command_timeout_s - 1e-9 else (0.0, 0.0)

    def _tilts(self, times_s: Array) -> Tilts:
        measured, rates = self._mount_drive.tilts(times_s)
        return Tilts(self._mount.true_tilts(measured), measured, rates)

    def _still_sweeping(self) -> bool:
        self._mount_drive.finish(self.stamp_s)
        return self.sweeping

    def _advance(self, command: tuple[float, float], tilts: Tilts) -> PhysicsTick:
        """One tick of physics; contacts are looked at whenever the IMU samples, wheels at half and at all of it."""
        speeds = self._drive.step(*command, TICK_S)
        side = self._robot.side_of_wheel
        slip = (1.0 + self._slip.step(TICK_S) + self._slip_of_ground(speeds))[side]
        self._physics.set_wheel_speeds(speeds[side] / slip)
        self._physics.set_tilt(float(tilts.measured[-1]))
        look = self._steps // IMU_PER_TICK
        states, contacts, turns = [self._state], [], []
        movers = self._moved_parts()
        for step in range(1, self._steps + 1):
            if movers is not None:
                self._physics.place_movers(movers.at(step / self._steps))
            states.append(self._stepped(step))
            if step % look == 0 and not (self._hands and self._hands.hold):
                contacts += self._physics.contacts(states[-1 - look])
            if step % (self._steps // ENCODERS_PER_TICK) == 0:
                before, self._angles = self._angles, self._physics.wheel_angles()
                turns.append((self._angles - before) * slip)
        self._state = states[-1]
        return replace(self._physics_tick(states, tilts, np.array(turns), contacts), movers=movers)

    def _stepped(self, step: int) -> BodyState:
        """A step of the physics, or what hands make of it."""
        state = self._physics.step()
        if self._hands is None:
            return state
        now_s = self.stamp_s - self._begin_s + step * self._dt_s
        speed_mps = float(state.linear @ state.R_world_base[:, 0])
        self._hands.step(now_s, _pose(state), speed_mps)
        guided = self._hands.guided(now_s)
        return state if guided is None else self._physics.put(guided)

    def _moved_parts(self) -> MovingParts | None:
        """Movers go on by a tick, as they saw the robot at its begin."""
        if self._crowd is None:
            return None
        before = self._crowd.part_poses()
        self._crowd.step(TICK_S, self._seen())
        return MovingParts.of(self._crowd.parts, np.stack([before, self._crowd.part_poses()]), TICK_S)

    def _slip_of_ground(self, speeds: Array) -> Array:
        """(2,) added slip of both sides on this ground, whose sideways friction is set, too."""
        if not (self._ground.varies or self._hands):
            return np.zeros(2)
        R, place = self._state.R_world_base, self._state.position[:2]
        self._physics.set_grip(self._ground.sideways_ratio(place), self._hands.grip if self._hands else 1.0)
        left = R[:2, 1] * self._body.track_m / 2.0
        return self._ground.slip(np.array([place + left, place - left]), float(R[2, 0] * np.sign(speeds.sum())))

    def _physics_tick(self, states: list[BodyState], tilts: Tilts, turns: Array, contacts: list[Contact]) -> PhysicsTick:
        encoders = self._encoders
        for turn in turns:
            self._encoders = self._encoders + turn
        return PhysicsTick(
            begin_ns=self._now_ns,
            rotations=np.array([s.R_world_base for s in states]),
            positions=np.array([s.position for s in states]),
            angular=np.array([s.angular for s in states]),
            imu_velocities=np.array([_velocity_at(s, self._robot.T_base_imu[:3, 3]) for s in states]),
            tilts=tilts,
            encoders=encoders,
            turns=turns,
            contacts=strongest(contacts),
        )

    def _stood(self) -> PhysicsTick:
        """A tick before the first one: the robot stands."""
        still = self._tilts(np.zeros(self._steps + 1))
        before = self._physics_tick([self._state] * (self._steps + 1), still, np.zeros((ENCODERS_PER_TICK, len(self._robot.wheels))), [])
        crowd = self._crowd
        parts = None if crowd is None else MovingParts.of(crowd.parts, np.stack([crowd.part_poses()] * 2), TICK_S)
        return replace(before, begin_ns=self._now_ns - TICK_NS, movers=parts)


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
