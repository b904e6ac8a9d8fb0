"""Messages to arrays and back, without a master: round trips, and what is refused."""

import math
from typing import TypeVar

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Point, Pose, Quaternion, Transform
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState, LaserScan, PointCloud2, PointField

from rigid_geometry import transform_from_rpy, yaw_of
from ros_adapters import conversions as c

T = transform_from_rpy((1.0, -2.0, 0.5), (0.1, -0.2, 2.0))
RNG_SEED = 7


def cloud(count: int = 100, frame: str = "base_link") -> tuple[PointCloud2, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(RNG_SEED)
    points, origins = rng.normal(size=(2, count, 3)).astype(np.float32)
    return c.cloud_message(12.5, frame, points, origins), points, origins


M = TypeVar("M")


def through_the_wire(message: M) -> M:
    from io import BytesIO

    buffer = BytesIO()
    message.serialize(buffer)
    received = type(message)()
    received.deserialize(buffer.getvalue())
    return received


@pytest.mark.parametrize("stamp_s", [0.05 * k for k in (20, 21, 23, 999, 12345)] + [1795257689.416312, 0.1 + 0.2, 1.9999999])
def test_stamps_are_rounded_to_microseconds_and_not_cut(stamp_s: float) -> None:
    assert c.ros_time(stamp_s).to_sec() == pytest.approx(stamp_s, abs=5.1e-7)
    assert c.ros_time(stamp_s).nsecs % 1000 == 0


def test_equal_times_of_different_arithmetic_get_equal_stamps() -> None:
    assert c.ros_time(0.1 + 0.2) == c.ros_time(0.3) == rospy.Time(0, 300_000_000)
    assert c.ros_time(23 * 0.05) == c.ros_time(1.15)
    assert c.ros_time(1.9999999) == rospy.Time(2, 0)


def test_cloud_comes_back_bit_for_bit() -> None:
    message, points, origins = cloud()
    got_points, got_origins = c.cloud_arrays(through_the_wire(message), "base_link")
    np.testing.assert_array_equal(got_points, points)
    np.testing.assert_array_equal(got_origins, origins)
    assert (message.header.frame_id, c.stamp_of(message), message.width, message.height) == ("base_link", 12.5, 100, 1)


def test_cloud_with_other_fields_between_is_read_by_name() -> None:
    names = ("intensity", "vp_z", "x", "y", "ring", "z", "vp_x", "vp_y")
    table = np.arange(24, dtype=np.float32).reshape(3, 8)
    message = PointCloud2(height=1, width=3, point_step=32, row_step=96, data=table.tobytes())
    message.fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate(names)]
    points, origins = c.cloud_arrays(message)
    np.testing.assert_array_equal(points, table[:, [2, 3, 5]])
    np.testing.assert_array_equal(origins, table[:, [6, 7, 1]])


def test_points_that_are_not_finite_are_left_out() -> None:
    _, points, origins = cloud()
    points[3, 1], origins[5, 0] = np.nan, np.inf
    kept, starts = c.cloud_arrays(c.cloud_message(1.0, "base_link", points, origins))
    assert kept.shape == starts.shape == (98, 3)
    assert np.isfinite(kept).all()


def broken(what: str) -> PointCloud2:
    message, points, origins = cloud()
    if what == "empty":
        return c.cloud_message(1.0, "base_link", points[:0], origins[:0])
    if what == "nan":
        return c.cloud_message(1.0, "base_link", np.full_like(points, np.nan), origins)
    if what == "cut":
        message.data = message.data[:-1]
    elif what == "no origins":
        message.fields = message.fields[:3]
    elif what == "whole numbers":
        message.fields[0].datatype = PointField.INT32
    elif what == "step":
        message.point_step = 8
    elif what == "frame":
        message.header.frame_id = "laser"
    return message


@pytest.mark.parametrize("what", ["empty", "nan", "cut", "no origins", "whole numbers", "step", "frame"])
def test_cloud_that_cannot_be_read_is_refused(what: str) -> None:
    with pytest.raises(ValueError, match="cloud"):
        c.cloud_arrays(broken(what), "base_link")


def test_frame_s_name_may_begin_with_a_slash() -> None:
    message, points, _ = cloud()
    message.header.frame_id = "/base_link"
    assert len(c.cloud_arrays(message, "base_link")[0]) == len(points)


def test_no_free_beams_are_empty_arrays() -> None:
    assert [a.shape for a in c.free_arrays(PointCloud2())] == [(0, 3), (0, 3)]


def test_joint_without_a_position_is_refused_and_others_are_passed_by() -> None:
    message = JointState(name=["wheel", "tilt_joint"], position=[1.0, 0.5])
    assert c.joint_position(message, "tilt_joint") == 0.5 and c.joint_position(message, "arm") is None
    message.position = [1.0]
    with pytest.raises(ValueError, match="nan as position of tilt_joint"):
        c.joint_position(JointState(name=["tilt_joint"], position=[math.nan]), "tilt_joint")
    with pytest.raises(ValueError, match="2 joints with 1 positions: none of tilt_joint"):
        c.joint_position(message, "tilt_joint")


def test_pose_and_transform_come_back() -> None:
    np.testing.assert_allclose(c.transform_from_pose(c.pose_message(T)), T, atol=1e-12)
    np.testing.assert_allclose(c.transform_from_message(c.transform_message(T)), T, atol=1e-12)
    stamped = c.transform_stamped(3.0, "map", "odom", T)
    assert (stamped.header.frame_id, stamped.child_frame_id, c.stamp_of(stamped)) == ("map", "odom", 3.0)


@pytest.mark.parametrize(
    "pose", [Pose(), Pose(Point(math.nan, 0, 0), Quaternion(0, 0, 0, 1)), Pose(Point(), Quaternion(0, 0, 0, math.inf))]
)
def test_pose_that_is_none_is_refused(pose: Pose) -> None:
    with pytest.raises(ValueError):
        c.transform_from_pose(pose)
    with pytest.raises(ValueError):
        c.transform_from_message(Transform())


def test_path_looks_along_itself_and_ends_with_the_goal_s_heading() -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 3.0, 0.2]])
    path = c.path_message(4.0, "map", points, goal_yaw=-1.0)
    np.testing.assert_allclose(c.path_points(path), points)
    yaws = [yaw_of(c.transform_from_pose(p.pose)) for p in path.poses]
    np.testing.assert_allclose(yaws, [math.pi / 4, math.pi / 2, -1.0], atol=1e-9)


def test_path_without_poses_is_an_empty_array() -> None:
    assert c.path_points(c.path_message(4.0, "map", np.zeros((0, 3)), 0.0)).shape == (0, 3)


def test_path_that_is_not_finite_is_refused() -> None:
    path = c.path_message(4.0, "map", np.zeros((2, 3)), 0.0)
    path.poses[0].pose.position.y = math.nan
    with pytest.raises(ValueError, match="not finite"):
        c.path_points(path)


def scan(ranges: list[float]) -> LaserScan:
    return LaserScan(
        angle_min=-math.pi / 2, angle_max=math.pi / 2, angle_increment=math.pi / 2, time_increment=1e-5, range_max=10.0, ranges=ranges
    )


def test_scan_points_are_hits_and_ends_of_free_beams() -> None:
    hits, free = c.scan_points(scan([2.0, math.inf, math.nan]))
    np.testing.assert_allclose(hits, [[0.0, -2.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(free, [[10.0, 0.0, 0.0]], atol=1e-12)


def test_scan_comes_back_with_its_layout_and_limits() -> None:
    before = c.scan_of(through_the_wire(scan([1.0, math.nan, 3.0])))
    after = c.scan_of(through_the_wire(c.scan_message(1.5, "laser", before)))
    assert (after.geometry, after.range_max_m, after.range_min_m, after.period_s) == (before.geometry, 10.0, 0.0, before.period_s)
    np.testing.assert_array_equal(after.ranges, np.float32([1.0, math.nan, 3.0]))


@pytest.mark.parametrize("ranges", [[], [1.0]])
def test_scan_without_a_layout_is_refused(ranges: list[float]) -> None:
    with pytest.raises(ValueError, match="beams"):
        c.scan_of(scan(ranges))


def test_covariance_changes_its_order_and_comes_back() -> None:
    covariance = np.arange(36.0).reshape(6, 6)
    swapped = c.covariance_ros_order(covariance)
    assert swapped[0, 0] == covariance[3, 3] and swapped[3, 0] == covariance[0, 3]
    np.testing.assert_array_equal(c.covariance_ros_order(swapped), covariance)


def test_gravity_is_the_odometry_s_up_with_the_sigma_of_roll_and_pitch() -> None:
    message = Odometry()
    message.pose.pose = c.pose_message(transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.1, 1.0)))
    message.pose.covariance = np.diag([1.0, 1.0, 1.0, 4e-4, 1e-4, 1.0]).ravel().tolist()
    up, sigma = c.odometry_gravity(message)
    np.testing.assert_allclose(up, [-math.sin(0.1), 0.0, math.cos(0.1)], atol=1e-12)
    assert sigma == pytest.approx(0.02)


def test_odometry_without_a_covariance_knows_no_gravity() -> None:
    message = Odometry()
    message.pose.pose.orientation.w = 1.0
    with pytest.raises(ValueError, match="covariance"):
        c.odometry_gravity(message)


@pytest.mark.parametrize("stamp_s", [-0.1, 2.0**32, float("nan"), float("inf")])
def test_time_that_no_message_can_hold_is_told(stamp_s):
    with pytest.raises(ValueError, match="no ROS time"):
        c.ros_time(stamp_s)


def test_message_from_the_end_of_time_is_refused():
    message = LaserScan()
    message.header.stamp = rospy.Time(4294967295, 0)
    with pytest.raises(ValueError, match="end of time"):
        c.stamp_of(message)


def test_joint_without_a_position_is_told():
    message = JointState(name=["wheel", "tilt"], position=[1.0, 2.0])
    assert c.joint_position(message, "tilt") == 2.0
    message.position = [1.0]
    with pytest.raises(ValueError, match="2 joints with 1 positions"):
        c.joint_position(message, "tilt")


@pytest.mark.parametrize("far_m, right", [(1.0e7, True), (1.0e30, False)])
def test_pose_that_is_no_place_on_the_earth_is_refused(far_m, right):
    pose = Pose(Point(0.0, far_m, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
    if right:
        assert c.transform_from_pose(pose)[1, 3] == far_m
    else:
        with pytest.raises(ValueError, match="no place on the Earth"):
            c.transform_from_pose(pose)


def test_planar_pose_is_place_and_yaw_also_of_a_pose_that_was_never_filled() -> None:
    message = Odometry()
    assert c.planar_pose(message) == (0.0, 0.0, 0.0)
    message.pose.pose = c.pose_message(T)
    assert c.planar_pose(message) == pytest.approx((1.0, -2.0, 2.0))
