#!/usr/bin/env python3
"""scan_tracking_node alone: odometry goes through it, a map corrects it, and what is none is refused and counted."""

import sys
import time
import unittest

import numpy as np
import rospy
from explore_3dnav.srv import SetLocalMap, SetTiltBacklash
from nav_msgs.msg import Odometry
from node_testing import (
    DiagnosticsOf,
    Inbox,
    clock,
    feed,
    floor_and_walls,
    joints,
    odometry,
    one_line_of,
    run_misconfigured,
    scan,
    wait_for_node,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState, LaserScan
from tf2_msgs.msg import TFMessage

import rostest
from ros_adapters.conversions import cloud_message, header, pose_message

NODE = "scan_tracking_node"
STEP_S = 0.05


class ScanTrackingTest(unittest.TestCase):
    clock_s = 100.0

    @classmethod
    def setUpClass(cls) -> None:
        wait_for_node(NODE)
        cls.tracked = Inbox("/odom_tracked", Odometry).wait_until_connected()
        cls.transforms = Inbox("/tf", TFMessage).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.odometry, cls.joints, cls.scans = feed("/odom", Odometry), feed("/joint_states", JointState), feed("/scan_filtered", LaserScan)
        cls.clock = feed("/clock", Clock)
        cls.set_map = rospy.ServiceProxy(f"{NODE}/set_map", SetLocalMap)
        cls.set_backlash = rospy.ServiceProxy(f"{NODE}/set_backlash", SetTiltBacklash)

    def tick(self, x: float, late_s: float = 0.0) -> Odometry:
        """Joint state, scan and odometry of the next moment; what is tracked of it."""
        stamp_s = ScanTrackingTest.clock_s = round(self.clock_s + STEP_S, 3)
        self.clock.publish(clock(stamp_s + late_s))
        self.joints.publish(joints(stamp_s - 0.01))
        self.scans.publish(scan(stamp_s - 0.04))
        time.sleep(0.005)
        self.odometry.publish(odometry(stamp_s, x=x, v=0.3))
        return self.tracked.wait_for_stamp(stamp_s)

    def test_1_odometry_without_a_map_goes_through_with_its_stamps_twist_and_transform(self) -> None:
        for k in range(10):
            message = self.tick(0.015 * k)
            self.assertEqual(message.pose.pose.position.x, 0.015 * k)
            self.assertEqual((message.header.frame_id, message.child_frame_id, message.twist.twist.linear.x), ("odom", "base_link", 0.3))
        self.assertGreater(message.pose.covariance[0], 0.0)
        self.transforms.wait_for(lambda m: any(t.header.stamp == message.header.stamp for t in m.transforms))

    def test_1_scans_wait_for_nobody_while_odometry_comes_late(self) -> None:
        for _ in range(4):
            self.tick(0.15, late_s=0.3)
        self.diagnostics.wait_for_dropped("no time to match")

    def test_2_map_is_taken_and_one_without_normals_is_refused(self) -> None:
        points, _ = floor_and_walls()
        normals = np.tile([0.0, 0.0, 1.0], (len(points), 1))
        here, origins = pose_message(np.eye(4)), np.zeros_like(points)
        self.assertTrue(self.set_map(cloud_message(self.clock_s, "map", points, origins, normals), here, []).accepted)
        with self.assertRaisesRegex(rospy.ServiceException, "without normals"):
            self.set_map(cloud_message(self.clock_s, "map", points, origins), here, [])
        with self.assertRaisesRegex(rospy.ServiceException, "expected 36"):
            self.set_map(cloud_message(self.clock_s, "map", points, origins, normals), here, [1.0] * 35)
        self.diagnostics.wait_for_dropped("bad set_map", 2)

    def test_3_play_of_the_mount_is_taken_and_one_that_can_be_none_is_refused(self) -> None:
        self.assertTrue(self.set_backlash(header(self.clock_s, "laser"), 0.005).accepted)
        with self.assertRaisesRegex(rospy.ServiceException, "backlash"):
            self.set_backlash(header(self.clock_s, "laser"), 5.0)

    def test_4_odometry_that_is_no_pose_is_counted_and_the_next_one_tracked(self) -> None:
        self.odometry.publish(odometry(self.clock_s + 0.01, x=float("nan")))
        self.diagnostics.wait_for_dropped("bad Odometry")
        self.tick(0.2)

    def test_5_odometry_that_jumps_is_counted_and_the_tracked_pose_goes_on_where_it_was(self) -> None:
        before = self.tick(0.2).pose.pose.position.x
        for _ in range(10):
            after = self.tick(0.7)
            self.assertAlmostEqual(after.pose.pose.position.x, before, delta=0.1)
        self.diagnostics.wait_for_dropped("odometry jumped")

    def test_6_wrong_parameter_ends_the_node_in_one_line(self) -> None:
        code, stderr = run_misconfigured(NODE, "bundle_s:=-1.0")
        self.assertEqual(code, 2)
        self.assertIn("bundle_s", one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("scan_tracking_test")
    rostest.rosrun("explore_3dnav", "scan_tracking", ScanTrackingTest, sys.argv)
