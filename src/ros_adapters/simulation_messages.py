"""What one tick of the simulator measured, as messages."""

from typing import TYPE_CHECKING

import numpy as np
import rospy
from explore_3dnav.msg import Contact
from geometry_msgs.msg import Vector3
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState, LaserScan, PointCloud2

from robot_body import RobotBody
from ros_adapters.conversions import header, pose_message, ros_time
from ros_adapters.revolution_messages import revolution_message

if TYPE_CHECKING:
    from pybullet_simulation import ImuSample, JointSample, Scan, ScanGeometry, TickData, Truth, WheelOdometry

_UNKNOWN_ORIENTATION = [-1.0] + [0.0] * 8  # sensor_msgs/Imu: no orientation estimate


class TickPublisher:
    """Publishes /clock first, then what the robot's longest chain of nodes waits for, and the judge's truth at the end."""

    def __init__(self, scan_geometry: "ScanGeometry", robot: RobotBody, *, spinning: bool = False) -> None:
        """/scan of a laser of this geometry, or /points of a spinning lidar, in the frames that the robot's sensors have."""
        self._geometry = scan_geometry
        self._laser_frame, self._imu_frame = robot.mount("laser").frame, robot.mount("imu").frame

        def small(topic: str, message_type: type) -> rospy.Publisher:
            return rospy.Publisher(topic, message_type, queue_size=None, tcp_nodelay=True)

        self._clock = small("/clock", Clock)
        self._scan = None if spinning else small("/scan", LaserScan)
        self._points = small("/points", PointCloud2) if spinning else None
        self._joints = small("/joint_states", JointState)
        self._imu = small("/imu/data", Imu)
        self._wheels = small("/wheel_odom", Odometry)
        self._truth = small("/ground_truth/odom", Odometry)
        self._contacts = small("/ground_truth/contacts", Contact)

    def __call__(self, data: "TickData") -> None:
        self._clock.publish(Clock(ros_time(data.stamp_s)))
        for imu in data.imu:
            self._imu.publish(_imu_message(imu, self._imu_frame))
        self._wheels.publish(_wheel_message(data.wheel_odometry))
        for joints in data.joints:
            self._joints.publish(_joint_message(joints))
        if self._scan:
            for scan in data.scans:
                self._scan.publish(_scan_message(scan, self._laser_frame, self._geometry))
        turn = data.revolution
        if self._points and turn is not None:
            self._points.publish(revolution_message(turn.stamp_s, self._laser_frame, turn.points, turn.rings, turn.times_s))
        self._truth.publish(_truth_message(data.truth))
        for contact in data.contacts:
            self._contacts.publish(Contact(header(data.stamp_s, "world"), contact.link, contact.speed_mps, contact.force_n))


def _scan_message(scan: "Scan", frame: str, geometry: "ScanGeometry") -> LaserScan:
    return LaserScan(
        header=header(scan.stamp_s, frame),
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
        header=header(joints.stamp_s, ""), name=list(joints.names), position=list(joints.positions), velocity=list(joints.velocities)
    )


def _imu_message(imu: "ImuSample", frame: str) -> Imu:
    message = Imu(header=header(imu.stamp_s, frame), angular_velocity=Vector3(*imu.gyro), linear_acceleration=Vector3(*imu.accel))
    message.orientation_covariance = _UNKNOWN_ORIENTATION
    return message


def _wheel_message(wheels: "WheelOdometry") -> Odometry:
    message = Odometry(header=header(wheels.stamp_s, "odom"), child_frame_id="base_link")
    message.pose.pose.orientation.w = 1.0
    message.pose.covariance = (np.eye(6) * 1e9).ravel().tolist()  # the encoders' node gives velocities, not a pose
    message.twist.twist.linear.x = wheels.v
    message.twist.twist.angular.z = wheels.w
    return message


def _truth_message(truth: "Truth") -> Odometry:
    message = Odometry(header=header(truth.stamp_s, "world"), child_frame_id="base_link")
    message.pose.pose = pose_message(truth.T_world_base)
    message.twist.twist.linear = Vector3(*truth.linear)
    message.twist.twist.angular = Vector3(*truth.angular)
    return message
