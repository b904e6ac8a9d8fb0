"""Sweeps come in two halves, and wait in their order."""

import pytest
from sensor_msgs.msg import PointCloud2

from ros_adapters.conversions import header, stamp_of
from ros_adapters.waiting_sweeps import WaitingSweeps


def half(stamp_s: float, width: int = 1) -> PointCloud2:
    return PointCloud2(header=header(stamp_s, "base_link"), width=width)


@pytest.fixture
def told() -> list[str]:
    return []


@pytest.fixture
def sweeps(told: list[str]) -> WaitingSweeps:
    return WaitingSweeps(lambda what, _why: told.append(what))


def test_halves_of_one_stamp_come_together_in_whatever_order(sweeps: WaitingSweeps) -> None:
    sweeps.add_free(half(1.0, 7))
    sweeps.add_cloud(half(1.0))
    sweeps.add_cloud(half(2.0))
    sweeps.add_free(half(2.0, 8))
    assert [tuple((stamp_of(m), m.width) for m in sweeps.take_first()) for _ in range(2)] == [((1.0, 1), (1.0, 7)), ((2.0, 1), (2.0, 8))]
    assert sweeps.first is None


def test_half_that_never_came_is_empty(sweeps: WaitingSweeps) -> None:
    sweeps.add_cloud(half(1.0))
    assert not sweeps.has_free(half(1.0))
    assert sweeps.take_first()[1].width == 0


def test_of_too_many_the_oldest_is_dropped_and_told(sweeps: WaitingSweeps, told: list[str]) -> None:
    for k in range(6):
        sweeps.add_cloud(half(1.0 + k))
    assert sweeps.first is not None and stamp_of(sweeps.first) == 2.0
    assert told == ["sweep that waited"]


def test_halves_that_nobody_asks_for_do_not_pile_up(sweeps: WaitingSweeps) -> None:
    for k in range(7):
        sweeps.add_free(half(1.0 + k))
    assert [sweeps.has_free(half(1.0 + k)) for k in range(7)] == [False, False, True, True, True, True, True]
