#!/usr/bin/env python3
"""octomap_server_3dnav_node with mapping off: the map is the one that it was given, and sweeps only tell where the robot is in it."""

import sys
import unittest

import numpy as np
import rospy
from explore_3dnav.msg import ExplorationDecision, MappedSweep
from explore_3dnav.srv import PlanPath, RestoreSweep, StorePlan, StorePlanRequest, StorePlanResponse
from geometry_msgs.msg import PoseStamped
from node_testing import DiagnosticsOf, Inbox, feed, floor_and_walls, octomap_bytes, wait_for_node
from std_srvs.srv import Trigger, TriggerResponse

import rostest
from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import cloud_message, header, pose_message
from ros_adapters.octomap_messages import GetOctomap

NODE = "octomap_server_3dnav_node"
AWAY = transform_from_rpy((1.0, 0.5, 0.132), (0.0, 0.0, 0.3))


class FinishedMapTest(unittest.TestCase):
    """One life: the tests run by their names."""

    clock_s = 100.0
    plans: list[StorePlanRequest] = []

    @classmethod
    def setUpClass(cls) -> None:
        cls.services = [
            rospy.Service("storePlan", StorePlan, cls.store),
            *(rospy.Service(f"/move_base_node/{name}", Trigger, lambda _: TriggerResponse(True, "")) for name in ("recall", "replan")),
        ]
        wait_for_node(NODE)
        cls.decisions = Inbox("/exploration/decision", ExplorationDecision).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.sweeps = feed("/mapped_sweep", MappedSweep)
        cls.points, cls.origins = floor_and_walls()

    @classmethod
    def store(cls, request: StorePlanRequest) -> StorePlanResponse:
        cls.plans.append(request)
        return StorePlanResponse(True, "")

    def of_vertex(self, *poses: np.ndarray) -> MappedSweep:
        """What the robot sees at the last of its poses, which is not the room of the map: it stands elsewhere in it."""
        cls = type(self)
        cls.clock_s += 2.0
        message = MappedSweep(header=header(self.clock_s, "map"), vertex_id=len(poses) - 1)
        message.vertex_poses = [pose_message(T) for T in poses]
        message.cloud = cloud_message(self.clock_s, "base_link", self.points, self.origins)
        return message

    def tree(self) -> bytes:
        return octomap_bytes(rospy.ServiceProxy("/octomap_full", GetOctomap)().map)

    def test_1_without_a_map_a_sweep_is_counted_with_the_reason(self) -> None:
        self.sweeps.publish(self.of_vertex(transform_from_rpy((0.0, 0.0, 0.132))))
        self.diagnostics.wait_for_dropped("bad MappedSweep")
        self.assertEqual(self.plans, [])

    def test_2_sweeps_tell_where_the_robot_is_and_nothing_is_added_or_explored(self) -> None:
        T_first = transform_from_rpy((0.0, 0.0, 0.132))
        answer = rospy.ServiceProxy(f"/{NODE}/restore_sweep", RestoreSweep, persistent=True)(self.of_vertex(T_first))
        self.assertTrue(answer.accepted, answer.message)
        trees = []
        for _ in range(3):
            self.sweeps.publish(self.of_vertex(T_first, AWAY))
            decision = self.decisions.wait_for_stamp(self.clock_s)
            self.assertEqual((decision.kind, decision.reason), ("wait", "exploration is off"))
            self.assertEqual((self.plans[-1].wait, len(self.plans[-1].plan.poses)), ("exploration is off", 0))
            trees.append(self.tree())
        self.assertEqual(len(set(trees)), 1)

    def test_3_goals_are_planned_to_from_where_it_is(self) -> None:
        goal = PoseStamped(header(0.0, "map"), pose_message(transform_from_rpy((-1.5, -1.0, 0.0))))
        plan = rospy.ServiceProxy(f"/{NODE}/plan_path", PlanPath)(PoseStamped(header(0.0, "map"), pose_message(AWAY)), goal, 0.5).plan
        first = plan.poses[0].pose.position
        self.assertLess(np.hypot(first.x - AWAY[0, 3], first.y - AWAY[1, 3]), 0.2)

    def test_4_exploration_is_not_begun_and_home_is_where_the_first_sweep_was_made(self) -> None:
        for name in ("start", "stop"):
            answer = rospy.ServiceProxy(f"/explore/{name}", Trigger)()
            self.assertFalse(answer.success)
            self.assertIn("exploration is off", answer.message)
        self.assertTrue(rospy.ServiceProxy("/explore/return_home", Trigger)().success)
        self.sweeps.publish(self.of_vertex(transform_from_rpy((0.0, 0.0, 0.132)), AWAY, transform_from_rpy((-1.0, -1.0, 0.132))))
        self.assertEqual(self.decisions.wait_for_stamp(self.clock_s).kind, "goal")
        end = self.plans[-1].plan.poses[-1].pose.position
        self.assertLess(np.hypot(end.x - AWAY[0, 3], end.y - AWAY[1, 3]), 0.1)


if __name__ == "__main__":
    rospy.init_node("finished_map_test")
    rostest.rosrun("explore_3dnav", "finished_map", FinishedMapTest, sys.argv)
