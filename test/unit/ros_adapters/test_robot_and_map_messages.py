"""The mount from the URDF, octomaps as messages, the pose graph's markers, and answers that are none."""

import math
from pathlib import Path

import numpy as np
import pytest
from visualization_msgs.msg import Marker

from octomap_server_3dnav.octree.octree import OctreeMap
from rigid_geometry import transform_from_rpy
from robot_body import SensorMount, mount_from_urdf
from ros_adapters.graph_markers import graph_markers, trajectory_message
from ros_adapters.matching import refused_response
from ros_adapters.octomap_messages import Octomap, octomap_message

ROOT = Path(__file__).resolve().parents[3]

LASER = SensorMount("laser", "laser")


def chain(*joints: str) -> str:
    return f"<robot name='r'>{''.join(joints)}</robot>"


def joint(name: str, parent: str, child: str, kind: str = "fixed", xyz: str = "0 0 0", axis: str = "0 1 0") -> str:
    head = f"<joint name='{name}' type='{kind}'><parent link='{parent}'/><child link='{child}'/>"
    return f"{head}<origin xyz='{xyz}'/><axis xyz='{axis}'/></joint>"


def test_mount_of_the_husky_is_where_the_brief_says() -> None:
    name, T_base_mount, T_tilt_laser = mount_from_urdf((ROOT / "urdf" / "husky.urdf").read_text(), LASER)
    assert name == "tilt_joint"
    np.testing.assert_allclose(T_base_mount, transform_from_rpy((0.20, 0.0, 0.75)), atol=1e-12)
    np.testing.assert_allclose(T_tilt_laser, transform_from_rpy((0.03, 0.0, 0.04)), atol=1e-12)


def test_fixed_joints_on_both_sides_of_the_tilt_are_chained() -> None:
    urdf = chain(
        joint("a", "base_link", "mast", xyz="0 0 1"),
        joint("t", "mast", "cradle", "revolute", xyz="1 0 0"),
        joint("b", "cradle", "plate", xyz="0 2 0"),
        joint("c", "plate", "laser", xyz="0 0 3"),
    )
    name, T_base_mount, T_tilt_laser = mount_from_urdf(urdf, LASER)
    assert name == "t"
    np.testing.assert_allclose(T_base_mount[:3, 3], [1.0, 0.0, 1.0])
    np.testing.assert_allclose(T_tilt_laser[:3, 3], [0.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("urdf", "said"),
    [
        (chain(joint("a", "base_link", "laser")), "no joint that tilts"),
        (chain(joint("a", "mast", "laser", "revolute")), "no chain of joints"),
        (chain(joint("a", "base_link", "laser", "revolute", axis="0 0 1")), "turns about 0 0 1"),
        (chain(joint("a", "base_link", "m", "revolute"), joint("b", "m", "laser", "revolute")), "only one joint may move"),
    ],
)
def test_urdf_without_one_tilting_joint_is_refused(urdf: str, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        mount_from_urdf(urdf, LASER)


def test_octomap_has_the_type_that_everybody_knows() -> None:
    assert Octomap._type == "octomap_msgs/Octomap"
    assert Octomap._md5sum == "9a45536b45c5e409cd49f04bb2d9999f"


@pytest.mark.parametrize("binary", [True, False])
def test_octomap_message_comes_back_as_the_tree(binary: bool) -> None:
    points = np.random.default_rng(5).uniform(-2.0, 2.0, (500, 3)).astype(np.float32)
    tree = OctreeMap(0.1)
    tree.insert_sweep(points, np.zeros_like(points))
    message = octomap_message(2.0, "map", 0.1, tree.to_binary() if binary else tree.to_full(), binary=binary)
    read = OctreeMap.from_binary if binary else OctreeMap.from_full
    back = read(np.asarray(message.data, np.int8).tobytes(), message.resolution)
    np.testing.assert_array_equal(back.states_at(points), tree.states_at(points))
    assert (message.header.frame_id, message.binary, message.id) == ("map", binary, "OcTree")


def test_pose_graph_shows_vertices_and_edges_by_kind() -> None:
    poses = np.stack([transform_from_rpy((float(k), 0.0, 0.0)) for k in range(3)])
    markers = {m.ns: m for m in graph_markers(1.0, poses, [(0, 1, "odometry"), (1, 2, "odometry"), (0, 2, "loop")]).markers}
    assert len(markers["vertices"].points) == 3
    assert (len(markers["odometry"].points), len(markers["loop"].points)) == (4, 2)
    assert markers["match"].action == Marker.DELETE


def test_trajectory_has_the_stamps_of_the_sweeps() -> None:
    poses = np.stack([transform_from_rpy((float(k), 0.0, 0.0)) for k in range(2)])
    path = trajectory_message(9.0, (3.0, 7.5), poses)
    assert [p.header.stamp.to_sec() for p in path.poses] == [3.0, 7.5]
    assert path.poses[1].pose.position.x == 1.0


def test_answer_to_no_request_holds_no_number_that_could_be_believed() -> None:
    answer = refused_response("empty cloud")
    assert (answer.verdict, answer.reason) == ("refused", "empty cloud")
    assert math.isnan(answer.transform.translation.x) and np.isnan(answer.covariance).all() and math.isnan(answer.match_ratio)
