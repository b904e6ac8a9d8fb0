"""Timing pieces of work."""

import time

import pytest

from ros_adapters.stage_times import StageTimes


def test_pieces_of_work_are_counted_and_summed_by_name():
    times = StageTimes()
    for name, seconds in (("local", 0.01), ("local", 0.02), ("global", 0.03)):
        with times.of(name):
            time.sleep(seconds)
    count, seconds = times.count("local")
    assert count == 2 and 0.03 <= seconds < 1.0
    assert times.count("global")[0] == 1 and times.count("none") == (0, 0.0)


def test_piece_of_work_that_fails_is_not_counted():
    times = StageTimes()
    with pytest.raises(ValueError, match="on purpose"), times.of("local"):
        raise ValueError("on purpose")
    assert times.count("local") == (0, 0.0)
