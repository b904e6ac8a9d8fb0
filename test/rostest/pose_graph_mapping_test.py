#!/usr/bin/env python3
"""pose_graph_mapping_node with a made-up match_clouds: what a sweep becomes, and what becomes of bad ones."""

import sys
import threading
import time
import unittest

import numpy as np
import rospy
from explore_3dnav.msg import MappedSweep
from explore_3dnav.srv import MatchClouds, MatchCloudsRequest, MatchCloudsResponse
from nav_msgs.msg import Odometry, Path
from node_testing import (
    QUIET_S,
    DiagnosticsOf,
    Inbox,
    feed,
    floor_and_walls,
    odometry,
    one_line_of,
    run_misconfigured,
    wait_for_node,
    wait_until,
)
from sensor_msgs.msg import PointCloud2
from std_srvs.srv import Trigger
from tf2_msgs.msg import TFMessage
from visualization_msgs.msg import MarkerArray

import rostest
from ros_adapters.conversions import cloud_message
from ros_adapters.matching import refused_response

NODE = "pose_graph_mapping_node"


def matched_at_the_guess(request: MatchCloudsRequest) -> MatchCloudsResponse:
    """A match that finds just what was guessed."""
    covariance = (np.eye(6) * 1e-4).ravel().tolist()
    return MatchCloudsResponse("accepted", "as guessed", request.guess, covariance, 0.9, 0.9, 0.0, [], [], 5)


class PoseGraphMappingTest(unittest.TestCase):
    clock_s = 100.0
    answer = staticmethod(matched_at_the_guess)

    @classmethod
    def setUpClass(cls) -> None:
        cls.service = rospy.Service("match_clouds", MatchClouds, lambda r: PoseGraphMappingTest.answer(r), buff_size=2**25)
        wait_for_node(NODE)
        cls.mapped = Inbox("/mapped_sweep", MappedSweep).wait_until_connected()
        cls.trajectory = Inbox("/trajectory", Path).wait_until_connected()
        cls.graph = Inbox("/pose_graph", MarkerArray).wait_until_connected()
        cls.tf = Inbox("/tf", TFMessage).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.clouds = feed("/sweep_cloud", PointCloud2)
        cls.odometry = feed("/odom", Odometry)
        cls.points, cls.origins = floor_and_walls()

    def setUp(self) -> None:
        PoseGraphMappingTest.answer = staticmethod(matched_at_the_guess)

    def cloud(self) -> PointCloud2:
        """A good sweep, later than all before."""
        PoseGraphMappingTest.clock_s += 5.0
        return cloud_message(self.clock_s, "base_link", self.points, self.origins)

    def drive_to(self, stamp_s: float) -> None:
        """Odometry up to a time."""
        for k in (2, 1, 0):
            self.odometry.publish(odometry(stamp_s - 0.05 * k, x=0.01 * stamp_s))

    def mapped_sweep(self) -> MappedSweep:
        cloud = self.cloud()
        self.drive_to(self.clock_s)
        self.clouds.publish(cloud)
        return self.mapped.wait_for_stamp(self.clock_s)

    def assert_lost(self, cloud: PointCloud2) -> None:
        """A cloud that is counted and reported as lost with a reason, so that nobody waits for it; the next one is mapped."""
        before = self.diagnostics.dropped("sweep")
        stamp_s = cloud.header.stamp.to_sec()
        self.drive_to(stamp_s)
        self.clouds.publish(cloud)
        lost = self.mapped.wait_for_stamp(stamp_s)
        self.assertTrue(lost.failure)
        self.assertEqual(lost.cloud.width, 0)
        self.assertEqual(self.mapped_sweep().failure, "")
        self.drive_to(self.clock_s + 2.0)
        self.diagnostics.wait_for_dropped("sweep", before + 1)

    def test_sweep_gets_a_vertex_in_the_map_and_keeps_its_cloud(self) -> None:
        sweep = self.mapped_sweep()
        self.assertEqual((sweep.header.frame_id, sweep.cloud.header.frame_id), ("map", "base_link"))
        self.assertEqual(len(sweep.vertex_poses), sweep.vertex_id + 1)
        self.assertEqual(sweep.cloud.width, len(self.points))
        self.assertFalse(sweep.match_refused or sweep.failure)

    def test_trajectory_and_graph_come_with_every_sweep(self) -> None:
        sweep = self.mapped_sweep()
        path = self.trajectory.wait_for_stamp(self.clock_s)
        self.assertEqual((path.header.frame_id, len(path.poses)), ("map", sweep.vertex_id + 1))
        self.assertEqual(path.poses[-1].pose, sweep.vertex_poses[-1])
        markers = self.graph.wait_for(lambda m: m.markers[0].header.stamp == sweep.header.stamp).markers
        self.assertEqual({m.header.frame_id for m in markers}, {"map"})

    def test_transform_map_to_odom_has_the_stamp_of_every_odometry(self) -> None:
        self.mapped_sweep()
        self.drive_to(self.clock_s + 1.0)
        sent = self.tf.wait_for(lambda m: abs(m.transforms[0].header.stamp.to_sec() - self.clock_s - 1.0) < 1e-6).transforms[0]
        self.assertEqual((sent.header.frame_id, sent.child_frame_id), ("map", "odom"))

    def test_refused_match_leaves_an_odometry_edge_and_says_so(self) -> None:
        self.mapped_sweep()
        PoseGraphMappingTest.answer = staticmethod(lambda _: refused_response("too little overlap"))
        self.assertTrue(self.mapped_sweep().match_refused)
        PoseGraphMappingTest.answer = staticmethod(matched_at_the_guess)
        self.assertFalse(self.mapped_sweep().match_refused)

    def test_sweep_after_a_way_of_which_odometry_knows_nothing_is_looked_for_in_the_map(self) -> None:
        before = self.mapped_sweep()
        self.drive_to(self.clock_s + 1.0)
        leap = odometry(self.clock_s + 1.05, x=3.0)
        leap.pose.covariance = np.diag([25.0, 25.0, 25.0, 0.0, 0.0, 3.0]).ravel().tolist()
        self.odometry.publish(leap)
        PoseGraphMappingTest.answer = staticmethod(lambda _: refused_response("too little overlap"))
        lost = self.mapped_sweep()
        self.assertTrue(lost.lost)
        self.assertIn("not found in the map", lost.failure)
        self.assertEqual(lost.vertex_poses, before.vertex_poses)
        PoseGraphMappingTest.answer = staticmethod(matched_at_the_guess)
        found = self.mapped_sweep()
        self.assertFalse(found.lost or found.failure or found.match_refused)
        self.assertEqual(found.vertex_id, before.vertex_id + 1)
        self.assertAlmostEqual(found.vertex_poses[-1].position.x, before.vertex_poses[-1].position.x, places=2)
        self.assertFalse(self.mapped_sweep().lost)

    def test_match_that_takes_long_holds_up_no_transform(self) -> None:
        self.mapped_sweep()
        begun, goes_on = threading.Event(), threading.Event()

        def slow(request: MatchCloudsRequest) -> MatchCloudsResponse:
            begun.set()
            goes_on.wait(120.0)
            return matched_at_the_guess(request)

        PoseGraphMappingTest.answer = staticmethod(slow)
        cloud = self.cloud()
        swept_s = self.clock_s
        self.drive_to(swept_s)
        self.clouds.publish(cloud)
        self.assertTrue(begun.wait(60.0))
        try:
            for k in range(1, 5):
                self.drive_to(swept_s + 0.5 * k)
                self.tf.wait_for(lambda m, k=k: abs(m.transforms[0].header.stamp.to_sec() - swept_s - 0.5 * k) < 1e-6, 20.0)
        finally:
            goes_on.set()
            PoseGraphMappingTest.answer = staticmethod(matched_at_the_guess)
        self.assertFalse(self.mapped.wait_for_stamp(swept_s).failure)
        PoseGraphMappingTest.clock_s = swept_s + 3.0
        self.assertFalse(self.mapped_sweep().failure)

    def test_matches_that_are_refused_in_a_row_are_told_of_until_one_is_not(self) -> None:
        said = "matches are refused"
        self.mapped_sweep()
        PoseGraphMappingTest.answer = staticmethod(lambda _: refused_response("too little overlap"))
        for _ in range(3):
            self.mapped_sweep()
        self.drive_to(self.clock_s + 1.0)
        wait_until(lambda: self.diagnostics.counts().get(said) == "3 in a row", said)
        PoseGraphMappingTest.answer = staticmethod(matched_at_the_guess)
        self.mapped_sweep()
        self.drive_to(self.clock_s + 1.0)
        wait_until(lambda: said not in self.diagnostics.message(), "it is over")

    def test_matcher_that_fails_leaves_an_odometry_edge(self) -> None:
        self.mapped_sweep()

        def fail(_: MatchCloudsRequest) -> MatchCloudsResponse:
            raise rospy.ServiceException("broken on purpose")

        PoseGraphMappingTest.answer = staticmethod(fail)
        self.assertTrue(self.mapped_sweep().match_refused)
        PoseGraphMappingTest.answer = staticmethod(matched_at_the_guess)
        self.assertFalse(self.mapped_sweep().match_refused)

    def test_sweep_waits_for_the_odometry_of_its_stamp(self) -> None:
        cloud = self.cloud()
        self.drive_to(self.clock_s - 1.0)
        self.clouds.publish(cloud)
        time.sleep(QUIET_S)
        self.assertNotIn(self.clock_s, self.mapped.stamps())
        self.drive_to(self.clock_s + 0.1)
        self.mapped.wait_for_stamp(self.clock_s)

    def test_empty_cloud_is_counted_and_reported_as_lost(self) -> None:
        self.cloud()
        self.assert_lost(cloud_message(self.clock_s, "base_link", self.points[:0], self.origins[:0]))

    def test_cloud_without_a_number_is_counted_and_reported_as_lost(self) -> None:
        self.cloud()
        self.assert_lost(cloud_message(self.clock_s, "base_link", np.full_like(self.points, np.nan), self.origins))

    def test_cloud_with_some_numbers_missing_is_mapped_without_them(self) -> None:
        holed = self.points.copy()
        holed[::10] = np.nan
        self.cloud()
        self.drive_to(self.clock_s)
        self.clouds.publish(cloud_message(self.clock_s, "base_link", holed, self.origins))
        self.mapped.wait_for_stamp(self.clock_s)

    def test_cloud_in_another_frame_is_counted_and_reported_as_lost(self) -> None:
        self.cloud()
        self.assert_lost(cloud_message(self.clock_s, "laser", self.points, self.origins))

    def test_cloud_with_a_handful_of_points_is_counted_and_reported_as_lost(self) -> None:
        self.cloud()
        self.assert_lost(cloud_message(self.clock_s, "base_link", self.points[:3], self.origins[:3]))

    def test_cloud_older_than_the_last_sweep_is_counted_and_dropped(self) -> None:
        self.drive_to(self.mapped_sweep().header.stamp.to_sec())
        before = self.diagnostics.dropped("sweep")
        self.clouds.publish(cloud_message(self.clock_s - 0.1, "base_link", self.points, self.origins))
        self.assertEqual(self.mapped_sweep().failure, "")
        self.drive_to(self.clock_s + 2.0)
        self.diagnostics.wait_for_dropped("sweep", before + 1)

    def test_odometry_that_is_no_pose_is_counted_and_dropped(self) -> None:
        PoseGraphMappingTest.clock_s += 5.0
        self.odometry.publish(odometry(self.clock_s, x=float("nan")))
        self.mapped_sweep()
        self.drive_to(self.clock_s + 2.0)
        self.diagnostics.wait_for_dropped("bad Odometry")

    def test_odometry_that_jumps_back_does_not_stop_the_node(self) -> None:
        self.mapped_sweep()
        self.drive_to(self.clock_s - 60.0)
        self.mapped_sweep()

    def test_sweep_from_before_the_clock_was_set_back_is_lost_and_holds_up_none(self) -> None:
        self.mapped_sweep()
        waiting = self.cloud()
        self.drive_to(self.clock_s - 1.0)
        self.clouds.publish(waiting)
        time.sleep(QUIET_S)
        lost_s = self.clock_s
        PoseGraphMappingTest.clock_s -= 60.0
        self.drive_to(self.clock_s)
        self.assertIn("the clock was set back", self.mapped.wait_for_stamp(lost_s).failure)
        self.assertEqual(self.mapped_sweep().failure, "")
        PoseGraphMappingTest.clock_s = lost_s

    def test_save_without_a_folder_is_no_failure(self) -> None:
        self.assertTrue(rospy.ServiceProxy(f"/{NODE}/save", Trigger)().success)

    def test_twice_sent_sweep_holds_up_no_later_one(self) -> None:
        """Its free beams are one message, and gone with the first of them. Last of all tests: from now on sweeps have free beams."""
        free = feed("/sweep_free", PointCloud2)
        for times in (2, 1):
            cloud = self.cloud()
            self.drive_to(self.clock_s)
            free.publish(cloud_message(self.clock_s, "base_link", self.points[:0], self.origins[:0]))
            for _ in range(times):
                self.clouds.publish(cloud)
            self.mapped.wait_for_stamp(self.clock_s)

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        code, stderr = run_misconfigured(NODE, "graph_dist:=20.0")
        self.assertEqual(code, 2, stderr)
        self.assertIn("did you mean graph_dist_m?", one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("pose_graph_mapping_test")
    rostest.rosrun("explore_3dnav", "pose_graph_mapping", PoseGraphMappingTest, sys.argv)
