"""Transforms that tf's C++ would print about, or end the process for, are refused before they get there."""

import math

import pytest
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped

from ros_adapters.tf_lookup import keep_transform


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
        keep_transform(tf2_ros.BufferCore(), wrong, static=static)


def test_right_transform_is_kept():
    buffer = tf2_ros.BufferCore()
    assert keep_transform(buffer, transform(z=0.5), static=False)[2, 3] == 0.5
    assert buffer.lookup_transform_core("odom", "base_link", rospy.Time(0)).transform.translation.z == 0.5
