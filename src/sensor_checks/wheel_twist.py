"""Whether a wheel odometry fills its twist, which is all that the nodes read of it: its pose tells when the robot moves."""

import math
from collections import deque

from rigid_geometry import JUMP_BACK_S

_WINDOW_S = 1.0  # over so long pose and twist are compared
_MOVED_M = 0.1  # beside a twist of 0 no pose moves so far in that time
_TURNED_RAD = 0.1  # nor turns so far

Pose = tuple[float, float, float]
"""x and y in metres, and yaw in radians."""


class TwistWatch:
    """Takes in every message, and says what is wrong of one whose pose moves while its twist is 0."""

    def __init__(self) -> None:
        self._window: deque[tuple[float, Pose]] = deque()
        self._fault: str | None = None

    def fault(self, stamp_s: float, pose: Pose, twist: tuple[float, float]) -> str | None:
        """In one line, from when it is seen until a twist is not 0; None for what is right, or cannot be told.

        `twist`: forward velocity in m/s and yaw rate in rad/s.
        """
        if any(twist):
            self._window.clear()
            self._fault = None
        elif all(map(math.isfinite, (stamp_s, *pose))):
            self._add(stamp_s, pose)
            moved_m, turned_rad = self._motion()
            if moved_m > _MOVED_M or turned_rad > _TURNED_RAD:
                self._fault = f"its pose moves, its twist is 0: {moved_m:.2f} m and {turned_rad:.2f} rad; let the driver fill the twist"
        return self._fault

    def _add(self, stamp_s: float, pose: Pose) -> None:
        if self._window and stamp_s < self._window[-1][0] - JUMP_BACK_S:
            self._window.clear()
        self._window.append((stamp_s, pose))
        while self._window[0][0] < stamp_s - _WINDOW_S:
            self._window.popleft()

    def _motion(self) -> tuple[float, float]:
        """Way in m and turn in rad of the window, each less its greatest step: a pose that is set anew leaps once."""
        poses = [pose for _, pose in self._window]
        steps = [_between(a, b) for a, b in zip(poses, poses[1:], strict=False)] or [(0.0, 0.0)]
        way_m, turn_rad = _between(poses[0], poses[-1])
        return way_m - max(step[0] for step in steps), turn_rad - max(step[1] for step in steps)


def _between(a: Pose, b: Pose) -> tuple[float, float]:
    return math.hypot(b[0] - a[0], b[1] - a[1]), abs(math.remainder(b[2] - a[2], 2.0 * math.pi))
