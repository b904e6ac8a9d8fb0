"""The filter from messages to estimates: what may be processed when, standing still, gaps and time that jumps.

State is committed at the stamps of wheel messages, an interval at a time, and only as far as asked for; an estimate in between
drives a copy on. So an estimate depends on stamps and samples only, never on the order between topics or on earlier questions.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from odometry_fusion import measurements
from odometry_fusion.config import OdometryConfig
from odometry_fusion.displacement import DisplacementWatch, begun_again, displaced
from odometry_fusion.error_state import GYRO_BIAS, SLIP, VELOCITY, ProcessNoise, State, predict, rest
from odometry_fusion.interval import ImuInterval, imu_interval
from odometry_fusion.measurements import GRAVITY_DRIVING_SIGMA, QUIET_ACCEL_MPS2
from odometry_fusion.stamp_watch import StampWatch
from odometry_fusion.track import Track, Wheels, anchored, at_stamp, track_covariance
from rigid_geometry import JUMP_BACK_S, STAMP_TOLERANCE_S, StampedBuffer
from robot_body import RobotBody

FloatArray = NDArray[np.float64]
IMU_RATE_HZ = 100.0  # bandwidth for which the noise of the reported rates holds
FIRST_LEVELLING_S = 1.0  # IMU samples older than this say nothing about the attitude at the first wheel message
_FORWARD_VELOCITY_WALK = 0.3  # [m/s^2/sqrt(Hz)] how strongly the forward velocity changes unseen
_ACROSS_VELOCITY_WALK = 0.2  # [m/s^2/sqrt(Hz)] how strongly the velocity sideways and up changes
_FORWARD_SLIP_TIME_S = 60.0  # for how long the slip stays as it is, before terrain and load change it
_GAP_RATE_SIGMA = 0.3  # [rad/s] how fast the robot may have turned unseen


@dataclass(frozen=True, eq=False)
class OdometryEstimate:
    """Where the robot is at `stamp_s`, and how sure that is.

    `T_odom_base` (4, 4); `pose_covariance` (6, 6): x, y, z, rotation about x, y, z, in axes of odom, as nav_msgs/Odometry has it,
    summed up from stop to stop: between two stops its difference is the true covariance of the movement.
    `twist` (6,) m/s and rad/s, linear then angular, in base_link, with `twist_covariance` (6, 6). `standing`: wheels and body are
    still. `displaced`: why nothing is known of the way just now, as the covariance says; "" where it is.
    """

    stamp_s: float
    T_odom_base: FloatArray
    pose_covariance: FloatArray
    twist: FloatArray
    twist_covariance: FloatArray
    standing: bool
    displaced: str = ""


class OdometryFilter:
    """6-D extended Kalman filter of gyroscope, accelerometer and wheel velocities (thesis 5.3)."""

    def __init__(self, config: OdometryConfig, robot: RobotBody) -> None:
        """ValueError when the configuration is wrong."""
        if problems := config.validate():
            raise ValueError("; ".join(problems))
        self._config, self._robot = config, robot
        self._noise = ProcessNoise(
            gyro=config.gyro_noise,
            velocity_walk=(_FORWARD_VELOCITY_WALK, _ACROSS_VELOCITY_WALK),
            gyro_bias_walk=config.gyro_bias_walk,
            accel_bias_walk=config.accel_bias_walk,
            slip_sigma=config.forward_slip_sigma,
            slip_time_s=_FORWARD_SLIP_TIME_S,
        )
        self._dropped: Counter[str] = Counter()
        self._imu: StampedBuffer[list[float]] = StampedBuffer("imu", config.buffer_s, self._dropped)
        self._wheels: StampedBuffer[list[float]] = StampedBuffer("wheels", config.buffer_s, self._dropped)
        self._buffers = {buffer.source: buffer for buffer in (self._imu, self._wheels)}
        self._set_back, self._ahead = StampWatch(self._dropped, "late"), StampWatch(self._dropped, "ahead")
        self._track: Track | None = None
        self._before: Track | None = None  # the last one before the clock was set back
        self._displacement = DisplacementWatch(config, robot)

    @property
    def dropped(self) -> dict[str, int]:
        """How many samples were dropped, pauses bridged and resets made, by reason."""
        return dict(self._dropped)

    @property
    def complete_until_s(self) -> float | None:
        """Both inputs are there up to this stamp: an estimate up to it that is None now will never come. None without inputs."""
        newest = self._newest_s()
        return min(newest) + STAMP_TOLERANCE_S if len(newest) == 2 else None

    def _newest_s(self) -> list[float]:
        return [b.last_stamp_s for b in self._buffers.values() if b.last_stamp_s is not None]

    @property
    def next_due_s(self) -> float | None:
        """Stamp of the first wheel message that no estimate was asked for yet and both inputs reach; None where there is none."""
        following, until_s = self._wheels.first(), self.complete_until_s
        return following[0] if following is not None and until_s is not None and following[0] <= until_s else None

    def mount_imu(self, position_base: ArrayLike) -> None:
        """Where (3,) in base_link the IMU is: one beside the middle feels turns. Until it is told, it is in the middle."""
        self._displacement.position_base = np.asarray(position_base, dtype=np.float64)

    def add_imu(self, stamp_s: float, gyro: ArrayLike, accel: ArrayLike) -> None:
        """Takes (3,) angular velocity in rad/s and (3,) specific force in m/s^2, both in base_link.

        What is not finite, late or repeated is dropped and counted; time that jumps back starts afresh. ValueError on other shapes.
        """
        row = np.concatenate([np.ravel(gyro), np.ravel(accel)]).tolist()
        if len(row) != 6:
            raise ValueError(f"an IMU sample has three rates and three accelerations, not {gyro!r} and {accel!r}")
        self._add(self._imu, stamp_s, row)

    def add_wheels(self, stamp_s: float, v: float, w: float) -> None:
        """Takes forward velocity in m/s and yaw rate in rad/s from the encoders; drops as `add_imu` does."""
        self._add(self._wheels, stamp_s, [float(v), float(w)])

    def estimate(self, stamp_s: float) -> OdometryEstimate | None:
        """The estimate at a time; stamps asked for must not decrease.

        None while an IMU sample or a wheel message with this stamp or a later one is missing, before the first wheel message
        with an IMU sample, and for times before the last wheel message already used. ValueError when the stamp is not finite.
        """
        if not math.isfinite(stamp_s):
            raise ValueError(f"the stamp of an estimate is a finite time, not {stamp_s}")
        if self.complete_until_s is None or stamp_s > self.complete_until_s:
            return None
        self._commit_until(stamp_s)
        track = self._track
        if track is None or stamp_s < track.state.stamp_s - STAMP_TOLERANCE_S:
            return None
        following = self._wheels.first()
        if stamp_s > track.state.stamp_s + STAMP_TOLERANCE_S and following is not None:
            track = self._between(track, stamp_s, self._observed(*following))
        return self._described(track)

    def _add(self, buffer: StampedBuffer[list[float]], stamp_s: float, row: list[float]) -> None:
        newest = self._newest_s()
        if not all(map(math.isfinite, (stamp_s, *row))):
            self._dropped[f"{buffer.source}_not_finite"] += 1
        elif buffer.jumps_back(stamp_s):
            if self._set_back.hold(buffer.source, stamp_s, row):
                self._begin_again()
        elif len(newest) == 2 and stamp_s > max(newest) + JUMP_BACK_S:
            # Of a pause, or a clock that was set forward, both inputs tell; of a stamp that is wrong one does.
            if self._ahead.hold(buffer.source, stamp_s, row):
                for source, held_s, held in self._ahead.believed():
                    self._buffers[source].append(held_s, held)
        elif buffer.takes(stamp_s, self._begin_again):
            self._set_back.forget(buffer.source)
            self._ahead.forget(buffer.source)
            buffer.append(stamp_s, row)

    def _begin_again(self) -> None:
        self._dropped["time_jump"] += 1
        for buffer in self._buffers.values():
            buffer.clear()
        self._before, self._track = self._track or self._before, None
        self._displacement.begin_again()
        for source, stamp_s, row in self._set_back.believed():
            self._add(self._buffers[source], stamp_s, row)

    def _commit_until(self, stamp_s: float) -> None:
        """Processes the wheel messages up to a time; the IMU is complete up to there."""
        while (following := self._wheels.first()) is not None and following[0] <= stamp_s + STAMP_TOLERANCE_S:
            wheels = self._observed(*following)
            self._track = self._started(wheels) if self._track is None else self._advanced(self._track, wheels)
            self._wheels.drop_first()
            self._imu.forget_before(wheels.stamp_s)

    def _observed(self, stamp_s: float, row: Sequence[float]) -> Wheels:
        """A wheel message in the light of the ones before: do the wheels stand, and since when?"""
        still = abs(row[0]) < self._config.still_wheel_mps and abs(row[1]) < self._config.still_wheel_rate
        before = self._track.wheels if self._track else None
        since = None
        if still:
            unbroken = before is not None and stamp_s - before.stamp_s <= self._config.max_wheel_gap_s
            since = before.still_since_s if unbroken and before is not None else None
            since = stamp_s if since is None else since
        return Wheels(stamp_s, row[0], row[1], since)

    def _started(self, wheels: Wheels) -> Track | None:
        """Levelled from the samples so far; None, and counted, when they do not show where up is."""
        stamps, samples = self._imu.around(wheels.stamp_s - FIRST_LEVELLING_S, wheels.stamp_s)
        rows = np.array(samples, dtype=np.float64)
        before = stamps <= wheels.stamp_s
        force = rows[before, 3:].mean(axis=0) if before.any() else np.zeros(3)
        strength = float(np.linalg.norm(force))
        if strength < 0.5 * self._config.gravity_mps2:
            self._dropped["start_without_gravity"] += 1
            return None
        still = wheels.still_since_s is not None
        disturbance = abs(strength - self._config.gravity_mps2) + (0.0 if still else GRAVITY_DRIVING_SIGMA)
        duration_s = max(float(np.ptp(stamps[before])), 0.01)
        state = measurements.level(wheels.stamp_s, force, duration_s, disturbance, still, self._config)
        return begun_again(Track(state, wheels, rows[before, :3][-1], -math.inf, False, None), self._before)

    def _advanced(self, track: Track, wheels: Wheels) -> Track:
        """The track at the next wheel message, with its measurements."""
        interval = imu_interval(self._imu, track.state.stamp_s, wheels.stamp_s)
        self._count_gaps(interval, wheels.stamp_s - track.wheels.stamp_s)
        if self._stands(track, interval, wheels):
            state = measurements.stand_still(rest(track.state, interval.duration_s, self._noise), interval, self._config)
            standing = track.standing or interval.mean_accel is not None
            stood = replace(track, state=at_stamp(state, wheels.stamp_s), wheels=wheels, rate=interval.rates[-1], standing=standing)
            return self._watched(stood, interval)
        track = anchored(track)
        state = self._driven(track.state, interval)
        state = measurements.roll_wheels(state, interval, wheels.forward_mps, wheels.yaw_rate, self._config, self._robot)
        forward_accel = (wheels.forward_mps - track.wheels.forward_mps) / interval.duration_s
        state = measurements.feel_gravity(state, interval, forward_accel, self._config)
        rocked_s = track.rocked_s if self._quiet(track, interval) else wheels.stamp_s
        driven = replace(track, state=at_stamp(state, wheels.stamp_s), wheels=wheels, rate=interval.rates[-1], rocked_s=rocked_s)
        return self._watched(driven, interval)

    def _watched(self, track: Track, interval: ImuInterval) -> Track:
        """The track, which does not know where it leads while the robot is moved otherwise than by its wheels."""
        why = self._displacement.reason(track.state, interval, track.wheels)
        if not why:
            return replace(track, displaced="")
        if not track.displaced:
            self._dropped["displaced"] += 1
        track = anchored(track)
        return replace(track, state=displaced(track.state), rocked_s=track.wheels.stamp_s, displaced=why)

    def _between(self, track: Track, stamp_s: float, following: Wheels) -> Track:
        """The track at a time before the wheel message that follows, which only tells whether the robot stands."""
        interval = imu_interval(self._imu, track.state.stamp_s, stamp_s)
        if self._stands(track, interval, following):
            return replace(track, state=at_stamp(track.state, stamp_s), rate=interval.rates[-1])
        track = anchored(track)
        return replace(track, state=at_stamp(self._driven(track.state, interval), stamp_s), rate=interval.rates[-1])

    def _stands(self, track: Track, interval: ImuInterval, wheels: Wheels) -> bool:
        """Wheels stood for long enough, at both ends of the interval, and so did the body."""
        since = wheels.still_since_s
        if track.displaced or since is None or track.wheels.still_since_s is None or interval.longest_gap_s > self._config.max_imu_gap_s:
            return False
        still_s = interval.end_stamp_s - max(since, track.rocked_s)
        return still_s >= self._config.still_delay_s and self._quiet(track, interval) and not self._accelerates(track.state, interval)

    def _quiet(self, track: Track, interval: ImuInterval) -> bool:
        """The body turns no faster than `still_gyro_rate`, or than the gyroscope's noise and its bias, as far as known, explain."""
        variance = np.trace(track.state.covariance[GYRO_BIAS, GYRO_BIAS]) + 3.0 * self._config.gyro_noise**2 / interval.duration_s
        limit = max(self._config.still_gyro_rate, 3.0 * math.sqrt(variance))
        return float(np.linalg.norm(interval.mean_rate - track.state.gyro_bias)) < limit

    def _accelerates(self, state: State, interval: ImuInterval) -> bool:
        """Something other than gravity is felt: who is pushed does not stand."""
        if interval.mean_accel is None:
            return False
        up = self._config.gravity_mps2 * state.R_odom_base[2]
        return float(np.linalg.norm(interval.mean_accel - state.accel_bias - up)) > QUIET_ACCEL_MPS2

    def _driven(self, state: State, interval: ImuInterval) -> State:
        turning = abs(float(interval.mean_rate[2] - state.gyro_bias[2]))
        noise = replace(self._noise, skid_walk=self._config.turning_slip_walk * turning)
        if interval.longest_gap_s > self._config.max_imu_gap_s:
            unseen_s = min(interval.longest_gap_s, interval.duration_s)
            variance = _GAP_RATE_SIGMA**2 * interval.longest_gap_s * unseen_s  # over the whole gap: (sigma * length)^2
            noise = replace(noise, attitude_variance=variance)
        return predict(state, interval.rates, interval.durations, noise)

    def _count_gaps(self, interval: ImuInterval, wheel_pause_s: float) -> None:
        if interval.longest_gap_s > self._config.max_imu_gap_s:
            self._dropped["imu_gap"] += 1
        if wheel_pause_s > self._config.max_wheel_gap_s:
            self._dropped["wheels_gap"] += 1

    def _described(self, track: Track) -> OdometryEstimate:
        state, standing = track.state, track.standing
        T_odom_base = np.eye(4)
        T_odom_base[:3, :3], T_odom_base[:3, 3] = state.R_odom_base, state.position
        rate = np.zeros(3) if standing else track.rate - state.gyro_bias
        return OdometryEstimate(
            stamp_s=state.stamp_s,
            T_odom_base=T_odom_base,
            pose_covariance=track_covariance(track),
            twist=np.concatenate([np.zeros(3) if standing else state.velocity, rate]),
            twist_covariance=self._twist_covariance(state),
            standing=standing,
            displaced=track.displaced,
        )

    def _twist_covariance(self, state: State) -> FloatArray:
        covariance = np.zeros((6, 6))
        covariance[:3, :3] = state.covariance[VELOCITY, VELOCITY]
        covariance[0, 0] += state.covariance[SLIP, SLIP] * state.velocity[0] ** 2
        covariance[3:, 3:] = state.covariance[GYRO_BIAS, GYRO_BIAS] + np.eye(3) * self._config.gyro_noise**2 * IMU_RATE_HZ
        return covariance
