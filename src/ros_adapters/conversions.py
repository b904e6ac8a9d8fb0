"""Messages to arrays and back: whole buffers at once, checked before they are believed."""

import functools
import math
from typing import TypeVar

import numpy as np
import rospy
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, Transform, TransformStamped, Vector3
from nav_msgs.msg import Odometry, Path
from numpy.typing import NDArray
from sensor_msgs.msg import JointState, LaserScan, PointCloud2, PointField
from std_msgs.msg import Header

from point_cloud2 import PointTable, read_points
from rigid_geometry import FARTHEST_M, quat_xyzw_from_transform, transform_from_quat, transform_from_rpy
from sweep_assembly import Scan, ScanGeometry

M = TypeVar("M")

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

CLOUD_FIELDS = ("x", "y", "z", "vp_x", "vp_y", "vp_z")
NORMAL_FIELDS = ("normal_x", "normal_y", "normal_z")
UNTURNED = Quaternion(0.0, 0.0, 0.0, 1.0)

_END_OF_TIME_S = 2.0**32 - 1.0  # seconds are 32 bits
_LAST_STAMP_S = _END_OF_TIME_S - 3600.0  # no driver means a later one, and what is reckoned from it can still be sent


def ros_time(stamp_s: float) -> rospy.Time:
    """A stamp rounded to whole microseconds: `from_sec` truncates, and then equal times of different arithmetic differ.

    ValueError for what a ROS message cannot hold.
    """
    if not 0.0 <= stamp_s < _END_OF_TIME_S:
        raise ValueError(f"{stamp_s} s is no ROS time: it lies between 0 and {_END_OF_TIME_S:.0f} s")
    seconds, microseconds = divmod(round(stamp_s * 1e6), 1_000_000)
    return rospy.Time(seconds, microseconds * 1000)


def header(stamp_s: float, frame: str) -> Header:
    return Header(stamp=ros_time(stamp_s), frame_id=frame)


def plain(message: M, kind: type[M]) -> M:
    """The same as a message that can be kept: what rospy gives with arrays of numbers is of a class of its own."""
    return kind(*(getattr(message, name) for name in kind.__slots__))  # type: ignore[attr-defined]


def stamp_of(message: object) -> float:
    """Seconds of a message's header stamp; ValueError at the end of time."""
    stamp_s = float(message.header.stamp.to_sec())  # type: ignore[attr-defined]
    if stamp_s > _LAST_STAMP_S:
        raise ValueError(f"a message stamped {stamp_s:.0f} s, the end of time: see its driver's clock")
    return stamp_s


def cloud_message(
    stamp_s: float,
    frame: str,
    points: NDArray[np.floating],
    origins: NDArray[np.floating],
    normals: NDArray[np.floating] | None = None,
) -> PointCloud2:
    """(N, 3) points, where their beams started and, if known, their normals: fields x y z vp_x vp_y vp_z (normal_x normal_y normal_z)."""
    columns = [points, origins] if normals is None else [points, origins, normals]
    names = CLOUD_FIELDS if normals is None else CLOUD_FIELDS + NORMAL_FIELDS
    data = np.hstack(columns).astype(np.float32, copy=False)
    fields = [PointField(name, 4 * i, PointField.FLOAT32, 1) for i, name in enumerate(names)]
    count, point_bytes = len(data), 4 * len(names)
    return PointCloud2(
        header=header(stamp_s, frame),
        height=1,
        width=count,
        fields=fields,
        is_bigendian=False,
        point_step=point_bytes,
        row_step=point_bytes * count,
        data=data.tobytes(),
        is_dense=True,
    )


def free_arrays(message: PointCloud2) -> tuple[Singles, Singles]:
    """Ends and origins of beams that met nothing; (0, 3) arrays when there are none."""
    if message.width * message.height == 0:
        return np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32)
    return cloud_arrays(message)


def cloud_arrays(message: PointCloud2, expected_frame: str | None = None) -> tuple[Singles, Singles]:
    """(N, 3) points and (N, 3) beam origins of a cloud; ValueError for another frame, other fields, no points, or a cut buffer.

    Points that are not finite are left out, as PCL does for clouds that are not dense.
    """
    if expected_frame is not None and message.header.frame_id.lstrip("/") != expected_frame:
        raise ValueError(f"cloud in frame {message.header.frame_id!r}, expected {expected_frame!r}")
    table, origins = _hits(message)
    return singles(table.points), singles(origins)


def cloud_arrays_with_normals(message: PointCloud2) -> tuple[Singles, Singles, Singles | None]:
    """`cloud_arrays`, and (N, 3) normals where the cloud has them; points whose normal is not finite are left out."""
    table, origins = _hits(message)
    if table.normals is None:
        return singles(table.points), singles(origins), None
    known = np.isfinite(table.normals).all(axis=1)
    return singles(table.points[known]), singles(origins[known]), singles(table.normals[known])


def _hits(message: PointCloud2) -> tuple[PointTable, NDArray[np.floating]]:
    table = read_points(message)
    if table.origins is None:
        raise ValueError("cloud without float fields vp_x, vp_y, vp_z, where its beams started")
    if not len(table.points):
        what = "none of which is finite" if message.height * message.width else "a cloud without points"
        raise ValueError(f"cloud of {message.height} x {message.width} points, {what}")
    return table, table.origins


def singles(vectors: NDArray[np.floating]) -> Singles:
    """Rows of numbers as they are sent."""
    return np.ascontiguousarray(vectors, np.float32)


def scan_of(message: LaserScan) -> Scan:
    """The scan with its layout and limits; ValueError when they are none."""
    geometry = ScanGeometry(message.angle_min, message.angle_increment, message.time_increment, len(message.ranges))
    return Scan(geometry, np.asarray(message.ranges, np.float32), message.range_min, message.range_max, message.scan_time)


def scan_message(stamp_s: float, frame: str, scan: Scan) -> LaserScan:
    """The message of a scan: `scan_of` gives it back."""
    geometry = scan.geometry
    return LaserScan(
        header=header(stamp_s, frame),
        angle_min=geometry.angle_min,
        angle_max=geometry.angle_min + (geometry.count - 1) * geometry.angle_increment,
        angle_increment=geometry.angle_increment,
        time_increment=geometry.time_increment,
        scan_time=scan.period_s,
        range_min=scan.range_min_m,
        range_max=scan.range_max_m,
        ranges=scan.ranges.tolist(),
    )


def joint_position(message: JointState, joint: str) -> float | None:
    """A joint's position; None where the message is of other joints. ValueError when it is named without a finite position."""
    if joint not in message.name:
        return None
    index = message.name.index(joint)
    if index >= len(message.position):
        raise ValueError(f"joint states of {len(message.name)} joints with {len(message.position)} positions: none of {joint}")
    if not math.isfinite(message.position[index]):
        raise ValueError(f"joint state with {message.position[index]} as position of {joint}")
    return float(message.position[index])


def sender_of(message: object) -> str:
    """The node that sent a message that was received; "somebody" where it is not told."""
    return str((getattr(message, "_connection_header", None) or {}).get("callerid", "somebody"))


def transform_from_pose(pose: Pose) -> Floats:
    """(4, 4) transform of a pose; ValueError when it is not finite, off the Earth, or its quaternion is no rotation."""
    p, q = pose.position, pose.orientation
    values = (p.x, p.y, p.z, q.x, q.y, q.z, q.w)
    if not all(map(math.isfinite, values)):
        raise ValueError(f"pose with numbers that are not finite: {values}")
    if max(abs(p.x), abs(p.y), abs(p.z)) > FARTHEST_M:
        raise ValueError(f"a pose at {p.x:g} {p.y:g} {p.z:g} m: farther than {FARTHEST_M:g} m is no place on the Earth")
    return transform_from_quat((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def pose_message(T: Floats) -> Pose:
    return Pose(Point(*T[:3, 3]), Quaternion(*quat_xyzw_from_transform(T)))


def transform_message(T: Floats) -> Transform:
    return Transform(Vector3(*T[:3, 3]), Quaternion(*quat_xyzw_from_transform(T)))


def transform_from_message(message: Transform) -> Floats:
    return transform_from_pose(Pose(Point(message.translation.x, message.translation.y, message.translation.z), message.rotation))


def transform_stamped(stamp_s: float, parent: str, child: str, T_parent_child: Floats) -> TransformStamped:
    return TransformStamped(header(stamp_s, parent), child, transform_message(T_parent_child))


def path_message(stamp_s: float, frame: str, points: Floats, goal_yaw: float) -> Path:
    """(K, 3) points as a path whose poses look along it and whose last pose has the goal's heading."""
    path = Path(header=header(stamp_s, frame))
    for i, point in enumerate(points):
        step = points[i + 1] - point if i + 1 < len(points) else None
        yaw = goal_yaw if step is None else math.atan2(step[1], step[0])
        path.poses.append(PoseStamped(path.header, pose_message(transform_from_rpy(point, (0.0, 0.0, yaw)))))
    return path


def path_points(message: Path) -> Floats:
    """(K, 3) positions of a path; ValueError when one is not finite."""
    points = np.array([[p.pose.position.x, p.pose.position.y, p.pose.position.z] for p in message.poses], dtype=np.float64).reshape(-1, 3)
    if not np.isfinite(points).all():
        raise ValueError("path with positions that are not finite")
    return points


def scan_points(message: LaserScan) -> tuple[Floats, Floats]:
    """(N, 3) hits and (M, 3) ends at range_max of the beams that met nothing (+inf), in the scan's frame; NaN beams are in neither."""
    ranges = np.asarray(message.ranges, dtype=np.float64)
    directions = _beam_directions(message.angle_min, message.angle_increment, len(ranges))
    hit, nothing = np.isfinite(ranges), np.isposinf(ranges)
    return directions[hit] * ranges[hit, None], directions[nothing] * message.range_max


@functools.lru_cache(maxsize=4)
def _beam_directions(angle_min: float, angle_increment: float, beams: int) -> Floats:
    angles = angle_min + angle_increment * np.arange(beams)
    return np.stack([np.cos(angles), np.sin(angles), np.zeros(beams)], axis=1)


def covariance_ros_order(covariance: Floats) -> Floats:
    """6x6 covariance with rotation first (gtsam) to translation first (ROS), or back."""
    swap = [3, 4, 5, 0, 1, 2]
    return covariance[np.ix_(swap, swap)]


def position_variances(message: Odometry) -> tuple[float, float]:
    """Of an odometry's pose, x and y in m^2."""
    return float(message.pose.covariance[0]), float(message.pose.covariance[7])


def level_sigma_m(message: Odometry) -> float:
    """Of an odometry's position, along the level axis that is known least."""
    return math.sqrt(max(position_variances(message)))


def odometry_twist(message: Odometry) -> tuple[float, float]:
    return message.twist.twist.linear.x, message.twist.twist.angular.z


def planar_pose(message: Odometry) -> tuple[float, float, float]:
    """x and y in metres and yaw in radians of an odometry's pose as it stands there; yaw is 0 for a quaternion of zeros."""
    at, q = message.pose.pose.position, message.pose.pose.orientation
    return at.x, at.y, math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))


def odometry_gravity(message: Odometry) -> tuple[Floats, float]:
    """Up in base_link, (3,), and its sigma in radians, as the odometry's roll and pitch know it from gravity."""
    T_odom_base = transform_from_pose(message.pose.pose)
    covariance = np.array(message.pose.covariance).reshape(6, 6)
    sigma = math.sqrt(max(covariance[3, 3], covariance[4, 4]))
    if not sigma > 0.0:
        raise ValueError(f"odometry without a covariance of roll and pitch: {covariance[3, 3]}, {covariance[4, 4]}")
    return T_odom_base[2, :3].copy(), sigma
