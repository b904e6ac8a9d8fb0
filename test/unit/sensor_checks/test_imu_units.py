"""What gravity and the wheels say of an IMU: right ones pass in any attitude that a robot stands in, wrong ones are named."""

import math

import numpy as np
import pytest

from rigid_geometry import rotation_from_rpy
from sensor_checks import ImuLimits, gravity_fault, turning_fault

LIMITS = ImuLimits()


def fault(*force):
    return gravity_fault(np.array(force), "imu_link", LIMITS)


@pytest.mark.parametrize("roll, pitch", [(0.0, 0.0), (0.44, 0.0), (0.0, -0.44), (0.5, 0.5)])
def test_gravity_of_a_robot_on_a_slope_is_right(roll, pitch):
    force = rotation_from_rpy(roll, pitch, 0.7).T @ [0.0, 0.0, 9.81]
    assert gravity_fault(force, "imu_link", LIMITS) is None


@pytest.mark.parametrize("strength, right", [(8.9, True), (10.7, True), (8.7, False), (10.9, False)])
def test_strength_is_gravity_s_within_what_biases_explain(strength, right):
    assert (fault(0.0, 0.0, strength) is None) is right


@pytest.mark.parametrize(
    "force, said",
    [
        ((0.0, 0.0, 1.0), "it is in g"),
        ((0.0, 0.0, 1000.0), "milli-g"),
        ((0.0, 0.0, 0.0), "removed gravity"),
        ((0.1, 0.1, 0.05), "removed gravity"),
        ((0.0, 0.0, 4.9), "wrong scale"),
        ((0.0, 0.3, -9.8), "upside down: as imu_link is mounted, gravity says that up is -z"),
        ((9.8, 0.0, 0.3), "leans by 88 deg: as imu_link is mounted, gravity says that up is +x"),
        ((0.0, -9.8, 0.3), "up is -y of base_link"),
    ],
)
def test_fault_is_named_in_one_line(force, said):
    text = fault(*force)
    assert text is not None and said in text and "\n" not in text


@pytest.mark.parametrize("ratio, said", [(57.3, "deg/s"), (30.0, "deg/s"), (-1.0, "other way"), (-57.3, "other way")])
def test_rates_that_contradict_the_wheels_are_told(ratio, said):
    assert said in str(turning_fault(ratio))


@pytest.mark.parametrize("ratio", [1.0, 0.6, 0.0, -0.4, 2.0, 7.0])
def test_slip_is_no_fault(ratio):
    assert turning_fault(ratio) is None


def test_limits_name_what_is_out_of_range():
    assert ImuLimits(judged_s=math.nan, most_lean_rad=2.0).validate() == [
        "most_lean_rad = 2.0 is above 1.2",
        "judged_s = nan is not finite",
    ]
