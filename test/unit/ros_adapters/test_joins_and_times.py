"""Joining what carries one stamp, and timing pieces of work."""

import itertools
import time

import pytest

from ros_adapters.stage_times import StageTimes
from ros_adapters.tick_join import TickJoin, stamp_key

NAMES = ("odom", "tilt", "command")


def joined(join: TickJoin) -> list[float]:
    return [stamp_s for stamp_s, _ in join.complete()]


@pytest.mark.parametrize("order", list(itertools.permutations(NAMES)))
def test_order_of_arrival_does_not_matter(order: tuple[str, ...]) -> None:
    join = TickJoin(NAMES)
    for name in order[:-1]:
        join.add(name, 1.05, name)
        assert joined(join) == []
    join.add(order[-1], 1.05, order[-1])
    assert list(join.complete()) == [(1.05, {name: name for name in NAMES})]
    assert joined(join) == []


def test_stamps_of_different_arithmetic_are_one() -> None:
    assert stamp_key(0.1 + 0.2) == stamp_key(0.3) == 300
    join = TickJoin(("a", "b"))
    join.add("a", 0.1 + 0.2, 1)
    join.add("b", 0.3, 2)
    assert joined(join) == [0.3]


def test_complete_stamps_come_in_order_and_older_incomplete_ones_are_given_up() -> None:
    join = TickJoin(("a", "b"))
    for stamp_s in (1.0, 1.05, 1.1):
        join.add("a", stamp_s, None)
    for stamp_s in (1.1, 1.05):
        join.add("b", stamp_s, None)
    assert joined(join) == [1.05, 1.1]
    join.add("b", 1.0, None)
    assert joined(join) == []


def test_newer_value_of_a_stamp_replaces_the_older_one() -> None:
    join = TickJoin(("a",))
    join.add("a", 1.0, "old")
    join.add("a", 1.0, "new")
    assert [values["a"] for _, values in join.complete()] == ["new"]


def test_stamp_that_was_given_out_is_not_given_out_again() -> None:
    join = TickJoin(("a",))
    join.add("a", 1.0, None)
    assert joined(join) == [1.0]
    join.add("a", 1.0, None)
    assert joined(join) == []


def test_time_that_jumped_back_starts_afresh() -> None:
    join = TickJoin(("a", "b"))
    join.add("a", 100.0, None)
    join.add("b", 100.0, None)
    assert joined(join) == [100.0]
    join.add("a", 20.0, None)
    join.add("b", 20.0, None)
    assert joined(join) == [20.0]


def test_what_never_completes_does_not_pile_up() -> None:
    join = TickJoin(("a", "b"))
    for k in range(1000):
        join.add("a", 0.05 * k, None)
    join.add("b", 0.0, None)
    assert joined(join) == []
    join.add("b", 0.05 * 999, None)
    assert joined(join) == [pytest.approx(0.05 * 999)]


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
