"""Who publishes, listens and serves on a robot: what the ROS master and tf tell, judged."""

import xmlrpc.client
from typing import Any

import rosgraph
import rospy
import rosservice
from tf2_msgs.msg import TFMessage

from ros_adapters.conversions import sender_of
from ros_adapters.frames import frames
from ros_adapters.mapping_mode import is_tracking
from ros_adapters.sensor_frames import SensorFrames
from sensor_checks import Level, Row, judged


def our_senders() -> dict[tuple[str, str], str]:
    """Who of these nodes sends which transform, by parent and child."""
    odometry = rospy.resolve_name("scan_tracking_node" if is_tracking() else "odometry_fusion_node")
    return {(frames().odom, frames().base): odometry, (frames().map, frames().odom): rospy.resolve_name("pose_graph_mapping_node")}


class RobotGraph:
    """The master's state at one instant."""

    def __init__(self) -> None:
        """Asks the master; OSError when it does not answer."""
        master = rosgraph.Master(rospy.get_name())
        publishers, subscribers, services = master.getSystemState()
        self.publishers, self.subscribers, self.services = dict(publishers), dict(subscribers), dict(services)
        self._types = dict(master.getTopicTypes())

    def silence_rows(self, topic: str, type_name: str, other_messages: int) -> list[Row]:
        """Why nothing came on a topic, as far as the master knows."""
        if other_messages:
            return []  # the messages came, and said nothing of this input: their own row tells that
        nodes = self.publishers.get(topic, [])
        found_type = self._types.get(topic, type_name)
        if nodes and found_type not in (type_name, "*"):
            found = f"{found_type} by {', '.join(nodes)}"
            return [Row(Level.ERROR, topic, "type", found, f"the nodes take {type_name}: remap {topic} to a topic of that type")]
        if nodes:
            advice = "its driver runs and sends nothing: see its output, and whether ROS_IP or ROS_HOSTNAME can be reached"
            return [Row(Level.ERROR, topic, "publisher", ", ".join(nodes), advice)]
        others = sorted(name for name in self.publishers if self._types.get(name) == type_name)
        advice = f"{type_name} comes on {', '.join(others)}: remap {topic}:={others[0]}" if others else "start its driver"
        return [Row(Level.ERROR, topic, "publisher", "nobody", advice)]

    def service_row(self, name: str, type_name: str, what: str) -> Row:
        """Whether one node serves `name`, with the right type; `what` the mount does then."""
        name = rospy.resolve_name(name)
        nodes = self.services.get(name, [])
        if not nodes:
            return Row(Level.ERROR, name, "served by", "nobody", f"the mount's driver must serve it ({type_name}): {what}")
        try:
            found = str(rosservice.get_service_type(name))
        except (OSError, rosservice.ROSServiceException, xmlrpc.client.Error):
            found = "None"
        return judged(
            name,
            "served by",
            f"{', '.join(nodes)} ({found})",
            (found == "None", Level.ERROR, "it does not answer: restart it, or see whether its ROS_IP can be reached"),
            (found != type_name, Level.ERROR, f"the nodes call it as {type_name}"),
        )

    def command_rows(self, topic: str) -> list[Row]:
        """Who obeys the velocity commands, and who else gives some."""
        topic = rospy.resolve_name(topic)
        listeners = [node for node in self.subscribers.get(topic, []) if node != rospy.get_name()]
        rows = [
            judged(
                topic,
                "obeyed by",
                ", ".join(listeners) or "nobody",
                (not listeners, Level.ERROR, f"start the base's driver, or remap {topic} to what it listens to"),
            )
        ]
        found_type = self._types.get(topic, "*")
        if found_type not in ("geometry_msgs/Twist", "*"):
            rows.append(Row(Level.ERROR, topic, "type", found_type, "the nodes send geometry_msgs/Twist"))
        ours = rospy.resolve_name("stop_scan_and_go_node")
        others = [node for node in self.publishers.get(topic, []) if node not in (ours, rospy.get_name())]
        if others:
            advice = "it drives the robot beside these nodes: end it, or give it a multiplexer (twist_mux)"
            rows.append(Row(Level.WARN, topic, "also sent by", ", ".join(others), advice))
        return rows


class TransformWatch:
    """Hears /tf and /tf_static: who else says where the robot is, and frames that stand elsewhere than the URDF has them."""

    def __init__(self, frames: SensorFrames) -> None:
        self._frames = frames
        self._others: dict[tuple[str, str], str] = {}
        self._wrong: set[str] = set()
        self._subscribers = (
            rospy.Subscriber("/tf", TFMessage, self._on_moving, queue_size=None),
            rospy.Subscriber("/tf_static", TFMessage, self._on_static, queue_size=None),
        )

    def _on_moving(self, message: Any) -> None:
        sender = sender_of(message)
        for t in message.transforms:
            edge = t.header.frame_id.lstrip("/"), t.child_frame_id.lstrip("/")
            if edge[1] in (frames().base, frames().odom) and our_senders().get(edge) != sender:
                self._others[edge] = sender

    def _on_static(self, message: Any) -> None:
        self._on_moving(message)
        try:
            self._frames.add_static(message)
        except ValueError as error:
            self._wrong.add(str(error))

    def stop(self) -> None:
        """Listens no more."""
        for subscriber in self._subscribers:
            subscriber.unregister()

    def rows(self) -> list[Row]:
        """What was heard against the tree map -> odom -> base_link -> sensors."""
        rows = [
            Row(Level.ERROR, "tf", f"{parent} -> {child}", f"sent by {sender}", _advice(parent, child))
            for (parent, child), sender in sorted(self._others.items())
        ]
        advice, static = "the URDF has it elsewhere: end the static publisher, or correct one of the two", rospy.resolve_name("/tf_static")
        rows += [Row(Level.ERROR, "tf", "mount", f"{static} moves {frame}", advice) for frame in sorted(self._frames.contradicting)]
        rows += [Row(Level.ERROR, "tf", "transform", text, f"see who publishes {static}") for text in sorted(self._wrong)]
        return rows or [Row(Level.OK, "tf", "tree", "nobody else sends map -> odom or odom -> base_link")]


def _advice(parent: str, child: str) -> str:
    if (parent, child) in our_senders():
        return f"these nodes send it, too: switch it off there (publish_tf, for example), and give {child} one parent"
    return (
        f"{child} has one parent in tf, and that is {frames().odom if child == frames().base else frames().map}: remove {parent} -> {child}"
    )
