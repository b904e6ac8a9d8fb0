"""While a robot stands, its odometry may learn how it has driven: that moves no robot."""

import numpy as np
import pytest
from numpy.typing import NDArray

from rigid_geometry import rpy_from_rotation, transform_from_rpy, yaw_of
from scan_tracking.held_odometry import HeldOdometry

BEFORE = transform_from_rpy([8.0, -3.0, 0.1], [0.02, 0.01, 2.0])
CORRECTED = transform_from_rpy([8.05, -2.96, 0.13], [0.0, -0.01, 2.01])
DRIVING, CREEPING, STANDING = (0.5, 0.1), (0.004, -0.001), (0.0, 0.0)


def driven() -> HeldOdometry:
    """Has driven, and slows down at 1.0 s."""
    held = HeldOdometry()
    held.pose(0.9, BEFORE, *DRIVING)
    held.pose(1.0, BEFORE, *CREEPING)
    return held


def test_pose_is_as_told_while_the_robot_moves() -> None:
    held = driven()
    assert held.pose(1.1, CORRECTED, *CREEPING) is CORRECTED


def test_position_and_heading_stay_while_it_stands_and_what_is_up_is_taken() -> None:
    found = driven().pose(1.1, CORRECTED, *STANDING)
    assert found[:3, 3] == pytest.approx(BEFORE[:3, 3]) and yaw_of(found) == pytest.approx(2.0)
    assert rpy_from_rotation(found[:3, :3])[:2] == pytest.approx((0.0, -0.01))


def test_it_goes_on_from_there_by_what_odometry_says() -> None:
    held = driven()
    stood = held.pose(1.1, CORRECTED, *STANDING)
    step = transform_from_rpy([0.3, 0.0, 0.0], [0.0, 0.0, 0.1])
    assert held.pose(1.6, CORRECTED @ step, *DRIVING) == pytest.approx(stood @ step)


def test_way_from_the_last_sample_that_moved_counts() -> None:
    held = HeldOdometry()
    held.pose(0.9, BEFORE, *DRIVING)
    assert held.pose(1.0, CORRECTED, *STANDING) is CORRECTED
    assert held.pose(1.1, BEFORE, *STANDING)[:3, 3] == pytest.approx(CORRECTED[:3, 3])


def test_after_a_pause_nobody_knows_that_it_stood() -> None:
    assert driven().pose(2.0, CORRECTED, *STANDING) is CORRECTED


@pytest.mark.parametrize("speed", [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5)])
def test_odometry_that_tells_not_both_speeds_moves_the_robot(speed: tuple[float, float]) -> None:
    held = HeldOdometry()
    held.pose(0.8, BEFORE, *speed)
    held.pose(0.9, BEFORE, *STANDING)
    assert held.pose(1.0, CORRECTED, *STANDING) is CORRECTED


@pytest.mark.parametrize("jumped", [np.eye(4), transform_from_rpy([8.0, -3.0, 0.1], [0.02, 0.01, 2.5])])
def test_odometry_that_begins_anew_or_jumps_is_told_as_it_is(jumped: NDArray[np.float64]) -> None:
    assert driven().pose(1.1, jumped, *STANDING) is jumped
