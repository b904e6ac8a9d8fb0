#!/usr/bin/env python3
"""sweep_assembler_node alone: frame, stamp and fields of the cloud, and what becomes of bad scans and gaps."""

import sys
import time
import unittest

import numpy as np
import rospy
from nav_msgs.msg import Odometry
from node_testing import (
    BEAMS,
    QUIET_S,
    DiagnosticsOf,
    Inbox,
    feed,
    joints,
    odometry,
    one_line_of,
    run_misconfigured,
    scan,
    wait_for_node,
    wait_until,
)
from sensor_msgs.msg import JointState, LaserScan, PointCloud2

import rostest
from ros_adapters.conversions import CLOUD_FIELDS, cloud_arrays

NODE = "sweep_assembler_node"
STEP_S = 0.025
LEVEL = 4  # samples of rest before and after
SLOPE = 20  # samples down, and as many up


class SweepAssemblyTest(unittest.TestCase):
    clock_s = 100.0

    @classmethod
    def setUpClass(cls) -> None:
        wait_for_node(NODE)
        cls.clouds = Inbox("/sweep_cloud", PointCloud2).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.scans = feed("/scan_filtered", LaserScan)
        cls.joints = feed("/joint_states", JointState)
        cls.odometry = feed("/odom", Odometry)
        cls.scans.publish(scan(50.0))  # the first scan tells the node the laser's layout
        time.sleep(QUIET_S)

    def sweep(self, ranges: object = 2.0, odometry_gap: slice = slice(0, 0), scan_every: int = 1) -> float:
        """Plays a short sweep and the time after it; the stamp at which the laser is level again."""
        begin_s = SweepAssemblyTest.clock_s = self.clock_s + 3.0
        down = np.linspace(0.0, 1.0, SLOPE)
        tilts = np.concatenate([np.zeros(LEVEL), down, down[::-1], np.zeros(2 * LEVEL)])
        for k, tilt in enumerate(tilts):
            self.joints.publish(joints(begin_s + STEP_S * k, tilt))
            if k % 2 == 0 and not odometry_gap.start <= k < odometry_gap.stop:
                self.odometry.publish(odometry(begin_s + STEP_S * k))
            if k % scan_every == 0 or k > LEVEL + 2 * SLOPE:
                self.scans.publish(scan(begin_s + STEP_S * k, ranges))
        return begin_s + STEP_S * (LEVEL + 2 * SLOPE - 1)

    def test_cloud_has_the_stamp_of_the_end_the_frame_of_the_base_and_the_beams_origins(self) -> None:
        cloud = self.clouds.wait_for_stamp(round(self.sweep(), 6))
        self.assertEqual(cloud.header.frame_id, "base_link")
        self.assertEqual([f.name for f in cloud.fields], list(CLOUD_FIELDS))
        points, origins = cloud_arrays(cloud, "base_link")
        self.assertGreater(len(points), 35 * BEAMS)
        np.testing.assert_allclose(np.linalg.norm(points - origins, axis=1), 2.0, atol=1e-3)
        self.assertLess(np.abs(origins - [0.2, 0.0, 0.75]).max(), 0.1)

    def test_sweep_without_a_reading_gives_no_cloud_and_is_counted(self) -> None:
        end_s = self.sweep(np.nan)
        self.diagnostics.wait_for_count("sweep_empty")
        self.assertNotIn(round(end_s, 6), self.clouds.stamps())
        self.clouds.wait_for_stamp(round(self.sweep(), 6))

    def test_scan_of_another_layout_counts_and_one_without_is_counted_and_dropped(self) -> None:
        self.scans.publish(scan(self.clock_s + 0.9, beams=100))
        self.scans.publish(scan(self.clock_s + 1.0, beams=0))
        self.clouds.wait_for_stamp(round(self.sweep(), 6))
        self.diagnostics.wait_for_dropped("bad LaserScan")

    def test_late_scan_is_counted_and_dropped(self) -> None:
        self.clouds.wait_for_stamp(round(self.sweep(), 6))
        self.scans.publish(scan(self.clock_s + 1.0))
        self.diagnostics.wait_for_count("scan_late")

    def test_scans_without_odometry_are_counted_and_left_out(self) -> None:
        cloud = self.clouds.wait_for_stamp(round(self.sweep(odometry_gap=slice(14, 30)), 6))
        self.assertLess(cloud.width, 30 * BEAMS)
        self.diagnostics.wait_for_count("scan_without_odometry")

    def test_sweep_of_half_of_its_scans_is_given_out_and_told_of_until_the_next_whole_one(self) -> None:
        said = "scans of a sweep are missing"
        cloud = self.clouds.wait_for_stamp(round(self.sweep(scan_every=2), 6))
        self.assertGreater(cloud.width, 15 * BEAMS)
        wait_until(lambda: said in self.diagnostics.message(), said)
        self.assertRegex(self.diagnostics.counts()[said], "^(4[5-9]|5[0-5]) % of them$")
        self.clouds.wait_for_stamp(round(self.sweep(), 6))
        wait_until(lambda: said not in self.diagnostics.message(), "it is over")

    def test_odometry_that_is_no_pose_is_counted_and_dropped(self) -> None:
        self.odometry.publish(odometry(self.clock_s + 1.0, x=float("nan")))
        self.clouds.wait_for_stamp(round(self.sweep(), 6))
        self.diagnostics.wait_for_dropped("bad Odometry")

    def test_joint_sample_that_is_no_number_is_counted_and_dropped(self) -> None:
        self.joints.publish(joints(self.clock_s + 1.0, float("nan")))
        self.clouds.wait_for_stamp(round(self.sweep(), 6))
        self.diagnostics.wait_for_dropped("bad JointState")

    def test_time_that_jumps_back_starts_afresh(self) -> None:
        self.clouds.wait_for_stamp(round(self.sweep(), 6))
        forward_s = self.clock_s
        SweepAssemblyTest.clock_s = forward_s - 60.0
        self.sweep()  # may be lost to a message of the time before that comes in between
        time.sleep(QUIET_S)
        self.clouds.wait_for_stamp(round(self.sweep(), 6))
        self.diagnostics.wait_for_count("time_jump")
        SweepAssemblyTest.clock_s = forward_s + 10.0

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        code, stderr = run_misconfigured(NODE, "buffer:=20.0")
        self.assertEqual(code, 2, stderr)
        self.assertIn("did you mean buffer_s?", one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("sweep_assembly_test")
    rostest.rosrun("explore_3dnav", "sweep_assembly", SweepAssemblyTest, sys.argv)
