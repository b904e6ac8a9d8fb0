"""While a robot stands, its odometry may learn how it has driven: that moves no robot."""

import numpy as np
import pytest

from rigid_geometry import rpy_from_rotation, transform_from_rpy, yaw_of
from scan_tracking.held_odometry import HeldOdometry

BEFORE = transform_from_rpy([8.0, -3.0, 0.1], [0.02, 0.01, 2.0])
CORRECTED = transform_from_rpy([8.05, -2.96, 0.13], [0.0, -0.01, 2.01])
DRIVING, STANDING = (0.5, 0.1), (0.0, 0.0)


def test_pose_is_as_told_while_the_robot_drives() -> None:
    held = HeldOdometry()
    assert held.pose(BEFORE, *DRIVING) is BEFORE
    assert held.pose(CORRECTED, *DRIVING) is CORRECTED


def test_position_and_heading_stay_while_it_stands_and_what_is_up_is_taken() -> None:
    held = HeldOdometry()
    held.pose(BEFORE, *DRIVING)
    found = held.pose(CORRECTED, *STANDING)
    assert found[:3, 3] == pytest.approx(BEFORE[:3, 3]) and yaw_of(found) == pytest.approx(2.0)
    assert rpy_from_rotation(found[:3, :3])[:2] == pytest.approx((0.0, -0.01))


def test_it_goes_on_from_there_by_what_odometry_says() -> None:
    held = HeldOdometry()
    held.pose(BEFORE, *DRIVING)
    stood = held.pose(CORRECTED, *STANDING)
    step = transform_from_rpy([0.3, 0.0, 0.0], [0.0, 0.0, 0.1])
    assert held.pose(CORRECTED @ step, *DRIVING) == pytest.approx(stood @ step)


def test_odometry_that_never_tells_a_speed_moves_the_robot() -> None:
    held = HeldOdometry()
    held.pose(BEFORE, *STANDING)
    assert held.pose(CORRECTED, *STANDING) is CORRECTED


def test_odometry_that_begins_anew_is_told_as_it_is() -> None:
    held = HeldOdometry()
    held.pose(BEFORE, *DRIVING)
    origin = np.eye(4)
    assert held.pose(origin, *STANDING) is origin
