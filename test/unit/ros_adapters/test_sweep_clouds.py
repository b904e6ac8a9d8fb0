"""Stamps of clouds of which nothing else is read, and what a whole sweep has to be."""

import io
import math
from typing import Any

import pytest
import rospy
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header

from ros_adapters.sweep_clouds import SweepClouds


@pytest.fixture
def heard(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Callbacks by topic."""
    callbacks: dict[str, Any] = {}
    monkeypatch.setattr(rospy, "Subscriber", lambda topic, _type, callback, **_: callbacks.update({topic: callback}))
    return callbacks


def test_stamp_of_the_newest_cloud_is_known_once_one_has_come(heard: dict[str, Any]) -> None:
    clouds = SweepClouds(listens=True, is_first=True)
    assert clouds.newest_s == -math.inf
    buffer, message = io.BytesIO(), rospy.AnyMsg()
    PointCloud2(header=Header(seq=7, stamp=rospy.Time(1_700_000_000, 250_000_000), frame_id="base_link"), data=b"123").serialize(buffer)
    message.deserialize(buffer.getvalue())
    heard["sweep_cloud"](message)
    assert clouds.newest_s == 1_700_000_000.25


def test_process_after_one_that_died_does_not_know_whether_one_came(heard: dict[str, Any]) -> None:
    assert SweepClouds(listens=True, is_first=False).newest_s is None and "sweep_cloud" in heard


def test_in_lock_step_nobody_listens(heard: dict[str, Any]) -> None:
    assert SweepClouds(listens=False, is_first=True).newest_s is None and not heard


@pytest.mark.parametrize(("windows", "expected"), [(None, None), ("rest", None), ("turning_points", 1.1)])
def test_tilt_is_asked_for_where_the_mount_nods(
    heard: dict[str, Any], monkeypatch: pytest.MonkeyPatch, windows: str | None, expected: float | None
) -> None:
    values = {"sweep_assembler_node/windows": windows, "sweep_assembler_node/whole_sweep_rad": 1.1}
    monkeypatch.setattr(rospy, "get_param", lambda name, default: default if values[name] is None else values[name])
    assert SweepClouds(listens=True, is_first=True).whole_sweep_rad == expected
