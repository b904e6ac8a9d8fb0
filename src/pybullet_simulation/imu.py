"""The IMU: angular velocity and specific force with scale, bias and noise; the force from differences of the velocity."""

import math

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.records import ImuSample

Array = NDArray[np.float64]

GRAVITY_MPS2 = np.array([0.0, 0.0, -9.81])


class Imu:
    """A strap-down IMU whose scales are drawn once; its biases are drawn once, and wander."""

    def __init__(self, config: SimulationConfig, rng: np.random.Generator) -> None:
        """`rng` feeds the biases and the noise of this IMU alone, a stream spawned of it the scales and how the biases wander."""
        self._config, self._rng, self._walk_rng = config, rng, rng.spawn(1)[0]
        self.gyro_bias = config.imu_gyro_bias_sigma_rps * rng.standard_normal(3)
        self.accel_bias = config.imu_accel_bias_sigma_mps2 * rng.standard_normal(3)
        self.gyro_scale = 1.0 + config.imu_gyro_scale_sigma * self._walk_rng.standard_normal(3)
        self._last_s = math.nan

    def sample(self, stamp_s: float, R_world_imu: Array, angular_world: Array, acceleration_world: Array) -> ImuSample:
        """A sample from the true angular velocity and acceleration, (3,) each in world axes."""
        self._wander(stamp_s)
        gyro = self.gyro_scale * (R_world_imu.T @ angular_world) + self.gyro_bias
        accel = R_world_imu.T @ (acceleration_world - GRAVITY_MPS2) + self.accel_bias
        gyro += self._config.imu_gyro_sigma_rps * self._rng.standard_normal(3)
        accel += self._config.imu_accel_sigma_mps2 * self._rng.standard_normal(3)
        return ImuSample(stamp_s, gyro, accel)

    def _wander(self, stamp_s: float) -> None:
        root_s = 0.0 if math.isnan(self._last_s) else math.sqrt(max(0.0, stamp_s - self._last_s))
        self._last_s = stamp_s
        gyro, accel = self._walk_rng.standard_normal((2, 3))
        self.gyro_bias = self.gyro_bias + self._config.imu_gyro_bias_walk_rps * root_s * gyro
        self.accel_bias = self.accel_bias + self._config.imu_accel_bias_walk_mps2 * root_s * accel
