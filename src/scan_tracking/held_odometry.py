"""Odometry that stays where it is while the robot stands."""

import math

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import inverse, rotation_angle, rotation_from_rpy, translation_distance, yaw_of

Array = NDArray[np.float64]

_JUMP_M, _JUMP_RAD = 0.15, 0.1  # at once: an odometry that begins anew, or jumps, corrects nothing
_PAUSE_S = 0.3  # between two samples: in a longer one the robot may have moved
_SLOW_MPS, _SLOW_RADPS = 0.02, 0.02  # faster before it stood, it still moved on the way to here


class HeldOdometry:
    """Poses of an odometry, without what it corrects of its past while it says that the robot stands.

    A filter learns most at rest: what is up, and how far its gyroscope is off. Then it knows better where it has driven, and moves its pose
    by centimetres. Who has followed the robot on a map knows that already. What is up is taken as the odometry has it.
    """

    def __init__(self) -> None:
        self._held_from_told: Array | None = None  # (4, 4), level; None: as it is told
        self._newest: Array | None = None
        self._slow_s = -math.inf  # stamp of the newest sample, where it was slow
        self._tells_v = self._tells_w = False

    def pose(self, stamp_s: float, T_odom_base: Array, v: float, w: float) -> Array:
        """(4, 4) the held pose, for one that was told with a speed of v m/s and w rad/s.

        It stands where both are exactly 0. An odometry that has never told another v, or another w, does not tell that.
        """
        self._tells_v, self._tells_w = self._tells_v or v != 0.0, self._tells_w or w != 0.0
        stands = v == w == 0.0 and self._tells_v and self._tells_w and 0.0 <= stamp_s - self._slow_s <= _PAUSE_S
        T = T_odom_base if self._held_from_told is None else self._held_from_told @ T_odom_base
        if stands and self._newest is not None and not _jumped(self._newest, T):
            self._held_from_told = _level_between(T_odom_base, self._newest)
            T = self._held_from_told @ T_odom_base
        self._newest, self._slow_s = T, stamp_s if abs(v) < _SLOW_MPS and abs(w) < _SLOW_RADPS else -math.inf
        return T


def _jumped(before: Array, after: Array) -> bool:
    return translation_distance(before, after) > _JUMP_M or rotation_angle(inverse(before) @ after) > _JUMP_RAD


def _level_between(a: Array, b: Array) -> Array:
    """(4, 4) turn about the vertical, and shift, that bring pose `a` to the position and heading of `b`."""
    T = np.eye(4)
    T[:3, :3] = rotation_from_rpy(0.0, 0.0, yaw_of(b) - yaw_of(a))
    T[:3, 3] = b[:3, 3] - T[:3, :3] @ a[:3, 3]
    return T
