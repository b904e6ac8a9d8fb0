#!/usr/bin/env python3
"""scan_filter_node alone: frames and stamps of what comes out, and what becomes of bad scans."""

import sys
import time
import unittest

import numpy as np
import rospy
from node_testing import BEAMS, QUIET_S, DiagnosticsOf, Inbox, feed, joints, one_line_of, run_misconfigured, scan, slowness, wait_for_node
from sensor_msgs.msg import JointState, LaserScan

import rostest

NODE = "scan_filter_node"


class ScanFilterTest(unittest.TestCase):
    clock_s = 100.0

    @classmethod
    def setUpClass(cls) -> None:
        wait_for_node(NODE)
        cls.filtered = Inbox("/scan_filtered", LaserScan).wait_until_connected()
        cls.horizontal = Inbox("/scan_horizontal", LaserScan).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.scans = feed("/scan", LaserScan)
        cls.joints = feed("/joint_states", JointState)

    def now(self) -> float:
        """A new time, later than all before and so much that diagnostics are due."""
        ScanFilterTest.clock_s += 2.0
        return ScanFilterTest.clock_s

    def through(self, message: LaserScan, tilt_rad: float = 0.0) -> tuple[LaserScan, LaserScan]:
        """What comes out of a scan that has its joint samples."""
        stamp_s = message.header.stamp.to_sec()
        self.joints.publish(joints(stamp_s, tilt_rad))
        self.scans.publish(message)
        self.joints.publish(joints(stamp_s + 0.025, tilt_rad))
        return self.filtered.wait_for_stamp(stamp_s), self.horizontal.wait_for_stamp(stamp_s)

    def test_scan_keeps_its_stamp_frame_and_beams(self) -> None:
        stamp_s = self.now()
        for out in self.through(scan(stamp_s)):
            self.assertEqual((out.header.stamp.to_sec(), out.header.frame_id, len(out.ranges)), (stamp_s, "laser", BEAMS))
        self.assertAlmostEqual(self.filtered.messages[-1].angle_increment, scan(0.0).angle_increment, places=7)

    def test_wrong_ranges_are_no_readings(self) -> None:
        ranges = np.full(BEAMS, 3.0)
        ranges[100:150], ranges[200:250], ranges[300:350] = 0.05, 45.0, np.nan
        filtered = np.array(self.through(scan(self.now(), ranges))[0].ranges)
        self.assertTrue(np.isnan(filtered[100:150]).all() and np.isinf(filtered[200:250]).all() and np.isnan(filtered[300:350]).all())
        self.assertTrue((filtered[500:600] == 3.0).all())

    def test_horizontal_scan_is_short_and_only_there_while_the_laser_is_level(self) -> None:
        ranges = np.where(np.arange(BEAMS) < 540, 2.0, 8.0)
        level = self.through(scan(self.now(), ranges))[1]
        self.assertTrue((np.array(level.ranges[20:500]) == 2.0).all() and np.isinf(level.ranges[560:]).all())
        self.assertAlmostEqual(level.range_max, 2.5, places=5)
        self.assertTrue(np.isnan(self.through(scan(self.now(), ranges), tilt_rad=0.4)[1].ranges).all())

    def test_scan_waits_for_the_joint_sample_after_its_last_beam(self) -> None:
        stamp_s = self.now()
        self.joints.publish(joints(stamp_s))
        self.scans.publish(scan(stamp_s))
        time.sleep(QUIET_S)
        self.assertNotIn(stamp_s, self.filtered.stamps())
        self.joints.publish(joints(stamp_s + 0.025))
        self.filtered.wait_for_stamp(stamp_s)

    def test_scan_without_beams_is_counted_and_does_not_hold_up_the_next(self) -> None:
        self.scans.publish(scan(self.now(), beams=0))
        self.through(scan(self.now()))
        self.diagnostics.wait_for_dropped("bad LaserScan")

    def test_scans_may_differ_in_layout(self) -> None:
        for beams in (600, BEAMS, BEAMS - 2):
            self.assertEqual(len(self.through(scan(self.now(), beams=beams))[0].ranges), beams)

    def test_scan_in_another_frame_is_counted_and_dropped(self) -> None:
        before = self.diagnostics.dropped("bad LaserScan")
        stamp_s = self.now()
        foreign = scan(stamp_s)
        foreign.header.frame_id = "camera"
        self.joints.publish(joints(stamp_s))
        self.scans.publish(foreign)
        self.joints.publish(joints(stamp_s + 0.025))
        self.through(scan(self.now()))
        self.diagnostics.wait_for_dropped("bad LaserScan", before + 1)
        self.assertNotIn(stamp_s, self.filtered.stamps())

    def test_joint_sample_that_is_no_number_is_counted_and_dropped(self) -> None:
        self.joints.publish(joints(self.now(), float("nan")))
        self.through(scan(self.now()))  # once it is through, so is the joint sample: topics are not ordered among each other
        self.through(scan(self.now()))  # and its report tells
        self.diagnostics.wait_for_dropped("bad JointState")

    def test_silent_mount_beside_a_base_that_talks_is_told(self) -> None:
        self.through(scan(self.now()))
        base = joints(self.now())
        base.name = ["left_wheel"]
        deadline = time.monotonic() + 2.0 * slowness()
        while "no /joint_states" not in self.diagnostics.message():
            self.assertLess(time.monotonic(), deadline, self.diagnostics.message())
            self.joints.publish(base)
            time.sleep(0.02)

    def test_late_scan_is_counted_and_dropped(self) -> None:
        stamp_s = self.now()
        self.through(scan(stamp_s))
        self.scans.publish(scan(stamp_s - 0.2))
        self.through(scan(self.now()))
        self.diagnostics.wait_for_count("scan_late")
        self.assertNotIn(round(stamp_s - 0.2, 6), self.filtered.stamps())

    def test_time_that_jumps_back_starts_afresh(self) -> None:
        forward_s = self.now()
        self.through(scan(forward_s))
        self.scans.publish(scan(forward_s + 1.0))  # still waits for its joints
        ScanFilterTest.clock_s = forward_s - 60.0
        self.through(scan(self.now()))
        ScanFilterTest.clock_s = forward_s + 10.0

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        code, stderr = run_misconfigured(NODE, "min_rang_m:=0.2")
        self.assertEqual(code, 2, stderr)
        self.assertIn("did you mean min_range_m?", one_line_of(stderr))

    def test_wrong_value_ends_the_node(self) -> None:
        code, stderr = run_misconfigured(NODE, "min_range_m:=-1.0")
        self.assertEqual(code, 2, stderr)
        self.assertIn("min_range_m = -1.0 is below", one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("scan_filter_test")
    rostest.rosrun("explore_3dnav", "scan_filter", ScanFilterTest, sys.argv)
