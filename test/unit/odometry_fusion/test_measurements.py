"""What a driving robot feels as gravity: the accelerometer less what the motion itself explains."""

from dataclasses import replace

import numpy as np
import pytest
from kinematic_robot import GRAVITY, Errors, Motion, simulate

from odometry_fusion import OdometryConfig, OdometryFilter
from odometry_fusion.interval import ImuInterval
from odometry_fusion.measurements import feel_gravity, level
from rigid_geometry import rpy_from_rotation
from robot_body import RobotBody

CONFIG = OdometryConfig()
UPRIGHT = level(0.0, np.array([0.0, 0.0, GRAVITY]), 1.0, 1.0, True, CONFIG)  # not sure of it: it would take any hint


def felt(accel, rate=(0.0, 0.0, 0.0)):
    """A twentieth of a second of the IMU."""
    rates = np.array([rate], dtype=float)
    return ImuInterval(0.05, rates, np.array([0.05]), rates[0], np.array(accel, dtype=float), 0.01)


def tilt(state):
    return np.abs(rpy_from_rotation(state.R_odom_base)[:2]).max()


@pytest.mark.parametrize("forward", [0.3, -0.3])
def test_speeding_up_and_slowing_down_is_no_tilt(forward):
    pushed = felt((forward, 0.0, GRAVITY))
    assert tilt(feel_gravity(UPRIGHT, pushed, forward, CONFIG)) < 1e-6
    assert tilt(feel_gravity(UPRIGHT, pushed, 0.0, CONFIG)) > 0.005  # the same push without a change of speed is a slope


@pytest.mark.parametrize("yaw_rate", [0.2, -0.2])
def test_bend_is_no_tilt(yaw_rate):
    driving = replace(UPRIGHT, velocity=np.array([0.5, 0.0, 0.0]))
    outward = felt((0.0, 0.5 * yaw_rate, GRAVITY), (0.0, 0.0, yaw_rate))
    assert tilt(feel_gravity(driving, outward, 0.0, CONFIG)) < 1e-6
    assert tilt(feel_gravity(UPRIGHT, outward, 0.0, CONFIG)) > 0.002


def test_robot_that_gathers_speed_for_long_stays_level():
    """0.25 m/s^2 for four seconds, again and again: a filter that took it for a slope of 1.5 deg would pitch."""
    gathering = [Motion(0.1, 0.025 * k) for k in range(40)]
    rests = [Motion(2.0)]
    data = simulate(rests + gathering * 3, Errors(), np.random.default_rng(0))
    odometry, pending, pitch = OdometryFilter(CONFIG, RobotBody()), list(data.imu), []
    for stamp, v, w in data.wheels:
        while pending and pending[0][0] <= stamp:
            odometry.add_imu(*pending.pop(0))
        odometry.add_wheels(stamp, v, w)
        pitch.append(rpy_from_rotation(odometry.estimate(stamp).T_odom_base[:3, :3])[1])
    assert np.abs(pitch).max() < 1e-3
