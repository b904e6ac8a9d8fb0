#!/usr/bin/env python3
"""check_robot beside a played robot: exit code 0 for a right one, 1 and its line for each fault, and nothing that it publishes."""

import math
import re
import subprocess
import sys
import threading
import unittest
from collections.abc import Sequence
from typing import Any

import rosgraph
import rospy
from node_testing import DiagnosticsOf
from played_robot import PlayedRobot
from sensor_msgs.msg import Imu
from std_msgs.msg import Header
from tf2_msgs.msg import TFMessage

import rostest
from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import ros_time, transform_stamped

SECONDS = 1.5
BUSY = re.compile("(network or the computer is busy|the computer's load)")  # warned of where the machine has other things to do
LOOKS = 4


def check(*arguments: str, seconds: float = SECONDS) -> tuple[int, str]:
    """Exit code and all output."""
    command = ["rosrun", "explore_3dnav", "check_robot", f"--seconds={seconds}", "--wait=5", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=180.0)
    return done.returncode, done.stdout + done.stderr


def shifted(seconds: float) -> Any:
    """A change that stamps otherwise."""

    def change(message: Any) -> Any:
        message.header = Header(stamp=ros_time(message.header.stamp.to_sec() + seconds), frame_id=message.header.frame_id)
        return message

    return change


def with_values(**values: Any) -> Any:
    """A change that sets fields, "a__b" for a.b; a function is given the old value."""

    def change(message: Any) -> Any:
        for name, value in values.items():
            *path, last = name.split("__")
            at = message
            for step in path:
                at = getattr(at, step)
            setattr(at, last, value(getattr(at, last)) if callable(value) else value)
        return message

    return change


def of_frame(frame: str) -> Any:
    """A change of the frame alone."""
    return with_values(header__frame_id=frame)


def nothing(_: Any) -> None:
    return None


class CheckRobotTest(unittest.TestCase):
    robot: PlayedRobot

    @classmethod
    def setUpClass(cls) -> None:
        cls.robot = PlayedRobot()

    def setUp(self) -> None:
        self.robot.change, self.robot.rates = {}, {}

    def expect(self, code: int, said: Sequence[str], *arguments: str, **change: Any) -> str:
        """What is printed about a robot of which some sensors are changed; with this exit code and these words.

        A look that found the machine too busy to tell is taken again.
        """
        self.robot.change = change
        for _ in range(LOOKS):
            found, text = check(*arguments)
            if (found == code and all(words in text for words in said)) or not BUSY.search(text):
                break
        self.assertEqual(found, code, text)
        for words in said:
            self.assertIn(words, text)
        self.assertNotIn("Traceback", text)
        return text

    def test_right_robot_passes_and_nothing_is_published(self) -> None:
        watched: set[str] = set()
        master = rosgraph.Master("/check_robot_test")
        ended = threading.Event()

        def watch() -> None:
            while not ended.wait(0.2):
                publishers, _, _ = master.getSystemState()
                watched.update(topic for topic, nodes in publishers for node in nodes if "check_robot_" in node and "test" not in node)

        threading.Thread(target=watch, daemon=True).start()
        text = self.expect(0, ["all is right"])
        ended.set()
        self.assertNotIn("ERROR", text)
        self.assertEqual(watched, {"/rosout"})

    def test_robot_that_is_not_there(self) -> None:
        elsewhere = [
            f"{name}:=/nowhere{name}" for name in ("/scan", "/joint_states", "/imu/data", "/wheel_odom", "/start_sweep", "/cmd_vel")
        ]
        text = self.expect(1, ["LaserScan comes on /scan: remap /nowhere/scan:=/scan", "start the base's driver"], "--wait=0", *elsewhere)
        self.assertEqual(text.count("nobody\n"), 6, text)

    def test_robot_that_is_to_map_while_it_drives_needs_a_mount_that_nods(self) -> None:
        said = ["must serve it (std_srvs/SetBool): nod in front of the robot", "without it, map with mapping:=stop_and_go"]
        self.expect(1, said, "--mapping", "driving")
        mapping = rospy.get_param("/mapping")
        self.addCleanup(rospy.set_param, "/mapping", mapping)
        rospy.delete_param("/mapping")
        self.expect(1, said)

    def test_silent_sensor_is_told_of_with_its_driver(self) -> None:
        self.expect(1, ["/scan", "its driver runs and sends nothing"], "--wait=0", scan=nothing)

    def test_topic_of_another_name_is_taken(self) -> None:
        front = rospy.Publisher("/front/imu", Imu, queue_size=100)
        self.expect(0, ["/front/imu"], "/imu/data:=/front/imu", imu=front.publish)

    def test_units_of_one_kind(self) -> None:
        self.expect(
            1,
            ["it is in g", "ranges are in millimetres", "the joint is in degrees", "husky cannot drive so fast"],
            imu=with_values(linear_acceleration__z=1.0),
            scan=with_values(ranges=lambda r: [1000.0 * v for v in r], range_max=30000.0),
            joints=with_values(position=[40.0]),
            wheels=with_values(twist__twist__linear__x=300.0),
        )

    def test_units_of_another_kind(self) -> None:
        self.expect(
            1,
            ["upside down", "wheels stand: its rates are in deg/s", "angle_increment is in degrees", "no joint tilt_joint"],
            imu=with_values(linear_acceleration__z=lambda z: -z, angular_velocity__z=lambda w: 57.3 * w + 0.1),
            scan=with_values(angle_increment=math.degrees),
            joints=with_values(name=["dynamixel"]),
        )

    def test_clocks(self) -> None:
        self.expect(1, ["/scan is 3.0", "behind", "chrony", "ahead of the clock"], scan=shifted(-1.02), wheels=shifted(2.0))
        self.expect(1, ["are zero"], imu=with_values(header__stamp=rospy.Time(0)))

    def test_frames_and_gravity_that_was_removed(self) -> None:
        self.expect(
            1, ["robot.yaml has 'laser'", "where frame 'bosch' is mounted is not known"], scan=of_frame("hokuyo"), imu=of_frame("bosch")
        )
        self.expect(
            1, ["removed gravity", "sees nothing"], imu=with_values(linear_acceleration__z=0.0), scan=with_values(ranges=[0.0] * 1081)
        )

    def test_slow_sensor_and_one_that_jumps_back(self) -> None:
        self.robot.rates = {"joints": 3.0}
        turn = iter(range(10**6))
        self.expect(1, ["at least 15 Hz", "time jumps back"], wheels=lambda m: shifted(-1.0 * (next(turn) % 2))(m))

    def test_messages_that_come_twice_are_warned_of(self) -> None:
        self.expect(0, ["come twice", "1 warnings"], wheels=lambda m: [m, m])

    def test_second_odometry_in_tf(self) -> None:
        tf = rospy.Publisher("/tf", TFMessage, queue_size=1, latch=True)
        tf.publish(TFMessage([transform_stamped(1.0, "odom", "base_link", transform_from_rpy((0.0, 0.0, 0.0)))]))
        self.expect(1, ["odom -> base_link", "publish_tf"])
        tf.unregister()

    def test_gate_becomes_the_command_when_all_is_right(self) -> None:
        self.expect(0, ["moves __name:=stop_scan_and_go_node"], "--then", "echo", "moves", "__name:=stop_scan_and_go_node")

    def test_gate_stays_shut_otherwise_and_tells_it_on_diagnostics(self) -> None:
        diagnostics = DiagnosticsOf("check_robot")
        text = self.expect(1, ["check:=false"], "--wait=0", "--then", "echo", "it moves", imu=nothing)
        self.assertNotIn("it moves", text)
        self.assertIn("its driver runs and sends nothing", diagnostics.counts()["/imu/data: publisher"])

    def test_wrong_argument(self) -> None:
        self.assertEqual(check("--seconds=0")[0], 2)
        self.assertEqual(check("_apart_s:=-1.0")[0], 2)


if __name__ == "__main__":
    rospy.init_node("check_robot_test")
    rostest.rosrun("explore_3dnav", "check_robot", CheckRobotTest, sys.argv)
