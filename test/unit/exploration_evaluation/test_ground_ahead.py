"""A robot on a straight way of ground that is shown by and by: how far ahead it was known."""

import numpy as np
import pytest

from exploration_evaluation.ground_ahead import START_BLIND_M, GroundAhead, ground_ahead

CELLS = np.column_stack([np.arange(0.0, 12.0, 0.05), np.zeros(240), np.zeros(240)])


def drive(*legs: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
    """Stamps and poses of a robot that drives along x: metres a second, for seconds, leg by leg."""
    speed = np.concatenate([np.full(round(seconds / 0.05), mps) for mps, seconds in legs])
    poses = np.tile(np.eye(4), (len(speed) + 1, 1, 1))
    poses[1:, 0, 3] = np.cumsum(speed) * 0.05
    poses[:, 2, 3] = 0.13
    return 10.0 + 0.05 * np.arange(len(speed) + 1), poses


def ahead(shown_s: np.ndarray, truth: tuple[np.ndarray, np.ndarray]) -> GroundAhead | None:
    return ground_ahead(CELLS, shown_s, truth)


def test_ground_that_is_shown_two_metres_before_the_robot_is_known_two_metres_ahead() -> None:
    shown_s = 10.0 + (CELLS[:, 0] - 2.0) / 0.5
    found = ahead(shown_s, drive((0.5, 20.0)))
    assert found is not None and found.least_m == pytest.approx(2.0, abs=0.11) and found.p05_m == pytest.approx(2.0, abs=0.11)
    assert found.moments > 150


def test_least_is_that_of_the_one_place_that_was_shown_late() -> None:
    shown_s = 10.0 + (CELLS[:, 0] - 3.0) / 0.5
    shown_s[(CELLS[:, 0] > 6.0) & (CELLS[:, 0] < 6.2)] += 5.0
    found = ahead(shown_s, drive((0.5, 20.0)))
    assert found is not None and found.least_m == pytest.approx(0.5, abs=0.11) and found.p05_m > 0.7


def test_slow_robot_is_asked_for_nothing_and_one_that_stands_first_knows_its_way() -> None:
    shown_s = np.where(CELLS[:, 0] < 4.0, 0.0, 30.0)
    assert ahead(shown_s, drive((0.5, 7.6), (0.0, 15.0), (0.5, 10.0))) is None
    found = ahead(shown_s, drive((0.5, 6.0), (0.1, 9.0), (0.0, 6.0), (0.5, 10.0)))
    assert found is None
    found = ahead(shown_s, drive((0.5, 6.0), (0.1, 12.0), (0.0, 6.0), (0.5, 10.0)))
    assert found is not None and found.least_m == pytest.approx(1.0, abs=0.11)


def test_ground_that_was_never_shown_and_that_around_its_start_do_not_count() -> None:
    shown_s = np.zeros(len(CELLS))
    shown_s[(CELLS[:, 0] > 5.0) & (CELLS[:, 0] < 5.3)] = np.inf
    shown_s[CELLS[:, 0] < START_BLIND_M] = 15.0
    assert ahead(shown_s, drive((0.5, 20.0))) is None


def test_times_that_are_not_those_of_the_ground_are_refused() -> None:
    with pytest.raises(ValueError, match=r"\(240, 3\) and \(3,\)"):
        ahead(np.zeros(3), drive((0.5, 2.0)))
