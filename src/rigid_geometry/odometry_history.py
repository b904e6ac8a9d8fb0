"""What sweeps ask of an odometry: the pose at their stamp, and what was up, which may come from another odometry."""

import math
from collections import deque
from typing import Generic, TypeVar

from rigid_geometry.pose_history import KEPT_S, LONGEST_STAND_S, PoseHistory, is_standing
from rigid_geometry.stamped_buffer import JUMP_BACK_S, STAMP_TOLERANCE_S
from rigid_geometry.transforms import Transform

V = TypeVar("V")

_LONGEST_GAP_S = 0.3  # of a robot that moves: where it is between two samples nobody knows


class OdometryHistory(Generic[V]):
    """Poses, and values that tell what was up, by their stamps, as long as sweeps may ask for them."""

    def __init__(self) -> None:
        self._poses = PoseHistory()
        self._ups: deque[tuple[float, V]] = deque()

    def add_pose(self, stamp_s: float, T_odom_base: Transform) -> bool:
        """Whether it takes the (4, 4) pose of base_link, as `PoseHistory.add`. ValueError when it is not rigid."""
        return self._poses.add(stamp_s, T_odom_base)

    def add_up(self, stamp_s: float, up: V) -> bool:
        """Whether it takes what is up: one that is late is left out; where the clock was set back, older ones are forgotten."""
        if self._ups and stamp_s <= self._ups[-1][0]:
            if stamp_s > self._ups[-1][0] - JUMP_BACK_S:
                return False
            self._ups.clear()
        self._ups.append((stamp_s, up))
        while self._ups[0][0] < stamp_s - KEPT_S:
            self._ups.popleft()
        return True

    def reaches(self, stamp_s: float) -> bool:
        """Whether both are known up to `stamp_s`."""
        return bool(self._ups) and self._ups[-1][0] >= stamp_s - STAMP_TOLERANCE_S and self._poses.reaches(stamp_s)

    def at(self, stamp_s: float) -> tuple[Transform, V]:
        """The (4, 4) pose at `stamp_s`, and the first that was told of up since.

        ValueError where either was silent around it while the robot moved, is forgotten, or does not reach it.
        """
        T_odom_base = self._poses.at(stamp_s, _LONGEST_GAP_S)
        for since_s, up in self._ups:
            late_s = since_s - stamp_s
            if late_s > LONGEST_STAND_S or (late_s > _LONGEST_GAP_S and not self._stood_until(since_s, T_odom_base)):
                raise ValueError(f"what was up at {stamp_s:.3f} s is not known: the odometry told it {late_s:.1f} s later")
            if since_s >= stamp_s - STAMP_TOLERANCE_S:
                return T_odom_base, up
        raise ValueError(f"what was up at {stamp_s:.3f} s is not known yet")

    def _stood_until(self, stamp_s: float, T_odom_base: Transform) -> bool:
        return self._poses.reaches(stamp_s) and is_standing(T_odom_base, self._poses.at(stamp_s))

    def newest(self) -> Transform:
        """T_odom_base (4, 4) as it was told last; ValueError before it was."""
        return self._poses.nearest(math.inf)
