#!/usr/bin/env python3
"""move_base_node as clients of move_base use it: actionlib's client, tf2, its topics and its services, by their names there."""

import sys

import actionlib
import numpy as np
import rospy
import tf2_ros
from actionlib_msgs.msg import GoalStatus
from explore_3dnav.msg import RunEvent
from fed_move_base import FedMoveBase
from geometry_msgs.msg import PolygonStamped, PoseStamped
from move_base_msgs.msg import MoveBaseAction, MoveBaseFeedback, MoveBaseGoal, RecoveryStatus
from nav_msgs.msg import OccupancyGrid, Path
from node_testing import BEAMS, Inbox, feed, wait_until
from std_srvs.srv import Trigger

import rostest
from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import header, path_message, pose_message, transform_from_pose, transform_stamped
from ros_adapters.costmap_topics import OccupancyGridUpdate

SIMPLE = "/move_base_simple/goal"
FAILED = "the robot has failed: the sweep did not begin"


def goal_at(x: float, y: float = 0.0, frame: str = "map", yaw: float = 0.0) -> MoveBaseGoal:
    return MoveBaseGoal(PoseStamped(header(0.0, frame), pose_message(transform_from_rpy((x, y, 0.0), (0.0, 0.0, yaw)))))


def wall_ahead(range_m: float, begin: int, end: int) -> np.ndarray:
    """A scan in which the beams from `begin` to `end` meet something."""
    ranges = np.full(BEAMS, np.inf)
    ranges[begin:end] = range_m
    return ranges


def client() -> actionlib.SimpleActionClient:
    found = actionlib.SimpleActionClient("move_base", MoveBaseAction)
    assert found.wait_for_server(rospy.Duration(60))
    return found


class MoveBaseGoalsTest(FedMoveBase):
    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        cls.client = client()
        cls.simple = feed(SIMPLE, PoseStamped)
        cls.current_goals = Inbox("/move_base/current_goal", PoseStamped).wait_until_connected()

    def begin(self, goal: MoveBaseGoal, by: "actionlib.SimpleActionClient | None" = None) -> None:
        """Sends a goal, and waits until the robot drives."""
        (by or self.client).send_goal(goal)
        wait_until(lambda: self.tick().state == "following", "the robot to follow")
        wait_until(lambda: (by or self.client).get_state() == GoalStatus.ACTIVE, "the client to hear of it")

    def wait_for_result(self, by: "actionlib.SimpleActionClient | None" = None) -> int:
        self.assertTrue((by or self.client).wait_for_result(rospy.Duration(60)))
        return (by or self.client).get_state()

    # -- the action

    def test_goal_is_reached_with_feedback_at_each_cycle(self) -> None:
        places: list[MoveBaseFeedback] = []
        self.client.send_goal(goal_at(1.0), feedback_cb=places.append)
        wait_until(lambda: bool(self.goals), "a path to be asked for")
        before = len(self.commands.messages)
        with self.ticking():
            state = self.wait_for_result()
        self.assertEqual((state, self.client.get_goal_status_text()), (GoalStatus.SUCCEEDED, "at the goal"))
        self.assertLess(np.hypot(self.at[0] - 1.0, self.at[1]), 0.2)
        x = [feedback.base_position.pose.position.x for feedback in places]
        self.assertEqual({feedback.base_position.header.frame_id for feedback in places}, {"map"})
        self.assertGreater(len(x), 0.8 * (len(self.commands.messages) - before) - 5)
        self.assertTrue((np.diff(x) >= -1e-9).all() and x[-1] > 0.8, x)
        self.assert_stands("reached")

    def test_goal_may_be_in_any_frame_that_tf_knows(self) -> None:
        type(self).T_map_odom = transform_from_rpy((0.5, -0.3, 0.0), (0.0, 0.0, 0.4))
        T_base_camera = transform_from_rpy((0.2, 0.1, 0.4), (0.0, 0.0, 0.5))
        camera = tf2_ros.StaticTransformBroadcaster()
        camera.sendTransform(transform_stamped(0.0, "base_link", "camera", T_base_camera))
        type(self).at = (0.3, 0.2, 0.1)
        self.tick()
        T_odom_base = transform_from_rpy((*self.at[:2], 0.132), (0.0, 0.0, self.at[2]))
        T_map_base = self.T_map_odom @ T_odom_base
        wanted = transform_from_rpy((1.0, 0.2, 0.0), (0.0, 0.0, 0.3))
        for frame, T in (
            ("map", np.eye(4)),
            ("/map", np.eye(4)),
            ("odom", self.T_map_odom),
            ("base_link", T_map_base),
            ("camera", T_map_base @ T_base_camera),
        ):
            self.goals.clear()
            type(self).at = (0.3, 0.2, 0.1)
            self.begin(goal_at(1.0, 0.2, frame, 0.3))
            self.assertEqual(self.goals[0].header.frame_id, "map")
            np.testing.assert_allclose(transform_from_pose(self.goals[0].pose), T @ wanted, atol=1e-6, err_msg=frame)
            self.client.cancel_goal()
            self.tick_until("paused")

    def test_goal_that_cannot_be_driven_to_is_aborted_with_its_reason_and_the_one_before_goes_on(self) -> None:
        first, second = self.client, client()
        self.begin(goal_at(3.0), first)
        nan, infinite, no_rotation = goal_at(float("nan")), goal_at(1.0, float("inf")), goal_at(1.0)
        no_rotation.target_pose.pose.orientation.w = 0.0
        for goal, reason in (
            (goal_at(40.0), "no ground within 0.5 m of it that the robot reaches"),
            (goal_at(1.0, frame=""), "without a frame"),
            (goal_at(1.0, frame="kitchen"), "'kitchen'"),
            (nan, "not finite"),
            (infinite, "not finite"),
            (no_rotation, "invalid quaternion"),
        ):
            second.send_goal(goal)
            with self.ticking():
                state = self.wait_for_result(second)
            self.assertEqual(state, GoalStatus.ABORTED, reason)
            self.assertIn(reason, second.get_goal_status_text())
            self.assertNotIn("b'", second.get_goal_status_text())
            self.assertEqual((first.get_state(), self.tick().state), (GoalStatus.ACTIVE, "following"), reason)
            self.assertAlmostEqual(self.current_goals.messages[-1].pose.position.x, 3.0)

    def test_quaternion_of_another_length_is_made_a_unit_as_move_base_does(self) -> None:
        goal = goal_at(2.0)
        goal.target_pose.pose.orientation.w = 3.0
        self.begin(goal)
        self.assertAlmostEqual(self.goals[0].pose.orientation.w, 1.0)

    def test_last_of_two_clients_wins_and_the_others_cancel_changes_nothing(self) -> None:
        first, second = self.client, client()
        self.begin(goal_at(3.0), first)
        self.begin(goal_at(0.0, 3.0), second)
        self.assertEqual((self.wait_for_result(first), first.get_goal_status_text()), (GoalStatus.PREEMPTED, "replaced by a newer goal"))
        first.cancel_goal()
        for _ in range(20):
            self.assertNotEqual(self.tick().state, "paused")
        self.assertEqual(second.get_state(), GoalStatus.ACTIVE)

    def test_follower_that_gives_up_aborts_the_goal_and_each_recovery_is_told(self) -> None:
        recoveries = Inbox("/move_base/recovery_status", RecoveryStatus).wait_until_connected()
        self.begin(goal_at(3.0))
        type(self).ranges = wall_ahead(0.6, 400, 681)
        with self.ticking():
            state = self.wait_for_result()
        self.assertEqual(state, GoalStatus.ABORTED)
        self.assertIn("not free", self.client.get_goal_status_text())
        recoveries.wait_for(lambda m: m.recovery_behavior_name == "blocked")
        told = [m.recovery_behavior_name for m in recoveries.messages]
        self.assertEqual((told[0], told[-1]), ("waiting", "blocked"))
        self.assertEqual(recoveries.messages[0].pose_stamped.header.frame_id, "map")
        self.assert_stands("idle")  # and no frontier of exploration's is blamed for it
        self.assertNotIn("blocked", [m.state for m in self.commands.messages[-40:]])
        self.assertFalse([a for a, b in zip(told, told[1:], strict=False) if a == b], told)

    def test_robot_that_gets_nowhere_gives_its_goal_up_though_each_sweep_brings_a_new_path(self) -> None:
        self.begin(goal_at(3.0))
        type(self).ranges = wall_ahead(0.6, 400, 681)
        began_s = self.clock_s
        while self.client.get_state() == GoalStatus.ACTIVE and self.clock_s < began_s + 40.0:
            self.store_straight_ahead()
            for _ in range(20):
                self.tick()
        self.assertEqual(self.client.get_state(), GoalStatus.ABORTED)
        self.assertIn("not free", self.client.get_goal_status_text())
        self.assert_stands("idle")

    def test_robot_that_has_failed_keeps_no_goal_waiting(self) -> None:
        self.begin(goal_at(3.0))
        events = feed("/exploration/event", RunEvent)
        events.publish(RunEvent(header(self.clock_s, "odom"), "failed", "the sweep did not begin", 1, False, "", 0.0, False, 0.0))
        self.assertEqual(self.wait_for_result(), GoalStatus.ABORTED)
        self.client.send_goal(goal_at(2.0))
        self.assertEqual((self.wait_for_result(), self.client.get_goal_status_text()), (GoalStatus.ABORTED, FAILED))
        events.publish(RunEvent(header(self.clock_s, "odom"), "driving", "", 1, False, "", 0.0, False, 0.0))
        wait_until(lambda: self.is_taken(goal_at(2.0)), "goals to be taken again")

    def is_taken(self, goal: MoveBaseGoal) -> bool:
        """Whether the robot drives to it."""
        self.client.send_goal(goal)
        for _ in range(5):
            if self.tick().state == "following":
                return True
        return False

    # -- cancel and resume

    def assert_sweep_is_asked_for(self) -> None:
        wait_until(lambda: self.tick().state == "recalled", "a sweep to be asked for")

    def assert_exploration_waits_until_it_is_told_to_go_on(self) -> None:
        self.assert_stands("paused")
        self.store_straight_ahead()
        self.assert_stands("paused")
        self.resume.publish(True)
        self.assert_sweep_is_asked_for()
        self.store_straight_ahead()
        self.tick_until("following")

    def test_robot_stands_after_a_client_has_cancelled(self) -> None:
        self.begin(goal_at(3.0))
        self.client.cancel_goal()
        with self.ticking():
            self.assertEqual(self.wait_for_result(), GoalStatus.PREEMPTED)
        self.assert_exploration_waits_until_it_is_told_to_go_on()

    def test_cancel_of_all_ends_simple_goals_too(self) -> None:
        self.simple.publish(goal_at(3.0).target_pose)
        self.tick_until("following")
        self.client.cancel_all_goals()
        self.tick_until("paused")
        self.assert_exploration_waits_until_it_is_told_to_go_on()

    def test_cancel_of_all_stops_exploration(self) -> None:
        self.store_straight_ahead()
        self.tick_until("following")
        self.client.cancel_all_goals()
        self.tick_until("paused")
        self.assert_exploration_waits_until_it_is_told_to_go_on()

    def test_new_goal_is_driven_to_after_a_cancel_and_then_the_robot_stands_again(self) -> None:
        self.begin(goal_at(3.0))
        self.client.cancel_goal()
        self.tick_until("paused")
        self.begin(goal_at(self.at[0] + 0.6))
        with self.ticking():
            self.assertEqual(self.wait_for_result(), GoalStatus.SUCCEEDED)
        self.store_straight_ahead()  # what exploration decides after the sweep there
        self.assert_exploration_waits_until_it_is_told_to_go_on()

    def test_paused_exploration_leaves_a_goal_alone(self) -> None:
        self.begin(goal_at(1.0))
        self.resume.publish(False)
        for _ in range(10):
            self.assertEqual(self.tick().state, "following")
        with self.ticking():
            self.assertEqual(self.wait_for_result(), GoalStatus.SUCCEEDED)
        self.store_straight_ahead()
        self.assert_exploration_waits_until_it_is_told_to_go_on()

    def test_false_on_resume_stops_exploration(self) -> None:
        self.store_straight_ahead()
        self.tick_until("following")
        self.resume.publish(False)
        self.tick_until("paused")
        self.assert_exploration_waits_until_it_is_told_to_go_on()

    def call(self, name: str) -> tuple[bool, str]:
        answer = rospy.ServiceProxy(name, Trigger)()
        return answer.success, answer.message

    def test_exploration_is_paused_and_resumed_by_service_and_who_contradicts_is_told_so(self) -> None:
        self.store_straight_ahead()
        self.tick_until("following")
        self.assertEqual(self.call("/explore/resume"), (False, "exploration is not paused"))
        self.assertEqual(self.tick().state, "following")
        self.assertTrue(self.call("/explore/pause")[0])
        self.tick_until("paused")
        refused, reason = self.call("/explore/pause")
        self.assertEqual((refused, reason.split(":")[0]), (False, "paused already"))
        self.store_straight_ahead()
        self.assert_stands("paused")
        self.assertTrue(self.call("/explore/resume")[0])
        self.assert_sweep_is_asked_for()
        self.store_straight_ahead()
        self.tick_until("following")

    def test_topic_and_service_are_one_pause(self) -> None:
        self.resume.publish(False)
        self.tick_until("paused")
        self.assertTrue(self.call("/explore/resume")[0])
        self.assert_sweep_is_asked_for()
        self.assertTrue(self.call("/explore/pause")[0])
        self.resume.publish(True)
        self.assert_sweep_is_asked_for()

    def test_recall_drops_plan_goal_and_pause_and_asks_for_a_sweep(self) -> None:
        for prepare in (self.store_straight_ahead, lambda: self.begin(goal_at(3.0)), lambda: self.call("/explore/pause")):
            prepare()
            self.assertTrue(self.call("/move_base_node/recall")[0])
            self.assert_sweep_is_asked_for()
            self.assert_stands("recalled")
        self.assertEqual(self.client.get_state(), GoalStatus.PREEMPTED)
        self.store_plan(plan=Path())
        self.assert_stands("idle")

    def test_what_was_decided_before_a_recall_takes_no_effect(self) -> None:
        before = self.clock_s
        self.tick()
        self.assertTrue(self.call("/move_base_node/recall")[0])
        plan = path_message(before, "map", np.zeros((0, 3)), 0.0)
        self.assertTrue(self.store_plan(plan=plan, wait="exploration is off").accepted)
        self.assert_stands("recalled")

    def test_replan_drops_the_path_alone(self) -> None:
        self.begin(goal_at(3.0))
        self.assertTrue(self.call("/explore/pause")[0])
        self.assertTrue(self.call("/move_base_node/replan")[0])
        self.assert_sweep_is_asked_for()
        self.assertEqual(self.client.get_state(), GoalStatus.ACTIVE)
        self.store_straight_ahead()  # what exploration decides after the sweep: the goal is planned to anew
        self.tick_until("following")
        self.client.cancel_goal()
        self.tick_until("paused")
        self.assertTrue(self.call("/move_base_node/replan")[0])  # there is no path
        self.assert_stands("paused")

    def test_plan_to_wait_pauses_exploration_with_its_reason(self) -> None:
        self.store_straight_ahead()
        self.store_plan(plan=Path(), wait="home, 0.05 m from the start")
        self.assertIn("home, 0.05 m from the start", self.tick_until("paused").reason)
        self.assert_exploration_waits_until_it_is_told_to_go_on()

    def test_end_that_is_to_be_stood_at_is_reached_within_half_the_tolerances(self) -> None:
        points = np.column_stack([np.linspace(0.0, 1.0, 11), np.zeros(11), np.full(11, 0.04)])
        self.store_plan(plan=path_message(self.clock_s, "map", points, 0.14), exact=True)
        self.tick_until("reached")
        self.assertLess(np.hypot(self.at[0] - 1.0, self.at[1]), 0.1)
        self.assertLess(abs(self.at[2] - 0.14), 0.06)

    def test_end_of_exploration_is_not_the_end_of_a_goal(self) -> None:
        self.begin(goal_at(1.0))
        self.store_plan(plan=Path())
        with self.ticking():
            self.assertEqual(self.wait_for_result(), GoalStatus.SUCCEEDED)

    # -- topics and services by move_base's names

    def test_plan_that_is_driven_is_shown_under_navfns_name(self) -> None:
        plans = Inbox("/move_base/NavfnROS/plan", Path).wait_until_connected()
        self.begin(goal_at(2.0))
        shown = plans.wait_for(lambda m: m.poses and abs(m.poses[-1].pose.position.x - 2.0) < 1e-6)
        self.assertEqual(shown.header.frame_id, "map")
        self.client.cancel_goal()
        self.tick_until("paused")
        self.resume.publish(True)
        self.tick_until("recalled")
        exploration = path_message(self.clock_s, "map", np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]]), 0.0)
        self.store_plan(plan=exploration)
        plans.wait_for(lambda m: m.poses and abs(m.poses[-1].pose.position.y - 2.0) < 1e-6)

    def test_current_goal_is_told_in_map(self) -> None:
        type(self).T_map_odom = transform_from_rpy((0.5, 0.0, 0.0))
        self.tick()
        self.simple.publish(goal_at(2.0, frame="odom").target_pose)
        found = self.current_goals.wait_for(lambda m: abs(m.pose.position.x - 2.5) < 1e-6)
        self.assertEqual(found.header.frame_id, "map")

    def assert_costmap_is_there(self, prefix: str) -> None:
        whole = Inbox(f"{prefix}/local_costmap/costmap", OccupancyGrid).wait_until_connected()
        updates = Inbox(f"{prefix}/local_costmap/costmap_updates", OccupancyGridUpdate).wait_until_connected()
        footprints = Inbox(f"{prefix}/local_costmap/footprint", PolygonStamped).wait_until_connected()
        for _ in range(12):  # it is sent with every fourth, and whole to new listeners
            self.tick()
        self.assertEqual(whole.messages[-1].header.frame_id, "map")
        type(self).ranges = wall_ahead(1.0, 500, 581)
        wait_until(lambda: self.tick() is not None and any(100 in m.data for m in updates.messages), "the wall")
        footprints.wait_for(lambda m: len(m.polygon.points) == 4 and m.header.frame_id == "map")
        type(self).ranges = np.nan  # no beam measures: nothing clears the wall but the service
        for _ in range(12):
            self.tick()
        updates.messages.clear()
        self.clear_costmaps()
        wait_until(lambda: self.tick() is not None and bool(updates.messages), "the costmap without the wall")
        self.assertFalse(any(100 in m.data for m in updates.messages))

    def test_costmap_its_updates_and_the_footprint_are_there_and_cleared(self) -> None:
        self.assert_costmap_is_there("")

    def test_costmap_is_there_under_move_bases_name_too(self) -> None:
        self.assert_costmap_is_there("/move_base")


if __name__ == "__main__":
    rospy.init_node("move_base_goals_test")
    rostest.rosrun("explore_3dnav", "move_base_goals", MoveBaseGoalsTest, sys.argv)
