"""Is the robot getting anywhere? Measured along the path and in turns, on the stamps of the observations."""

import math
from dataclasses import dataclass

from path_following.config import FollowerConfig
from rigid_geometry import angle_difference

_LARGEST_TURN_RAD = 3 * math.pi
PROGRESS_DISTANCE_M = 0.10  # progress is this much along the path
_PROGRESS_ANGLE_RAD = 0.15  # or this much of a turn


@dataclass(frozen=True)
class _Mark:
    stamp: float
    s: float
    yaw: float


class ProgressWatch:
    """Tells when neither distance nor turning has grown for too long; turning alone counts for one and a half circles only."""

    def __init__(self, config: FollowerConfig, stamp: float, s: float, yaw: float) -> None:
        self._config = config
        self._mark = _Mark(stamp, s, yaw)
        self._turned = 0.0
        self.has_recovered = False
        """Whether there was a recovery since the last progress: another helps no more."""

    def pause(self, seconds: float) -> None:
        """Let `seconds` count for nothing."""
        self._mark = _Mark(self._mark.stamp + seconds, self._mark.s, self._mark.yaw)

    def carry_to(self, s: float) -> None:
        """Go on along another path, at its arc length `s` m."""
        self._mark = _Mark(self._mark.stamp, s, self._mark.yaw)

    def is_stalled(self, stamp: float, s: float, yaw: float) -> bool:
        """Take in arc length `s` m and `yaw` rad at `stamp` s; True when the patience is over."""
        turn = abs(angle_difference(yaw, self._mark.yaw))
        if s >= self._mark.s + PROGRESS_DISTANCE_M:
            self._mark, self._turned, self.has_recovered = _Mark(stamp, s, yaw), 0.0, False
        elif turn >= _PROGRESS_ANGLE_RAD and self._turned < _LARGEST_TURN_RAD:
            self._turned += turn
            self._mark = _Mark(stamp, self._mark.s, yaw)
        return stamp - self._mark.stamp > self._config.progress_patience_s
