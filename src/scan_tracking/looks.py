"""When a robot is matched to the map: while it moves, and for a while after it has stopped where it saw too little."""

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import inverse
from scan_tracking.pose_error import way_of

Array = NDArray[np.float64]

_MOVED_M = 0.01  # way, 0.3 m a radian counted in, below which a robot stands
_STANDING_SIGMA_M = 0.015  # of the position; a robot that stands is matched until it is no worse
_STANDING_LOOKS = 30  # or so many bundles were, a nod of the mount: what is seen again tells no more


class Looks:
    """Whether the next bundle is to be matched."""

    def __init__(self) -> None:
        self._looked_at: Array = np.eye(4)  # odometry there
        self._left = 0  # bundles that are matched while it stands

    def begin(self, T_odom_base: Array) -> None:
        """The robot stands here, and what is known of it was told."""
        self._looked_at = T_odom_base

    def renew(self) -> None:
        """Nothing is known any more: it looks around where it stands."""
        self._left = _STANDING_LOOKS

    def matched(self) -> None:
        """One bundle was."""
        self._left -= 1

    def wanted(self, T_odom_base: Array, covariance: Array) -> bool:
        """Whether the robot moves, or stands, is unsure by the (6, 6) `covariance` of its pose, and has not looked around.

        One that rocks as its mount turns does not move.
        """
        if way_of(inverse(self._looked_at) @ T_odom_base) > _MOVED_M:
            self._looked_at, self._left = T_odom_base, _STANDING_LOOKS
        elif np.sqrt(np.diag(covariance)[:3].max()) <= _STANDING_SIGMA_M:
            self._left = 0
        return self._left > 0
