"""What wheels, gravity and standing still tell about the state: residual, Jacobian and variances of each."""

import math

import numpy as np
from numpy.typing import NDArray

from odometry_fusion.config import OdometryConfig
from odometry_fusion.error_state import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, SIZE, SLIP, VELOCITY, State, update
from odometry_fusion.interval import ImuInterval
from rigid_geometry import skew, slide_per_rad
from robot_body import RobotBody

FloatArray = NDArray[np.float64]
GYRO_BIAS_Z = 11
YAW = 5
GRAVITY_DRIVING_SIGMA = 0.5  # [m/s^2] noise of the gravity direction while driving quietly
QUIET_ACCEL_MPS2 = 0.5  # specific force further than this from gravity says nothing about up
_QUIET_RATE = 0.25  # [rad/s] nor does one measured while turning faster
_STILL_VELOCITY_SIGMA_MPS = 1e-3  # noise of the zero velocity while standing
_STILL_RATE_SIGMA = 2e-4  # [rad/s] noise of the zero rate while standing, beside the gyroscope's own


def level(stamp_s: float, mean_accel: FloatArray, duration_s: float, disturbance_mps2: float, still: bool, config: OdometryConfig) -> State:
    """The first state: at the origin, yaw zero, levelled so that the mean specific force points up.

    `disturbance_mps2`: how far the force may be from gravity beside noise and bias, in m/s^2.
    """
    up = mean_accel / float(np.linalg.norm(mean_accel))
    state = State(
        stamp_s=stamp_s,
        position=np.zeros(3),
        R_odom_base=_level_rotation(up),
        velocity=np.zeros(3),
        gyro_bias=np.zeros(3),
        accel_bias=np.zeros(3),
        covariance=_first_covariance(still, config),
        anchor_cross=np.zeros((SIZE, 6)),
    )
    variance = config.accel_noise**2 / duration_s + disturbance_mps2**2
    residual, H = _gravity(state, mean_accel, config)
    return update(state, residual, H, np.full(3, variance))


def stand_still(state: State, interval: ImuInterval, config: OdometryConfig) -> State:
    """While the robot stands the gyroscope reads its bias and the accelerometer gravity."""
    H = np.zeros((6, SIZE))
    H[0:3, VELOCITY] = H[3:6, GYRO_BIAS] = np.eye(3)
    residual = np.concatenate([-state.velocity, interval.mean_rate - state.gyro_bias])
    rate_variance = config.gyro_noise**2 / interval.duration_s + _STILL_RATE_SIGMA**2
    variances = np.repeat([_STILL_VELOCITY_SIGMA_MPS**2, rate_variance], 3)
    if interval.mean_accel is not None:
        gravity_residual, gravity_H = _gravity(state, interval.mean_accel, config)
        residual, H = np.concatenate([residual, gravity_residual]), np.vstack([H, gravity_H])
        variances = np.append(variances, np.full(3, config.accel_noise**2 / interval.duration_s))
    return update(state, residual, H, variances)


def roll_wheels(
    state: State, interval: ImuInterval, forward_mps: float, yaw_rate: float, config: OdometryConfig, robot: RobotBody
) -> State:
    """Wheels give the forward velocity and roughly the yaw rate; up the robot hardly moves, sideways it slides as it turns.

    It slides down a slope, and in a bend outwards, where what it takes to hold it on its track is as much as on a slope of v w / g.
    """
    rate = interval.mean_rate - state.gyro_bias
    turning, tipping = abs(float(rate[2])), math.hypot(rate[0], rate[1])
    forward = forward_mps * (1.0 - config.forward_slip)
    fall = -state.R_odom_base[2, 1] - forward * float(rate[2]) / config.gravity_mps2
    slide = turning * float(slide_per_rad(fall, robot.turning_slide_m))
    residual = np.array([forward - state.velocity[0], slide - state.velocity[1], -state.velocity[2], yaw_rate - rate[2]])
    H = np.zeros((4, SIZE))
    H[0:3, VELOCITY] = np.eye(3)
    H[3, GYRO_BIAS_Z] = -1.0
    sigmas = [
        math.hypot(config.forward_sigma_mps, config.turning_sigma_m * turning),
        math.hypot(config.lateral_sigma_mps, config.turning_sigma_m * turning),
        math.hypot(config.vertical_sigma_mps, config.turning_sigma_m * tipping),
        config.yaw_rate_sigma + config.yaw_rate_slip * abs(yaw_rate),
    ]
    return update(state, residual, H, np.square(sigmas))


def feel_gravity(state: State, interval: ImuInterval, forward_accel: float, config: OdometryConfig) -> State:
    """While driving quietly the accelerometer, less what the motion explains, shows up; unchanged when it is not quiet."""
    rate = interval.mean_rate - state.gyro_bias
    if interval.mean_accel is None or float(np.linalg.norm(rate)) > _QUIET_RATE or abs(forward_accel) > QUIET_ACCEL_MPS2:
        return state
    force = interval.mean_accel - np.cross(rate, state.velocity) - np.array([forward_accel, 0.0, 0.0])
    if abs(float(np.linalg.norm(force)) - config.gravity_mps2) > QUIET_ACCEL_MPS2:
        return state
    residual, H = _gravity(state, force, config)
    return update(state, residual, H, np.full(3, GRAVITY_DRIVING_SIGMA**2))


def _gravity(state: State, specific_force: FloatArray, config: OdometryConfig) -> tuple[FloatArray, FloatArray]:
    """Residual (3,) and Jacobian (3, 16) of: force = R^T gravity + bias, all in base_link."""
    upward = np.array([0.0, 0.0, config.gravity_mps2])
    H = np.zeros((3, SIZE))
    H[:, ATTITUDE] = state.R_odom_base.T @ skew(upward)
    H[:, ACCEL_BIAS] = np.eye(3)
    return specific_force - state.R_odom_base.T @ upward - state.accel_bias, H


def _level_rotation(up: FloatArray) -> FloatArray:
    """(3, 3) rotation without yaw whose third row is `up`."""
    forward = np.array([1.0, 0.0, 0.0]) - up[0] * up
    forward /= float(np.linalg.norm(forward))
    return np.stack([forward, np.cross(up, forward), up])


def _first_covariance(still: bool, config: OdometryConfig) -> FloatArray:
    """Position and yaw define odom, hence are known; tilt is unknown until gravity is felt."""
    sigmas = np.empty(SIZE)
    sigmas[0:3], sigmas[ATTITUDE], sigmas[YAW] = 1e-4, 1.0, 1e-4
    sigmas[VELOCITY] = _STILL_VELOCITY_SIGMA_MPS if still else 1.0
    sigmas[GYRO_BIAS], sigmas[ACCEL_BIAS], sigmas[SLIP] = config.gyro_bias_sigma, config.accel_bias_sigma, config.forward_slip_sigma
    return np.diag(sigmas**2)
