"""Times by activity of runs that end well, in time, or in the middle."""

import numpy as np
import pytest

from exploration_evaluation.activity import activity_times, time_spent
from rigid_geometry import transform_from_rpy

STATES = ("starting", "settling", "sweeping", "mapping", "driving", "settling", "sweeping", "mapping", "finished")
STAMPS = (1.0, 2.0, 2.5, 9.0, 9.0, 15.0, 15.5, 22.0, 22.0)
WALL = (0.0, 1.0, 1.1, 2.0, 3.5, 4.0, 4.1, 5.0, 7.0)


def test_whole_run_is_divided_among_its_activities():
    found = activity_times(STAMPS, WALL, STATES, end_s=22.0)
    assert found.simulated_s == {"waiting": 2.0, "sweeping": 13.0, "mapping": 0.0, "driving": 6.0}
    assert found.compute_s == pytest.approx(1.5 + 2.0)


def test_clock_that_goes_on_after_the_end_counts_for_nothing():
    assert activity_times(STAMPS, WALL, STATES, end_s=40.0) == activity_times(STAMPS, WALL, STATES, end_s=22.0)


@pytest.mark.parametrize("decided_s", [8.975, 2.0])
def test_decision_with_its_sweep_s_stamp_does_not_turn_the_clock_back(decided_s):
    found = activity_times((1.0, 9.0, decided_s, 12.0), (0, 1, 2, 3), ("sweeping", "mapping", "driving", "finished"), end_s=12.0)
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
        ((1.0, 2.0), (1.0, 0.0), ("starting", "driving"), "order of time"),
    ],
)
def test_what_is_no_record_of_a_run_is_refused(stamps, wall, states, text):
    with pytest.raises(ValueError, match=text):
        activity_times(stamps, wall, states, end_s=10.0)


def moved(*parts):
    """Stamps and poses of parts of a drive from 1 s on: seconds, metres a second ahead, radians a second."""
    stamps, poses = [1.0], [np.eye(4)]
    for seconds, speed, rate in parts:
        for _ in range(round(seconds / 0.05)):
            stamps.append(stamps[-1] + 0.05)
            poses.append(poses[-1] @ transform_from_rpy((0.05 * speed, 0, 0), (0, 0, 0.05 * rate)))
    return np.array(stamps), np.array(poses)


def spent(states, truth):
    stamps, names = zip(*states, strict=True)
    return time_spent(stamps, names, truth, 0.335)


def test_time_is_spent_driving_turning_on_the_spot_sweeping_and_waiting():
    states = [
        (1.0, "starting"),
        (2.0, "sweeping"),
        (8.0, "mapping"),
        (8.0, "driving"),
        (19.0, "settling"),
        (20.0, "sweeping"),
        (26.0, "finished"),
    ]
    truth = moved((7, 0, 0), (2, 0, 0.8), (6, 0.5, 0.1), (1, 0, 0), (2, 0.1, 0.6), (7, 0, 0))
    assert spent(states, truth) == pytest.approx({"driving_s": 6.0, "turning_s": 4.0, "sweeping_s": 12.0, "waiting_s": 3.0}, abs=0.2)


def test_sweep_while_driving_is_driving_and_a_drive_that_stands_is_waiting():
    truth = moved((4, 0.5, 0), (3, 0, 0))
    assert spent([(1.0, "sweeping")], truth) == pytest.approx(
        {"driving_s": 4.0, "turning_s": 0.0, "sweeping_s": 3.0, "waiting_s": 0.0}, abs=0.2
    )
    assert spent([(1.0, "driving")], truth) == pytest.approx(
        {"driving_s": 4.0, "turning_s": 0.0, "sweeping_s": 0.0, "waiting_s": 3.0}, abs=0.2
    )


def test_robot_that_trembles_stands_and_one_that_creeps_drives():
    stamps, poses = moved((10, 0, 0))
    poses[:, 0, 3] += 0.001 * (np.arange(len(poses)) % 2)
    assert spent([(1.0, "driving")], (stamps, poses))["waiting_s"] == pytest.approx(10.0)
    assert spent([(1.0, "driving")], moved((10, 0.08, 0)))["driving_s"] == pytest.approx(10.0)


def test_time_spent_needs_a_record():
    with pytest.raises(ValueError, match="two true poses"):
        time_spent((), (), moved((1, 0, 0)), 0.335)
    with pytest.raises(ValueError, match="two true poses"):
        time_spent((1.0,), ("driving",), moved(), 0.335)
