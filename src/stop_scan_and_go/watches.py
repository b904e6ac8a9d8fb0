"""Conditions that must hold for a while, on the stamps of the ticks: the robot is still, the sweep is over."""

import math

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import clock_leap_s
from stop_scan_and_go.config import StopScanAndGoConfig
from stop_scan_and_go.interface import SweepKind, TickObservation

_UNBROKEN_S = 1.0  # ticks come at 10 Hz or more; a longer step is a clock that was set or a robot that was not looked at
FOLLOWER_GRACE_S = 0.5  # after a decision the follower's old end is not taken for its new one so long
_IDLE_LIMIT_S = 5.0  # a follower without a path for this long ends the drive
_LEVEL_TIME_S = 0.1  # horizontal and standing for so long ends a sweep


def leap_s(before: float | None, stamp: float) -> float:
    """The step from one tick's stamp to the next where it is no time that was looked at: backward, or too long; else 0."""
    return clock_leap_s(before, stamp, _UNBROKEN_S)


def is_moving(config: StopScanAndGoConfig, twist: tuple[float, float] | None) -> bool:
    """Whether a measured twist (m/s, rad/s) is that of a robot that moves, or may be."""
    if twist is None or not all(math.isfinite(t) for t in twist):
        return True
    return abs(twist[0]) > config.still_speed_mps or abs(twist[1]) > config.still_turn_rate_radps


class HeldFor:
    """True once a condition has held without a break for some time."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._since: float | None = None
        self._last: float | None = None

    def holds(self, stamp: float, condition: bool) -> bool:
        """Take in the condition at `stamp` s; where time leaps the waiting begins anew."""
        leapt, self._last = leap_s(self._last, stamp), stamp
        if not condition:
            self._since = None
            return False
        if self._since is None or leapt:
            self._since = stamp
        # A hair's breadth for sums of ticks.
        return stamp - self._since >= self._seconds - 1e-9


class RockingWatch:
    """How fast the robot rolls and pitches, from one pose to the next."""

    def __init__(self) -> None:
        self._last: tuple[float, NDArray[np.float64]] | None = None

    def rate(self, stamp: float, T_odom_base: NDArray[np.float64] | None) -> float:
        """rad/s since the pose before; infinite where that is not known, or no time has passed."""
        before, self._last = self._last, None if T_odom_base is None else (stamp, T_odom_base[2, :3].copy())
        if before is None or self._last is None or not stamp > before[0]:
            return math.inf
        turned = float(np.linalg.norm(np.cross(before[1], self._last[1])))
        return math.asin(min(1.0, turned)) / (stamp - before[0])


class DriveWatch:
    """Sees what the follower says of the end of one drive. It may still tell of its last path when the new one is just being stored."""

    def __init__(self) -> None:
        self._awaits_follower = True
        self._idle = HeldFor(_IDLE_LIMIT_S)

    def end(self, tick: TickObservation, since_s: float) -> tuple[SweepKind, str] | None:
        """How the drive that began `since_s` before has ended, and why; None while it has not."""
        end = tick.drive_end
        is_old = self._awaits_follower and since_s < FOLLOWER_GRACE_S
        if end is not None and not is_old:
            return end, f"{tick.follower_state}: {tick.follower_reason}"
        if end is None and not tick.is_idle:
            self._awaits_follower = False
        if self._idle.holds(tick.stamp_s, tick.is_idle):
            return SweepKind.IDLE, f"the follower is idle: {tick.follower_reason}"
        return None


class SweepWatch:
    """Sees from the tilt alone that a sweep has begun and that it is over.

    A sweep passes the horizon on its way, so being horizontal is not enough: the mount must stand there.
    """

    def __init__(self, config: StopScanAndGoConfig, stamp: float) -> None:
        self._config = config
        self.begun_s = stamp
        self.has_left = False
        self._silent_s, self._lowest_rad, self._highest_rad = 0.0, math.inf, -math.inf
        self._last: tuple[float, float] | None = None
        self._level = HeldFor(_LEVEL_TIME_S)

    def is_over(self, stamp: float, tilt: float) -> bool:
        """Take in the tilt in radians at `stamp` s; True when the laser has left the horizontal and stands in it again."""
        rate = self._rate(stamp, tilt)
        self._lowest_rad, self._highest_rad = min(self._lowest_rad, tilt), max(self._highest_rad, tilt)
        self.has_left = self.has_left or abs(tilt) > self._config.left_tilt_rad
        level = abs(tilt) <= self._config.level_tilt_rad and rate <= self._config.level_rate_radps
        return self._level.holds(stamp, self.has_left and level)

    def _rate(self, stamp: float, tilt: float) -> float:
        last, self._last = self._last, (stamp, tilt)
        return abs(tilt - last[1]) / (stamp - last[0]) if last and stamp > last[0] else float("inf")

    def let_pass(self, seconds: float) -> None:
        """A time without a tilt counts for nothing."""
        self._silent_s += seconds

    def without_cloud(self, asked_rad: float | None) -> str:
        """That no cloud came of it, and which tilts were seen; `asked_rad`: of those that are asked for, None where nobody knows."""
        asked = "" if asked_rad is None else f", of {asked_rad:.2f} that are asked for"
        return f"no cloud of the sweep, in which the mount went from {self._lowest_rad:.2f} to {self._highest_rad:.2f} rad{asked}"

    def failure(self, stamp: float) -> str:
        """Why the sweep has failed by now; empty while it has not."""
        waited = stamp - self.begun_s - self._silent_s
        if not self.has_left and waited > self._config.sweep_start_limit_s:
            return f"the sweep did not begin within {self._config.sweep_start_limit_s:.1f} s"
        if waited > self._config.sweep_limit_s:
            return f"the sweep did not end within {self._config.sweep_limit_s:.1f} s"
        return ""
