"""./check_robot's look at a robot, without a master: what it makes of the messages that come."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import rospy
from sensor_msgs.msg import PointCloud2

from robot_body import RobotBody, urdf_file
from ros_adapters import robot_check
from ros_adapters.conversions import header
from ros_adapters.revolution_messages import revolution_message
from ros_adapters.robot_check import RobotCheck
from sensor_checks import CheckLimits, ImuLimits
from sweep_assembly import LidarConfig


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> dict[str, Callable[[Any], None]]:
    """The callbacks by topic."""
    callbacks: dict[str, Callable[[Any], None]] = {}

    class Subscriber:
        def __init__(self, topic: str, _type: type, callback: Callable[[Any], None], **_: object) -> None:
            callbacks[topic] = callback

    monkeypatch.setattr(rospy, "Subscriber", Subscriber)
    monkeypatch.setattr(rospy, "resolve_name", lambda name: f"/{name}")
    monkeypatch.setattr(rospy, "get_time", lambda: 0.0)
    monkeypatch.setattr(robot_check, "TransformWatch", lambda _: None)
    return callbacks


def look() -> RobotCheck:
    robot = RobotBody()
    return RobotCheck(
        robot, urdf_file(robot).read_text(encoding="utf-8"), "spinning", "driving", (CheckLimits(), ImuLimits()), LidarConfig()
    )


@pytest.mark.parametrize("frame", ["velodyne", "/velodyne"])
def test_cloud_of_any_frame_is_looked_at(heard: dict[str, Callable[[Any], None]], frame: str) -> None:
    """Whether it is the right one is told by a row of its own."""
    points = look()._points
    cloud: PointCloud2 = revolution_message(1.0, "laser", np.ones((3, 3)), np.arange(3), np.zeros(3))
    cloud.header = header(1.0, frame)
    heard["points"](cloud)
    assert points is not None and points.faults == {} and len(points.contents) == 1 and points.frames == {frame}
