"""The newest poses of a moving frame, asked for times that lie between them and for no others."""

import math
from collections import deque

import numpy as np

from rigid_geometry.stamped_buffer import JUMP_BACK_S, STAMP_TOLERANCE_S
from rigid_geometry.transforms import Transform, as_transform, interpolate_transforms, inverse, rotation_angle, translation_distance

KEPT_S = 20.0
LONGEST_STAND_S = 2.0  # between two poses; in a longer silence it may have driven away and back
_STOOD_M, _STOOD_RAD = 0.05, math.radians(1.0)  # by which the poses of a robot that stands differ, of a GNSS for example


class PoseHistory:
    """Stamped poses in order; time that jumped back starts it afresh."""

    def __init__(self) -> None:
        self._stamps: deque[float] = deque()
        self._poses: deque[Transform] = deque()

    def add(self, stamp_s: float, T: Transform) -> bool:
        """Whether it takes the (4, 4) pose: one that is late or doubled is left out. ValueError when it is not rigid."""
        pose = as_transform(T)
        if self._stamps and stamp_s <= self._stamps[-1]:
            if stamp_s > self._stamps[-1] - JUMP_BACK_S:
                return False
            self._stamps.clear()
            self._poses.clear()
        self._stamps.append(stamp_s)
        self._poses.append(pose)
        while len(self._stamps) > 2 and self._stamps[0] < stamp_s - KEPT_S:
            self._stamps.popleft()
            self._poses.popleft()
        return True

    def reaches(self, stamp_s: float) -> bool:
        """True when a pose at or after `stamp_s` is there."""
        return bool(self._stamps) and self._stamps[-1] >= stamp_s - 1e-6

    def nearest(self, stamp_s: float) -> Transform:
        """The (4, 4) pose at `stamp_s`, or at the end of what is known that is nearest to it; ValueError when nothing is."""
        if not self._stamps:
            raise ValueError(f"no pose is known at {stamp_s:.3f} s")
        return self.at(min(max(stamp_s, self._stamps[0]), self._stamps[-1]))

    def at(self, stamp_s: float, longest_gap_s: float = math.inf) -> Transform:
        """The (4, 4) pose at `stamp_s`, between the poses around it.

        ValueError when it lies outside, or those are farther apart and it moved between them, or they are by LONGEST_STAND_S.
        """
        if not self._stamps:
            raise ValueError(f"no pose is known at {stamp_s:.3f} s")
        stamps = np.array(self._stamps)
        last = min(int(np.searchsorted(stamps, stamp_s)), len(stamps) - 1)
        first = max(last - 1, 0)
        is_between = stamps[last] - stamps[first] > longest_gap_s and stamps[last] - stamp_s > STAMP_TOLERANCE_S
        is_silent = stamps[last] - stamps[first] > LONGEST_STAND_S or not is_standing(self._poses[first], self._poses[last])
        if is_between and is_silent:
            raise ValueError(f"the pose at {stamp_s:.3f} s is not known: there was none for {stamps[last] - stamps[first]:.1f} s")
        poses = np.stack([self._poses[i] for i in range(first, last + 1)])
        return np.asarray(
            interpolate_transforms(stamps[first : last + 1], poses, min(stamp_s, stamps[-1]) if self.reaches(stamp_s) else stamp_s)[0]
        )


def is_standing(T_a: Transform, T_b: Transform) -> bool:
    """Whether two (4, 4) poses are those of a robot that stood, as well as an odometry knows it."""
    return translation_distance(T_a, T_b) < _STOOD_M and rotation_angle(inverse(T_a) @ T_b) < _STOOD_RAD
