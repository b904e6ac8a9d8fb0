"""Small recordings of a room with a known truth: bags as a robot records them, and folders of point clouds."""

import sys
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from mapping_tools import map_bag
from pose_graph_mapping.session.session_store import tum_text
from rigid_geometry import inverse, quat_xyzw_from_transform, transform_from_rpy

sys.path.append(str(Path(__file__).parents[1] / "pose_graph_mapping"))

from synthetic_sweeps import furnished_room, pose, sweep, world_of

STORE = get_typestore(Stores.ROS1_NOETIC)
TYPES = STORE.types
TRUTH = [pose(-2.5, -1, 0.0), pose(-1.2, -1, 0.2), pose(0.0, -0.6, 0.5), pose(1.0, 0.2, 1.0), pose(1.2, 1.0, 1.6)]
STEP = transform_from_rpy((0.05, -0.04, 0.0), (0, 0, 0.05))
INTERVAL_S = 10.0
SIGMA_RAD = 0.01


def sweeps(truth=None, seed=3):
    """(points, origins) float32 of every pose."""
    rng, scene = np.random.default_rng(seed), world_of(furnished_room())
    return [tuple(a.astype(np.float32) for a in sweep(scene, T, rng)) for T in truth or TRUTH]


def odometry(truth=None):
    """Drifting poses that start at the first true one."""
    truth = truth or TRUTH
    poses = [truth[0]]
    for a, b in zip(truth, truth[1:], strict=False):
        poses.append(poses[-1] @ inverse(a) @ b @ STEP)
    return poses


def header(stamp_s, frame):
    seconds, nanoseconds = divmod(round(stamp_s * 1e9), 1_000_000_000)
    return TYPES["std_msgs/msg/Header"](0, TYPES["builtin_interfaces/msg/Time"](seconds, nanoseconds), frame)


def cloud_message(stamp_s, points, origins=None, frame="base_link", kind="<f4"):
    """A PointCloud2 of x y z, with vp_x vp_y vp_z where origins are given."""
    columns = points if origins is None else np.hstack([points, origins])
    data = np.ascontiguousarray(columns, dtype=kind)
    size, code = data.itemsize, {"<f4": 7, "<f8": 8}[kind]
    names = ("x", "y", "z", "vp_x", "vp_y", "vp_z")[: data.shape[1]]
    fields = [TYPES["sensor_msgs/msg/PointField"](name, k * size, code, 1) for k, name in enumerate(names)]
    step = size * data.shape[1]
    raw = np.frombuffer(data.tobytes(), np.uint8)
    return TYPES["sensor_msgs/msg/PointCloud2"](header(stamp_s, frame), 1, len(data), fields, False, step, step * len(data), raw, True)


def odometry_message(stamp_s, T, sigma=SIGMA_RAD, child="base_link", variance_m2=0.0):
    covariance = np.zeros(36)
    covariance[[21, 28]] = sigma**2
    covariance[[0, 7]] = variance_m2
    vector, quaternion, zero = (TYPES[f"geometry_msgs/msg/{n}"] for n in ("Point", "Quaternion", "Vector3"))
    at = TYPES["geometry_msgs/msg/Pose"](vector(*T[:3, 3]), quaternion(*quat_xyzw_from_transform(T)))
    still = TYPES["geometry_msgs/msg/Twist"](zero(0.0, 0.0, 0.0), zero(0.0, 0.0, 0.0))
    return TYPES["nav_msgs/msg/Odometry"](
        header(stamp_s, "odom"),
        child,
        TYPES["geometry_msgs/msg/PoseWithCovariance"](at, covariance),
        TYPES["geometry_msgs/msg/TwistWithCovariance"](still, np.zeros(36)),
    )


def write_bag(path, messages, compression=None, times_s=None):
    """A bag of (topic, message), written in this order, recorded at the messages' own stamps where no other times are given."""
    writer = Writer(path)
    if compression:
        writer.set_compression(compression)
    with writer:
        connections = {}
        for k, (topic, message) in enumerate(messages):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            stamp = message.header.stamp
            time_ns = stamp.sec * 1_000_000_000 + stamp.nanosec if times_s is None else round(1e9 * times_s[k])
            writer.write(connections[topic], time_ns, STORE.serialize_ros1(message, kind))
    return path


def drive(clouds, poses=None, *, cloud_topic="/sweep_cloud", odom_topic="/odom", **values):
    """Messages of a run: odometry around every sweep; keywords are cloud_message's."""
    poses, messages = poses or odometry(), []
    for k, ((points, origins), T) in enumerate(zip(clouds, poses, strict=True)):
        stamp_s = 5.0 + INTERVAL_S * k
        messages += [(odom_topic, odometry_message(stamp_s - 0.05, T)), (cloud_topic, cloud_message(stamp_s, points, origins, **values))]
        messages.append((odom_topic, odometry_message(stamp_s + 0.05, T)))
    return messages


def lifted(clouds, poses, since):
    """Messages of a run whose robot was carried before a sweep: odometry goes on elsewhere, and says that it knows nothing of the way."""
    carried = [T if k < since else transform_from_rpy((12.0, 5.0, 0.0), (0, 0, 1.0)) @ T for k, T in enumerate(poses)]
    return [
        (topic, odometry_message(stamp_s, T, variance_m2=25.0 * (k >= since))) if topic == "/odom" else (topic, message)
        for k, T in enumerate(carried)
        for (topic, message), stamp_s in zip(drive(clouds, carried)[3 * k : 3 * k + 3], _stamps_s(k), strict=True)
    ]


def _stamps_s(k):
    return [5.0 + INTERVAL_S * k + off_s for off_s in (-0.05, 0.0, 0.05)]


def write_folder(folder, clouds, suffix=".pcd", poses=None):
    """Files scan_00.pcd, .., in the frame of the sensor, and poses.txt where poses are given."""
    folder.mkdir()
    for k, (points, origins) in enumerate(clouds):
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector((points - origins.mean(axis=0)).astype(np.float64)))
        o3d.io.write_point_cloud(str(folder / f"scan_{k:02d}{suffix}"), cloud)
    if poses is not None:
        (folder / "poses.txt").write_text(tum_text(INTERVAL_S * np.arange(len(poses)), np.array(poses)))
    return folder


__all__ = ["TRUTH", "cloud_message", "drive", "odometry", "odometry_message", "pose", "sweeps", "write_bag", "write_folder"]


def refusal(capsys: pytest.CaptureFixture[str], *words: object) -> str:
    """The one line that ./map_bag says of arguments that it refuses."""
    assert map_bag.main([str(word) for word in words]) == 2
    text = capsys.readouterr().err
    assert text.startswith("./map_bag: ") and text.count("\n") == 1
    return text
