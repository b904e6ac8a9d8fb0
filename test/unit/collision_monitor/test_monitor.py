"""The last guard: it stops in time, slows on the way there, and leaves alone what it must not judge."""

import math
from dataclasses import replace

import numpy as np
import pytest

from collision_monitor import CollisionMonitor, CollisionMonitorConfig, seen_from
from robot_body import RobotBody

ROBOT, CONFIG = RobotBody(), CollisionMonitorConfig()
FRONT_M, SIDE_M = ROBOT.half_length_m, ROBOT.half_width_m
NOBODY = np.empty((0, 2))


def share(v, w, *points):
    return CollisionMonitor(CONFIG, ROBOT).limited(1.0, v, w, np.array(points)).share


def test_command_passes_whole_where_nobody_is():
    limited = CollisionMonitor(CONFIG, ROBOT).limited(1.0, 0.5, 0.2, NOBODY)
    assert (limited.v, limited.w, limited.share, limited.reason) == (0.5, 0.2, 1.0, "")


def test_it_goes_slower_the_nearer_a_stranger_is_and_stands_before_it():
    shares = [share(0.5, 0.0, (FRONT_M + gap, 0.0)) for gap in (2.0, 1.2, 1.0, 0.75, 0.5, 0.2)]
    assert shares[0] == 1.0 and shares[-1] == 0.0 and shares == sorted(shares, reverse=True) and 0.7 in shares


def test_stop_comes_in_time_for_a_person_who_walks_up_meanwhile():
    """Driven by the monitor against a person at a walk: the robot stands before the two can meet, as far as its own way goes."""
    monitor, x, v, person, gap = CollisionMonitor(CONFIG, ROBOT), 0.0, 0.5, 2.5, math.inf
    seen = [person] * 5
    for tick in range(100):
        limited = monitor.limited(0.05 * tick, 0.5, 0.0, np.array([[seen[-4] - x, 0.0]]))
        v = max(limited.v, v - 1.5 * 0.05) if limited.v < v else limited.v
        x += v * 0.05
        person -= 1.0 * 0.05
        seen.append(person)
        gap = person - x - FRONT_M
        if v == 0.0:
            break
    assert v == 0.0 and gap >= CONFIG.margin_m - 0.05


def test_robot_that_brakes_weakly_is_stopped_earlier():
    weak, stranger = replace(ROBOT, max_acceleration_mps2=0.3), np.array([[FRONT_M + 1.2, 0.0]])
    slowed = CollisionMonitor(CONFIG, weak).limited(1.0, 0.5, 0.0, stranger).share
    assert slowed < share(0.5, 0.0, tuple(stranger[0]))


def test_turn_on_the_spot_stops_before_who_stands_at_the_corner_s_way():
    corner = math.hypot(FRONT_M, SIDE_M)
    at = (corner - 0.05) * np.array([math.cos(1.0), math.sin(1.0)])
    assert share(0.0, 0.8, at) == 0.0 and share(0.0, 0.8, 3.0 * at) == 1.0


@pytest.mark.parametrize(("v", "point"), [(0.5, (-FRONT_M - 0.05, 0.0)), (-0.15, (FRONT_M + 0.05, 0.0)), (0.5, (0.0, SIDE_M + 0.05))])
def test_robot_may_leave_whoever_stands_behind_or_beside_it(v, point):
    assert share(v, 0.0, point) == 1.0


def test_whole_command_comes_back_within_a_second():
    monitor = CollisionMonitor(CONFIG, ROBOT)
    assert monitor.limited(0.0, 0.5, 0.0, [(FRONT_M + 0.1, 0.0)]).v == 0.0
    speeds = [monitor.limited(0.05 * k, 0.5, 0.0, NOBODY).v for k in range(1, 25)]
    assert speeds[0] == pytest.approx(0.025) and np.diff(speeds).max() < 0.03 and speeds[-1] == 0.5
    assert monitor.limited(2.0, 0.5, 0.0, NOBODY).reason == ""


def test_it_says_why():
    assert (
        CollisionMonitor(CONFIG, ROBOT).limited(1.0, 0.5, 0.0, [(FRONT_M + 0.1, 0.0)]).reason == "stands before what the map does not know"
    )
    with pytest.raises(ValueError, match="margin_m"):
        CollisionMonitor(CollisionMonitorConfig(margin_m=-1.0), ROBOT)


def test_points_of_the_map_are_seen_ahead_and_to_the_left_of_a_robot_that_looks_along_y():
    ahead, left = seen_from([(1.0, 4.0), (0.0, 2.0)], 1.0, 2.0, math.pi / 2)
    assert ahead == pytest.approx((2.0, 0.0)) and left == pytest.approx((0.0, 1.0))


def share_of_a_look(seen_ago_s, gap_m=1.2, period_s=0.05):
    monitor = CollisionMonitor(CONFIG, ROBOT)
    monitor.limited(1.0 - period_s, 0.0, 0.0, NOBODY)
    return monitor.limited(1.0, 0.5, 0.0, [(FRONT_M + gap_m, 0.0)], seen_ago_s).share


def test_older_the_look_the_earlier_it_brakes():
    """What was seen 0.4 s ago came nearer for so long."""
    assert share_of_a_look(None) == share_of_a_look(0.1) == 1.0
    assert share_of_a_look(0.4) < 1.0 and share_of_a_look(0.8) == 0.0


def test_look_that_is_younger_than_the_reaction_changes_nothing_and_the_period_counts():
    gaps = np.arange(0.3, 2.0, 0.02)
    known = [share_of_a_look(None, gap) for gap in gaps]
    assert [share_of_a_look(CONFIG.reaction_s - 0.05, gap) for gap in gaps] == known
    assert [share_of_a_look(CONFIG.reaction_s, gap) for gap in gaps] != known


def test_stop_comes_in_time_by_lines_that_come_late():
    """A person at a walk of ISO 13855, seen 0.5 s late: the robot stands before its own way takes it there."""
    monitor, x, v, person, seen = CollisionMonitor(CONFIG, ROBOT), 0.0, 0.5, 4.0, [4.0] * 11
    while v > 0.0:
        limited = monitor.limited(0.05 * len(seen), 0.5, 0.0, np.array([[seen[-11] - x, 0.0]]), 0.5)
        v = max(limited.v, v - 1.5 * 0.05) if limited.v < v else limited.v
        x, person = x + v * 0.05, person - CONFIG.approach_mps * 0.05
        seen.append(person)
    assert person - x - FRONT_M >= CONFIG.margin_m - 0.05


@pytest.mark.parametrize("seen_ago_s", [math.inf, math.nan, -3.0])
def test_age_that_is_none_counts_as_the_oldest_or_as_none(seen_ago_s):
    assert share_of_a_look(seen_ago_s) == (1.0 if seen_ago_s < 0.0 else 0.0)
