"""What stop_scan_and_go_node sends to the wheels while no follower speaks: the joystick's word, then zero, and nothing unasked."""

import runpy
import time
from pathlib import Path
from threading import RLock
from types import SimpleNamespace
from typing import Any

import pytest
from geometry_msgs.msg import Twist

NODE = Path(__file__).resolve().parents[3] / "nodes" / "stop_scan_and_go_node"
HOLD_S = 0.1


class _Wheels:
    def __init__(self) -> None:
        self.v: list[float] = []

    @property
    def sent(self) -> int:
        return len(self.v)

    def publish(self, twist: Twist) -> None:
        self.v.append(twist.linear.x)


@pytest.fixture(scope="module")
def node_class() -> type:
    return runpy.run_path(str(NODE), run_name="loaded")["StopScanAndGoNode"]


def node_that_heard_no_command(node_class: type, *, is_first: bool = True) -> Any:
    """A process that has just begun, without ROS; `is_first`: no other one was there before it."""
    node = object.__new__(node_class)
    node.life, node._velocity = SimpleNamespace(is_first=is_first), _Wheels()
    node._commanded_s, node._teleop, node._teleop_hold_s, node._max_age_s = None, None, HOLD_S, 0.3
    return node


def test_joystick_that_falls_silent_before_the_first_command_is_followed_by_zero(node_class: type) -> None:
    node, twist = node_that_heard_no_command(node_class), Twist()
    twist.linear.x = 0.8
    node._on_teleop(twist)
    node._stand_without_commands(time.monotonic())
    assert node._velocity.v == [0.8]
    time.sleep(2 * HOLD_S)
    for _ in range(3):
        node._stand_without_commands(time.monotonic())
    assert node._velocity.v == [0.8, 0.0, 0.0, 0.0]


def test_where_nobody_has_spoken_nothing_is_sent(node_class: type) -> None:
    node = node_that_heard_no_command(node_class)
    node._stand_without_commands(time.monotonic())
    assert node._velocity.v == []


def test_process_after_one_that_died_sends_zero_for_what_that_may_have_sent(node_class: type) -> None:
    node = node_that_heard_no_command(node_class, is_first=False)
    node._stand_without_commands(time.monotonic())
    assert node._velocity.v == [0.0]


def test_end_of_the_run_leaves_wheels_that_stand_and_a_mount_at_rest(node_class: type) -> None:
    node, ends = node_that_heard_no_command(node_class), []
    node.lock, node._tilt, node._nodding = RLock(), SimpleNamespace(is_fixed=False), SimpleNamespace(end=lambda: ends.append("rest"))
    node._end()
    assert node._velocity.v == [] and ends == ["rest"], "nobody has driven"
    node._velocity.publish(Twist())
    node._end()
    assert node._velocity.v == [0.0, 0.0] and len(ends) == 2
    node._act(None)  # a command that comes now goes nowhere: nothing of the node is asked
