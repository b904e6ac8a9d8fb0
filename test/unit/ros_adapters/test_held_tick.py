"""A tick of lock-step waits for what the robot thinks, and not for ever: what was lost with a node that died does not come."""

import pytest
import rospy

from ros_adapters.barrier import Tick
from ros_adapters.driving_memory import DrivingMemory
from ros_adapters.held_tick import HeldTick
from ros_adapters.mapping_mode import OpenSweeps, ResultTimes
from stop_scan_and_go import ScanWhileDriving, StopScanAndGoConfig

BEGUN_S = 1000.0  # by the steady clock


@pytest.fixture
def memory() -> DrivingMemory:
    return DrivingMemory(ScanWhileDriving(StopScanAndGoConfig()), OpenSweeps(ResultTimes(), driving=False))


def held(memory: DrivingMemory) -> HeldTick:
    tick = HeldTick(memory)
    tick.hold(Tick(5.0), BEGUN_S)
    return tick


def test_tick_of_which_nothing_is_awaited_is_answered_once(memory: DrivingMemory) -> None:
    tick = held(memory)
    assert tick.take() == Tick(5.0)
    assert tick.take() is None and tick.awaited(BEGUN_S + 1e6) == ""


def test_decision_that_does_not_come_is_told_after_a_while_and_then_given_up(memory: DrivingMemory) -> None:
    memory.open_sweeps.tick(5.0, 1)
    tick = held(memory)
    assert tick.take() is None and tick.awaited(BEGUN_S + 19.0) == ""
    tick.hold(Tick(5.0, recount=1), BEGUN_S + 15.0)  # another node came back
    assert tick.awaited(BEGUN_S + 21.0) == "the decision about a sweep has not come"
    assert tick.give_up(BEGUN_S + 89.0) == "" and tick.take() is None
    assert tick.give_up(BEGUN_S + 91.0) == "the decision about a sweep has not come"
    assert tick.take() == Tick(5.0, recount=1)
    memory.open_sweeps.decide(4.9)  # it comes late
    memory.open_sweeps.tick(9.0, 2)
    tick.hold(Tick(9.0), BEGUN_S + 95.0)
    assert tick.take() is None  # the next one is waited for again


def test_terrain_that_does_not_come_is_told_and_given_up(memory: DrivingMemory) -> None:
    memory.decided_stamp = rospy.Time(4)
    tick = held(memory)
    assert tick.awaited(BEGUN_S + 21.0) == "the follower has not the terrain of the last decision"
    assert tick.give_up(BEGUN_S + 91.0) and tick.take() == Tick(5.0)


def test_terrain_that_comes_releases_it(memory: DrivingMemory) -> None:
    memory.decided_stamp = rospy.Time(4)
    tick = held(memory)
    tick.terrain_stamp = rospy.Time(4)
    assert tick.take() == Tick(5.0)
