#!/usr/bin/env python3
"""pybullet_sim_node running free at real time: frames, stamps, rates and counts of the sensors, sweeps, bad and ceasing commands."""

import sys
import time
import unittest

import numpy as np
import rospy
from explore_3dnav.msg import SimulationTick
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from node_testing import BEAMS, DiagnosticsOf, Inbox, feed, one_line_of, run_misconfigured, wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState, LaserScan
from std_srvs.srv import Trigger

import rostest
from ros_adapters.conversions import stamp_of

NODE = "pybullet_sim_node"
TICK_S = 0.05


class PybulletSimTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.clock = Inbox("/clock", Clock)
        cls.scans = Inbox("/scan", LaserScan)
        cls.joints = Inbox("/joint_states", JointState)
        cls.imu = Inbox("/imu/data", Imu)
        cls.wheels = Inbox("/wheel_odom", Odometry)
        cls.truth = Inbox("/ground_truth/odom", Odometry)
        cls.ticks = Inbox("/simulation/tick", SimulationTick)
        cls.clock.wait_for(timeout_s=120.0)
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.velocity = feed("/cmd_vel", Twist)

    def drive(self, v: float, w: float = 0.0) -> None:
        message = Twist()
        message.linear.x, message.angular.z = v, w
        self.velocity.publish(message)

    def drive_for(self, seconds: float, v: float, w: float = 0.0) -> None:
        """A command every 0.1 s, as a controller sends them."""
        for _ in range(round(seconds / 0.1)):
            self.drive(v, w)
            time.sleep(0.1)

    def next_truth(self) -> Odometry:
        """The truth of a tick that begins after now."""
        seen = len(self.truth.messages)
        wait_until(lambda: len(self.truth.messages) > seen + 2, "a new tick")
        return self.truth.messages[-1]

    def assert_spacing(self, inbox: Inbox, seconds: float) -> None:
        """About a period apart, never exactly; a lost message leaves two, a doubled one none."""
        wait_until(lambda: len(inbox.messages) > 40, f"40 messages on {inbox.topic}")
        apart = np.diff([m.header.stamp.to_nsec() for m in list(inbox.messages)]) / 1e9
        self.assertAlmostEqual(float(np.median(apart)), seconds, delta=0.02 * seconds, msg=inbox.topic)
        self.assertTrue((np.abs(apart - seconds) < 0.05 * seconds).mean() > 0.9, inbox.topic)
        self.assertGreater(float(apart[np.abs(apart - seconds) < 0.05 * seconds].std()), 0.005 * seconds, inbox.topic)

    def test_clock_never_reads_zero_nor_goes_back_and_reaches_every_tick(self) -> None:
        wait_until(lambda: len(self.ticks.messages) > 20, "20 ticks")
        clock = [m.clock.to_sec() for m in list(self.clock.messages)]
        self.assertGreater(clock[0], 0.0)
        self.assertTrue((np.diff(clock) >= 0.0).all())
        np.testing.assert_allclose(np.diff(self.ticks.stamps()), TICK_S, atol=1e-6)

    def test_sensors_come_at_their_rates_in_their_frames(self) -> None:
        sensors = ((self.scans, 0.025, "laser"), (self.joints, 0.025, ""), (self.imu, 0.01, "imu_link"), (self.wheels, TICK_S, "odom"))
        for inbox, period_s, frame in sensors:
            self.assert_spacing(inbox, period_s)
            self.assertEqual(inbox.messages[-1].header.frame_id, frame)
        self.assertEqual(self.wheels.messages[-1].child_frame_id, "base_link")

    def test_no_two_sensors_share_a_stamp(self) -> None:
        wait_until(lambda: len(self.wheels.messages) > 40, "40 messages of the wheels")
        stamps = [{m.header.stamp.to_nsec() for m in list(box.messages)} for box in (self.scans, self.joints, self.imu, self.wheels)]
        self.assertEqual(sum(map(len, stamps)), len(set().union(*stamps)))

    def test_tick_comes_with_the_number_of_messages_sent_on_each_topic(self) -> None:
        """A subscriber may have missed the first: what is counted between two ticks has come between them."""
        wait_until(lambda: len(self.ticks.messages) > 40, "40 ticks")
        first, last = self.ticks.messages[-31], self.ticks.messages[-1]
        self.assertEqual(sorted(last.topics), ["/imu/data", "/joint_states", "/scan", "/wheel_odom"])
        sent = {t: b - a for t, a, b in zip(last.topics, first.counts, last.counts, strict=True)}
        for inbox, each in ((self.scans, 60), (self.joints, 60), (self.imu, 150), (self.wheels, 30)):
            self.assertAlmostEqual(sent[inbox.topic], each, delta=max(2.0, 0.03 * each))

    def test_messages_come_when_they_are_due_and_not_tick_by_tick(self) -> None:
        wait_until(lambda: len(self.clock.messages) > 200, "200 clock messages")
        clock = [m.clock.to_nsec() for m in list(self.clock.messages)[-200:]]
        self.assertGreater(len({ns % 50_000_000 for ns in clock}), 100)

    def test_wheels_stand_a_quarter_of_a_second_after_the_last_command(self) -> None:
        self.drive_for(1.0, 0.0, 0.6)
        silent_from = stamp_of(self.ticks.messages[-1])
        self.wheels.wait_for(lambda m: stamp_of(m) > silent_from + 0.6)
        late = [m.twist.twist.angular.z for m in list(self.wheels.messages) if stamp_of(m) > silent_from + 0.5]
        early = [m.twist.twist.angular.z for m in list(self.wheels.messages) if silent_from < stamp_of(m) < silent_from + 0.1]
        self.assertGreater(min(early), 0.3)
        self.assertLess(max(map(abs, late)), 0.02)

    def test_scan_has_the_laser_s_layout_and_ranges_in_bounds(self) -> None:
        message = self.scans.wait_for()
        self.assertEqual(len(message.ranges), BEAMS)
        self.assertAlmostEqual(message.angle_min + (BEAMS - 1) * message.angle_increment, message.angle_max, places=4)
        ranges = np.array(message.ranges)
        self.assertTrue((ranges[np.isfinite(ranges)] < message.range_max + 0.2).all() and np.isfinite(ranges).mean() > 0.5)

    def test_resting_imu_feels_gravity(self) -> None:
        self.drive(0.0)
        newest = [m.linear_acceleration for m in self.imu.messages[-50:]]
        force = np.mean([[a.x, a.y, a.z] for a in newest], axis=0)
        self.assertAlmostEqual(float(np.linalg.norm(force)), 9.81, delta=0.3)
        self.assertEqual(self.imu.messages[-1].orientation_covariance[0], -1.0)

    def test_robot_turns_when_told_to_and_its_encoders_tell(self) -> None:
        self.drive_for(1.0, 0.0, 0.6)
        turning = self.wheels.wait_for(lambda m: m.twist.twist.angular.z > 0.3)
        self.drive(0.0)
        self.assertLess(abs(turning.twist.twist.linear.x), 0.1)
        wait_until(lambda: abs(self.wheels.messages[-1].twist.twist.angular.z) < 0.05, "the robot to stand again")

    def test_sweep_tilts_the_laser_once_and_a_second_request_is_refused(self) -> None:
        start_sweep = rospy.ServiceProxy("start_sweep", Trigger)
        self.assertTrue(start_sweep().success)
        refused = start_sweep()
        self.assertFalse(refused.success)
        self.assertIn("a sweep is running", refused.message)
        far = self.joints.wait_for(lambda m: m.position[m.name.index("tilt_joint")] > 2.5)
        wait_until(
            lambda: self.joints.messages[-1].header.stamp > far.header.stamp and abs(self.joints.messages[-1].position[0]) < 1e-3,
            "the laser to be level again",
        )

    def test_command_that_is_no_number_is_counted_and_stops_the_robot(self) -> None:
        self.drive(0.0, float("nan"))
        self.diagnostics.wait_for_dropped("bad Twist")
        pose = self.next_truth().pose.pose.position
        self.assertTrue(np.isfinite([pose.x, pose.y, pose.z]).all())

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        code, stderr = run_misconfigured(NODE, "physics_rat_hz:=240")
        self.assertEqual(code, 2, stderr)
        self.assertIn("did you mean physics_rate_hz?", one_line_of(stderr))

    def test_unknown_world_ends_the_node(self) -> None:
        code, stderr = run_misconfigured(NODE, "world:=romms")
        self.assertEqual(code, 2, stderr)
        self.assertIn("romms", one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("pybullet_sim_test", disable_rostime=True)
    rostest.rosrun("explore_3dnav", "pybullet_sim", PybulletSimTest, sys.argv)
