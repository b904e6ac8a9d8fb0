"""Inputs by time, the topic that drives, silence, and the barrier of lock-step."""

import itertools
from collections import deque
from types import SimpleNamespace

import pytest
import rospy

from ros_adapters.barrier import Barrier, Tick
from ros_adapters.diagnostics import Diagnostics
from ros_adapters.inputs import Driver, InputWatch, TimedInput


def filled(*stamps_s: float, max_age_s: float = 0.3) -> TimedInput[float]:
    values: TimedInput[float] = TimedInput(max_age_s)
    for stamp_s in stamps_s:
        values.add(stamp_s, stamp_s)
    return values


@pytest.mark.parametrize("phase_s", [0.0, 1e-9, 0.007, 0.0499])
def test_newest_value_that_is_not_later_is_taken_whatever_its_phase(phase_s: float) -> None:
    values = filled(*(0.05 * k + phase_s for k in range(20)))
    assert values.at(0.5) == pytest.approx(0.5 if phase_s == 0.0 else 0.45 + phase_s)


def test_value_that_is_too_old_is_not_known() -> None:
    values = filled(1.0)
    assert values.at(1.29) == 1.0
    assert values.at(1.31) is None
    assert values.at(0.999) is None


@pytest.mark.parametrize("order", list(itertools.permutations((1.0, 1.02, 1.04))))
def test_late_and_doubled_values_find_their_place(order: tuple[float, ...]) -> None:
    values = filled(*order, *order)
    assert [values.at(s) for s in (1.01, 1.03, 1.05)] == [1.0, 1.02, 1.04]


def test_clock_that_was_set_back_begins_anew() -> None:
    values = filled(100.0, 100.1, 50.0)
    assert values.at(50.1) == 50.0
    assert values.at(100.1) is None
    driver: Driver[float] = Driver()
    driver.add(100.0, 1.0)
    driver.add(50.0, 2.0)
    assert list(driver.take()) == [(50.0, 2.0)]


def test_driver_gives_every_value_once_in_order_and_counts_what_is_late_or_doubled() -> None:
    driver: Driver[str] = Driver()
    for stamp_s in (1.0, 1.05, 1.05, 1.02, 1.1):
        driver.add(stamp_s, f"{stamp_s}")
    assert [s for s, _ in driver.take(1.07)] == [1.0, 1.05]
    assert [s for s, _ in driver.take()] == [1.1]
    assert list(driver.take()) == []
    assert driver.late == 2


def test_silence_is_told_with_its_topic_and_how_long() -> None:
    watch = InputWatch("/scan", 0.3, since_s=10.0)
    assert watch.silence(10.2) == ""
    assert watch.silence(12.0) == "nothing ever came on /scan for 2.0 s"
    for k in range(20):
        watch.arrived(12.0 + 0.025 * k)
    assert watch.silence(12.5) == ""
    assert watch.silence(13.475) == "no /scan for 1.0 s"
    assert watch.described(12.5).startswith("40.0 Hz, 0.03 s old, 20")


def test_topic_that_speaks_only_at_times_is_never_silent() -> None:
    assert InputWatch("/exploration/decision", None, since_s=0.0).silence(1e6) == ""


def test_tick_is_complete_when_all_that_was_sent_is_here_in_whatever_order() -> None:
    events = ("scan", "scan", "joints", "tick")
    for order in set(itertools.permutations(events)):
        barrier = Barrier(("",), ("/scan", "/joints"))
        for k, event in enumerate(order):
            assert barrier.next() is None or k == len(order)
            if event == "tick":
                barrier.told("", Tick(1.05, {"/scan": 2, "/joints": 1, "/imu": 7}))
            else:
                barrier.received(f"/{event}")
        assert barrier.next() == Tick(1.05, {"/scan": 2, "/joints": 1, "/imu": 7})
        assert barrier.next() is None


def test_tick_waits_for_all_who_tell_of_it_and_takes_the_larger_count() -> None:
    barrier = Barrier(("fusion", "filter"), ("/odom",))
    barrier.told("fusion", Tick(1.05, {"/odom": 1}))
    assert barrier.next() is None
    barrier.told("filter", Tick(1.05, {"/odom": 0, "/scan": 2}))
    assert barrier.next() is None
    barrier.received("/odom")
    assert barrier.next() == Tick(1.05, {"/odom": 1, "/scan": 2})


def test_tick_in_which_nothing_was_sent_is_complete_at_once() -> None:
    barrier = Barrier(("",), ("/scan",))
    barrier.told("", Tick(1.0, {}))
    barrier.told("", Tick(1.05, {"/scan": 0}))
    assert [barrier.next(), barrier.next()] == [Tick(1.0, {}), Tick(1.05, {"/scan": 0})]


def test_driver_that_nobody_takes_from_keeps_the_newest_alone() -> None:
    driver: Driver[int] = Driver()
    for k in range(1000):
        driver.add(0.05 * k, k)
    waiting = list(driver.take())
    assert len(waiting) <= 200 and waiting[-1] == (0.05 * 999, 999)


def test_node_that_was_away_goes_on_from_the_recount_with_what_it_lost_left_out() -> None:
    barrier = Barrier(("",), ("/scan",))
    barrier.told("", Tick(1.0, {"/scan": 40}))  # of which this process heard none
    assert barrier.next() is None
    barrier.told("", Tick(1.0, {"/scan": 40}, 1))
    assert barrier.next() == Tick(1.0, {"/scan": 40}, 1)
    barrier.told("", Tick(1.05, {"/scan": 41}, 1))
    assert barrier.next() is None
    barrier.received("/scan")
    assert barrier.next() == Tick(1.05, {"/scan": 41}, 1)


def test_who_listens_to_a_node_that_was_away_counts_with_it_from_zero() -> None:
    barrier = Barrier(("fusion", "filter"), ("/odom", "/scan"))
    for _ in range(5):
        barrier.received("/odom"), barrier.received("/scan")
    barrier.told("filter", Tick(1.0, {"/scan": 5}))  # fusion died before it told of it
    barrier.told("filter", Tick(1.0, {"/scan": 5}, 1))
    assert barrier.next() is None
    barrier.told("fusion", Tick(1.0, {"/odom": 0}, 1))
    assert barrier.next() == Tick(1.0, {"/scan": 5, "/odom": 0}, 1)
    barrier.told("filter", Tick(1.05, {"/scan": 6}, 1))
    barrier.told("fusion", Tick(1.05, {"/odom": 1}, 1))
    barrier.received("/scan")
    assert barrier.next() is None
    barrier.received("/odom")
    assert barrier.next() == Tick(1.05, {"/scan": 6, "/odom": 1}, 1)


def test_a_second_recount_takes_the_place_of_one_that_somebody_never_told() -> None:
    barrier = Barrier(("fusion", "filter"), ())
    barrier.told("filter", Tick(1.0, {}, 1))
    barrier.told("filter", Tick(1.0, {}, 2))
    barrier.told("fusion", Tick(1.0, {}, 2))
    assert [barrier.next(), barrier.next()] == [Tick(1.0, {}, 2), None]


class Looking(deque[float]):
    """Arrivals at which another thread looks whenever one is added."""

    def __init__(self, watch: InputWatch) -> None:
        super().__init__()
        self.watch = watch

    def append(self, now_s: float) -> None:
        self.watch.described(now_s)
        super().append(now_s)
        self.watch.described(now_s)


def test_first_message_may_come_while_it_is_reported_that_none_has() -> None:
    watch = InputWatch("/scan", 0.3, since_s=10.0)
    watch._arrivals = Looking(watch)
    watch.arrived(10.1)
    assert watch.count == 1


class TextsThatAreReported(dict[str, str]):
    """Texts at which another thread looks whenever one is added."""

    def __init__(self, diagnostics: Diagnostics) -> None:
        super().__init__()
        self.diagnostics = diagnostics

    def __setitem__(self, what: str, text: str) -> None:
        self.diagnostics._publish(0.0, 0, "")
        super().__setitem__(what, text)


def test_first_drop_of_a_kind_may_come_while_others_are_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda *_: None)  # it asks for the time, which there is in nodes only
    diagnostics = Diagnostics("x")
    diagnostics._publisher = SimpleNamespace(publish=lambda _: None)
    diagnostics._last_text = TextsThatAreReported(diagnostics)
    diagnostics.dropped("sweep refused", "busy")
    assert diagnostics._last_text["sweep refused"] == "busy"


def test_barrier_says_what_it_waits_for_too_long() -> None:
    barrier = Barrier(("", "filter"), ("/odom", "/scan"))
    assert barrier.missing(100.0, 0.0) == ""
    barrier.told("filter", Tick(1.0, {"/odom": 2}))
    assert barrier.missing(100.0, 0.0) == "tick of 1.00 s: the simulator has not told of the tick, 0 of 2 messages came on /odom"
    barrier.told("", Tick(1.0, {"/scan": 1, "/odom": 1}))
    barrier.received("/odom")
    words = "tick of 1.00 s: 1 of 2 messages came on /odom, 0 of 1 messages came on /scan"
    assert [barrier.missing(at_s, 20.0) for at_s in (110.0, 129.9, 130.0)] == ["", "", words]
    barrier.received("/odom")
    assert barrier.missing(131.0, 20.0) == ""
    barrier.received("/scan")
    assert barrier.next() is not None
    assert barrier.missing(200.0, 0.0) == ""
