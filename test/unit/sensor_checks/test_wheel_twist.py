"""A wheel odometry whose pose moves while its twist is never filled, and those that are right."""

import math

import numpy as np
import pytest

from sensor_checks import Level, TwistWatch
from sensor_checks.contents import twist_rows


def faults(speed_mps=0.0, turning_rps=0.0, twist=(0.0, 0.0), seconds=5.0, rate_hz=50.0, watch=None, begin_s=100.0):
    """What is told of a robot that drives so and says `twist`, sample by sample."""
    watch, found, x, y, yaw = watch or TwistWatch(), [], 0.0, 0.0, 0.0
    for i in range(int(seconds * rate_hz)):
        found.append(watch.fault(begin_s + i / rate_hz, (x, y, yaw), twist))
        yaw = math.remainder(yaw + turning_rps / rate_hz, 2.0 * math.pi)
        x, y = x + speed_mps * math.cos(yaw) / rate_hz, y + speed_mps * math.sin(yaw) / rate_hz
    return found


@pytest.mark.parametrize("rate_hz", [10.0, 50.0])
@pytest.mark.parametrize(("speed_mps", "turning_rps"), [(0.7, 0.0), (-0.2, 0.0), (0.0, 0.9), (0.0, -0.2), (0.3, 0.5)])
def test_pose_that_moves_beside_a_twist_of_0_is_a_fault_within_a_second(speed_mps, turning_rps, rate_hz):
    found = faults(speed_mps, turning_rps, rate_hz=rate_hz)
    assert found[0] is None and "its pose moves, its twist is 0" in found[int(rate_hz)]
    assert all(found[int(rate_hz) :])


@pytest.mark.parametrize(
    "case", [{"speed_mps": 0.7, "twist": (0.7, 0.0)}, {"turning_rps": 0.9, "twist": (0.0, 0.9)}, {}, {"twist": (0.5, 0.0)}]
)
def test_twist_that_is_filled_and_pose_that_stands_are_right(case):
    assert not any(faults(**case))


def test_refused_twist_stays_so_while_the_robot_stands_until_it_is_filled():
    watch = TwistWatch()
    assert faults(0.7, watch=watch)[-1]
    assert all(faults(watch=watch, begin_s=105.0))
    assert not any(faults(0.7, twist=(0.7, 0.0), watch=watch, begin_s=110.0))


def test_pose_that_is_set_anew_trembles_or_is_not_known_is_no_motion():
    rng, watch = np.random.default_rng(0), TwistWatch()
    for i in range(500):
        x, y, yaw = rng.normal(0.0, 0.005, 3) + [5.0 * (i > 100), 0.0, 3.0 * (i > 200)]
        assert watch.fault(100.0 + 0.02 * i, (x, math.nan if i == 300 else y, yaw), (0.0, 0.0)) is None


def test_clock_that_is_set_back_begins_anew():
    watch = TwistWatch()
    faults(0.7, seconds=0.1, watch=watch)
    assert not faults(0.0, watch=watch, begin_s=50.0, seconds=0.5)[-1]
    assert faults(0.7, watch=watch, begin_s=50.5)[-1]


def test_check_robot_tells_it_of_a_robot_that_moves():
    def told(speed_mps, twist):
        return twist_rows("/wheel_odom", [(100.0 + 0.05 * i, (0.05 * i * speed_mps, 0.0, 0.0), twist) for i in range(100)])

    assert told(0.3, (0.3, 0.0)) == [] == told(0.0, (0.0, 0.0))
    (row,) = told(0.3, (0.0, 0.0))
    assert row.level is Level.ERROR and "its pose moves, its twist is 0" in row.advice
