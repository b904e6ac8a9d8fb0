"""How far the robot has come since the last sweep: sums of distance and of turning, not displacement (thesis 6.2.1)."""

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import angle_difference, tilt_angle, translation_distance, yaw_of
from stop_scan_and_go.config import StopScanAndGoConfig
from stop_scan_and_go.interface import TickObservation

_PIVOT_M = 0.2  # a turn about a centre that is nearer than this is one in place


class TravelMeter:
    """Sums the steps between poses of the odometry frame."""

    def __init__(self, slope_rad: float) -> None:
        """`slope_rad`: tilt from which on the robot stands on a slope."""
        self._slope_rad = slope_rad
        self.total_m = 0.0
        self.restart()
        self._last: NDArray[np.float64] | None = None

    def restart(self) -> None:
        """Begin the sums since the last sweep anew; `total_m` goes on."""
        self.distance_m = 0.0
        self.yaw_rad = 0.0
        self.slope_turn_rad = 0.0  # of it in place on a slope

    def take(self, T_odom_base: NDArray[np.float64] | None, *, moves: bool, displaced: bool) -> None:
        """The next pose (4, 4), None where it is not known: a step where the robot `moves`; one that nobody knows where it is displaced."""
        if T_odom_base is not None and moves and not displaced:
            self.add(T_odom_base)
        elif T_odom_base is not None or displaced:
            self.skip_to(T_odom_base)

    def skip_to(self, T_odom_base: NDArray[np.float64] | None) -> None:
        """Take a pose (4, 4) as the next step's beginning without counting the way to it; None forgets the last one."""
        self._last = T_odom_base

    def add(self, T_odom_base: NDArray[np.float64]) -> None:
        """Count the step from the last pose to this (4, 4) one."""
        if self._last is not None:
            step = translation_distance(T_odom_base, self._last)
            self.distance_m += step
            self.total_m += step
            turn = abs(angle_difference(yaw_of(T_odom_base), yaw_of(self._last)))
            self.yaw_rad += turn
            if step < _PIVOT_M * turn and tilt_angle(T_odom_base) > self._slope_rad:
                self.slope_turn_rad += turn
        self._last = T_odom_base


def too_far(config: StopScanAndGoConfig, travel: TravelMeter, tick: TickObservation) -> str:
    """Why it has come so far since the last sweep that the next is due; empty when it has not."""
    sigma_m = tick.tracked_sigma_m
    most_m = config.max_distance_m if sigma_m is None else config.max_tracked_distance_m
    if travel.distance_m > most_m:
        return f"{travel.distance_m:.2f} m since the last sweep"
    if sigma_m is not None:  # which knows what turns did to it
        return f"the position is known to {100 * sigma_m:.1f} cm only" if sigma_m > config.max_pose_sigma_m else ""
    if travel.yaw_rad > config.max_yaw_rad:
        return f"{travel.yaw_rad:.2f} rad since the last sweep"
    drives_on = tick.command is not None and abs(tick.command[0]) > config.still_speed_mps
    if drives_on and travel.slope_turn_rad > config.max_slope_turn_rad:
        return f"turned {travel.slope_turn_rad:.2f} rad in place on a slope"
    return ""
