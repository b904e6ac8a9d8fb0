"""What one tick of the simulator brought, as messages."""

from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import rospy
from explore_3dnav.msg import Contact, SimulationTick
from geometry_msgs.msg import Vector3
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState, LaserScan, PointCloud2
from std_msgs.msg import Header

from robot_body import RobotBody
from ros_adapters.conversions import pose_message
from ros_adapters.frames import frames
from ros_adapters.node import TICK_TOPIC
from ros_adapters.revolution_messages import revolution_message

if TYPE_CHECKING:
    from pybullet_simulation import Delivery, ImuSample, JointSample, Revolution, Scan, ScanGeometry, TickData, Truth, WheelOdometry

_QUEUE = 100
_UNKNOWN_ORIENTATION = [-1.0] + [0.0] * 8  # sensor_msgs/Imu: no orientation estimate


class TickPublisher:
    """Publishes a tick: /clock, what came of the sensors in its order, the judge's truth, and last how many messages were sent so far."""

    def __init__(self, scan_geometry: "ScanGeometry", robot: RobotBody, *, spinning: bool = False) -> None:
        """/scan of a laser of this geometry, or /points of a spinning lidar, in the frames that the robot's sensors have."""
        laser, imu = robot.mount("laser").frame, robot.mount("imu").frame
        kinds: dict[str, tuple[type, Callable]] = {  # type: ignore[type-arg]  # each makes its message of its own kind of sample
            "/imu/data": (Imu, lambda sample: _imu_message(sample, imu)),
            "/wheel_odom": (Odometry, _wheel_message),
            "/joint_states": (JointState, _joint_message),
        }
        if spinning:
            kinds["/points"] = (PointCloud2, lambda sample: _points_message(sample, laser))
        else:
            kinds["/scan"] = (LaserScan, lambda sample: _scan_message(sample, laser, scan_geometry))
        self._sensors = {topic: (_publisher(topic.lstrip("/"), kind), message) for topic, (kind, message) in kinds.items()}
        self._clock = _publisher("/clock", Clock)
        self._truth = _publisher("ground_truth/odom", Odometry)
        self._contacts = _publisher("ground_truth/contacts", Contact)
        self._tick = _publisher(TICK_TOPIC, SimulationTick)
        self._counts = Counter({publisher.resolved_name: 0 for publisher, _ in self._sensors.values()})
        self._stamp_s, self.recounts = 0.0, 0

    def __call__(self, data: "TickData", wait_until: Callable[[float], None] | None = None) -> None:
        """All at once; or, with something that waits until an instant of the clock, each message, and the clock before it, at its own."""
        if wait_until is None:
            self._clock.publish(Clock(_time(data.stamp_s)))
        for one in data.deliveries:
            if wait_until is not None:
                wait_until(one.time_s)
                self._clock.publish(Clock(_time(one.time_s)))
            self._publish(one)
        if wait_until is not None:
            wait_until(data.stamp_s)
            self._clock.publish(Clock(_time(data.stamp_s)))
        self._truth.publish(_truth_message(data.truth))
        for contact in data.contacts:
            self._contacts.publish(Contact(_header(data.stamp_s, "world"), contact.link, contact.speed_mps, contact.force_n, contact.other))
        self._stamp_s = data.stamp_s
        self._tell()

    def recount(self) -> None:
        """The last tick once more, from which all count anew."""
        self.recounts += 1
        self._tell()

    def _tell(self) -> None:
        self._tick.publish(SimulationTick(_header(self._stamp_s, ""), list(self._counts), list(self._counts.values()), self.recounts))

    def _publish(self, delivery: "Delivery") -> None:
        publisher, message = self._sensors[delivery.topic]
        publisher.publish(message(delivery.sample))
        self._counts[publisher.resolved_name] += 1


def _publisher(topic: str, message_type: type) -> rospy.Publisher:
    queue = None if rospy.get_param("lockstep", False) else _QUEUE  # running free, no subscriber that hangs stops the robot
    return rospy.Publisher(topic, message_type, queue_size=queue, tcp_nodelay=True)


def _time(stamp_s: float) -> rospy.Time:
    """To the nanosecond, as drivers stamp."""
    return rospy.Time(*divmod(round(stamp_s * 1e9), 1_000_000_000))


def _header(stamp_s: float, frame: str) -> Header:
    return Header(stamp=_time(stamp_s), frame_id=frame)


def _points_message(turn: "Revolution", frame: str) -> PointCloud2:
    message = revolution_message(turn.stamp_s, frame, turn.points, turn.rings, turn.times_s)
    message.header.stamp = _time(turn.stamp_s)
    return message


def _scan_message(scan: "Scan", frame: str, geometry: "ScanGeometry") -> LaserScan:
    return LaserScan(
        header=_header(scan.stamp_s, frame),
        angle_min=geometry.angle_min,
        angle_max=geometry.angle_max,
        angle_increment=geometry.angle_increment,
        time_increment=geometry.time_increment,
        scan_time=geometry.scan_time,
        range_min=geometry.range_min,
        range_max=geometry.range_max,
        ranges=scan.ranges.tolist(),
    )


def _joint_message(joints: "JointSample") -> JointState:
    return JointState(
        header=_header(joints.stamp_s, ""), name=list(joints.names), position=list(joints.positions), velocity=list(joints.velocities)
    )


def _imu_message(imu: "ImuSample", frame: str) -> Imu:
    message = Imu(header=_header(imu.stamp_s, frame), angular_velocity=Vector3(*imu.gyro), linear_acceleration=Vector3(*imu.accel))
    message.orientation_covariance = _UNKNOWN_ORIENTATION
    return message


def _wheel_message(wheels: "WheelOdometry") -> Odometry:
    message = Odometry(header=_header(wheels.stamp_s, frames().odom), child_frame_id=frames().base)
    message.pose.pose.orientation.w = 1.0
    message.pose.covariance = (np.eye(6) * 1e9).ravel().tolist()  # the encoders' node gives velocities, not a pose
    message.twist.twist.linear.x = wheels.v
    message.twist.twist.angular.z = wheels.w
    return message


def _truth_message(truth: "Truth") -> Odometry:
    message = Odometry(header=_header(truth.stamp_s, "world"), child_frame_id=frames().base)
    message.pose.pose = pose_message(truth.T_world_base)
    message.twist.twist.linear = Vector3(*truth.linear)
    message.twist.twist.angular = Vector3(*truth.angular)
    return message
