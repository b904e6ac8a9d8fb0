"""Transforms as inputs: map->odom by time, and other frames for goals; never the identity in place of what is not known."""

import math
import time
from functools import partial

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PoseStamped, TransformStamped
from numpy.typing import NDArray
from tf2_msgs.msg import TFMessage

from rigid_geometry import JUMP_BACK_S
from ros_adapters.connections import heard_publishers
from ros_adapters.conversions import pose_message, sender_of, stamp_of, transform_from_message, transform_from_pose, transform_stamped
from ros_adapters.frames import frames
from ros_adapters.inputs import TimedInput
from ros_adapters.node import Node


class NoTransformError(ValueError):
    """tf does not tell where a frame was, or not yet."""


_PATIENCE_S = 0.5
_MAPPING = "pose_graph_mapping_node"
MAP_ODOM = "/tf map->odom"  # as the barrier and the diagnostics call it


def pose_in_map(buffer: tf2_ros.BufferCore, pose: PoseStamped) -> PoseStamped:
    """The pose in map by the newest transforms, its stamp left; ValueError when its frame is not known."""
    frame = pose.header.frame_id.lstrip("/")
    if frame == frames().map:
        pose.header.frame_id = frame
        return pose
    if not frame:
        raise ValueError("a goal without a frame: its header's frame_id is empty; map, odom or base_link is meant")
    try:
        found = buffer.lookup_transform_core(frames().map, frame, rospy.Time())
    except tf2_ros.TransformException as error:
        raise ValueError(f"a goal in frame {frame!r}, which tf cannot tell in map: {error}") from error
    moved = PoseStamped(pose.header, pose_message(transform_from_message(found.transform) @ transform_from_pose(pose.pose)))
    moved.header.frame_id = frames().map
    return moved


class KnownTransforms:
    """tf's buffer. Where a clock was set back it forgets what moves: tf itself would go on with what has the newest stamp."""

    def __init__(self) -> None:
        self.buffer = tf2_ros.BufferCore(rospy.Duration(30))
        self._newest_s: dict[tuple[str, str], float] = {}

    def keep(self, transform: TransformStamped, *, static: bool) -> NDArray[np.float64]:
        """Puts a transform into the buffer and gives it as (4, 4). ValueError when it is none: for some tf's C++ ends the process."""
        stamp_s = stamp_of(transform)
        parent, child = transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/")
        if not parent or not child or parent == child:
            raise ValueError(f"a transform from {parent!r} to {child!r}")
        T = transform_from_message(transform.transform)
        if static:
            self.buffer.set_transform_static(transform, "tf")
            return T
        if stamp_s < self._newest_s.get((parent, child), -math.inf) - JUMP_BACK_S:
            self.buffer.clear()  # but for what is static
            self._newest_s.clear()
        self._newest_s[parent, child] = max(stamp_s, self._newest_s.get((parent, child), -math.inf))
        self.buffer.set_transform(transform, "tf")
        return T


class TransformsWhenAsked:
    """tf for a node that needs it rarely: in lock-step, where every message costs, listened to from the first question on."""

    def __init__(self, node: Node) -> None:
        """Listens beside the node's lock: who asks holds it while he waits."""
        self._node = node
        self._known: KnownTransforms | None = None
        if not node.lockstep:
            self._listening()

    def in_map(self, pose: PoseStamped) -> PoseStamped:
        """The pose in map; ValueError when its frame is not known, also after half a second of listening."""
        deadline = time.monotonic() + _PATIENCE_S
        while True:
            try:
                return pose_in_map(self._listening().buffer, pose)
            except ValueError:
                if time.monotonic() > deadline or not pose.header.frame_id:
                    raise
            time.sleep(0.02)

    def at(self, frame: str, stamp: rospy.Time) -> NDArray[np.float64]:
        """(4, 4) where a frame was in map; NoTransformError when that is not known by now, also for an empty name."""
        frame = frame.lstrip("/")
        if frame == frames().map:
            return np.eye(4)
        if not frame:
            raise NoTransformError("a message without a frame: set frame_id in its driver")
        try:
            return transform_from_message(self._listening().buffer.lookup_transform_core(frames().map, frame, stamp).transform)
        except tf2_ros.TransformException as error:
            raise NoTransformError(f"tf does not tell {frame!r} in {frames().map!r} at {stamp.to_sec():.3f} s: {error}") from error

    def newest(self, frame: str, not_before_s: float = 0.0) -> NDArray[np.float64] | None:
        """The same by the newest transforms; None where they do not tell, or are older."""
        try:
            found = self._listening().buffer.lookup_transform_core(frames().map, frame, rospy.Time())
        except tf2_ros.TransformException:
            return None
        return transform_from_message(found.transform) if found.header.stamp.to_sec() >= not_before_s else None

    def _listening(self) -> KnownTransforms:
        if self._known is None:
            self._known = KnownTransforms()
            self._subscribers = [
                rospy.Subscriber("/tf", TFMessage, partial(self._on_transforms, static=False)),
                rospy.Subscriber("/tf_static", TFMessage, partial(self._on_transforms, static=True)),
            ]
        return self._known

    def _on_transforms(self, message: TFMessage, *, static: bool) -> None:
        for transform in message.transforms:
            try:
                self._listening().keep(transform, static=static)
            except ValueError as error:
                self._node.diagnostics.dropped("bad TFMessage", f"{transform.child_frame_id!r}: {error}")


class TransformInput:
    """Hears /tf and /tf_static for a node, and keeps map->odom apart: it moves the robot.

    Once the mapping node was heard, what others send between the two counts for nothing, and they are named.
    """

    def __init__(self, node: Node, max_age_s: float) -> None:
        """`max_age_s`: an older map->odom is not known any more."""
        self._node = node
        self._map_odom: TimedInput[NDArray[np.float64]] = TimedInput(max_age_s)
        self._known, self._has_heard_mapping = KnownTransforms(), False
        node.watch(MAP_ODOM, max_age_s)
        self._subscriber = node.subscribe("/tf", TFMessage, self._on_transforms, required=False)
        node.subscribe("/tf_static", TFMessage, self._on_static, required=False)

    def hears(self, publisher: str) -> bool:
        """True when the node `publisher` is connected: a transform that it sends from now on will arrive."""
        return rospy.resolve_name(publisher) in heard_publishers(self._subscriber)

    def T_map_odom(self, stamp_s: float) -> NDArray[np.float64] | None:
        """The (4, 4) correction that holds at a time; None when it is not known or too old."""
        return self._map_odom.at(stamp_s)

    def add_odometry(self, stamp: rospy.Time, T_odom_base: NDArray[np.float64]) -> None:
        """Where the robot is in odom, as its odometry says: goals in base_link need not wait for tf."""
        self._keep(transform_stamped(stamp.to_sec(), frames().odom, frames().base, T_odom_base), static=False)

    def in_map(self, pose: PoseStamped) -> PoseStamped:
        """The pose in map by the newest transforms; ValueError when its frame is not known."""
        return pose_in_map(self._known.buffer, pose)

    def _on_transforms(self, message: TFMessage) -> None:
        sender = sender_of(message)
        for transform in message.transforms:
            between = transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/")
            if between == (frames().odom, frames().base):
                continue  # the odometry itself has told
            if between == (frames().map, frames().odom) and not self._is_trusted(sender):
                self._node.diagnostics.dropped(f"{MAP_ODOM} of {sender}", "only the mapping node's is obeyed: switch it off there")
                continue
            T = self._keep(transform, static=False)
            if T is not None and between == (frames().map, frames().odom):
                self._map_odom.add(stamp_of(transform), T)
                self._node.received(MAP_ODOM)

    def _is_trusted(self, sender: str) -> bool:
        is_mapping = sender == rospy.resolve_name(_MAPPING)
        self._has_heard_mapping = self._has_heard_mapping or is_mapping
        return is_mapping or not self._has_heard_mapping

    def _on_static(self, message: TFMessage) -> None:
        for transform in message.transforms:
            self._keep(transform, static=True)

    def _keep(self, transform: TransformStamped, *, static: bool) -> NDArray[np.float64] | None:
        """As (4, 4); None, and counted, when it is none: the others of its message are kept."""
        try:
            return self._known.keep(transform, static=static)
        except ValueError as error:
            self._node.diagnostics.dropped("bad TFMessage", f"{transform.child_frame_id!r}: {error}")
            return None
