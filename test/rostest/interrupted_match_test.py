#!/usr/bin/env python3
"""Ctrl-C while pose_graph_mapping_node waits for a match: the files hold the sweeps that are there and the vertices that belong to them."""

import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

import rospy
from explore_3dnav.msg import MappedSweep
from explore_3dnav.srv import MatchClouds, MatchCloudsRequest, MatchCloudsResponse
from nav_msgs.msg import Odometry
from node_testing import Inbox, feed, floor_and_walls, odometry, wait_for_node
from pose_graph_mapping_test import matched_at_the_guess
from sensor_msgs.msg import PointCloud2

import rostest
from pose_graph_mapping.graph.pose_graph import PoseGraph
from pose_graph_mapping.session.session_store import SessionStore
from ros_adapters.conversions import cloud_message

NODE = "pose_graph_mapping_node"
PROGRAM = Path(__file__).resolve().parents[2] / "nodes" / NODE


class SlowMatcher:
    """match_clouds that lets a call wait, and then answers or fails."""

    def __init__(self) -> None:
        self.waits, self.goes_on, self.fails, self.is_slow = threading.Event(), threading.Event(), False, False
        rospy.Service("match_clouds", MatchClouds, self._answer, buff_size=2**25)

    def _answer(self, request: MatchCloudsRequest) -> MatchCloudsResponse:
        if self.is_slow:
            self.waits.set()
            self.goes_on.wait(120.0)
            if self.fails:
                raise rospy.ServiceException("ended")
        return matched_at_the_guess(request)


class InterruptedMatchTest(unittest.TestCase):
    def session_after_interrupt(self, matcher_fails: bool) -> Path:
        """The folder of a node with two sweeps in its map that was interrupted while it matched the third."""
        folder = Path(tempfile.mkdtemp())
        node = subprocess.Popen([sys.executable, str(PROGRAM), f"__name:={NODE}", f"_out:={folder}"])
        self.addCleanup(node.kill)
        MATCHER.waits.clear()
        MATCHER.goes_on.clear()
        MATCHER.fails, MATCHER.is_slow = matcher_fails, False
        wait_for_node(NODE)
        mapped = Inbox("/mapped_sweep", MappedSweep).wait_until_connected()
        clouds, driven = feed("/sweep_cloud", PointCloud2), feed("/odom", Odometry)
        points, origins = floor_and_walls()
        for stamp_s in (10.0, 20.0, 30.0):
            MATCHER.is_slow = stamp_s == 30.0
            for before_s in (0.1, 0.05, 0.0):
                driven.publish(odometry(stamp_s - before_s, x=0.01 * stamp_s))
            clouds.publish(cloud_message(stamp_s, "base_link", points, origins))
            if not MATCHER.is_slow:
                mapped.wait_for_stamp(stamp_s)
        self.assertTrue(MATCHER.waits.wait(60.0), "the third sweep is not matched")
        node.send_signal(signal.SIGINT)
        time.sleep(3.0)  # until it knows
        MATCHER.goes_on.set()
        node.wait(60.0)
        return folder

    def assert_whole(self, folder: Path, sweeps: int) -> None:
        stored = SessionStore(folder).sweeps
        stamps = [float(line.split()[0]) for line in (folder / "trajectory.txt").read_text().splitlines()]
        self.assertEqual(stamps, [s.stamp_s for s in stored])
        self.assertEqual((len(stored), len(PoseGraph.load_g2o(folder / "graph.g2o"))), (sweeps, sweeps))
        self.assertGreater((folder / "cloud.ply").stat().st_size, 10_000)

    def test_sweep_whose_match_ends_is_in_the_map(self) -> None:
        self.assert_whole(self.session_after_interrupt(matcher_fails=False), 3)

    def test_sweep_whose_matcher_ends_is_given_up_and_the_map_is_kept(self) -> None:
        self.assert_whole(self.session_after_interrupt(matcher_fails=True), 2)


if __name__ == "__main__":
    rospy.init_node("interrupted_match_test")
    MATCHER = SlowMatcher()
    rostest.rosrun("explore_3dnav", "interrupted_match", InterruptedMatchTest, sys.argv)
