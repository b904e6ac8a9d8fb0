"""What sweeps need of the odometry, as long as they may still ask for it; the next process of a node knows what this one knew."""

import math
from collections import deque
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from node_life import Journal, Life
from rigid_geometry import JUMP_BACK_S, PoseHistory
from rigid_geometry.transforms import Transform

_TOLERANCE_S = 1e-6
_KEPT_S = 20.0
_LONGEST_GAP_S = 0.3  # a robot that turns meanwhile is nobody knows where between two samples
_Gravity = tuple[NDArray[np.float64], float]
_Up = tuple[float, NDArray[np.float64], float]
_Note = tuple[float, Transform | None, _Gravity | None]


class AtSweep(NamedTuple):
    """T_odom_base (4, 4) at the end of a sweep, and up in base_link (3,) with its sigma."""

    T_odom_base: Transform
    up: NDArray[np.float64]
    up_sigma_rad: float


class OdometryRecord:
    """Poses, and what is up, which may come from another odometry, by their stamps."""

    def __init__(self, life: Life) -> None:
        """As the process before this one knew it."""
        self._journal = Journal(life, "odometry")
        nothing = PoseHistory(), deque[_Up]()
        (self._poses, self._ups), notes = self._journal.taken_up(nothing)
        for stamp_s, T_odom_base, gravity in cast(list[_Note], notes):
            if T_odom_base is not None:
                self._poses.add(stamp_s, T_odom_base)
            if gravity is not None:
                self._ups.append((stamp_s, *gravity))

    def add_pose(self, stamp_s: float, T_odom_base: Transform) -> None:
        """The (4, 4) pose of base_link. ValueError when it is not rigid."""
        self._poses.add(stamp_s, T_odom_base)
        self._note(stamp_s, T_odom_base, None)

    def add_up(self, stamp_s: float, up: NDArray[np.float64], sigma_rad: float) -> None:
        """(3,) in base_link, with its sigma. One that is late is left out; where the clock was set back, older ones are forgotten."""
        if self._ups and stamp_s <= self._ups[-1][0]:
            if stamp_s > self._ups[-1][0] - JUMP_BACK_S:
                return
            self._ups.clear()
        self._ups.append((stamp_s, up, sigma_rad))
        while self._ups[0][0] < stamp_s - _KEPT_S:
            self._ups.popleft()
        self._note(stamp_s, None, (up, sigma_rad))

    def reaches(self, stamp_s: float) -> bool:
        """Whether both are known up to `stamp_s`."""
        return bool(self._ups) and self._ups[-1][0] >= stamp_s - _TOLERANCE_S and self._poses.reaches(stamp_s)

    def at(self, stamp_s: float) -> AtSweep:
        """The pose at `stamp_s`, and the first that was told of up since. ValueError where either was silent around it, or is forgotten."""
        T_odom_base = self._poses.at(stamp_s, _LONGEST_GAP_S)
        since_s, up, sigma_rad = next(known for known in self._ups if known[0] >= stamp_s - _TOLERANCE_S)
        if since_s > stamp_s + _LONGEST_GAP_S:
            raise ValueError(f"what was up at {stamp_s:.3f} s is not known: the odometry told it {since_s - stamp_s:.1f} s later")
        return AtSweep(T_odom_base, up, sigma_rad)

    def newest(self) -> Transform:
        """T_odom_base (4, 4) as it was told last; ValueError before it was."""
        return self._poses.nearest(math.inf)

    def _note(self, stamp_s: float, T_odom_base: Transform | None, gravity: _Gravity | None) -> None:
        if self._journal.note((stamp_s, T_odom_base, gravity)):
            self._journal.keep((self._poses, self._ups))
