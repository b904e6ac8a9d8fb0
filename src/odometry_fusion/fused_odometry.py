"""From raw messages of IMU and wheels to an estimate for every wheel stamp: what odometry_fusion_node and ./map_bag both run."""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from odometry_fusion.config import OdometryConfig
from odometry_fusion.imu_input import ImuInput
from odometry_fusion.odometry_filter import OdometryEstimate, OdometryFilter
from robot_body import RobotBody
from sensor_checks import ImuLimits

FloatArray = NDArray[np.float64]


def _in_the_middle(_frame: str) -> FloatArray:
    return np.zeros(3)


class FusedOdometry:
    """The wheels drive it: an estimate comes out at each of their stamps, once all inputs up to it are there."""

    def __init__(
        self,
        config: OdometryConfig,
        limits: ImuLimits,
        robot: RobotBody,
        rotation_of: Callable[[str], FloatArray],
        position_of: Callable[[str], FloatArray] = _in_the_middle,
    ) -> None:
        """ValueError when the configuration is wrong.

        `rotation_of(frame)`: the (3, 3) rotation R_base_imu of a frame, or ValueError. `position_of(frame)`: its (3,) origin in base_link.
        """
        self._filter = OdometryFilter(config, robot)
        self._imu = ImuInput(limits, rotation_of)
        self._position_of, self._frame = position_of, ""

    @property
    def dropped(self) -> dict[str, int]:
        """As the filter's."""
        return self._filter.dropped

    def add_imu(self, stamp_s: float, frame: str, gyro: Sequence[float], accel: Sequence[float]) -> None:
        """Takes rates in rad/s and specific force in m/s^2 in `frame`; ValueError in one line for an IMU that cannot be right."""
        for sample in self._imu.add(stamp_s, frame, gyro, accel):
            if frame != self._frame:
                self._frame = frame
                self._filter.mount_imu(self._position_of(frame))
            self._filter.add_imu(sample.stamp_s, sample.gyro, sample.accel)

    def add_wheels(self, stamp_s: float, forward_mps: float, yaw_rate: float) -> None:
        """Takes the wheels' velocities in m/s and rad/s."""
        self._imu.add_wheels(stamp_s, yaw_rate)
        self._filter.add_wheels(stamp_s, forward_mps, yaw_rate)

    def poll(self) -> Iterator[OdometryEstimate]:
        """The estimates that are due by now, oldest first."""
        while (due_s := self._filter.next_due_s) is not None:
            estimate = self._filter.estimate(due_s)
            if estimate is not None:
                yield estimate
