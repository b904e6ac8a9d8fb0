"""Conditions that must hold for a while, on the stamps of the ticks: the robot is still, the sweep is over."""

import math

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import clock_leap_s
from stop_scan_and_go.config import StopScanAndGoConfig

_UNBROKEN_S = 1.0  # ticks come at 10 Hz or more; a longer step is a clock that was set or a robot that was not looked at
_LEVEL_TIME_S = 0.1  # horizontal and standing for so long ends a sweep


def leap_s(before: float | None, stamp: float) -> float:
    """The step from one tick's stamp to the next where it is no time that was looked at: backward, or too long; else 0."""
    return clock_leap_s(before, stamp, _UNBROKEN_S)


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


class SweepWatch:
    """Sees from the tilt alone that a sweep has begun and that it is over.

    A sweep passes the horizon on its way, so being horizontal is not enough: the mount must stand there.
    """

    def __init__(self, config: StopScanAndGoConfig, stamp: float) -> None:
        self._config = config
        self.begun_s = stamp
        self.has_left = False
        self._last: tuple[float, float] | None = None
        self._level = HeldFor(_LEVEL_TIME_S)

    def is_over(self, stamp: float, tilt: float) -> bool:
        """Take in the tilt in radians at `stamp` s; True when the laser has left the horizontal and stands in it again."""
        rate = self._rate(stamp, tilt)
        self.has_left = self.has_left or abs(tilt) > self._config.left_tilt_rad
        level = abs(tilt) <= self._config.level_tilt_rad and rate <= self._config.level_rate_radps
        return self._level.holds(stamp, self.has_left and level)

    def _rate(self, stamp: float, tilt: float) -> float:
        last, self._last = self._last, (stamp, tilt)
        return abs(tilt - last[1]) / (stamp - last[0]) if last and stamp > last[0] else float("inf")

    def failure(self, stamp: float) -> str:
        """Why the sweep has failed by now; empty while it has not."""
        waited = stamp - self.begun_s
        if not self.has_left and waited > self._config.sweep_start_limit_s:
            return f"the sweep did not begin within {self._config.sweep_start_limit_s:.1f} s"
        if waited > self._config.sweep_limit_s:
            return f"the sweep did not end within {self._config.sweep_limit_s:.1f} s"
        return ""
