#!/usr/bin/env python3
"""Two robots with a simulator each on one ROS master, in the namespaces left and right: none hears the other, each explores its world."""

import math
import sys
import unittest

import rosgraph
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from explore_3dnav.msg import ExplorationDecision, ExploreStatus, MappedSweep
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from node_testing import Inbox, wait_until
from rosgraph_msgs.msg import Clock
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage

import rostest

SIDES = ("left", "right")
START_S, SWEEP_S = 300.0, 180.0  # both robots load their kernels, and share the machine
DRIVEN_M, STANDS_MPS = 0.3, 0.02
EVERYBODY_S = {"/diagnostics", "/rosout", "/rosout_agg"}
OF_THE_MASTER = {"/roslaunch", "/rosversion", "/rosdistro", "/run_id", "/use_sim_time", "/rosout"}


class Robot:
    """What one of the two says."""

    def __init__(self, side: str) -> None:
        self.odometry, self.velocity = Inbox(f"/{side}/odom", Odometry), Inbox(f"/{side}/cmd_vel", Twist)
        self.sweeps, self.decisions = (
            Inbox(f"/{side}/mapped_sweep", MappedSweep),
            Inbox(f"/{side}/exploration/decision", ExplorationDecision),
        )
        self.status, self.tf, self.clock = (
            Inbox(f"/{side}/explore/status", ExploreStatus),
            Inbox(f"/{side}/tf", TFMessage),
            Inbox(f"/{side}/clock", Clock),
        )
        self._side = side

    def position(self) -> tuple[float, float]:
        at = self.odometry.messages[-1].pose.pose.position
        return at.x, at.y

    def call(self, name: str) -> None:
        answer = rospy.ServiceProxy(f"/{self._side}/{name}", Trigger)()
        assert answer.success, answer.message


def state_of_the_master() -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """(topic, node) of all who publish or listen, and (service, node) of all who serve; without this test."""
    publishers, subscribers, services = rosgraph.Master("/two_robots_test").getSystemState()
    pairs = [
        [(name, node) for name, nodes in table for node in nodes if node != rospy.get_name()]
        for table in (publishers, subscribers, services)
    ]
    return pairs[0] + pairs[1], pairs[2]


def namespace(name: str) -> str:
    return name.split("/")[1]


class TwoRobotsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.robots = {side: Robot(side) for side in SIDES}
        cls.diagnostics = Inbox("/diagnostics", DiagnosticArray)
        for robot in cls.robots.values():
            robot.odometry.wait_for(timeout_s=START_S)
        for robot in cls.robots.values():
            robot.sweeps.wait_for(timeout_s=SWEEP_S)
            robot.decisions.wait_for(lambda m: m.kind == "goal", SWEEP_S)

    def test_1_each_drives_to_a_goal_in_its_own_map(self) -> None:
        for side, robot in self.robots.items():
            wait_until(lambda robot=robot: math.hypot(*robot.position()) > DRIVEN_M, f"{side} to drive", SWEEP_S)
            self.assertTrue(any(m.linear.x > 0.0 for m in robot.velocity.messages))
        clouds = [len(robot.sweeps.messages[0].cloud.data) for robot in self.robots.values()]
        self.assertNotEqual(*clouds, "two worlds, two maps")

    def test_2_nobody_is_heard_or_served_by_the_other(self) -> None:
        topics, services = state_of_the_master()
        self.assertEqual({topic for topic, _ in topics if namespace(topic) not in SIDES} - EVERYBODY_S, set())
        crossed = [(topic, node) for topic, node in topics if topic not in EVERYBODY_S and namespace(topic) != namespace(node)]
        self.assertEqual(crossed, [])
        self.assertEqual([(service, node) for service, node in services if namespace(service) != namespace(node)], [])

    def test_3_each_has_its_own_parameters_transforms_and_clock(self) -> None:
        strangers = [
            name for name in rospy.get_param_names() if namespace(name) not in SIDES and f"/{namespace(name)}" not in OF_THE_MASTER
        ]
        self.assertEqual(strangers, [])
        topics, _ = state_of_the_master()
        for side, robot in self.robots.items():
            robot.tf.wait_for(lambda m: any((t.header.frame_id, t.child_frame_id) == ("map", "odom") for t in m.transforms))
            senders = {m._connection_header["callerid"] for m in robot.tf.messages}
            self.assertEqual({namespace(sender) for sender in senders}, {side})
            self.assertIn(f"/{side}/robot_state_publisher", senders, "roscpp's nodes, too")
            self.assertIn((f"/{side}/clock", f"/{side}/robot_state_publisher"), topics)
            self.assertIn("pid", rospy.get_param(f"/{side}/revival/scan_filter_node"))

    def test_4_diagnostics_tell_whose_they_are(self) -> None:
        for side in SIDES:
            said = self.diagnostics.wait_for(lambda m, side=side: any(s.name == f"{side}/scan_filter_node" for s in m.status)).status[0]
            self.assertIn(f"input: /{side}/scan", {value.key for value in said.values})

    def test_5_one_is_paused_and_the_other_goes_on(self) -> None:
        left, right = self.robots["left"], self.robots["right"]
        left.call("explore/pause")
        left.status.wait_for(lambda m: m.state == "paused")
        wait_until(lambda: abs(left.odometry.messages[-1].twist.twist.linear.x) < STANDS_MPS, "left to stand", SWEEP_S)
        stands, clock_s, commands = left.position(), left.clock.messages[-1].clock.to_sec(), len(right.velocity.messages)
        wait_until(lambda: left.clock.messages[-1].clock.to_sec() > clock_s + 1.0, "left's clock to go on", SWEEP_S)
        wait_until(lambda: any(m.linear.x > 0.0 or m.angular.z for m in right.velocity.messages[commands:]), "right to drive on", SWEEP_S)
        self.assertLess(math.dist(left.position(), stands), 0.1)
        self.assertNotEqual(right.status.messages[-1].state, "paused")
        left.call("explore/resume")


if __name__ == "__main__":
    rospy.init_node("two_robots_test", disable_rostime=True)
    rostest.rosrun("explore_3dnav", "two_robots", TwoRobotsTest, sys.argv)
