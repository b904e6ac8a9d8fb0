"""Transforms that tf's C++ would print about, or end the process for, are refused before they get there."""

import math

import pytest
import rospy
from geometry_msgs.msg import TransformStamped

from ros_adapters.tf_lookup import KnownTransforms


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
