"""Where the robot came from: there it fits, also where the costmap says that its outline grazes something."""

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from path_following.reference_path import Pose
from rigid_geometry import angle_difference

_EVERY_M, _EVERY_RAD = 0.02, 0.05
_MOST = 500  # poses: ten metres of driving
_JUMP_M = 0.3  # farther from one to the next the robot was carried
_BESIDE_M, _TURNED_RAD = 0.03, 0.05  # a pose like one that the robot had
_AT_M = 0.3  # so near to a place the robot was there


class Trail:
    """The latest poses of the robot in map."""

    def __init__(self) -> None:
        self._poses: deque[Pose] = deque(maxlen=_MOST)

    def add(self, pose: Pose) -> None:
        """The robot stands at x, y, yaw in map now."""
        if self._poses:
            x, y, yaw = self._poses[-1]
            moved = math.hypot(pose[0] - x, pose[1] - y)
            if moved < _EVERY_M and abs(angle_difference(pose[2], yaw)) < _EVERY_RAD:
                return
            if moved > _JUMP_M:
                self._poses.clear()
        self._poses.append(pose)

    def carry_to(self, pose: Pose) -> None:
        """The robot stood while its place in map was corrected, to x, y, yaw: what lies behind it lies as far behind as before."""
        if not self._poses:
            return
        x, y, yaw = self._poses[-1]
        if math.hypot(pose[0] - x, pose[1] - y) > _JUMP_M:
            self._poses.clear()
            return
        turned = angle_difference(pose[2], yaw)
        c, s = math.cos(turned), math.sin(turned)
        for k, (px, py, heading) in enumerate(self._poses):
            dx, dy = px - x, py - y
            self._poses[k] = (pose[0] + c * dx - s * dy, pose[1] + s * dx + c * dy, heading + turned)

    def back_to(self, xy: NDArray[np.float64]) -> NDArray[np.float64]:
        """(M, 2) places from where the robot is to where it was last at `xy` (2,); M is 0 where it was not there."""
        way = np.array(self._poses).reshape(-1, 3)[::-1, :2]
        away = np.linalg.norm(way - xy, axis=1)
        at = away < _AT_M
        if not at.any():
            return way[:0]
        came = int(np.argmax(at))
        left = came + int(np.argmin([*at[came:], False]))
        return way[: came + int(np.argmin(away[came:left])) + 1]

    def like(self, poses: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        """To each of (K, 3) poses those (M, 3) that the robot had and that are it, to a few centimetres and degrees."""
        had = np.array(self._poses).reshape(-1, 3)
        off = np.abs(had - poses[:, None])
        turned = np.minimum(off[..., 2] % (2 * math.pi), -off[..., 2] % (2 * math.pi))
        is_it = (np.hypot(off[..., 0], off[..., 1]) <= _BESIDE_M) & (turned <= _TURNED_RAD)
        return [had[one] for one in is_it]
