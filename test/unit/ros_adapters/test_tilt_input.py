"""The mount's tilt, by joint states or, of a lidar that is fixed, with odometry."""

from collections.abc import Callable
from typing import Any

import pytest
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from ros_adapters.conversions import ros_time
from ros_adapters.tilt_input import TiltInput


class PlayedNode:
    """Also its own diagnostics: of conditions it keeps the text."""

    def __init__(self) -> None:
        self.callbacks: dict[str, Callable[[Any], object]] = {}
        self.diagnostics, self.held = self, dict[str, str]()

    def holds(self, what: str, text: str) -> None:
        self.held[what] = text

    def subscribe(self, topic: str, _type: type, callback: Callable[[Any], object], **_how: object) -> None:
        self.callbacks[topic] = callback


def joints(stamp_s: float, **positions: float) -> JointState:
    return JointState(header=Header(stamp=ros_time(stamp_s)), name=list(positions), position=list(positions.values()))


def test_tilting_mount_is_heard_by_its_joint_and_not_by_odometry() -> None:
    node, heard = PlayedNode(), list[tuple[float, float]]()
    tilt = TiltInput(node, "tilt_joint", lambda *one: heard.append(one))  # type: ignore[arg-type]
    tilt.add_odometry(1.0)
    assert node.callbacks["joint_states"](joints(2.0, wheel=7.0, tilt_joint=0.3)) is True
    assert node.callbacks["joint_states"](joints(3.0, wheel=7.0)) is False
    assert heard == [(pytest.approx(2.0), 0.3)] and not tilt.is_fixed and tilt.topics == ("joint_states",)


def test_fixed_mount_is_level_with_every_odometry_and_hears_no_joints() -> None:
    node, heard = PlayedNode(), list[tuple[float, float]]()
    tilt = TiltInput(node, None, lambda *one: heard.append(one))  # type: ignore[arg-type]
    tilt.add_odometry(1.0)
    tilt.add_odometry(1.05)
    assert heard == [(1.0, 0.0), (1.05, 0.0)] and tilt.is_fixed and not node.callbacks and tilt.topics == ()


def test_two_senders_of_the_joint_are_told_by_name_for_as_long_as_both_send() -> None:
    node = PlayedNode()
    TiltInput(node, "tilt_joint", lambda *_: None)  # type: ignore[arg-type]

    def told(stamp_s: float, sender: str, joint: str = "tilt_joint") -> str:
        message = joints(stamp_s, **{joint: 0.3})
        message._connection_header = {"callerid": sender}
        node.callbacks["joint_states"](message)
        return node.held["tilt_joint has two senders"]

    assert told(2.0, "/mount") == "" == told(2.01, "/base", "wheel")
    assert told(2.02, "/joint_state_publisher") == "/joint_state_publisher, /mount"
    assert told(2.03, "/mount") == "/joint_state_publisher, /mount"
    assert told(9.0, "/mount") == ""
