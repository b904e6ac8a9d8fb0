"""Transforms that tf's C++ would print about, or end the process for, are refused before they get there."""

import math
from types import SimpleNamespace

import pytest
import rospy
from geometry_msgs.msg import TransformStamped
from tf2_msgs.msg import TFMessage

from ros_adapters.tf_lookup import KnownTransforms, TransformInput


def transform(stamp=None, z=0.0, w=1.0):
    message = TransformStamped()
    message.header.stamp, message.header.frame_id, message.child_frame_id = stamp or rospy.Time(100), "odom", "base_link"
    message.transform.translation.z, message.transform.rotation.w = z, w
    return message


@pytest.mark.parametrize(
    "wrong", [transform(z=math.nan), transform(w=0.0), transform(w=math.inf), transform(rospy.Time(4294967295, 999999999))]
)
@pytest.mark.parametrize("static", [False, True])
def test_wrong_transform_is_refused(wrong, static):
    with pytest.raises(ValueError):
        KnownTransforms().keep(wrong, static=static)


def test_right_transform_is_kept():
    known = KnownTransforms()
    assert known.keep(transform(z=0.5), static=False)[2, 3] == 0.5
    assert height_in(known, "odom", "base_link") == 0.5


def height_in(known: KnownTransforms, parent: str, child: str) -> float:
    """By the newest transforms."""
    return float(known.buffer.lookup_transform_core(parent, child, rospy.Time(0)).transform.translation.z)


def test_clock_that_was_set_back_leaves_no_pose_from_before():
    known, laser = KnownTransforms(), transform(z=0.25)
    laser.header.frame_id, laser.child_frame_id = "base_link", "laser"
    known.keep(laser, static=True)
    known.keep(transform(rospy.Time(1000), z=5.0), static=False)
    known.keep(transform(rospy.Time(999, 900000000), z=4.0), static=False)
    assert height_in(known, "odom", "laser") == 5.25, "late is not set back"
    known.keep(transform(rospy.Time(400), z=1.0), static=False)
    assert height_in(known, "odom", "laser") == 1.25


class Listening:
    """In the place of a node: it is told of what was dropped."""

    def __init__(self) -> None:
        self.dropped: list[str] = []
        self.diagnostics = SimpleNamespace(dropped=lambda what, _: self.dropped.append(what))

    def watch(self, *_: object) -> None: ...
    def received(self, *_: object) -> None: ...
    def subscribe(self, *_: object, **__: object) -> None: ...


def correction(sender, stamp_s, z):
    one = transform(rospy.Time(stamp_s), z=z)
    one.header.frame_id, one.child_frame_id = "map", "odom"
    message = TFMessage([one])
    message._connection_header = {"callerid": sender}
    return message


def test_only_the_mapping_node_says_where_odom_is_in_map(monkeypatch):
    monkeypatch.setattr(rospy, "resolve_name", lambda name: f"/robot/{name}")
    node = Listening()
    heard = TransformInput(node, 10.0)
    heard._on_transforms(correction("/robot/pose_graph_mapping_node", 100, 1.0))
    heard._on_transforms(correction("/robot/amcl", 101, 5.0))
    heard._on_transforms(correction("/pose_graph_mapping_node", 102, 6.0))
    assert heard.T_map_odom(103.0)[2, 3] == 1.0
    assert node.dropped == ["/tf map->odom of /robot/amcl", "/tf map->odom of /pose_graph_mapping_node"]
    heard._on_transforms(correction("/robot/pose_graph_mapping_node", 103, 2.0))
    assert heard.T_map_odom(103.0)[2, 3] == 2.0


def test_other_transforms_of_whoever_sends_them_are_kept():
    heard = TransformInput(Listening(), 10.0)
    message = correction("/robot_state_publisher", 100, 0.25)
    message.transforms[0].header.frame_id, message.transforms[0].child_frame_id = "base_link", "laser"
    heard._on_transforms(message)
    assert height_in(heard._known, "base_link", "laser") == 0.25 and heard.T_map_odom(100.0) is None
