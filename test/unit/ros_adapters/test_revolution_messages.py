"""A spinning lidar's clouds, as the simulator and as a Velodyne's driver send them, and the level scan."""

import math

import numpy as np
import pytest
from sensor_msgs.msg import PointCloud2, PointField

from ros_adapters.conversions import scan_points
from ros_adapters.revolution_messages import level_scan_message, revolution_message, revolution_of, sensor_is_spinning
from sweep_assembly import LEVEL_BEAMS, LidarConfig

POINTS = np.array([[1.0, 2.0, 3.0], [np.nan, np.nan, np.nan], [-4.0, 0.5, -0.25]], np.float32)
RINGS = np.array([0, 7, 15], np.uint16)
TIMES = np.array([0.0, 0.05, 0.0999], np.float32)


def driver_s(count: int = 4, names: tuple[str, ...] = ("x", "y", "z", "intensity", "ring", "time")) -> PointCloud2:
    """What velodyne_pointcloud publishes: 22 bytes a point, ring a uint16 between floats."""
    offsets = dict(zip(("x", "y", "z", "intensity", "ring", "time"), (0, 4, 8, 12, 16, 18), strict=True))
    kinds = {name: PointField.UINT16 if name == "ring" else PointField.FLOAT32 for name in offsets}
    layout = np.dtype({"names": list(offsets), "formats": ["<f4"] * 4 + ["<u2", "<f4"], "offsets": list(offsets.values()), "itemsize": 22})
    table = np.zeros(count, layout)
    table["x"], table["ring"], table["time"] = np.arange(count) + 1.0, np.arange(count), np.arange(count) * 0.01
    message = PointCloud2(height=1, width=count, point_step=22, row_step=22 * count, data=table.tobytes())
    message.header.frame_id = "laser"
    message.fields = [PointField(name, offsets[name], kinds[name], 1) for name in names]
    return message


def test_cloud_has_the_fields_of_a_velodyne_s_driver() -> None:
    message = revolution_message(3.25, "laser", POINTS, RINGS, TIMES)
    kinds = {f.name: f.datatype for f in message.fields}
    assert kinds == {**dict.fromkeys(("x", "y", "z", "time"), PointField.FLOAT32), "ring": PointField.UINT16}
    assert (message.header.frame_id, message.header.stamp.to_sec()) == ("laser", 3.25)
    assert message.width == 3 and len(message.data) == 3 * message.point_step and not message.is_dense


def test_revolution_comes_back_as_it_was() -> None:
    back = revolution_of(revolution_message(3.25, "laser", POINTS, RINGS, TIMES), "laser")
    np.testing.assert_array_equal(back.points, POINTS)
    np.testing.assert_array_equal(back.rings, RINGS)
    np.testing.assert_array_equal(back.times_s, TIMES.astype(float))
    assert back.met_nothing.tolist() == [False, True, False]


def test_driver_s_cloud_with_more_fields_is_read() -> None:
    back = revolution_of(driver_s(), "laser")
    assert back.points[:, 0].tolist() == [1.0, 2.0, 3.0, 4.0] and back.rings.tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(back.times_s, [0.0, 0.01, 0.02, 0.03], atol=1e-8)


def test_cloud_without_points_is_a_revolution_without_beams() -> None:
    assert len(revolution_of(driver_s(0), "laser").points) == 0


def test_point_that_is_half_a_number_counts_as_none() -> None:
    half = POINTS.copy()
    half[2, 1] = np.inf
    assert revolution_of(revolution_message(1.0, "laser", half, RINGS, TIMES), "laser").met_nothing.tolist() == [False, True, True]


def test_clouds_that_are_none_of_a_lidar_are_refused() -> None:
    with pytest.raises(ValueError, match="without fields ring or line or channel, time or t or"):
        revolution_of(driver_s(names=("x", "y", "z", "intensity")), "laser")
    cut = driver_s()
    cut.data = cut.data[:-1]
    with pytest.raises(ValueError, match="cannot be read"):
        revolution_of(cut, "laser")
    foreign = driver_s()
    foreign.header.frame_id = "velodyne"
    with pytest.raises(ValueError, match="frame 'velodyne', expected 'laser'"):
        revolution_of(foreign, "laser")


def test_level_scan_belongs_to_the_time_at_which_the_revolution_ended() -> None:
    message = level_scan_message(7.1, "laser", np.full(LEVEL_BEAMS, 2.0, np.float32), LidarConfig(), 2.5)
    assert message.header.stamp.to_sec() + message.time_increment * LEVEL_BEAMS == pytest.approx(7.1)
    assert message.angle_min + (LEVEL_BEAMS - 1) * message.angle_increment == pytest.approx(message.angle_max)


def test_level_scan_is_read_as_a_laser_s() -> None:
    ranges = np.full(LEVEL_BEAMS, np.nan, np.float32)
    ranges[LEVEL_BEAMS // 4], ranges[0] = 2.0, np.inf  # to the right, and behind
    hits, free = scan_points(level_scan_message(7.1, "laser", ranges, LidarConfig(), 2.5))
    np.testing.assert_allclose(hits, [[2.0 * math.sin(math.pi / LEVEL_BEAMS), -2.0, 0.0]], atol=0.02)
    np.testing.assert_allclose(free, [[-2.5, 0.0, 0.0]], atol=0.02)


@pytest.mark.parametrize(("value", "spinning"), [("tilting", False), ("spinning", True)])
def test_sensor_is_what_the_parameter_says(monkeypatch: pytest.MonkeyPatch, value: str, spinning: bool) -> None:
    monkeypatch.setattr("rospy.get_param", lambda name, default: {"sensor": value}.get(name, default))
    assert sensor_is_spinning("a_node") is spinning


def test_unknown_sensor_ends_the_node_with_exit_code_two(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("rospy.get_param", lambda name, default: "radar")
    with pytest.raises(SystemExit) as ended:
        sensor_is_spinning("a_node")
    assert ended.value.code == 2
    assert capsys.readouterr().err == "a_node: wrong parameter: /sensor = 'radar' is none of tilting, spinning\n"
