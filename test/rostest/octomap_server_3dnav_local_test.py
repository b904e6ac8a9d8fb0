#!/usr/bin/env python3
"""octomap_server_3dnav_local_node alone: what it hands on of the classified surroundings, and what becomes of bad ones."""

import sys
import time
import unittest

import numpy as np
import rospy
from explore_3dnav.msg import TerrainGrid as TerrainGridMessage
from node_testing import QUIET_S, DiagnosticsOf, Inbox, feed, one_line_of, run_misconfigured, wait_for_node

import rostest
from octomap_server_3dnav.navigation.local_grid import TerrainGrid
from ros_adapters.grid_messages import message_of_grid, terrain_grid

NODE = "octomap_server_3dnav_local_node"
RESOLUTION_M, SIZE_M, KEPT_M = 0.08, 12.0, 8.0


def room() -> TerrainGrid:
    """A floor with a wall at x = 3, beyond which nothing is known."""
    cells = round(SIZE_M / RESOLUTION_M)
    x = (np.arange(cells) + 0.5) * RESOLUTION_M - SIZE_M / 2
    cost = np.tile(np.select([np.abs(x - 3.0) < 0.05, x < 3.0], [100, 0], -1).astype(np.int8), (cells, 1))
    height = np.where(cost == 0, np.float32(0.08), np.float32(np.nan))
    distance = np.where(cost == 0, np.tile(3.0 - x, (cells, 1)), np.where(cost == 100, 0.0, np.nan)).astype(np.float32)
    return TerrainGrid(cost, height, distance, (-SIZE_M / 2, -SIZE_M / 2), RESOLUTION_M)


class OctomapServer3dnavLocalTest(unittest.TestCase):
    clock_s = 100.0

    @classmethod
    def setUpClass(cls) -> None:
        wait_for_node(NODE)
        cls.grids = Inbox("/terrain_grid", TerrainGridMessage).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.terrains = feed("/local_terrain", TerrainGridMessage)

    def terrain(self, frame: str = "map") -> TerrainGridMessage:
        """The room, later than all before."""
        OctomapServer3dnavLocalTest.clock_s += 2.0
        return message_of_grid(self.clock_s, frame, room())

    def grid(self) -> TerrainGridMessage:
        """What comes of good surroundings."""
        self.terrains.publish(self.terrain())
        return self.grids.wait_for_stamp(self.clock_s)

    def assert_dropped(self, message: TerrainGridMessage) -> None:
        before = self.diagnostics.dropped("bad TerrainGrid")
        stamp_s = self.clock_s
        self.terrains.publish(message)
        time.sleep(QUIET_S)
        self.grid()
        self.diagnostics.wait_for_dropped("bad TerrainGrid", before + 1)
        self.assertNotIn(round(stamp_s, 6), self.grids.stamps())

    def test_middle_of_the_surroundings_is_handed_on_as_it_is(self) -> None:
        message = self.grid()
        self.assertEqual(message.header.frame_id, "map")
        grid, whole = terrain_grid(message), room()
        self.assertAlmostEqual(len(grid.cost) * RESOLUTION_M, KEPT_M, delta=2 * RESOLUTION_M)
        first = round((grid.origin_xy[0] + SIZE_M / 2) / RESOLUTION_M)
        there = np.s_[first : first + len(grid.cost), first : first + len(grid.cost)]
        for name in ("cost", "height", "distance"):
            np.testing.assert_array_equal(getattr(grid, name), getattr(whole, name)[there])

    def test_surroundings_without_distances_are_counted_and_dropped(self) -> None:
        message = self.terrain()
        message.distance = message.distance[:7]
        self.assert_dropped(message)

    def test_surroundings_without_resolution_are_counted_and_dropped(self) -> None:
        message = self.terrain()
        message.info.resolution = 0.0
        self.assert_dropped(message)

    def test_surroundings_in_another_frame_are_counted_and_dropped(self) -> None:
        self.assert_dropped(self.terrain("odom"))

    def test_time_that_jumps_back_starts_afresh(self) -> None:
        self.grid()
        forward_s = self.clock_s
        OctomapServer3dnavLocalTest.clock_s = forward_s - 60.0
        self.grid()
        OctomapServer3dnavLocalTest.clock_s = forward_s + 10.0

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        code, stderr = run_misconfigured(NODE, "size:=3.0")
        self.assertEqual(code, 2, stderr)
        self.assertIn("did you mean size_m?", one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("octomap_server_3dnav_local_test")
    rostest.rosrun("explore_3dnav", "octomap_server_3dnav_local", OctomapServer3dnavLocalTest, sys.argv)
