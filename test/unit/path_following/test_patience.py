"""A goal is given up when the robot, free to drive, came no farther for 30 s."""

import numpy as np

from path_following.patience import PATIENCE_S, Patience

STEP_S = 0.1
HERE = np.array([1.0, 2.0, 0.3])


def seconds_until_over(patience: Patience, *, is_held: bool = False, begin_s: float = 100.0, most_s: float = 60.0) -> float | None:
    for k in range(int(most_s / STEP_S)):
        if patience.is_over(begin_s + k * STEP_S, HERE, is_held=is_held):
            return k * STEP_S
    return None


def test_robot_that_stays_where_it_is_is_given_thirty_seconds() -> None:
    over_s = seconds_until_over(Patience())
    assert over_s is not None and abs(over_s - PATIENCE_S) < 2 * STEP_S


def test_time_in_which_it_is_held_does_not_count() -> None:
    patience = Patience()
    assert seconds_until_over(patience, is_held=True) is None
    over_s = seconds_until_over(patience, begin_s=160.0)
    assert over_s is not None and over_s > PATIENCE_S - 2 * STEP_S


def test_robot_that_gets_on_keeps_its_goal() -> None:
    patience = Patience()
    for k in range(1000):
        assert not patience.is_over(k * STEP_S, HERE + [0.01 * k, 0.0, 0.0], is_held=False)


def test_clock_that_is_set_is_no_time_in_vain() -> None:
    patience = Patience()
    assert not patience.is_over(100.0, HERE, is_held=False)
    assert not patience.is_over(1e9, HERE, is_held=False)
    assert not patience.is_over(50.0, HERE, is_held=False)
    over_s = seconds_until_over(patience, begin_s=50.0)
    assert over_s is not None and over_s > PATIENCE_S - 1.0
