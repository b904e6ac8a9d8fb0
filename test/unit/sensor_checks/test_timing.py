"""Rates, ages, order and clocks of messages that come as drivers send them, and of those that do not."""

import numpy as np
import pytest

from sensor_checks import CheckLimits, Heard, Level, Needs, clock_rows, timing_rows

NEEDS = Needs(10.0, 0.1, 0.3, 16.0)
LIMITS = CheckLimits()


def messages(rate_hz=20.0, latency_s=0.012, seconds=10.0, jitter=0.0, seed=0, duration_s=0.0, late_s=0.0):
    """`latency_s` after the stamp, and up to `late_s` more by chance."""
    rng = np.random.default_rng(seed)
    stamps = 1.7e9 + (np.arange(int(rate_hz * seconds)) + jitter * rng.normal(size=int(rate_hz * seconds))) / rate_hz
    return [Heard(s - 1.7e9, s + latency_s + late_s * rng.random(), s, duration_s) for s in stamps]


def rows(heard):
    return {row.asked: row for row in timing_rows("/t", heard, NEEDS, 10.0, LIMITS)}


def test_right_input_is_ok_and_its_rate_and_jitter_are_told():
    found = rows(messages(jitter=0.02))
    assert {row.level for row in found.values()} == {Level.OK}
    assert found["rate"].found.startswith("20.0 Hz, jitter 2.") or found["rate"].found.startswith("20.0 Hz, jitter 3.")
    assert found["age"].found.startswith("12 ms")


def test_lost_and_late_messages_do_not_blow_up_the_jitter():
    heard = [h for i, h in enumerate(messages()) if i % 50]
    assert rows(heard)["rate"].found == "19.6 Hz, jitter 0.0 %"


@pytest.mark.parametrize("rate_hz, level", [(9.0, Level.ERROR), (11.0, Level.WARN), (17.0, Level.OK)])
def test_rate_below_what_is_needed_is_an_error_and_one_that_is_too_slow_to_drive_by_a_warning(rate_hz, level):
    assert rows(messages(rate_hz))["rate"].level is level


@pytest.mark.parametrize(
    "latency_s, level", [(0.09, Level.OK), (0.2, Level.ERROR), (-0.01, Level.OK), (-0.05, Level.ERROR), (-5e8, Level.ERROR)]
)
def test_age_on_both_sides(latency_s, level):
    assert rows(messages(latency_s=latency_s))["age"].level is level


def test_single_late_messages_are_a_warning():
    heard = [Heard(h.arrival_s, h.clock_s + (0.3 if i % 10 == 0 else 0.0), h.stamp_s) for i, h in enumerate(messages())]
    assert rows(heard)["age"].level is Level.WARN


def test_order():
    right = messages()
    few = [*right[:100], right[99], *right[100:]]
    assert rows(few)["order"].level is Level.OK and "1 of 201 stamps come twice" in rows(few)["order"].found
    assert rows([h for h in right for _ in range(2)])["order"].level is Level.WARN
    swapped = [right[i ^ 1] for i in range(200)]
    assert rows(swapped)["order"].level is Level.WARN
    assert rows([*right[100:], *right[:100]])["order"].level is Level.ERROR


@pytest.mark.parametrize("lost, warned", [(4, False), (8, True)])
def test_pause_that_stops_the_robot_is_warned_of(lost, warned):
    right = messages()
    assert ("pauses" in rows([*right[:100], *right[100 + lost :]])) is warned


def test_nothing_and_stamps_of_zero():
    assert rows([])["messages"].level is Level.ERROR
    assert rows([Heard(0.0, 1.7e9, 0.0)])["stamps"].level is Level.ERROR


def test_single_message_is_judged_without_a_jitter():
    assert rows(messages()[:1])["rate"].found == "0.1 Hz"


@pytest.mark.parametrize("apart_s, level", [(0.05, Level.OK), (3.0, Level.ERROR), (-3.0, Level.ERROR)])
def test_clocks_are_compared_by_the_least_age(apart_s, level):
    (row,) = clock_rows({"/a": messages(), "/b": messages(latency_s=0.012 + apart_s), "/c": []}, LIMITS)
    assert row.level is level
    assert ("/b is 3.00 s behind /a" in row.found) is (apart_s == 3.0)
    assert not clock_rows({"/a": messages()}, LIMITS)


@pytest.mark.parametrize("turn_s", [0.05, 0.1, 0.2])
def test_turn_of_a_lidar_that_is_stamped_with_its_first_beam_is_no_other_clock(turn_s):
    points = messages(1.0 / turn_s, turn_s + 0.006, duration_s=turn_s)
    others = {"/imu/data": messages(100.0, 0.002), "/wheel_odom": messages(50.0, 0.004)}
    (row,) = clock_rows({"/points": points, **others}, LIMITS)
    assert (row.level, row.found) == (Level.OK, "agree within 4 ms")
    late = messages(1.0 / turn_s, turn_s + 0.206, duration_s=turn_s)
    (row,) = clock_rows({"/points": late, **others}, LIMITS)
    assert row.level is Level.ERROR and "/points is 204 ms behind /imu/data" in row.found


@pytest.mark.parametrize(
    ("latency_s", "said"), [(0.106, ""), (0.006, "not that of the first beam"), (-0.1, "its clock is not the robot's")]
)
def test_reading_that_comes_before_its_last_beam_is_not_stamped_with_the_first(latency_s, said):
    spinning = Needs(5.0, 0.3, 0.3, 8.0)
    heard = messages(10.0, latency_s, duration_s=0.0999)
    (age,) = [row for row in timing_rows("/points", heard, spinning, 10.0, LIMITS) if row.asked == "age"]
    assert said in age.advice and (age.level is Level.OK) == (not said)
    if latency_s > 0.0:
        (clocks,) = clock_rows({"/points": heard, "/imu/data": messages(100.0, 0.002)}, LIMITS)
        assert clocks.level is Level.OK


@pytest.mark.parametrize(
    ("behind_s", "late_s", "level"), [(0.0, 0.0, Level.OK), (0.015, 0.0, Level.OK), (0.095, 0.0, Level.WARN), (0.03, 0.1, Level.OK)]
)
@pytest.mark.parametrize(("rate_hz", "duration_s"), [(40.0, 0.0187), (10.0, 0.1)])
def test_tilt_that_is_behind_the_laser_by_more_than_its_jitter_is_warned_of(behind_s, late_s, level, rate_hz, duration_s):
    scans, tilts = messages(rate_hz, duration_s + 0.006, duration_s=duration_s), messages(50.0, 0.006 + behind_s, late_s=late_s)
    every, tilt = clock_rows({"/scan": scans, "/joint_states": tilts}, LIMITS, ("/joint_states", "/scan"))
    assert every.level is Level.OK and tilt.level is level
    assert ("/joint_states is 95 ms behind /scan" in tilt.found) == (behind_s == 0.095)
    assert len(clock_rows({"/scan": scans, "/joint_states": []}, LIMITS, ("/joint_states", "/scan"))) == 0
