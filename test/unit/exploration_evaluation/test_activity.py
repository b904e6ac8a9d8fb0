"""Times by activity of runs that end well, in time, or in the middle."""

import pytest

from exploration_evaluation.activity import activity_times

STATES = ("starting", "settling", "sweeping", "mapping", "driving", "settling", "sweeping", "mapping", "finished")
STAMPS = (1.0, 2.0, 2.5, 9.0, 9.0, 15.0, 15.5, 22.0, 22.0)
WALL = (0.0, 1.0, 1.1, 2.0, 3.5, 4.0, 4.1, 5.0, 7.0)


def test_whole_run_is_divided_among_its_activities():
    found = activity_times(STAMPS, WALL, STATES, end_s=22.0)
    assert found.simulated_s == {"waiting": 2.0, "sweeping": 13.0, "mapping": 0.0, "driving": 6.0}
    assert found.compute_s == pytest.approx(1.5 + 2.0)


def test_clock_that_goes_on_after_the_end_counts_for_nothing():
    assert activity_times(STAMPS, WALL, STATES, end_s=40.0) == activity_times(STAMPS, WALL, STATES, end_s=22.0)


def test_decision_with_its_sweep_s_stamp_does_not_turn_the_clock_back():
    found = activity_times((1.0, 9.0, 8.975, 12.0), (0, 1, 2, 3), ("sweeping", "mapping", "driving", "finished"), end_s=12.0)
    assert found.simulated_s == {"waiting": 0.0, "sweeping": 8.0, "mapping": 0.0, "driving": 3.0}


def test_drive_that_was_cut_off_lasts_until_the_end_of_the_run():
    found = activity_times(STAMPS[:5], WALL[:5], STATES[:5], end_s=12.0)
    assert found.simulated_s["driving"] == 3.0
    assert found.compute_s == pytest.approx(1.5)


def test_run_cut_off_in_mapping_has_no_known_compute_time():
    found = activity_times(STAMPS[:8], WALL[:8], STATES[:8], end_s=22.0)
    assert found.compute_s is None
    assert found.simulated_s["sweeping"] == 13.0


def test_end_before_the_last_change_takes_no_time_away():
    assert activity_times((1.0, 5.0), (0.0, 1.0), ("starting", "driving"), end_s=3.0).simulated_s["driving"] == 0.0


@pytest.mark.parametrize(
    ("stamps", "wall", "states", "text"),
    [
        ((), (), (), "every change of state"),
        ((1.0, 2.0), (0.0,), ("starting", "driving"), "every change of state"),
        ((1.0,), (0.0,), ("flying",), "the robot is not flying"),
        ((5.0, 1.0), (0.0, 1.0), ("starting", "driving"), "order of time"),
        ((1.0, 2.0), (1.0, 0.0), ("starting", "driving"), "order of time"),
    ],
)
def test_what_is_no_record_of_a_run_is_refused(stamps, wall, states, text):
    with pytest.raises(ValueError, match=text):
        activity_times(stamps, wall, states, end_s=10.0)
