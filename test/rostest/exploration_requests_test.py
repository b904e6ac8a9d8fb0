#!/usr/bin/env python3
"""What people ask of exploration at octomap_server_3dnav_node, with a made-up robot: start, stop, home, and the state that is told."""

import sys
import unittest
from collections.abc import Sequence

import numpy as np
import rospy
from explore_3dnav.msg import ExplorationDecision, ExploreStatus, MappedSweep, RunEvent, TerrainGrid, Zone, ZoneList
from explore_3dnav.srv import PlanPath, SetZones, StorePlan, StorePlanRequest, StorePlanResponse
from geometry_msgs.msg import Point32, Polygon, PoseStamped
from node_testing import Inbox, feed, floor_and_walls, wait_for_node, wait_until
from std_srvs.srv import Empty, Trigger, TriggerRequest, TriggerResponse
from visualization_msgs.msg import MarkerArray

import rostest
from octomap_server_3dnav.navigation.local_grid import TerrainGrid as Grid
from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import cloud_message, header, pose_message
from ros_adapters.grid_messages import terrain_grid

NODE = "octomap_server_3dnav_node"
HOME, AWAY = (0.0, 0.0, 0.4), (1.5, 1.0, 0.0)  # x, y, yaw


def square(low: float, high: float) -> list[tuple[float, float]]:
    return [(low, low), (high, low), (high, high), (low, high)]


def cost_at(grid: Grid, x: float, y: float) -> int:
    row, column = (int((v - o) / grid.resolution) for v, o in ((y, grid.origin_xy[1]), (x, grid.origin_xy[0])))
    return int(grid.cost[row, column])


def closes(message: TerrainGrid, x: float, y: float) -> bool:
    return cost_at(terrain_grid(message), x, y) == 100


class ExplorationRequestsTest(unittest.TestCase):
    """One robot, one life: the tests run by their names."""

    clock_s = 100.0
    places: list[tuple[float, float, float]] = []
    plans: list[StorePlanRequest] = []
    recalls = replans = 0

    @classmethod
    def setUpClass(cls) -> None:
        cls.services = [
            rospy.Service("storePlan", StorePlan, cls.store),
            rospy.Service("/move_base_node/recall", Trigger, cls.recall),
            rospy.Service("/move_base_node/replan", Trigger, cls.replan),
        ]
        wait_for_node(NODE)
        cls.decisions = Inbox("/exploration/decision", ExplorationDecision).wait_until_connected()
        cls.events, cls.sweeps = feed("/exploration/event", RunEvent), feed("/mapped_sweep", MappedSweep)
        points, origins = floor_and_walls()
        inside = points[:, 0] < 2.9  # the wall ahead is missing: what lies behind is unknown
        cls.points, cls.origins = points[inside], origins[inside]

    @classmethod
    def store(cls, request: StorePlanRequest) -> StorePlanResponse:
        cls.plans.append(request)
        return StorePlanResponse(True, "")

    @classmethod
    def recall(cls, _request: TriggerRequest) -> TriggerResponse:
        cls.recalls += 1
        return TriggerResponse(True, "")

    @classmethod
    def replan(cls, _request: TriggerRequest) -> TriggerResponse:
        cls.replans += 1
        return TriggerResponse(True, "")

    def sweep(self, x: float, y: float, yaw: float) -> ExplorationDecision:
        """The decision after a sweep from a place in the room, made at a goal."""
        cls = type(self)
        cls.clock_s += 2.0
        cls.places.append((x, y, yaw))
        T = transform_from_rpy((x, y, 0.132), (0.0, 0.0, yaw))
        points = (self.points.astype(np.float64) - (x, y, 0.0)) @ T[:3, :3]
        message = MappedSweep(header=header(self.clock_s, "map"), vertex_id=len(self.places) - 1)
        message.vertex_poses = [pose_message(transform_from_rpy((*xy, 0.132), (0.0, 0.0, heading))) for *xy, heading in self.places]
        message.cloud = cloud_message(self.clock_s, "base_link", points.astype(np.float32), self.origins)
        self.sweeps.publish(message)
        return self.decisions.wait_for_stamp(self.clock_s)

    def event(self, state: str, reason: str = "") -> None:
        self.events.publish(RunEvent(header(self.clock_s, "odom"), state, reason, len(self.places), False, "", 0.0, False, 0.0))

    def ask(self, name: str) -> tuple[bool, str]:
        answer = rospy.ServiceProxy(f"/explore/{name}", Trigger)()
        return answer.success, answer.message

    def status(self) -> ExploreStatus:
        """As somebody hears it who comes late."""
        late = Inbox("/explore/status", ExploreStatus)
        return late.wait_for()

    def wait_for_status(self, state: str, reason: str = "") -> None:
        wait_until(lambda: (s := self.status()).state == state and reason in s.reason, f"{state} because of {reason!r}")

    def test_1_before_the_first_sweep_nobody_knows_where_home_is(self) -> None:
        self.assertEqual(self.status().state, "exploring")
        for name in ("return_home", "stop"):
            done, why = self.ask(name)
            self.assertEqual((done, why.split(":")[0]), (False, "no sweep is in the map yet"))
        self.assertEqual(self.recalls, 0)

    def test_2_robot_that_is_asked_home_is_led_there_and_waits(self) -> None:
        self.assertEqual(self.sweep(*HOME).kind, "goal")
        self.event("driving", "goal: frontier")
        self.wait_for_status("exploring", "frontier")
        self.assertEqual(self.ask("start"), (False, "exploring already"))
        self.assertEqual(self.ask("return_home"), (True, "going home"))
        self.assertEqual(self.recalls, 1)
        self.wait_for_status("going_home")
        again, why = self.ask("return_home")
        self.assertEqual((again, why.split(":")[0]), (False, "already going home"))
        way = self.sweep(*AWAY)
        self.assertIn("going home", way.reason)
        end = self.plans[-1].plan.poses[-1].pose
        np.testing.assert_allclose((end.position.x, end.position.y), HOME[:2], atol=1e-6)
        self.assertAlmostEqual(2 * np.arctan2(end.orientation.z, end.orientation.w), HOME[2], places=5)
        self.assertEqual((self.plans[-1].exact, self.plans[-1].wait), (True, ""))
        self.event("paused", "exploration was paused")
        self.wait_for_status("paused", "exploration was paused")
        self.event("driving", "goal: going home")
        self.wait_for_status("going_home", "told to return home")
        self.assertEqual(self.sweep(*HOME).kind, "keep")  # it drives by
        self.event("sweeping", "reached: at the goal")
        wait_until(lambda: self.sweep(*HOME).kind == "wait", "home")  # event and sweep come by two topics: either may be first
        self.assertEqual(len(self.plans[-1].plan.poses), 0)
        self.assertIn("; home, 0.00 m", self.plans[-1].wait)
        self.event("paused", self.plans[-1].wait)
        self.wait_for_status("home", "; home, 0.00 m")
        self.assertFalse(self.ask("return_home")[0])

    def test_3_from_home_exploration_is_started_again(self) -> None:
        self.assertTrue(self.ask("start")[0])
        self.assertEqual(self.recalls, 2)
        self.event("sweeping")
        self.assertIn("frontier", self.sweep(*HOME).reason)
        self.event("driving", "goal: frontier")
        self.wait_for_status("exploring", "frontier")

    def test_4_exploration_that_is_stopped_has_ended_until_it_is_started(self) -> None:
        self.assertTrue(self.ask("stop")[0])
        ended = self.sweep(*AWAY)
        self.assertEqual((ended.kind, ended.reason), ("ended", "told to stop"))
        self.event("finished", "ended: told to stop")
        self.wait_for_status("done", "told to stop")
        again, why = self.ask("stop")
        self.assertEqual((again, why), (False, "exploration has ended already: ended: told to stop"))
        self.assertTrue(self.ask("start")[0])

    def set_zones(
        self, bounds: Sequence[Sequence[tuple[float, float]]], no_go: Sequence[Sequence[tuple[float, float]]] = (), frame: str = "map"
    ) -> tuple[bool, str]:
        bounds, no_go = ([Zone(polygon=Polygon([Point32(x, y, 0.0) for x, y in p])) for p in zones] for zones in (bounds, no_go))
        answer = rospy.ServiceProxy("/explore/set_zones", SetZones)(header(0.0, frame), bounds, no_go)
        return answer.accepted, answer.message

    def test_5_zones_close_costmap_and_goals_at_once_and_frontiers_from_the_next_sweep_on(self) -> None:
        grids = Inbox("/local_terrain", TerrainGrid).wait_until_connected()
        markers = Inbox("/explore/zones", MarkerArray).wait_until_connected()
        self.event("driving", "goal: frontier")
        self.assertEqual(self.sweep(*HOME).kind, "goal")  # started again, it looks for the missing wall
        self.assertEqual(self.set_zones([square(-2.5, 2.0)], [square(1.0, 1.5)]), (True, "1 bounds, 1 no-go zones"))
        self.assertEqual(self.replans, 1)
        grid = terrain_grid(grids.wait_for(lambda m: closes(m, 2.5, 0.0)))
        self.assertEqual(cost_at(grid, 0.5, 0.5), 0)
        self.assertEqual(cost_at(grid, 1.25, 1.25), 100)
        shown = markers.wait_for(lambda m: len(m.markers) == 3).markers
        self.assertEqual([m.ns for m in shown[1:]], ["bounds", "no_go"])
        plan_path = rospy.ServiceProxy(f"/{NODE}/plan_path", PlanPath)
        here, inside, zone, outside = (
            PoseStamped(header(0.0, "map"), pose_message(transform_from_rpy((x, y, 0.0))))
            for x, y in ((0, 0), (-1, -1), (1.25, 1.25), (2.4, 0))
        )
        self.assertTrue(plan_path(here, inside, 0.5).plan.poses)
        for goal, why in ((zone, r"the goal at \(1.25, 1.25\) lies in no_go\[0\]"), (outside, "lies outside the bounds")):
            with self.assertRaisesRegex(rospy.ServiceException, why):
                plan_path(here, goal, 0.5)
        self.assertEqual(self.sweep(*HOME).kind, "explored")

    def test_6_zones_that_are_none_or_close_out_the_robot_are_refused_and_change_nothing(self) -> None:
        replans, size = self.replans, 2.5
        cross = [(-size, -size), (size, size), (size, -size), (-size, size)]
        for zones, why in (
            (([cross],), "bounds[0]: its sides cross"),
            (([[(0.0, 0.0)]],), "three corners"),
            (([square(1.0, 2.0)],), "the robot at (0.00, 0.00) lies outside the bounds"),
            (([], [square(-1.0, 1.0)]), "the robot at (0.00, 0.00) lies in no_go[0]"),
            (([], [], "odom"), "zones in frame 'odom', expected 'map'"),
        ):
            accepted, message = self.set_zones(*zones)
            self.assertFalse(accepted, why)
            self.assertIn(why, message)
        self.assertEqual(self.replans, replans)
        self.assertEqual(self.sweep(*HOME).kind, "explored")
        self.assertEqual(self.set_zones([]), (True, "0 bounds, 0 no-go zones"))
        self.assertEqual(self.sweep(*HOME).kind, "goal")

    def test_7_zones_that_are_set_after_a_reset_hold_and_are_told(self) -> None:
        lists = Inbox("/explore/zone_list", ZoneList).wait_until_connected()
        rospy.ServiceProxy(f"/{NODE}/reset", Empty)()
        self.places.clear()
        replans = self.replans
        self.assertEqual(self.set_zones([square(-2.5, 2.0)]), (True, "1 bounds, 0 no-go zones"))
        lists.wait_for(lambda m: len(m.bounds) == 1)
        self.assertEqual(self.replans, replans + 1)
        grids = Inbox("/local_terrain", TerrainGrid).wait_until_connected()
        self.sweep(*HOME)
        grids.wait_for(lambda m: m.header.stamp.to_sec() == self.clock_s and closes(m, 2.5, 0.0))

    def test_8_robot_that_has_failed_is_asked_for_nothing_but_to_explore_anew(self) -> None:
        self.event("failed", "the sweep did not begin")
        self.wait_for_status("failed", "the sweep did not begin")
        for name in ("stop", "return_home"):
            self.assertEqual(self.ask(name), (False, "the robot has failed: the sweep did not begin"))
        self.assertEqual(self.ask("start"), (True, "exploring, with a sweep from here"))


if __name__ == "__main__":
    rospy.init_node("exploration_requests_test")
    rostest.rosrun("explore_3dnav", "exploration_requests", ExplorationRequestsTest, sys.argv)
