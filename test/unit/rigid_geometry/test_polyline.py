"""Straight legs of polylines."""

import numpy as np
import pytest

from rigid_geometry import legs_of


def test_leg_ends_where_the_direction_changes() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 5], [2, 0, 0], [2, 1, 0], [2, 2, 0], [1, 2, 0]])
    assert legs_of(points) == [(0, 2), (2, 4), (4, 5)]
    assert legs_of(points[:, :2]) == legs_of(points)


def test_turn_back_is_a_corner() -> None:
    assert legs_of(np.array([[0.0, 0], [1, 0], [0, 0]])) == [(0, 1), (1, 2)]


def test_points_on_each_other_and_noise_are_no_corners() -> None:
    points = np.array([[0.0, 0], [1, 0], [1, 0], [2, 0.01], [3, 0.01]])
    assert legs_of(points) == [(0, 4)]


@pytest.mark.parametrize("count", [0, 1])
def test_fewer_than_two_points_have_no_leg(count: int) -> None:
    assert legs_of(np.zeros((count, 3))) == []
