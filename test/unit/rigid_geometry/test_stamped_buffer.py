"""Stamped samples: their order, their bounds, and what is found around an interval."""

from collections import Counter

import pytest

from rigid_geometry import StampedBuffer


@pytest.fixture
def dropped() -> Counter[str]:
    return Counter()


@pytest.fixture
def buffer(dropped: Counter[str]) -> StampedBuffer[str]:
    filled: StampedBuffer[str] = StampedBuffer("imu", 10.0, dropped)
    for stamp_s, value in zip((1.0, 2.0, 3.0, 4.0), "abcd", strict=True):
        filled.append(stamp_s, value)
    return filled


def test_arrivals_are_judged_by_the_latest_stamp_and_counted(buffer, dropped):
    assert [buffer.takes(s, buffer.clear) for s in (4.1, 4.0, 3.6, 3.4)] == [True, False, False, True]
    assert not len(buffer) and dropped == {"imu_late": 2, "time_jump": 1}


def test_what_is_older_than_the_buffer_is_long_is_forgotten_and_counted(buffer, dropped):
    buffer.append(13.0, "e")
    assert buffer.values == ["c", "d", "e"] and dropped == {"imu_overflow": 2}


def test_between_takes_the_ends_and_around_reaches_past_them(buffer):
    assert buffer.between(2.0, 3.0)[1] == ["b", "c"]
    assert buffer.around(2.5, 3.5)[1] == ["b", "c", "d"]
    assert buffer.around(2.0, 3.0)[1] == ["b", "c"]
    assert buffer.around(0.0, 9.0)[1] == ["a", "b", "c", "d"]


def test_forgetting_keeps_the_sample_that_interpolation_needs(buffer):
    buffer.forget_before(2.5)
    assert buffer.values == ["b", "c", "d"]
    buffer.forget_before(0.0)
    assert len(buffer) == 3 and buffer.first() == (2.0, "b")
    buffer.drop_first()
    assert buffer.stamps.tolist() == [3.0, 4.0]


def test_cleared_buffer_takes_any_stamp(buffer):
    buffer.clear()
    assert buffer.first() is None and buffer.last_stamp_s is None and buffer.takes(0.5, buffer.clear)
