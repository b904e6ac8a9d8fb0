"""Was the robot moved otherwise than by its wheels: lifted, pushed, tilted, or sliding? The IMU tells, against the wheels.

What the accelerometer sums up to, less the filter's velocity, which the wheels hold, is what nobody drove. It is summed up over a short
window only: there an error of the attitude makes centimetres. From when it is too much until the robot rests again, odometry knows nothing
of the way.
"""

import math
from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from odometry_fusion.config import OdometryConfig
from odometry_fusion.error_state import POSITION, State, exp_rotation
from odometry_fusion.interval import ImuInterval
from odometry_fusion.track import Track, Wheels, track_covariance
from robot_body import RobotBody

FloatArray = NDArray[np.float64]
SET_BACK = "the clock was set back"
_WINDOW_S = 0.5  # over so long IMU and wheels are compared; over longer the attitude's error would count
_DISPLACED_M = 0.15  # a way within that time of which the wheels know nothing: somebody moves the robot, or it slides
_SHARE = 0.15  # beside it, as a share of the way that they rolled; rocks make three quarters of both at 0.7 m/s
_UP_M = 0.1  # the same upward or downward: somebody lifts it, or it falls
_UP_SHARE = 0.35  # and beside it, as such a share; plates and ramps make three quarters of both
_TURN_RAD = 0.35  # a turn within that time of which they know nothing, beside yaw_rate_slip of theirs
_TILT_RAD = 0.25  # a tilt while its wheels stand that somebody makes: one that slips off its highest step tilts by 0.2
_STANDING_M = 0.05  # wheels that roll less stand
_REST_MPS2 = 0.3  # a displacement is over after still_delay_s without a stronger acceleration
_REST_RATE = 0.05  # [rad/s] and without a faster turn
_SIGMA_M = 5.0  # nothing is known of the way then; sigma that it adds to the position, sample by sample


@dataclass(frozen=True, eq=False)
class _Moment:
    """Sums since the beginning. In axes of odom, (3,): what the accelerometer makes of the velocity, what of it the wheels do not explain,
    and the way that this is; then yaw that they do not explain and their own, how far they rolled, and the robot's upward axis."""

    stamp_s: float
    felt: FloatArray
    unexplained: FloatArray
    way: FloatArray
    unexplained_yaw: float
    wheel_yaw: float
    rolled_m: float
    upward: FloatArray


class DisplacementWatch:
    """Takes in every interval of the filter, and says why odometry knows nothing of the way in it."""

    def __init__(self, config: OdometryConfig, robot: RobotBody) -> None:
        self._config, self._half_track_m = config, 0.5 * robot.track_m
        self.position_base: FloatArray = np.zeros(3)
        """Of the IMU, (3,) in base_link."""
        self.begin_again()

    def begin_again(self) -> None:
        """Forgets what was, as after a jump of time."""
        self._window: deque[_Moment] = deque()
        self._accel: FloatArray | None = None  # what was felt last
        self._reason = ""
        self._moved_s = -math.inf  # when it was last felt to move, while it is displaced

    def reason(self, state: State, interval: ImuInterval, wheels: Wheels) -> str:
        """In words, "" where the wheels explain the way; `state` and `wheels` at the interval's end."""
        self._accel = self._accel if interval.mean_accel is None else interval.mean_accel  # none came where wheels tell more often
        if self._accel is None or interval.longest_gap_s > self._config.max_imu_gap_s:
            self._window.clear()
            return self._reason
        rate, duration_s = interval.mean_rate - state.gyro_bias, interval.duration_s
        R_midway = state.R_odom_base @ exp_rotation(-0.5 * duration_s * rate)
        acceleration = R_midway @ (self._accel - state.accel_bias) - np.array([0.0, 0.0, self._config.gravity_mps2])
        velocity = state.R_odom_base @ (state.velocity + np.cross(rate, self.position_base))
        self._add(state, wheels, duration_s, (acceleration, velocity), float(rate[2]))
        if self._reason:
            self._rest(interval.end_stamp_s, acceleration, rate)
        elif why := self._too_much():
            self._reason, self._moved_s = why, interval.end_stamp_s
        return self._reason

    def _add(self, state: State, wheels: Wheels, duration_s: float, motion: tuple[FloatArray, FloatArray], yaw_rate: float) -> None:
        (acceleration, velocity), now_s, upward = motion, wheels.stamp_s, state.R_odom_base[:, 2]
        if not self._window:
            self._window.append(_Moment(now_s, velocity, np.zeros(3), np.zeros(3), 0.0, 0.0, 0.0, upward))
            return
        last = self._window[-1]
        felt = last.felt + duration_s * acceleration
        unexplained = felt - velocity
        rolled_m = duration_s * (abs(wheels.forward_mps) + self._half_track_m * abs(wheels.yaw_rate))
        self._window.append(
            _Moment(
                now_s,
                felt,
                unexplained,
                last.way + 0.5 * duration_s * (last.unexplained + unexplained),
                last.unexplained_yaw + duration_s * (yaw_rate - wheels.yaw_rate),
                last.wheel_yaw + duration_s * abs(wheels.yaw_rate),
                last.rolled_m + rolled_m,
                upward,
            )
        )
        while self._window[0].stamp_s < now_s - _WINDOW_S:
            self._window.popleft()

    def _too_much(self) -> str:
        """Why the window is more than the wheels explain."""
        config, first, last = self._config, self._window[0], self._window[-1]
        seconds = last.stamp_s - first.stamp_s
        x, y, z = (last.way - first.way - seconds * first.unexplained).tolist()
        rolled_m = last.rolled_m - first.rolled_m
        if math.hypot(x, y) > _DISPLACED_M + _SHARE * rolled_m:
            return f"moved {math.hypot(x, y):.2f} m otherwise than by its wheels"
        if abs(z) > _UP_M + _UP_SHARE * rolled_m:
            return f"moved {z:+.2f} m up otherwise than by its wheels"
        turned = abs(last.unexplained_yaw - first.unexplained_yaw)
        if turned > _TURN_RAD + config.yaw_rate_slip * (last.wheel_yaw - first.wheel_yaw):
            return f"turned {turned:.2f} rad otherwise than by its wheels"
        tipped = math.acos(min(1.0, float(first.upward @ last.upward)))
        if tipped > _TILT_RAD and rolled_m < _STANDING_M:
            return f"tilted {tipped:.2f} rad while its wheels stood"
        return ""

    def _rest(self, now_s: float, acceleration: FloatArray, rate: FloatArray) -> None:
        """Over once it has rested long enough: neither accelerated nor turned."""
        config = self._config
        if float(np.linalg.norm(acceleration)) > _REST_MPS2 or float(np.linalg.norm(rate)) > _REST_RATE:
            self._moved_s = now_s
        if now_s - self._moved_s > config.still_delay_s:
            self._reason = ""
            self._window.clear()


def displaced(state: State, before_m2: float = 0.0) -> State:
    """The state after a way of which nothing is known, as the covariance of its position says.

    That of the heading stays: else every metre driven on would make the position as unsure again. `before_m2`: the variance that the
    position had in a filter that has begun anew since, m^2, above which it leaps.
    """
    covariance = state.covariance.copy()
    np.einsum("ii->i", covariance)[POSITION] += before_m2 + _SIGMA_M**2
    return replace(state, covariance=covariance)


def begun_again(track: Track, before: Track | None) -> Track:
    """The first track of a filter; after that `before`, whose clock was set back, nothing is known of the way between."""
    if before is None:
        return track
    before_m2 = float(np.diag(track_covariance(before))[:2].max())
    return replace(track, state=displaced(track.state, before_m2), displaced=SET_BACK)
