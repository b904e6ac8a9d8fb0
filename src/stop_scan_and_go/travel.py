"""How far the robot has come since the last sweep: sums of distance and of turning, not displacement (thesis 6.2.1)."""

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import angle_difference, translation_distance, yaw_of


class TravelMeter:
    """Sums the steps between poses of the odometry frame."""

    def __init__(self) -> None:
        self.total_m = 0.0
        self.restart()
        self._last: NDArray[np.float64] | None = None

    def restart(self) -> None:
        """Begin the sums since the last sweep anew; `total_m` goes on."""
        self.distance_m = 0.0
        self.yaw_rad = 0.0

    def skip_to(self, T_odom_base: NDArray[np.float64] | None) -> None:
        """Take a pose (4, 4) as the next step's beginning without counting the way to it; None forgets the last one."""
        self._last = T_odom_base

    def add(self, T_odom_base: NDArray[np.float64]) -> None:
        """Count the step from the last pose to this (4, 4) one."""
        if self._last is not None:
            step = translation_distance(T_odom_base, self._last)
            self.distance_m += step
            self.total_m += step
            self.yaw_rad += abs(angle_difference(yaw_of(T_odom_base), yaw_of(self._last)))
        self._last = T_odom_base
