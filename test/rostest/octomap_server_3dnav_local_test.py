#!/usr/bin/env python3
"""octomap_server_3dnav_local_node alone: the terrain grid of an octomap and a pose, and what becomes of bad ones."""

import sys
import time
import unittest

import numpy as np
import rospy
from explore_3dnav.msg import TerrainGrid
from nav_msgs.msg import Path
from node_testing import QUIET_S, DiagnosticsOf, Inbox, feed, floor_and_walls, one_line_of, run_misconfigured, wait_for_node

import rostest
from octomap_server_3dnav.octree.octree import OctreeMap
from rigid_geometry import transform_from_rpy, transform_points
from ros_adapters.conversions import terrain_grid_arrays
from ros_adapters.graph_markers import trajectory_message
from ros_adapters.octomap_messages import Octomap, octomap_message

NODE = "octomap_server_3dnav_local_node"
RESOLUTION_M = 0.08
T_MAP_BASE = transform_from_rpy((0.0, 0.0, 0.132))


class OctomapServer3dnavLocalTest(unittest.TestCase):
    clock_s = 100.0

    @classmethod
    def setUpClass(cls) -> None:
        wait_for_node(NODE)
        cls.grids = Inbox("/terrain_grid", TerrainGrid).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.octomaps = feed("/octomap_local", Octomap)
        cls.trajectories = feed("/trajectory", Path)
        points, origins = (transform_points(T_MAP_BASE, a) for a in floor_and_walls())
        tree = OctreeMap(RESOLUTION_M)
        tree.insert_sweep(points, origins)
        tree.insert_plane((0.0, 0.0, -0.02), 0.8)
        cls.data = tree.to_binary()

    def octomap(self) -> Octomap:
        """The room, later than all before."""
        OctomapServer3dnavLocalTest.clock_s += 2.0
        return octomap_message(self.clock_s, "map", RESOLUTION_M, self.data, binary=True)

    def grid(self) -> TerrainGrid:
        """What comes of a good octomap and its pose."""
        self.octomaps.publish(self.octomap())
        self.publish_pose(self.clock_s)
        return self.grids.wait_for_stamp(self.clock_s)

    def publish_pose(self, stamp_s: float, T_map_base: np.ndarray = T_MAP_BASE) -> None:
        self.trajectories.publish(trajectory_message(stamp_s, [stamp_s], np.stack([T_map_base])))

    def assert_dropped(self, message: Octomap) -> None:
        before = self.diagnostics.dropped("bad Octomap")
        stamp_s = self.clock_s
        self.octomaps.publish(message)
        self.publish_pose(stamp_s)
        time.sleep(QUIET_S)
        self.grid()
        self.diagnostics.wait_for_dropped("bad Octomap", before + 1)
        self.assertNotIn(round(stamp_s, 6), self.grids.stamps())

    def test_grid_has_stamp_and_frame_and_shows_floor_and_walls(self) -> None:
        message = self.grid()
        self.assertEqual(message.header.frame_id, "map")
        cost, height, origin_xy, resolution = terrain_grid_arrays(message)
        at = lambda x, y: (int((y - origin_xy[1]) / resolution), int((x - origin_xy[0]) / resolution))  # noqa: E731
        self.assertEqual(cost[at(1.0, 1.0)], 0)
        self.assertAlmostEqual(float(height[at(1.0, 1.0)]), 0.0, delta=RESOLUTION_M)
        self.assertTrue((cost[at(0.0, 3.0)[0] - 2 : at(0.0, 3.0)[0] + 3, at(0.0, 3.0)[1]] == 100).any())
        self.assertEqual(cost[at(3.8, 3.8)], -1)

    def test_octomap_waits_for_the_pose_of_its_stamp(self) -> None:
        self.octomaps.publish(self.octomap())
        self.publish_pose(self.clock_s - 1.0)
        time.sleep(QUIET_S)
        self.assertNotIn(round(self.clock_s, 6), self.grids.stamps())
        self.publish_pose(self.clock_s)
        self.grids.wait_for_stamp(self.clock_s)

    def test_octomap_of_another_kind_is_counted_and_dropped(self) -> None:
        message = self.octomap()
        message.id = "ColorOcTree"
        self.assert_dropped(message)

    def test_octomap_without_resolution_is_counted_and_dropped(self) -> None:
        message = self.octomap()
        message.resolution = 0.0
        self.assert_dropped(message)

    def test_octomap_that_is_cut_off_is_counted_and_dropped(self) -> None:
        message = self.octomap()
        message.data = message.data[: len(message.data) // 2]
        self.assert_dropped(message)

    def test_octomap_in_another_frame_is_counted_and_dropped(self) -> None:
        message = self.octomap()
        message.header.frame_id = "odom"
        self.assert_dropped(message)

    def test_pose_that_is_none_is_counted_and_dropped(self) -> None:
        self.octomaps.publish(self.octomap())
        broken = trajectory_message(self.clock_s, [self.clock_s], np.stack([T_MAP_BASE]))
        broken.poses[-1].pose.position.x = float("nan")
        self.trajectories.publish(broken)
        self.grid()
        self.diagnostics.wait_for_dropped("bad Path")

    def test_empty_trajectory_does_no_harm(self) -> None:
        self.trajectories.publish(Path())
        self.grid()

    def test_time_that_jumps_back_starts_afresh(self) -> None:
        self.grid()
        forward_s = self.clock_s
        OctomapServer3dnavLocalTest.clock_s = forward_s - 60.0
        self.grid()
        OctomapServer3dnavLocalTest.clock_s = forward_s + 10.0

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        code, stderr = run_misconfigured(NODE, "radius:=3.0")
        self.assertEqual(code, 2, stderr)
        self.assertIn("did you mean radius_m?", one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("octomap_server_3dnav_local_test")
    rostest.rosrun("explore_3dnav", "octomap_server_3dnav_local", OctomapServer3dnavLocalTest, sys.argv)
