#!/usr/bin/env python3
"""odometry_fusion_node alone: frames and stamps of /odom and its transform, and what becomes of bad samples."""

import math
import sys
import time
import unittest

import numpy as np
import rospy
from nav_msgs.msg import Odometry
from node_testing import QUIET_S, DiagnosticsOf, Inbox, feed, imu, one_line_of, run_misconfigured, wait_for_node, wait_until, wheels
from sensor_msgs.msg import Imu
from tf2_msgs.msg import TFMessage

import rostest
from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import transform_from_pose, transform_stamped

NODE = "odometry_fusion_node"
TICK_S = 0.05


class OdometryFusionTest(unittest.TestCase):
    clock_s = 100.0

    @classmethod
    def setUpClass(cls) -> None:
        wait_for_node(NODE)
        cls.odometry = Inbox("/odom", Odometry).wait_until_connected()
        cls.tf = Inbox("/tf", TFMessage).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.imu = feed("/imu/data", Imu)
        cls.wheels = feed("/wheel_odom", Odometry)

    def ticks(self, seconds: float, v: float = 0.0, w: float = 0.0) -> Odometry:
        """The last odometry of a time during which the robot drives with v and w."""
        for _ in range(round(seconds / TICK_S)):
            start_s, OdometryFusionTest.clock_s = self.clock_s, round(self.clock_s + TICK_S, 3)
            for k in range(1, 6):
                self.imu.publish(imu(round(start_s + 0.01 * k, 3), gyro=(1e-9 * k, 0.0, w)))
            self.wheels.publish(wheels(self.clock_s, v, w))
        return self.odometry.wait_for_stamp(self.clock_s)

    def test_odometry_has_the_stamp_of_the_wheels_and_the_frames_of_rep_105(self) -> None:
        out = self.ticks(0.2)
        self.assertEqual((out.header.frame_id, out.child_frame_id), ("odom", "base_link"))
        self.assertAlmostEqual(out.header.stamp.to_sec(), self.clock_s, places=6)
        self.assertAlmostEqual(np.linalg.norm([getattr(out.pose.pose.orientation, a) for a in "xyzw"]), 1.0, places=6)
        covariance = np.array(out.pose.covariance).reshape(6, 6)
        self.assertTrue((np.linalg.eigvalsh(covariance) >= -1e-12).all() and np.trace(covariance) > 0)

    def test_transform_is_that_of_the_odometry(self) -> None:
        out = self.ticks(0.2, v=0.3)
        sent = self.tf.wait_for(lambda m: m.transforms[0].header.stamp == out.header.stamp).transforms[0]
        self.assertEqual((sent.header.frame_id, sent.child_frame_id), ("odom", "base_link"))
        self.assertEqual(sent.transform.translation.x, out.pose.pose.position.x)

    def test_footprint_is_on_the_ground_below_the_base(self) -> None:
        (sent,) = Inbox("/tf_static", TFMessage).wait_for(lambda m: m.transforms[0].child_frame_id == "base_footprint").transforms
        self.assertEqual(sent.header.frame_id, "base_link")
        self.assertAlmostEqual(sent.transform.translation.z, -0.132)

    def test_driving_straight_moves_the_robot_ahead(self) -> None:
        before = self.ticks(1.0).pose.pose.position
        after = self.ticks(2.0, v=0.5).pose.pose.position
        self.assertAlmostEqual(np.hypot(after.x - before.x, after.y - before.y), 1.0, delta=0.15)

    def test_estimate_waits_for_the_imu(self) -> None:
        self.ticks(0.2)
        OdometryFusionTest.clock_s = round(self.clock_s + TICK_S, 3)
        self.wheels.publish(wheels(self.clock_s))
        time.sleep(QUIET_S)
        self.assertNotIn(self.clock_s, self.odometry.stamps())
        for k in range(4, -1, -1):
            self.imu.publish(imu(round(self.clock_s - 0.01 * k, 3)))
        self.odometry.wait_for_stamp(self.clock_s)

    def test_samples_that_are_no_numbers_are_counted_and_dropped(self) -> None:
        nan = float("nan")
        self.ticks(0.2)
        self.imu.publish(imu(self.clock_s + 0.001, gyro=(nan, 0.0, 0.0)))
        self.wheels.publish(wheels(self.clock_s + 0.001, v=nan))
        position = self.ticks(2.0).pose.pose.position
        self.assertTrue(np.isfinite([position.x, position.y, position.z]).all())
        self.diagnostics.wait_for_count("imu_not_finite")
        self.diagnostics.wait_for_count("wheels_not_finite")

    def test_late_samples_are_counted_and_dropped(self) -> None:
        self.ticks(0.5)
        before = len(self.odometry.messages)
        self.imu.publish(imu(self.clock_s - 0.2))
        self.wheels.publish(wheels(self.clock_s - 0.2))
        time.sleep(QUIET_S)
        self.assertEqual(len(self.odometry.messages), before)
        self.ticks(2.0)
        self.diagnostics.wait_for_count("imu_late")
        self.diagnostics.wait_for_count("wheels_late")

    def test_wheels_that_come_twice_are_answered_once(self) -> None:
        self.ticks(0.2)
        self.wheels.publish(wheels(self.clock_s))
        self.ticks(1.5)
        self.diagnostics.wait_for_count("wheels_late")
        self.assertEqual(len(self.odometry.stamps()), len(set(self.odometry.stamps())))

    def test_imu_s_mounting_is_that_of_its_frame(self) -> None:
        statics = rospy.Publisher("/tf_static", TFMessage, queue_size=1, latch=True)
        upside_down = transform_stamped(0.0, "base_link", "imu_below", transform_from_rpy((0.0, 0.0, -0.1), (math.pi, 0.0, 0.0)))
        statics.publish(TFMessage([upside_down]))
        wait_until(lambda: statics.get_num_connections() > 0, "the node to hear /tf_static")
        self.ticks(1.0)
        time.sleep(QUIET_S)
        before = self.odometry.messages[-1].pose.pose
        for _ in range(40):
            OdometryFusionTest.clock_s = round(self.clock_s + TICK_S, 3)
            for k in range(4, -1, -1):
                self.imu.publish(imu(round(self.clock_s - 0.01 * k, 3), (1e-9 * k, 0.0, -0.5), (0.0, 0.0, -9.81), "imu_below"))
            self.wheels.publish(wheels(self.clock_s, 0.0, 0.5))
        after = self.odometry.wait_for_stamp(self.clock_s).pose.pose
        turned = transform_from_pose(before)[:3, :3].T @ transform_from_pose(after)[:3, :3]
        self.assertAlmostEqual(math.atan2(turned[1, 0], turned[0, 0]), 1.0, delta=0.05)
        self.assertGreater(transform_from_pose(after)[2, 2], 0.999)

    def test_imu_of_an_unknown_frame_is_dropped_with_advice(self) -> None:
        self.ticks(0.2)
        for frame in ("nowhere", "", "laser"):
            self.imu.publish(imu(self.clock_s + 0.001, frame=frame))
        self.ticks(2.0)
        self.diagnostics.wait_for_dropped("bad Imu", 3)

    def test_time_that_jumps_back_starts_afresh(self) -> None:
        self.ticks(0.5)
        forward_s = self.clock_s
        OdometryFusionTest.clock_s = forward_s - 50.0
        self.ticks(2.0)
        self.diagnostics.wait_for_count("time_jump")
        OdometryFusionTest.clock_s = forward_s + 10.0

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        code, stderr = run_misconfigured(NODE, "gyro_nois:=0.1")
        self.assertEqual(code, 2, stderr)
        self.assertIn("did you mean gyro_noise?", one_line_of(stderr))

    def test_wrong_value_ends_the_node(self) -> None:
        code, stderr = run_misconfigured(NODE, "gyro_noise:=low")
        self.assertEqual(code, 2, stderr)
        self.assertIn("gyro_noise = 'low' is no float", one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("odometry_fusion_test")
    rostest.rosrun("explore_3dnav", "odometry_fusion", OdometryFusionTest, sys.argv)
