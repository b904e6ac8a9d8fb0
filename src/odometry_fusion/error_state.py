"""The Kalman filter's state and its two steps, prediction and update; pure functions on small arrays.

Error state of 16: position, attitude, velocity, gyroscope bias, accelerometer bias, wheel slip. Attitude errors turn about
the axes of odom, R_true = Exp(error) R, so that the pose's covariance is the one of nav_msgs/Odometry as it stands. Biases and
slip are states because they are the same from sample to sample: as white noise they would make the filter over-confident. Nothing
here can observe the slip. It acts between velocity and position, so that no measurement of the velocity is taken for news of it.
Error-state formulation as in Sola, "Quaternion kinematics for the error-state Kalman filter" (2017), global angular error.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import skew

FloatArray = NDArray[np.float64]

POSITION, ATTITUDE, VELOCITY = slice(0, 3), slice(3, 6), slice(6, 9)
GYRO_BIAS, ACCEL_BIAS, SLIP = slice(9, 12), slice(12, 15), 15
SIZE = 16


@dataclass(frozen=True, eq=False)
class State:
    """Mean and covariance at a time.

    `position` (3,) and `R_odom_base` (3, 3) in odom; `velocity` (3,) m/s of base_link in its own axes, as without further slip;
    `gyro_bias` (3,) rad/s; `accel_bias` (3,) m/s^2; `covariance` (16, 16). `anchor_cross` (16, 6): covariance of the error with
    the error that the pose had at an earlier instant, zero when there is none.
    """

    stamp_s: float
    position: FloatArray
    R_odom_base: FloatArray
    velocity: FloatArray
    gyro_bias: FloatArray
    accel_bias: FloatArray
    covariance: FloatArray
    anchor_cross: FloatArray


@dataclass(frozen=True)
class ProcessNoise:
    """What an interval adds to the covariance; densities as in OdometryConfig, `velocity_walk` forward and across;
    `skid_walk` (m/sqrt(s)) of the position forward and sideways; `attitude_variance` (rad^2) once an interval."""

    gyro: float
    velocity_walk: tuple[float, float]
    gyro_bias_walk: float
    accel_bias_walk: float
    slip_sigma: float
    slip_time_s: float
    skid_walk: float = 0.0
    attitude_variance: float = 0.0


def exp_rotation(vector: FloatArray) -> FloatArray:
    """(3, 3) rotation of a (3,) rotation vector in radians."""
    x, y, z = vector.tolist()
    angle_squared = x * x + y * y + z * z
    angle = math.sqrt(angle_squared)
    a = math.sin(angle) / angle if angle > 1e-8 else 1.0
    b = (1.0 - math.cos(angle)) / angle_squared if angle > 1e-5 else 0.5
    return np.array(
        [
            [1.0 - b * (y * y + z * z), b * x * y - a * z, b * x * z + a * y],
            [b * x * y + a * z, 1.0 - b * (x * x + z * z), b * y * z - a * x],
            [b * x * z - a * y, b * y * z + a * x, 1.0 - b * (x * x + y * y)],
        ]
    )


def predict(state: State, rates: FloatArray, durations: FloatArray, noise: ProcessNoise) -> State:
    """Drives on with constant body velocity and measured rates.

    `rates` (K, 3) rad/s are means over K consecutive stretches of `durations` (K,) seconds. The attitude is integrated a
    stretch at a time; the covariance once over all, which holds while the robot turns by less than a few degrees.
    """
    R = state.R_odom_base
    R_integral = np.zeros((3, 3))
    for rate, duration in zip(rates, durations.tolist(), strict=True):
        R_next = R @ exp_rotation((rate - state.gyro_bias) * duration)
        R_integral += (R + R_next) * (0.5 * duration)
        R = R_next
    moved = R_integral @ state.velocity
    total_s = float(durations.sum())
    F = _transition(moved, R_integral, math.exp(-total_s / noise.slip_time_s))
    F[POSITION, SLIP] = -state.velocity[0] * R_integral[:, 0]
    covariance = F @ state.covariance @ F.T + _process_covariance(state.R_odom_base, total_s, noise)
    return replace(
        state,
        stamp_s=state.stamp_s + total_s,
        position=state.position + moved,
        R_odom_base=R,
        covariance=covariance,
        anchor_cross=F @ state.anchor_cross,
    )


def rest(state: State, duration_s: float, noise: ProcessNoise) -> State:
    """Stands still: the pose stays, biases wander."""
    covariance = state.covariance.copy()
    diagonal = np.einsum("ii->i", covariance)
    diagonal[GYRO_BIAS] += noise.gyro_bias_walk**2 * duration_s
    diagonal[ACCEL_BIAS] += noise.accel_bias_walk**2 * duration_s
    return replace(state, stamp_s=state.stamp_s + duration_s, covariance=covariance)


def update(state: State, residual: FloatArray, H: FloatArray, variances: FloatArray) -> State:
    """Corrects by a measurement: (m,) measured minus expected, (m, 16) Jacobian, (m,) variances of its independent noise."""
    P = state.covariance
    PHt = P @ H.T
    innovation = H @ PHt
    np.einsum("ii->i", innovation)[:] += variances
    gain = np.linalg.solve(innovation, PHt.T).T
    error = gain @ residual
    covariance = P - gain @ PHt.T
    return replace(
        state,
        position=state.position + error[POSITION],
        R_odom_base=exp_rotation(error[ATTITUDE]) @ state.R_odom_base,
        velocity=state.velocity + error[VELOCITY],
        gyro_bias=state.gyro_bias + error[GYRO_BIAS],
        accel_bias=state.accel_bias + error[ACCEL_BIAS],
        covariance=0.5 * (covariance + covariance.T),
        anchor_cross=state.anchor_cross - gain @ (H @ state.anchor_cross),
    )


def _transition(moved: FloatArray, R_integral: FloatArray, slip_decay: float) -> FloatArray:
    F = np.eye(SIZE)
    lever = skew(moved)
    F[POSITION, ATTITUDE] = -lever
    F[POSITION, VELOCITY] = R_integral
    F[POSITION, GYRO_BIAS] = 0.5 * lever @ R_integral
    F[ATTITUDE, GYRO_BIAS] = -R_integral
    F[SLIP, SLIP] = slip_decay
    return F


def _process_covariance(R: FloatArray, t: float, noise: ProcessNoise) -> FloatArray:
    """Random walks over t seconds; the velocity's walk also moves the position, so that the next wheel message mends both."""
    diagonal = np.zeros(SIZE)
    forward, across = noise.velocity_walk
    q = np.array([forward, across, across]) ** 2
    diagonal[ATTITUDE] = noise.gyro**2 * t + noise.attitude_variance
    diagonal[VELOCITY] = q * t
    diagonal[GYRO_BIAS] = noise.gyro_bias_walk**2 * t
    diagonal[ACCEL_BIAS] = noise.accel_bias_walk**2 * t
    diagonal[SLIP] = noise.slip_sigma**2 * -math.expm1(-2.0 * t / noise.slip_time_s)
    Q = np.diag(diagonal)
    R_q = R * q
    Q[POSITION, POSITION] = R_q @ R.T * (t**3 / 3.0) + R[:, :2] @ R[:, :2].T * (noise.skid_walk**2 * t)
    Q[POSITION, VELOCITY] = R_q * (t**2 / 2.0)
    Q[VELOCITY, POSITION] = Q[POSITION, VELOCITY].T
    return Q
