"""Odometry that knows nothing of the last way says so by its covariance, which leaps: so all who hear it know, in the same order."""

import math

LEAP_M = 1.0
"""Nothing that a robot drives between two samples makes its position so unsure."""


class LeapWatch:
    """Takes in the covariance of every sample of an odometry."""

    def __init__(self) -> None:
        self._variance_m2 = math.inf

    def leapt(self, variance_x_m2: float, variance_y_m2: float) -> bool:
        """Whether nothing is known of the way from the sample before to the one with these variances of its position."""
        before, self._variance_m2 = self._variance_m2, max(variance_x_m2, variance_y_m2)
        return self._variance_m2 - before > LEAP_M**2
