"""How late stamps are by this computer's clock, and how early where its clock is behind the robot's."""

import time
from types import SimpleNamespace
from typing import Any

import pytest
import rospy
from rosgraph_msgs.msg import Clock

from ros_adapters.lateness import Lateness


def lateness(monkeypatch: pytest.MonkeyPatch, *, lockstep: bool = False, simulated: bool = False) -> Lateness:
    monkeypatch.setattr(rospy, "get_param", lambda name, default=None: simulated)
    monkeypatch.setattr(rospy, "Subscriber", lambda *_, **__: None)
    node: Any = SimpleNamespace(lockstep=lockstep)
    return Lateness(node)


def test_stamps_of_about_now_are_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    found = lateness(monkeypatch)
    assert [found.words(time.time() - late_s, 0.3) for late_s in (0.25, 0.0, -0.05)] == ["", "", ""]


def test_late_ones_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    assert lateness(monkeypatch).words(time.time() - 0.6, 0.3).startswith("0.6 s late")


def test_stamps_ahead_of_this_computer_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its clock is behind the robot's by three seconds: what comes two seconds late would look in time."""
    words = lateness(monkeypatch).words(time.time() + 3.04, 0.3)
    assert words == "stamped 3.0 s ahead of this computer's clock: give them one clock"
    assert lateness(monkeypatch).words(time.time() + 0.15, 0.3)


def test_where_the_clock_waits_nothing_is_late_or_early(monkeypatch: pytest.MonkeyPatch) -> None:
    found = lateness(monkeypatch, lockstep=True)
    assert [found.words(time.time() + s, 0.3) for s in (-9.0, 9.0)] == ["", ""]


def test_simulated_clock_that_comes_after_the_sensors_is_not_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    found = lateness(monkeypatch, simulated=True)
    assert found.words(1000.0, 0.3) == "", "it has not come yet"
    found._on_clock(Clock(clock=rospy.Time(1000)))
    assert found.words(1000.5, 0.3) == "" and found.words(999.5, 0.3)


def test_age_of_what_was_seen_is_known_where_the_clock_does_not_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    assert lateness(monkeypatch).age_s(time.time() - 0.5) == pytest.approx(0.5, abs=0.2)
    assert lateness(monkeypatch, lockstep=True).age_s(0.0) is None
