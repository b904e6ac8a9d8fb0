"""The IMU: angular velocity and specific force with bias and noise; the force from differences of the velocity."""

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.records import ImuSample

Array = NDArray[np.float64]

GRAVITY_MPS2 = np.array([0.0, 0.0, -9.81])


class Imu:
    """A strap-down IMU whose biases are drawn once."""

    def __init__(self, config: SimulationConfig, rng: np.random.Generator) -> None:
        """`rng` feeds the biases and the noise of this IMU alone."""
        self._config, self._rng = config, rng
        self.gyro_bias = config.imu_gyro_bias_sigma_rps * rng.standard_normal(3)
        self.accel_bias = config.imu_accel_bias_sigma_mps2 * rng.standard_normal(3)

    def sample(self, stamp_s: float, R_world_imu: Array, angular_world: Array, acceleration_world: Array) -> ImuSample:
        """A sample from the true angular velocity and acceleration, (3,) each in world axes."""
        gyro = R_world_imu.T @ angular_world + self.gyro_bias
        accel = R_world_imu.T @ (acceleration_world - GRAVITY_MPS2) + self.accel_bias
        gyro += self._config.imu_gyro_sigma_rps * self._rng.standard_normal(3)
        accel += self._config.imu_accel_sigma_mps2 * self._rng.standard_normal(3)
        return ImuSample(stamp_s, gyro, accel)
