"""What goes out under move_base's names: costmap and changes, recoveries, second names, and a service's reason without rospy's words."""

import io
from typing import Any

import numpy as np
import pytest
import rospy

from local_terrain_costmap.view import CostmapView
from path_following import FollowerOutput, FollowerState
from robot_body import RobotBody
from ros_adapters.aliases import ALIASES
from ros_adapters.costmap_topics import CostmapTopics, OccupancyGridUpdate, costmap_message
from ros_adapters.counting_publisher import CountingPublisher
from ros_adapters.recovery_status import Recovery, RecoveryTopic
from ros_adapters.service_errors import reason_of

RES = 0.1
HERE = np.eye(4)


class _Topic:
    def __init__(self) -> None:
        self.messages: list[Any] = []
        self.listeners = 1

    def publish(self, message: Any) -> None:
        self.messages.append(message)

    def get_num_connections(self) -> int:
        return self.listeners


class _Node:
    """Stands for a node: its publishers keep what they are given."""

    def __init__(self) -> None:
        self.topics: dict[str, _Topic] = {}

    def publisher(self, topic: str, _type: type, **_more: object) -> _Topic:
        return self.topics.setdefault(topic, _Topic())


def view(cost: np.ndarray, x: float = 0.0) -> CostmapView:
    return CostmapView(cost.astype(np.uint8), (x, 0.0), RES)


def test_costs_are_translated_as_costmap_2d_does() -> None:
    grid = costmap_message(1.0, view(np.array([[0, 1, 252, 253, 254, 255]])), 0.5)
    assert list(grid.data) == [0, 1, 98, 99, 100, -1]
    assert (grid.info.width, grid.info.height, grid.info.origin.position.z) == (6, 1, 0.5)


def test_update_is_the_type_that_rviz_knows() -> None:
    assert OccupancyGridUpdate._md5sum == "b295be292b335c34718bd939deebe1c9"
    buffer = io.BytesIO()
    OccupancyGridUpdate(x=1, width=1, height=1, data=[100]).serialize(buffer)
    assert OccupancyGridUpdate().deserialize(buffer.getvalue()).data == (100,)


def test_whole_costmap_and_its_updates_together_are_the_newest_one() -> None:
    node, rng = _Node(), np.random.default_rng(3)
    topics, cost = CostmapTopics(node, RobotBody()), np.zeros((20, 30), np.uint8)  # type: ignore[arg-type]
    whole, updates = node.topics["local_costmap/costmap"], node.topics["local_costmap/costmap_updates"]
    shown = np.zeros(0)
    for step in range(40):
        if step % 8 == 7:
            cost = cost.copy()
            cost[rng.integers(20), rng.integers(30)] = 254
        whole.messages, updates.messages = [], []
        topics.publish(float(step), view(cost, x=RES * (step // 16)), HERE)
        assert len(whole.messages) + len(updates.messages) <= 1
        for grid in whole.messages:
            shown = np.reshape(grid.data, (grid.info.height, grid.info.width)).copy()
        for u in updates.messages:
            shown[u.y : u.y + u.height, u.x : u.x + u.width] = np.reshape(u.data, (u.height, u.width))
        assert np.array_equal(shown == 100, cost == 254)
        assert bool(whole.messages) == (step % 16 == 0)


def test_whoever_begins_to_listen_gets_the_whole_costmap() -> None:
    node = _Node()
    topics, same = CostmapTopics(node, RobotBody()), view(np.zeros((4, 4)))  # type: ignore[arg-type]
    whole = node.topics["local_costmap/costmap"]
    for listeners, sent in ((1, 1), (1, 1), (2, 2), (1, 2), (0, 2), (1, 3)):
        whole.listeners = listeners
        topics.publish(1.0, same, HERE)
        assert len(whole.messages) == sent


def test_footprint_is_the_outline_where_the_robot_is() -> None:
    node, robot = _Node(), RobotBody()
    T = np.eye(4)
    T[:2, :2], T[:3, 3] = [[0.0, -1.0], [1.0, 0.0]], (2.0, 3.0, 0.5)  # turned to the left
    CostmapTopics(node, robot).publish(1.0, view(np.zeros((4, 4))), T)  # type: ignore[arg-type]
    (message,) = node.topics["local_costmap/footprint"].messages
    x, y, z = np.array([[p.x, p.y, p.z] for p in message.polygon.points]).T
    assert message.header.frame_id == "map" and set(z) == {0.5}
    assert np.ptp(x) == pytest.approx(robot.width_m) and np.ptp(y) == pytest.approx(robot.length_m)
    assert (x.mean(), y.mean()) == pytest.approx((2.0, 3.0))


def test_each_recovery_is_told_once_when_it_begins() -> None:
    node, S = _Node(), FollowerState
    topic = RecoveryTopic(node)  # type: ignore[arg-type]
    for state in (S.FOLLOWING, S.WAITING, S.WAITING, S.BACKING_OFF, S.BACKING_OFF, S.BLOCKED, S.BLOCKED, S.FOLLOWING, S.WAITING):
        topic.tell(1.0, FollowerOutput(0.0, 0.0, state, "in the test"), HERE)
    told = node.topics["move_base/recovery_status"].messages
    assert [m.recovery_behavior_name for m in told] == ["waiting", "backing_off", "blocked", "waiting"]
    assert [list(Recovery)[m.current_recovery_number].value for m in told] == ["waiting", "backing_off", "blocked", "waiting"]
    assert {m.total_number_of_recoveries for m in told} == {len(Recovery)}


def test_what_is_no_state_of_the_follower_is_told_too_but_by_a_robot_that_knows_its_place() -> None:
    node = _Node()
    topic = RecoveryTopic(node)  # type: ignore[arg-type]
    for recovery, here in ((Recovery.LOCALISING, HERE), (Recovery.CLEARING, HERE), (Recovery.NEXT_GOAL, None)):
        topic.tell_of(recovery, 1.0, here)
    told = node.topics["move_base/recovery_status"].messages
    assert [m.recovery_behavior_name for m in told] == ["localising", "clearing"]


def test_what_has_a_second_name_goes_out_under_both_and_counts_once(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[str] = []

    def begin(self: rospy.Publisher, name: str, _type: type, **_more: object) -> None:
        self.name = name

    monkeypatch.setattr(rospy.Publisher, "__init__", begin)
    monkeypatch.setattr(rospy.Publisher, "publish", lambda self, *_: sent.append(self.name))
    monkeypatch.setattr(rospy.Publisher, "get_num_connections", lambda self: 1)
    ours = "local_costmap/costmap"
    publisher, other = CountingPublisher(ours, object), CountingPublisher("/odom", object)
    for each in (publisher, other):
        each.publish("message")
    assert sent == [ours, ALIASES[ours], "/odom"]
    assert (publisher.sent, publisher.get_num_connections(), other.get_num_connections()) == (1, 2, 1)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (
            "service [/a/plan_path] responded with an error: b'error processing request: no sweep is in the map yet'",
            "no sweep is in the map yet",
        ),
        ("service [/a] responded with an error: b'error processing request: no sweep yet'", "no sweep yet"),
        ("service [/a] responded with an error: b'service cannot process request: in \\'odom\\': \"no\"'", "in 'odom': \"no\""),
        ("service [/a] unavailable", "service [/a] unavailable"),
    ],
)
def test_reason_of_a_service_comes_without_rospys_words(text: str, reason: str) -> None:
    assert reason_of(rospy.ServiceException(text)) == reason
