#!/usr/bin/env python3
"""octomap_server_3dnav_node with a made-up follower: map, decision and path for a sweep, and what becomes of bad ones."""

import sys
import unittest

import numpy as np
import rospy
from explore_3dnav.msg import ExplorationDecision, MappedSweep, TerrainGrid
from explore_3dnav.srv import PlanPath, StorePlan, StorePlanRequest, StorePlanResponse
from geometry_msgs.msg import Point, PoseStamped
from nav_msgs.msg import Path
from nav_msgs.srv import GetPlan
from node_testing import DiagnosticsOf, Inbox, feed, floor_and_walls, octomap_bytes, one_line_of, run_misconfigured, wait_for_node
from std_srvs.srv import Empty, Trigger
from visualization_msgs.msg import Marker, MarkerArray

import rostest
from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.octree.octree import OctreeMap
from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import cloud_message, header, pose_message
from ros_adapters.grid_messages import terrain_grid
from ros_adapters.octomap_messages import BoundingBoxQuery, GetOctomap, Octomap

NODE = "octomap_server_3dnav_node"
T_MAP_BASE = transform_from_rpy((0.0, 0.0, 0.132))


class OctomapServer3dnavTest(unittest.TestCase):
    clock_s = 100.0
    mapped = 0
    refuses_plans = False
    plans: list[Path] = []

    @classmethod
    def setUpClass(cls) -> None:
        cls.service = rospy.Service("storePlan", StorePlan, cls.store)
        wait_for_node(NODE)
        cls.decisions = Inbox("/exploration/decision", ExplorationDecision).wait_until_connected()
        cls.local = Inbox("/local_terrain", TerrainGrid).wait_until_connected()
        cls.full = Inbox("/octomap_full", Octomap).wait_until_connected()
        cls.binary = Inbox("/octomap_binary", Octomap).wait_until_connected()
        cls.markers = Inbox("/terrain_markers", MarkerArray).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.sweeps = feed("/mapped_sweep", MappedSweep)
        points, origins = floor_and_walls()
        inside = points[:, 0] < 2.9  # the wall ahead is missing: what lies behind is unknown
        cls.points, cls.origins = points[inside], origins[inside]

    @classmethod
    def store(cls, request: StorePlanRequest) -> StorePlanResponse:
        cls.plans.append(request.plan)
        return StorePlanResponse(not cls.refuses_plans, "refused on purpose" if cls.refuses_plans else "")

    def sweep(self, points: np.ndarray | None = None, frame: str = "base_link") -> MappedSweep:
        """The next sweep from the same place, with the vertices of those that were mapped."""
        OctomapServer3dnavTest.clock_s += 2.0
        points = self.points if points is None else points
        message = MappedSweep(header=header(self.clock_s, "map"), vertex_id=self.mapped)
        message.vertex_poses = [pose_message(T_MAP_BASE)] * (self.mapped + 1)
        message.cloud = cloud_message(self.clock_s, frame, points, np.tile(self.origins[:1], (len(points), 1)))
        return message

    def decision(self) -> ExplorationDecision:
        """The answer to a good sweep."""
        self.sweeps.publish(self.sweep())
        answer = self.decisions.wait_for_stamp(self.clock_s)
        OctomapServer3dnavTest.mapped += 1
        return answer

    def assert_dropped(self, message: MappedSweep) -> None:
        """A sweep that is counted and gets no decision; the next one gets one."""
        before = self.diagnostics.dropped("bad MappedSweep")
        self.sweeps.publish(message)
        self.decision()
        self.diagnostics.wait_for_dropped("bad MappedSweep", before + 1)
        self.assertNotIn(round(message.header.stamp.to_sec(), 6), self.decisions.stamps())

    def test_decision_has_stamp_and_frame_of_the_sweep_and_a_goal_at_the_unknown(self) -> None:
        answer = self.decision()
        self.assertEqual((answer.kind, answer.header.frame_id), ("goal", "map"), answer.reason)
        self.assertGreater(answer.frontier.x, 1.5)
        self.assertGreaterEqual(answer.open_frontiers, 1)

    def test_path_to_the_goal_is_stored_in_the_map_frame(self) -> None:
        self.plans.clear()
        answer = self.decision()
        self.assertEqual(self.plans[-1].header.frame_id, "map")
        self.assertEqual(self.plans[-1].header.stamp, answer.header.stamp)
        self.assertGreaterEqual(len(self.plans[-1].poses), 2)
        first = self.plans[-1].poses[0].pose.position
        self.assertLess(np.hypot(first.x, first.y), 0.3)

    def test_local_terrain_holds_the_classified_surroundings(self) -> None:
        self.decision()
        grid = terrain_grid(self.local.wait_for_stamp(self.clock_s))
        at = lambda x, y: (int((y - grid.origin_xy[1]) / grid.resolution), int((x - grid.origin_xy[0]) / grid.resolution))  # noqa: E731
        self.assertEqual(grid.cost[at(1.0, 1.0)], 0)
        self.assertAlmostEqual(float(grid.height[at(1.0, 1.0)]), 0.0, delta=grid.resolution)
        row, column = at(-3.0, 0.0)
        self.assertTrue((grid.cost[row, column - 2 : column + 3] == 100).any())
        self.assertAlmostEqual(float(grid.distance[at(-2.5, 0.0)]), 0.5, delta=0.1)
        self.assertEqual(grid.cost[at(5.5, 5.5)], -1)

    def test_octomaps_of_the_whole_can_be_read(self) -> None:
        self.decision()
        full, binary = self.full.wait_for_stamp(self.clock_s), self.binary.wait_for_stamp(self.clock_s)
        maps = OctreeMap.from_full(octomap_bytes(full), full.resolution), OctreeMap.from_binary(octomap_bytes(binary), binary.resolution)
        self.assertEqual(*(len(tree.occupied_voxels()[0]) for tree in maps))

    def test_octomaps_are_served_by_the_names_of_octomap_server(self) -> None:
        self.decision()
        served = [rospy.ServiceProxy(name, GetOctomap)().map for name in ("/octomap_binary", "/octomap_full")]
        published = [inbox.wait_for_stamp(self.clock_s) for inbox in (self.binary, self.full)]
        self.assertEqual([octomap_bytes(m) for m in served], [octomap_bytes(m) for m in published])
        self.assertEqual([m.header.frame_id for m in served], ["map", "map"])

    def test_box_is_cleared_by_the_service_of_octomap_server(self) -> None:
        self.decision()
        served = rospy.ServiceProxy("/octomap_full", GetOctomap)
        centers, _ = OctreeMap.from_full(octomap_bytes(served().map), 0.08).occupied_voxels()
        wall = centers[centers[:, 2] > 0.4][:1]
        clear = rospy.ServiceProxy(f"/{NODE}/clear_bbx", BoundingBoxQuery)
        clear(Point(*(wall[0] - 0.03)), Point(*(wall[0] + 0.03)))
        states = OctreeMap.from_full(octomap_bytes(served().map), 0.08).states_at(wall)
        self.assertEqual(states.tolist(), [VoxelState.FREE])
        with self.assertRaisesRegex(rospy.ServiceException, "lo <= hi"):
            clear(Point(1.0, 0.0, 0.0), Point(0.0, 1.0, 1.0))

    def classes_of_last_sweep(self) -> list[Marker]:
        """The whole map's classes, by which plans are made from now on."""
        return self.markers.wait_for(lambda m: abs(m.markers[0].header.stamp.to_sec() - self.clock_s) < 1e-6).markers

    def test_classes_are_shown_in_the_map_frame(self) -> None:
        self.decision()
        shown = self.classes_of_last_sweep()
        self.assertEqual({m.header.frame_id for m in shown}, {"map"})
        self.assertIn("traversable", [m.ns for m in shown if m.points])

    def test_frontiers_are_shown_with_their_cost_as_by_explore_lite_and_the_goal_before_the_chosen_one(self) -> None:
        shown = Inbox("/explore/frontiers", MarkerArray).wait_until_connected()
        answer = self.decision()
        markers = shown.wait_for(lambda m: len(m.markers) > 1 and abs(m.markers[1].header.stamp.to_sec() - self.clock_s) < 1e-6).markers
        self.assertEqual(markers[0].action, Marker.DELETEALL)
        balls, costs, (goal,) = ([m for m in markers[1:] if m.ns == name] for name in ("frontiers", "cost", "goal"))
        self.assertEqual((len(balls), len(costs)), (answer.open_frontiers, answer.open_frontiers))
        chosen = [m for m in balls if m.color.g > m.color.b]
        self.assertEqual([m.pose.position for m in chosen], [answer.frontier])
        self.assertEqual([float(m.text) for m in costs], sorted(float(m.text) for m in costs))
        end = self.plans[-1].poses[-1].pose
        np.testing.assert_allclose((goal.pose.position.x, goal.pose.position.y), (end.position.x, end.position.y), atol=1e-6)
        self.assertEqual({m.header.frame_id for m in markers}, {"map"})

    def test_empty_cloud_is_counted_and_dropped(self) -> None:
        self.assert_dropped(self.sweep(self.points[:0]))

    def test_cloud_without_a_number_is_counted_and_dropped(self) -> None:
        self.assert_dropped(self.sweep(np.full_like(self.points, np.nan)))

    def test_cloud_in_another_frame_is_counted_and_dropped(self) -> None:
        self.assert_dropped(self.sweep(frame="laser"))

    def test_sweep_with_poses_of_others_is_counted_and_dropped(self) -> None:
        message = self.sweep()
        message.vertex_poses = message.vertex_poses * 3
        self.assert_dropped(message)

    def test_sweep_that_is_nowhere_is_counted_and_dropped(self) -> None:
        message = self.sweep()
        message.vertex_poses, message.failure = [], "placed by nobody"
        self.assert_dropped(message)

    def test_sweep_with_a_pose_that_is_none_is_counted_and_dropped(self) -> None:
        message = self.sweep()
        message.vertex_poses = [*message.vertex_poses[:-1], pose_message(T_MAP_BASE)]
        message.vertex_poses[-1].position.x = float("nan")
        self.assert_dropped(message)

    def test_sweep_that_was_lost_is_answered_all_the_same(self) -> None:
        self.decision()
        message = self.sweep(self.points[:0])
        message.failure = "lost on purpose"
        self.sweeps.publish(message)
        self.decisions.wait_for_stamp(self.clock_s)
        self.decision()
        self.diagnostics.wait_for_dropped("sweep not mapped")

    def test_make_plan_leads_over_the_ground_and_nowhere_else(self) -> None:
        self.decision()
        make_plan = rospy.ServiceProxy(f"/{NODE}/make_plan", GetPlan)
        near = PoseStamped(header(0.0, "map"), pose_message(transform_from_rpy((1.0, 0.5, 0.0))))
        plan = make_plan(PoseStamped(), near, 0.5).plan
        self.assertEqual(plan.header.frame_id, "map")
        self.assertLess(np.hypot(plan.poses[-1].pose.position.x - 1.0, plan.poses[-1].pose.position.y - 0.5), 0.5)
        far = PoseStamped(header(0.0, "map"), pose_message(transform_from_rpy((50.0, 0.0, 0.0))))
        self.assertEqual(make_plan(PoseStamped(), far, 0.5).plan.poses, [])
        start = PoseStamped(header(0.0, "map"), pose_message(transform_from_rpy((-1.0, 0.5, 0.0))))
        first = make_plan(start, near, 0.5).plan.poses[0].pose.position
        self.assertLess(np.hypot(first.x + 1.0, first.y - 0.5), 0.5)
        self.assertEqual(make_plan(far, near, 0.5).plan.poses, [])
        near.pose.position.z = float("nan")
        self.assertEqual(make_plan(PoseStamped(), near, 0.5).plan.poses[-1].pose, plan.poses[-1].pose)

    def test_make_plan_is_found_under_move_bases_name_and_says_what_it_lacks(self) -> None:
        self.decision()
        make_plan = rospy.ServiceProxy("/move_base/make_plan", GetPlan)
        near = PoseStamped(header=header(0.0, "map"))
        near.pose.position.x = 1.0  # without a heading: rosservice's users leave it out
        end = make_plan(PoseStamped(), near, 0.5).plan.poses[-1].pose
        self.assertLess(np.hypot(end.position.x - 1.0, end.position.y), 0.5)
        nowhere = PoseStamped(header=header(0.0, "map"))
        nowhere.pose.position.x = float("nan")
        for goal, reason in (
            (PoseStamped(), "without a frame"),
            (PoseStamped(header(0.0, "kitchen"), near.pose), "kitchen"),
            (nowhere, "no numbers"),
        ):
            with self.assertRaisesRegex(rospy.ServiceException, reason):
                make_plan(PoseStamped(), goal, 0.5)

    def test_plan_path_leads_where_make_plan_does_and_tells_that_it_is_whole(self) -> None:
        self.decision()
        here, near = (PoseStamped(header(0.0, "map"), pose_message(transform_from_rpy(xyz))) for xyz in ((0.0, 0.0, 0.0), (1.0, 0.5, 0.0)))
        plan = rospy.ServiceProxy(f"/{NODE}/make_plan", GetPlan)(PoseStamped(), near, 0.5).plan
        plan_path = rospy.ServiceProxy(f"/{NODE}/plan_path", PlanPath)
        answer = plan_path(here, near, 0.5)
        self.assertEqual(answer.plan.poses[-1].pose, plan.poses[-1].pose)
        self.assertEqual((answer.whole, any(answer.straight)), (True, False))
        with self.assertRaisesRegex(rospy.ServiceException, "odom"):
            plan_path(PoseStamped(header(0.0, "odom"), here.pose), near, 0.5)
        near.pose.position.x = 50.0
        self.assertEqual(plan_path(here, near, 0.5).plan.poses, [])

    def test_make_plan_leads_through_a_door_without_room_to_turn_and_plan_path_up_to_it(self) -> None:
        points, origins = floor_and_walls()
        wall = points[(points[:, 0] > 2.99) & (abs(points[:, 1]) > 0.48)] - np.float32([1.4, 0.0, 0.0])
        behind = points + np.float32([4.6, 0.0, 0.0])
        x, y, _ = (behind - origins).T
        behind = behind[(abs(y) * 1.4 < 0.45 * x) & (behind[:, 0] > 1.6)]  # what is seen through the door
        reset = rospy.ServiceProxy(f"/{NODE}/reset", Empty)
        reset()
        self.sweeps.publish(self.sweep(np.concatenate([points[points[:, 0] < 1.6], wall, behind])))
        OctomapServer3dnavTest.mapped += 1
        self.classes_of_last_sweep()
        here, far = (PoseStamped(header(0.0, "map"), pose_message(transform_from_rpy((x, 0.0, 0.0)))) for x in (-0.5, 4.0))
        plan = rospy.ServiceProxy(f"/{NODE}/make_plan", GetPlan)(PoseStamped(), far, 0.5).plan
        self.assertLess(abs(plan.poses[-1].pose.position.x - 4.0), 0.5)
        through = [p.pose.position.y for p in plan.poses if abs(p.pose.position.x - 1.6) < 0.4]
        self.assertLess(max(map(abs, through)), 0.1)
        answer = rospy.ServiceProxy(f"/{NODE}/plan_path", PlanPath)(here, far, 0.5)
        self.assertFalse(answer.whole)
        self.assertLess(answer.plan.poses[-1].pose.position.x, 1.2)
        reset()

    def test_save_without_a_folder_says_so(self) -> None:
        answer = rospy.ServiceProxy(f"/{NODE}/save", Trigger)()
        self.assertEqual((answer.success, "~out" in answer.message), (False, True))

    def test_map_comes_also_when_nobody_stores_the_plan(self) -> None:
        self.decision()
        before = self.diagnostics.dropped("bad StorePlanRequest")
        type(self).refuses_plans = True
        try:
            self.sweeps.publish(self.sweep())
            self.full.wait_for_stamp(self.clock_s)
            self.local.wait_for_stamp(self.clock_s)
            self.diagnostics.wait_for_dropped("bad StorePlanRequest", before + 1)
        finally:
            type(self).refuses_plans = False
        OctomapServer3dnavTest.mapped += 1
        without_plan = self.clock_s
        self.decision()
        self.assertNotIn(round(without_plan, 6), self.decisions.stamps())

    def test_sweep_of_another_map_frame_is_counted_and_dropped(self) -> None:
        message = self.sweep()
        message.header.frame_id = "world"
        self.assert_dropped(message)

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        for parameter, expected in (
            ("resolutoin:=0.1", "did you mean resolution"),
            ("terrain/clearanc_m:=1.0", "did you mean"),
            ("compres_map:=true", "did you mean compress_map"),
            ("sensor_model/max_rang:=5.0", "did you mean max_range"),
            ("pointcloud_min_z:=2000000.0", "is above"),
        ):
            code, stderr = run_misconfigured(NODE, parameter)
            self.assertEqual(code, 2, stderr)
            self.assertIn(expected, one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("octomap_server_3dnav_test")
    rostest.rosrun("explore_3dnav", "octomap_server_3dnav", OctomapServer3dnavTest, sys.argv)
