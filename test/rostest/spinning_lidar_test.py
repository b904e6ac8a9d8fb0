#!/usr/bin/env python3
"""A spinning lidar in the laser's place, from the simulator to the sweep's cloud: topics, frames, fields, and what is refused."""

import sys
import unittest

import numpy as np
import rospy
from node_testing import DiagnosticsOf, Inbox, feed, one_line_of, run_misconfigured, wait_for_node, wait_until
from sensor_msgs.msg import LaserScan, PointCloud2
from std_srvs.srv import Trigger

import rostest
from ros_adapters.conversions import CLOUD_FIELDS, cloud_arrays, stamp_of
from ros_adapters.revolution_messages import revolution_message, revolution_of

COLUMNS = 300
PERIOD_S = 0.1


class SpinningLidarTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        for node in ("scan_filter_node", "sweep_assembler_node", "odometry_fusion_node"):
            wait_for_node(node)
        cls.points = Inbox("/points", PointCloud2).wait_until_connected()
        cls.filtered = Inbox("/points_filtered", PointCloud2).wait_until_connected()
        cls.level = Inbox("/scan_horizontal", LaserScan).wait_until_connected()
        cls.clouds = Inbox("/sweep_cloud", PointCloud2).wait_until_connected()
        cls.free = Inbox("/sweep_free", PointCloud2).wait_until_connected()
        cls.diagnostics = DiagnosticsOf("scan_filter_node").wait_until_connected()

    def test_revolutions_come_ten_times_a_second_with_the_fields_of_a_driver(self) -> None:
        wait_until(lambda: len(self.points.messages) > 8, "revolutions")
        turns = [m for m in self.points.messages if m.header.frame_id == "laser"]  # not the one that another test sends
        apart = np.diff([stamp_of(m) for m in turns])
        self.assertAlmostEqual(float(np.median(apart)), PERIOD_S, delta=0.03 * PERIOD_S)
        self.assertGreater(float(np.ptp(apart)), 0.001 * PERIOD_S)
        message = turns[-1]
        self.assertEqual([f.name for f in message.fields], ["x", "y", "z", "ring", "time"])
        turn = revolution_of(message, "laser")
        self.assertLessEqual(len(turn.points), 16 * COLUMNS)
        self.assertEqual(set(turn.rings), set(range(16)))
        self.assertTrue(0.0 <= turn.times_s.min() and turn.times_s.max() < PERIOD_S)

    def test_there_is_no_scan_of_a_laser(self) -> None:
        topics = {name for name, _ in rospy.get_published_topics()}
        self.assertFalse({"/scan", "/scan_filtered"} & topics)

    def test_level_scan_sees_the_rooms_while_the_lidar_is_level(self) -> None:
        scan = self.level.wait_for(lambda m: np.isfinite(m.ranges).any())
        self.assertEqual(scan.header.frame_id, "laser")
        ranges = np.array(scan.ranges)
        self.assertLessEqual(ranges[np.isfinite(ranges)].max(), 2.5)
        self.assertGreater(np.isfinite(ranges).sum() + np.isposinf(ranges).sum(), 0.6 * COLUMNS)

    def test_sweep_gives_one_cloud_of_many_revolutions(self) -> None:
        before = len(self.clouds.messages)
        self.assertTrue(rospy.ServiceProxy("start_sweep", Trigger)().success)
        wait_until(lambda: len(self.clouds.messages) > before, "the sweep's cloud", 120.0)
        cloud = self.clouds.messages[-1]
        self.assertEqual([f.name for f in cloud.fields], list(CLOUD_FIELDS))
        points, origins = cloud_arrays(cloud, "base_link")
        self.assertGreater(len(points), 15 * 16 * COLUMNS * 0.5)
        self.assertLess(np.abs(origins - [0.2, 0.0, 0.75]).max(), 0.1)
        floor = (np.abs(points[:, 2] + 0.132) < 0.05) & (np.hypot(points[:, 0], points[:, 1]) < 2.0)
        self.assertGreater(floor.sum(), 1000)
        self.free.wait_for_stamp(round(cloud.header.stamp.to_sec(), 6))

    def test_cloud_of_another_sensor_is_counted_and_dropped(self) -> None:
        points = feed("/points", PointCloud2)
        foreign = revolution_message(1.0, "laser", np.ones((4, 3)), np.zeros(4, np.uint16), np.zeros(4))
        foreign.header.frame_id = "camera"
        points.publish(foreign)
        self.diagnostics.wait_for_dropped("bad PointCloud2")

    def test_wrong_parameter_of_the_lidar_ends_the_node_with_the_nearest_name(self) -> None:
        for node, parameter, said in (
            ("pybullet_sim_node", "spinning/columnz:=300", "did you mean columns?"),
            ("scan_filter_node", "lidar/ring:=16", "did you mean rings?"),
            ("sweep_assembler_node", "lidar/rate_hz:=-1.0", "rate_hz = -1.0 is below"),
        ):
            code, stderr = run_misconfigured(node, parameter)
            self.assertEqual(code, 2, stderr)
            self.assertIn(said, one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("spinning_lidar_test", disable_rostime=True)
    rostest.rosrun("explore_3dnav", "spinning_lidar", SpinningLidarTest, sys.argv)
