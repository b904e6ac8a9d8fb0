"""Jacobians against numerical ones, and the algebra that the filter rests on."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from odometry_fusion import OdometryConfig, measurements
from odometry_fusion.error_state import (
    ACCEL_BIAS,
    ATTITUDE,
    GYRO_BIAS,
    POSITION,
    SIZE,
    VELOCITY,
    ProcessNoise,
    State,
    exp_rotation,
    predict,
    update,
)
from odometry_fusion.interval import ImuInterval
from odometry_fusion.track import carried
from rigid_geometry import renormalised, skew
from robot_body import RobotBody

QUIET = ProcessNoise(0.0, (0.0, 0.0), 0.0, 0.0, 0.0, 60.0)
RNG = np.random.default_rng(7)


def some_state() -> State:
    rng = np.random.default_rng(5)
    A = rng.normal(size=(SIZE, SIZE)) * 0.1
    R = Rotation.from_rotvec([0.3, -0.2, 1.1]).as_matrix()
    velocity, biases = np.array([0.5, 0.02, -0.01]), rng.normal(size=(2, 3)) * 0.02
    return State(1.0, rng.normal(size=3), R, velocity, biases[0], biases[1], A @ A.T, A[:, :6])


def moved_by(state: State, error: np.ndarray) -> State:
    return replace(
        state,
        position=state.position + error[POSITION],
        R_odom_base=exp_rotation(error[ATTITUDE]) @ state.R_odom_base,
        velocity=state.velocity + error[VELOCITY],
        gyro_bias=state.gyro_bias + error[GYRO_BIAS],
        accel_bias=state.accel_bias + error[ACCEL_BIAS],
    )


def difference(a: State, b: State) -> np.ndarray:
    turn = Rotation.from_matrix(a.R_odom_base @ b.R_odom_base.T).as_rotvec()
    return np.r_[a.position - b.position, turn, a.velocity - b.velocity, a.gyro_bias - b.gyro_bias, a.accel_bias - b.accel_bias]


@pytest.mark.parametrize("vector", [(0, 0, 0), (1e-9, 0, 0), (1e-6, 2e-6, 0), (0.3, -0.2, 1.0), (0, 3.1, 0)])
def test_exponential_agrees_with_scipy(vector):
    np.testing.assert_allclose(exp_rotation(np.array(vector, dtype=float)), Rotation.from_rotvec(vector).as_matrix(), atol=1e-14)


def test_prediction_carries_errors_as_its_jacobian_says():
    state, rates, durations = some_state(), RNG.normal(size=(5, 3)) * 0.5, np.full(5, 0.01)
    base = predict(state, rates, durations, QUIET)
    for index in range(15):
        error = np.zeros(SIZE)
        error[index] = 1e-5
        numerical = difference(predict(moved_by(state, error), rates, durations, QUIET), base) / 1e-5
        unit = replace(state, anchor_cross=np.tile(error[:, None], 6))
        jacobian = predict(unit, rates, durations, QUIET).anchor_cross[:15, 0] / 1e-5
        np.testing.assert_allclose(jacobian, numerical, atol=2e-4)


def test_gravity_jacobian_is_the_numerical_one():
    state, config = some_state(), OdometryConfig()
    residual, H = measurements._gravity(state, np.array([0.1, 0.2, 9.7]), config)
    for index in range(15):
        error = np.zeros(SIZE)
        error[index] = 1e-6
        changed, _ = measurements._gravity(moved_by(state, error), np.array([0.1, 0.2, 9.7]), config)
        np.testing.assert_allclose(-(changed - residual) / 1e-6, H[:, index], atol=1e-4)


def test_update_is_the_least_squares_solution():
    state, P = some_state(), some_state().covariance
    H, residual, variances = RNG.normal(size=(2, SIZE)), np.array([0.01, -0.02]), np.array([0.1, 0.2])
    after = update(state, residual, H, variances)
    information = np.linalg.inv(P) + H.T @ np.diag(1 / variances) @ H
    np.testing.assert_allclose(after.covariance, np.linalg.inv(information), atol=1e-9)
    step = np.linalg.solve(information, H.T @ (residual / variances))
    np.testing.assert_allclose(difference(after, state), step[:15], atol=1e-9)


def test_slip_shortens_the_way_and_is_not_learnt_from_wheels():
    state, rates, durations = some_state(), np.zeros((1, 3)), np.full(1, 0.1)
    one_percent = replace(state, anchor_cross=np.zeros((SIZE, 6)))
    one_percent.anchor_cross[15, 0] = 0.01
    carried_slip = predict(one_percent, rates, durations, QUIET).anchor_cross[POSITION, 0]
    assert np.linalg.norm(carried_slip) == pytest.approx(0.01 * 0.05, rel=1e-3)
    config = OdometryConfig()
    level = measurements.level(0.0, np.array([0.0, 0.0, 9.81]), 1.0, 0.0, True, config)
    interval = ImuInterval(0.05, rates, np.full(1, 0.05), np.zeros(3), None, 0.01)
    after = measurements.roll_wheels(level, interval, 0.5, 0.0, config, RobotBody())
    assert after.covariance[15, 15] == level.covariance[15, 15]


@pytest.mark.parametrize("fall, share", [(0.4, 2.0), (0.1, 1.0), (0.025, 0.5), (0.0, 0.0), (-0.1, -1.0)])
def test_robot_that_turns_slides_to_the_side_that_is_downhill(fall, share):
    config = OdometryConfig()
    up = np.array([0.0, -fall, math.sqrt(1.0 - fall**2)])  # felt in base_link: its left side is low
    state = measurements.level(0.0, 9.81 * up, 1.0, 0.0, False, config)
    turning = ImuInterval(0.05, np.array([[0.0, 0.0, -0.5]]), np.full(1, 0.05), np.array([0.0, 0.0, -0.5]), None, 0.01)
    for _ in range(200):
        state = measurements.roll_wheels(state, turning, 0.0, -0.5, config, RobotBody())
    assert state.velocity[1] == pytest.approx(0.5 * RobotBody().turning_slide_m * share, rel=0.05, abs=1e-3)


def test_robot_in_a_bend_slides_outwards_as_on_a_slope():
    config = OdometryConfig()
    forward, rate = 0.5, 0.49
    fall = forward * rate / config.gravity_mps2  # one in forty
    state = measurements.level(0.0, np.array([0.0, 0.0, 9.81]), 1.0, 0.0, False, config)
    left_bend = ImuInterval(0.05, np.array([[0.0, 0.0, rate]]), np.full(1, 0.05), np.array([0.0, 0.0, rate]), None, 0.01)
    for _ in range(200):
        state = measurements.roll_wheels(state, left_bend, forward, rate, config, RobotBody())
    assert state.velocity[1] == pytest.approx(-rate * RobotBody().turning_slide_m * math.sqrt(fall / 0.1), rel=0.05)


def test_renormalised_rotation_is_without_rounding():
    R = exp_rotation(np.array([0.3, 0.2, -1.0])) + RNG.normal(size=(3, 3)) * 1e-7
    fixed = renormalised(R)
    np.testing.assert_allclose(fixed @ fixed.T, np.eye(3), atol=1e-12)


def test_carried_error_is_the_cross_product():
    lever, turn = np.array([3.0, -1.0, 0.5]), np.array([0.01, 0.02, -0.03])
    np.testing.assert_allclose((carried(lever) @ np.r_[0, 0, 0, turn])[:3], np.cross(turn, lever))
    np.testing.assert_allclose(carried(lever)[:3, 3:], -skew(lever))
