"""What a replay publishes in place of the nodes of a run: the robot at rest in its joints, and the map as it grows by sweeps."""

from collections.abc import Sequence
from xml.etree import ElementTree

import numpy as np
from nav_msgs.msg import Path
from numpy.typing import NDArray
from sensor_msgs.msg import JointState, PointCloud2
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

from ros_adapters.conversions import cloud_message, header, transform_stamped
from ros_adapters.frames import robot_description
from ros_adapters.graph_markers import graph_markers, trajectory_message
from ros_adapters.node import Node

Floats = NDArray[np.float64]


def moving_joints(urdf: str) -> dict[str, str]:
    """Child link of every joint that moves, by the joint's name."""
    joints = ElementTree.fromstring(urdf).iter("joint") if urdf else ()
    children = {j.get("name", ""): j.find("child") for j in joints if j.get("type") not in (None, "fixed")}
    return {name: child.get("link", "") for name, child in children.items() if child is not None}


class RestingJoints:
    """/joint_states with every joint of /robot_description at zero: the tilting laser is horizontal there."""

    def __init__(self, node: Node) -> None:
        self.links = moving_joints(robot_description())
        self._publisher = node.publisher("joint_states", JointState)

    def show(self, stamp_s: float) -> None:
        self._publisher.publish(JointState(header=header(stamp_s, ""), name=list(self.links), position=[0.0] * len(self.links)))


class RobotTopics:
    """tf map->odom->base_link and the joints. A run's folder does not hold its odometry: map and odom are one."""

    def __init__(self, node: Node) -> None:
        self._joints = RestingJoints(node)
        self._tf = node.publisher("/tf", TFMessage)

    def show(self, stamp_s: float, T_map_base: Floats) -> None:
        """The robot at a (4, 4) pose."""
        transforms = [transform_stamped(stamp_s, "map", "odom", np.eye(4)), transform_stamped(stamp_s, "odom", "base_link", T_map_base)]
        self._tf.publish(TFMessage(transforms))
        self._joints.show(stamp_s)


class SweepTopics:
    """/cloud_map, /pose_graph and /trajectory, latched for whoever comes late."""

    def __init__(self, node: Node) -> None:
        self.cloud = node.publisher("cloud_map", PointCloud2, large=True, latch=True)
        self._graph = node.publisher("pose_graph", MarkerArray, latch=True)
        self._trajectory = node.publisher("trajectory", Path, latch=True)

    def show_map(self, stamp_s: float, points: Floats, poses: Floats, edges: Sequence[tuple[int, int, str]]) -> None:
        """(N, 3) points and (V, 4, 4) vertices in map; of the edges those between vertices that are there."""
        known = [edge for edge in edges if max(edge[:2]) < len(poses)]
        self._graph.publish(graph_markers(stamp_s, poses, known))
        self.cloud.publish(cloud_message(stamp_s, "map", points, points))

    def show_path(self, stamp_s: float, stamps_s: Floats, poses: Floats) -> None:
        """(P,) stamps and (P, 4, 4) poses of the way so far, in map."""
        self._trajectory.publish(trajectory_message(stamp_s, stamps_s.tolist(), poses))
