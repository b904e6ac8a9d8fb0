"""What the mount is told: whatever it does at the beginning, and at the end that it rests."""

from types import SimpleNamespace
from typing import Any

import pytest
import rospy

from ros_adapters import mount_nodding
from ros_adapters.driving_memory import DrivingMemory
from ros_adapters.mapping_mode import OpenSweeps, ResultTimes
from ros_adapters.mount_nodding import MountNodding
from stop_scan_and_go import ScanWhileDriving, StopScanAndGoConfig


class _Mount:
    """In the place of its driver: what it was asked, and how it answers; None: nobody is there."""

    def __init__(self) -> None:
        self.asked: list[bool] = []
        self.obeys: bool | None = True

    def __call__(self, wanted: bool) -> Any:
        self.asked.append(wanted)
        if self.obeys is None:
            raise rospy.ServiceException("service [/nod] unavailable")
        return SimpleNamespace(success=self.obeys, message="no")


@pytest.fixture
def mount(monkeypatch: pytest.MonkeyPatch) -> _Mount:
    found = _Mount()
    monkeypatch.setattr(mount_nodding, "AskedService", lambda *_, **__: found)
    return found


def nodding(*, nods: bool | None = None, is_needed: bool = True) -> tuple[MountNodding, list[str]]:
    """And what it told of on diagnostics."""
    told: list[str] = []
    memory = DrivingMemory(ScanWhileDriving(StopScanAndGoConfig()), OpenSweeps(ResultTimes(), driving=True))
    memory.nods = memory.nods if nods is None else nods
    diagnostics: Any = SimpleNamespace(dropped=lambda what, _: told.append(what))
    return MountNodding(memory, diagnostics, limit_s=1.0, is_needed=is_needed), told


def want(asked: MountNodding, stamps_s: list[float], wanted: bool, *, is_stalled: bool = False, may_rest: bool = True) -> None:
    for stamp_s in stamps_s:
        asked.want(stamp_s, wanted, is_stalled=is_stalled, may_rest=may_rest)


def test_first_command_has_a_mount_rest_that_a_launch_before_left_nodding(mount: _Mount) -> None:
    asked, _ = nodding()
    want(asked, [0.0, 0.05, 0.1, 9.0], False)
    assert mount.asked == [False]
    want(asked, [9.1, 9.2], True)
    assert mount.asked == [False, True]


def test_mount_of_unknown_motion_is_not_told_to_rest_in_a_sweep(mount: _Mount) -> None:
    asked, _ = nodding()
    want(asked, [0.0, 9.0], False, may_rest=False)
    assert mount.asked == []


def test_driver_that_is_not_there_yet_is_asked_again_and_one_that_nobody_needs_is_not_missed(mount: _Mount) -> None:
    mount.obeys = None
    (asked, told), (other, nothing) = nodding(), nodding(is_needed=False)
    want(asked, [0.0, 1.0, 2.9, 3.1], False)
    assert (mount.asked, len(told)) == ([False, False], 2)
    want(other, [0.0, 3.1], False)
    assert not nothing


def test_refused_or_stalled_it_is_asked_again(mount: _Mount) -> None:
    asked, told = nodding(nods=False)
    mount.obeys = False
    want(asked, [0.0, 0.05], True)
    assert (mount.asked, told) == ([True, True], ["nod refused", "nod refused"])
    mount.obeys = True
    want(asked, [0.1, 0.15, 3.2], True)
    assert len(mount.asked) == 3
    want(asked, [3.3, 3.4, 6.0], True, is_stalled=True)
    assert len(mount.asked) == 4


@pytest.mark.parametrize(("nods", "expected"), [(True, [False]), (None, [False]), (False, [])])
def test_end_of_the_run_leaves_it_at_rest(mount: _Mount, nods: bool | None, expected: list[bool]) -> None:
    asked, _ = nodding(nods=nods)
    asked.end()
    assert mount.asked == expected


def test_end_of_the_run_stands_a_driver_that_is_gone(mount: _Mount) -> None:
    mount.obeys = None
    asked, told = nodding(nods=True)
    asked.end()
    assert told == ["mount not told to nod"]
