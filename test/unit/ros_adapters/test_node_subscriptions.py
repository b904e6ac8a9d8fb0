"""What a node takes for heard: its callback says which messages are for it, the barrier counts them all. No master runs."""

from collections.abc import Callable
from typing import Any

import pytest
import rospy
from sensor_msgs.msg import JointState

from ros_adapters.barrier import Tick
from ros_adapters.conversions import joint_position
from ros_adapters.node import Node

TOPIC = "/joint_states"
BASE, MOUNT = JointState(name=["left_wheel"], position=[0.0]), JointState(name=["tilt"], position=[0.1])


class _Wire:
    """Stands for rospy's publishers and subscribers; keeps the callbacks by topic."""

    callbacks: dict[str, Callable[[Any], None]] = {}

    def __init__(self, topic: str, _type: type, callback: Callable[[Any], None] = lambda _: None, **_more: object) -> None:
        self.callbacks[topic] = callback

    def publish(self, *_: object) -> None: ...


@pytest.fixture
def parameters(monkeypatch: pytest.MonkeyPatch) -> dict[str, object]:
    values: dict[str, object] = {}
    monkeypatch.setattr(rospy, "init_node", lambda *_, **__: None)
    monkeypatch.setattr(rospy, "get_param", values.get)
    monkeypatch.setattr(rospy, "Publisher", _Wire)
    monkeypatch.setattr("ros_adapters.node.CountingPublisher", _Wire)
    monkeypatch.setattr(rospy, "Subscriber", _Wire)
    return values


def listening() -> Node:
    node = Node("listener")
    node.subscribe(TOPIC, JointState, lambda m: joint_position(m, "tilt") is not None, silent_after_s=0.3)
    return node


def test_message_that_is_not_for_the_node_breaks_no_silence(parameters: dict[str, object]) -> None:
    node = listening()
    (watch,) = node.diagnostics.inputs
    since_s = watch.since_s
    _Wire.callbacks[TOPIC](BASE)
    assert (watch.count, watch.since_s) == (0, since_s) and watch.silence(since_s + 1.0) == f"nothing ever came on {TOPIC} for 1.0 s"
    _Wire.callbacks[TOPIC](MOUNT)
    assert watch.count == 1 and watch.since_s > since_s


def test_barrier_counts_messages_that_are_not_for_the_node(parameters: dict[str, object]) -> None:
    parameters["lockstep"] = True
    node, acted = listening(), list[Tick | None]()
    node.acts(acted.append, after=("sim",), on=(TOPIC,))
    assert node._barrier is not None
    node._barrier.told("sim", Tick(1.0, {TOPIC: 2}))
    _Wire.callbacks[TOPIC](MOUNT)
    assert acted == []
    _Wire.callbacks[TOPIC](BASE)
    assert acted == [Tick(1.0, {TOPIC: 2})]
