#!/usr/bin/env python3
"""move_base_node alone: a command for every odometry, plans that are taken or refused, and what becomes of bad input."""

import math
import sys
import time

import numpy as np
import rospy
from actionlib_msgs.msg import GoalID
from explore_3dnav.msg import FollowerCommand
from explore_3dnav.srv import PlanPathRequest, PlanPathResponse
from fed_move_base import CELLS, HALF_M, NODE, RESOLUTION_M, TICK_S, MoveBaseFeeds, grid_of
from geometry_msgs.msg import Point, PointStamped, PoseStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from node_testing import QUIET_S, Inbox, clock, feed, odometry, one_line_of, run_misconfigured, scan, slowness, wait_until
from std_srvs.srv import Empty
from tf2_msgs.msg import TFMessage

import rostest
from rigid_geometry import transform_from_rpy
from ros_adapters.conversions import header, path_message, pose_message, transform_stamped
from ros_adapters.grid_messages import message_of_grid

STOREY_M = 2.4  # of the only ground that make_plan knows here


class MoveBaseTest(MoveBaseFeeds):
    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        cls.costmaps = Inbox("/local_costmap/costmap", OccupancyGrid).wait_until_connected()

    @classmethod
    def plan_path(cls, request: PlanPathRequest) -> PlanPathResponse:
        """Straight ahead to any goal on the upper storey, or of which no height is known; first to half of the way to goals beyond 3 m."""
        goal, at = request.goal.pose.position, request.start.pose.position
        cls.goals.append(goal)
        if abs(goal.z - STOREY_M) > request.tolerance:
            return PlanPathResponse()
        is_whole = goal.x <= 3.0 or at.x > 0.1
        points = np.array([[at.x, 0.0, STOREY_M], [max(3.0, goal.x) if is_whole else 0.3, 0.0, STOREY_M]])
        return PlanPathResponse(path_message(cls.clock_s, "map", points, 0.0), [True, False], is_whole)

    def setUp(self) -> None:
        """Flat free ground around the robot, nothing seen, no plan, and a second for diagnostics to be due."""
        MoveBaseTest.clock_s = round(self.clock_s + 2.0, 3)
        self.publish_terrain(np.zeros((CELLS, CELLS), np.int8))
        rospy.ServiceProxy(f"/{NODE}/clear_costmaps", Empty)()
        self.cancel.publish(GoalID())
        wait_until(lambda: self.tick().state == "paused", "the robot to stand")
        self.resume.publish(True)
        wait_until(lambda: self.tick().state == "recalled", "a sweep to be asked for")
        self.store_plan(plan=Path())  # what is decided after it
        wait_until(lambda: self.tick().state == "idle", "the robot to have no plan")

    def tick(
        self,
        message: Odometry | None = None,
        ranges: object = np.inf,
        without: str = "",
        scan_before_s: float = 0.025,
        tf_before_s: float = 0.0,
        late_s: float = 0.0,
    ) -> FollowerCommand:
        """The answer to the next odometry, with its scan and transform but for the one `without` which it is."""
        MoveBaseTest.clock_s = round(self.clock_s + TICK_S, 3)
        self.clock.publish(clock(self.clock_s + late_s))
        if without != "/scan_horizontal":
            self.scans.publish(scan(self.clock_s - scan_before_s, ranges))
        if without != "/tf map->odom":
            T = transform_from_rpy((0.0, 0.0, 0.0))
            self.tf.publish(TFMessage([transform_stamped(self.clock_s - tf_before_s, "map", "odom", T)]))
        time.sleep(0.01)  # what belongs to an odometry is there before it: topics are not ordered among each other
        self.odometry.publish(message or odometry(self.clock_s))
        return self.commands.wait_for_stamp(self.clock_s)

    def test_every_odometry_is_answered_with_its_stamp(self) -> None:
        answer = self.tick()
        self.assertEqual((answer.header.frame_id, answer.state), ("base_link", "idle"))
        self.assertEqual((answer.twist.linear.x, answer.twist.angular.z), (0.0, 0.0))

    def test_stored_plan_is_followed(self) -> None:
        self.store_straight_ahead()
        answers = [self.tick() for _ in range(10)]
        self.assertEqual(answers[-1].state, "following", answers[-1].reason)
        self.assertGreater(answers[-1].twist.linear.x, 0.1)
        self.assertLess(abs(answers[-1].twist.angular.z), 0.1)

    def test_empty_plan_stops_the_robot(self) -> None:
        self.store_straight_ahead()
        self.tick()
        self.store_plan(plan=Path())
        answer = self.tick()
        self.assertEqual((answer.state, answer.twist.linear.x), ("idle", 0.0))

    def test_obstacle_before_the_robot_stops_it(self) -> None:
        self.store_straight_ahead()
        ahead = np.full(1081, np.inf)
        ahead[400:681] = 0.6  # a wall half a metre before the laser
        answers = [self.tick(ranges=ahead) for _ in range(10)]
        self.assertEqual(answers[-1].twist.linear.x, 0.0, answers[-1].reason)

    def test_terrain_that_blocks_the_way_under_the_nose_stops_the_robot_until_the_next_plan(self) -> None:
        self.store_straight_ahead()
        for _ in range(20):
            command = self.tick()
        self.assertGreater(command.twist.linear.x, 0.2)
        cost, nose = np.zeros((CELLS, CELLS), np.int8), int((HALF_M + 0.6) / RESOLUTION_M)
        cost[:, nose : nose + 6] = 100
        self.publish_terrain(cost)
        self.assertEqual((self.tick().twist.linear.x, self.tick().state), (0.0, "waiting"))
        for _ in range(200):
            command = self.tick()
            self.assertLessEqual(command.twist.linear.x, 0.0)
        self.assertEqual(command.state, "blocked", command.reason)
        said = "the way is blocked"
        wait_until(lambda: said in self.tick_and_say(), said)
        behind = np.array([[0.0, 0.0, 0.0], [-3.0, 0.0, 0.0]])
        self.store_plan(plan=path_message(self.clock_s, "map", behind, math.pi))
        wait_until(lambda: said not in self.tick_and_say(), "it is over")
        self.assertNotEqual(self.tick().state, "blocked")

    def tick_and_say(self) -> str:
        """What the node says of itself by the next odometry."""
        self.tick()
        return self.diagnostics.message()

    def test_guard_stops_the_robot_before_whoever_the_map_does_not_know_where_the_follower_would_still_drive(self) -> None:
        self.store_straight_ahead()
        ahead = np.full(1081, np.inf)
        ahead[500:581] = 1.05  # 0.78 m before the front; the follower looks 0.6 m ahead
        answers = [self.tick(ranges=ahead) for _ in range(10)]
        self.assertEqual((answers[-1].state, answers[-1].twist.linear.x), ("following", 0.0), answers[-1].reason)
        self.assertIn("what the map does not know", answers[-1].reason)

    def test_costmap_comes_in_the_map_frame(self) -> None:
        for _ in range(5):
            self.tick(odometry(self.clock_s + TICK_S, x=0.5))  # it moves with the robot
        newest = self.costmaps.wait_for(lambda m: m.header.stamp.to_sec() > self.clock_s - 1.0)
        self.assertEqual(newest.header.frame_id, "map")
        self.assertEqual(len(newest.data), newest.info.width * newest.info.height)

    def test_goal_of_rviz_without_ground_at_its_height_is_asked_for_at_any(self) -> None:
        self.goals.clear()
        feed("/move_base_simple/goal", PoseStamped).publish(PoseStamped(header(self.clock_s, "map"), pose_message(np.eye(4))))
        wait_until(lambda: len(self.goals) == 2, "both requests for a plan")
        self.assertEqual([str(goal.z) for goal in self.goals], ["0.0", "nan"])
        wait_until(lambda: self.tick().state == "following", "the robot to follow")

    def test_clicked_point_is_a_goal_with_its_height(self) -> None:
        self.tick()
        self.goals.clear()
        clicked = feed("/clicked_point", PointStamped)
        clicked.publish(header(self.clock_s, "map"), Point(3.0, 0.0, STOREY_M))
        wait_until(lambda: self.tick().state == "following", "the robot to follow")
        self.assertEqual([goal.z for goal in self.goals], [STOREY_M])
        clicked.publish(header(self.clock_s, "map"), Point(3.0, 0.0, 9.0))
        wait_until(lambda: len(self.goals) == 2, "a plan to be asked for")
        self.diagnostics.wait_for_dropped("goal refused")
        self.assertEqual(self.tick().state, "following")

    def test_goal_behind_a_passage_stays_the_goal_after_the_sweep_before_it(self) -> None:
        self.goals.clear()
        self.tick()
        feed("/clicked_point", PointStamped).publish(header(self.clock_s, "map"), Point(5.0, 0.0, STOREY_M))
        wait_until(lambda: self.tick().state == "following", "the robot to follow")
        wait_until(lambda: self.tick(odometry(self.clock_s + TICK_S, x=0.29)).state == "reached", "the passage to be reached")
        self.store_straight_ahead()  # what exploration decides after the sweep there
        answer = self.tick(odometry(self.clock_s + TICK_S, x=0.29))
        self.assertEqual((len(self.goals), answer.state), (2, "following"), answer.reason)
        self.cancel.publish(GoalID())
        wait_until(lambda: self.tick().state == "paused", "the robot to stand")
        self.store_straight_ahead()
        self.assertEqual(len(self.goals), 2)

    def test_plan_in_another_frame_is_refused_with_the_reason(self) -> None:
        answer = self.store_plan(plan=path_message(self.clock_s, "odom", np.zeros((2, 3)), 0.0))
        self.assertFalse(answer.accepted)
        self.assertIn("odom", answer.message)
        self.assertEqual(self.tick().state, "idle")

    def test_plan_that_is_no_number_is_refused(self) -> None:
        plan = path_message(self.clock_s, "map", np.zeros((2, 3)), 0.0)
        plan.poses[0].pose.position.x = float("nan")
        self.assertFalse(self.store_plan(plan=plan).accepted)
        self.assertEqual(self.tick().state, "idle")

    def test_odometry_that_is_no_pose_is_counted_and_gets_no_command(self) -> None:
        bad_s = round(self.clock_s + TICK_S, 3)
        self.tf.publish(TFMessage([transform_stamped(bad_s, "map", "odom", np.eye(4))]))
        self.odometry.publish(odometry(bad_s, x=float("nan")))
        MoveBaseTest.clock_s = bad_s + 2.0
        self.tick()
        self.diagnostics.wait_for_dropped("bad Odometry")
        self.assertNotIn(round(bad_s, 6), self.commands.stamps())

    def test_robot_stands_while_map_to_odom_or_the_scan_is_silent_and_goes_on_afterwards(self) -> None:
        for silent in ("/tf map->odom", "/scan_horizontal"):
            self.store_straight_ahead()
            self.assertGreater([self.tick() for _ in range(10)][-1].twist.linear.x, 0.1)
            answers = [self.tick(without=silent) for _ in range(8)]
            self.assertGreater(answers[4].twist.linear.x, 0.0, answers[4].reason)  # 0.25 s old
            self.assertEqual(answers[-1].twist.linear.x, 0.0, answers[-1].reason)
            self.assertIn(f"no {silent}", answers[-1].reason)
            self.assertGreater([self.tick() for _ in range(10)][-1].twist.linear.x, 0.1)

    def test_robot_stands_while_all_comes_late_and_goes_on_afterwards(self) -> None:
        self.store_straight_ahead()
        self.assertGreater([self.tick(late_s=0.2) for _ in range(8)][-1].twist.linear.x, 0.0)
        answer = [self.tick(late_s=0.4) for _ in range(3)][-1]
        self.assertEqual(answer.twist.linear.x, 0.0)
        self.assertIn("/odom is 0.4 s late", answer.reason)
        self.assertGreater([self.tick() for _ in range(8)][-1].twist.linear.x, 0.0)

    def test_silent_input_is_named_on_diagnostics_within_a_second(self) -> None:
        limit_s = 1.0 * slowness()
        wait_until(lambda: "no /odom" not in self.tick_and_say(), "the word that /odom is there")
        wait_until(lambda: "no /odom" in self.diagnostics.message(), "the word that it is silent", limit_s)
        self.tick()
        wait_until(lambda: "no /odom" not in self.diagnostics.message(), "the word that /odom is back")

    def test_stamps_of_different_sensors_need_not_agree(self) -> None:
        self.store_straight_ahead()
        answers = [self.tick(scan_before_s=0.031 + 0.0007 * k, tf_before_s=0.003) for k in range(10)]
        self.assertGreater(answers[-1].twist.linear.x, 0.1, answers[-1].reason)

    def test_terrain_whose_sizes_do_not_agree_is_counted_and_dropped(self) -> None:
        bad = message_of_grid(self.clock_s, "map", grid_of(np.zeros((4, 4), np.int8)))
        bad.cost = bad.cost[:5]
        self.terrain.publish(bad)
        time.sleep(QUIET_S)
        MoveBaseTest.clock_s += 2.0
        self.tick()
        self.diagnostics.wait_for_dropped("bad TerrainGrid")

    def test_terrain_in_another_frame_is_counted_and_dropped(self) -> None:
        before = self.diagnostics.dropped("bad TerrainGrid")
        self.terrain.publish(message_of_grid(self.clock_s, "odom", grid_of(np.zeros((4, 4), np.int8))))
        time.sleep(QUIET_S)
        MoveBaseTest.clock_s += 2.0
        self.tick()
        self.diagnostics.wait_for_dropped("bad TerrainGrid", before + 1)

    def test_robot_stands_while_no_scan_has_a_number_as_of_a_laser_that_is_not_level(self) -> None:
        self.store_straight_ahead()
        self.assertGreater([self.tick() for _ in range(10)][-1].twist.linear.x, 0.1)
        answer = [self.tick(ranges=np.nan) for _ in range(10)][-1]
        self.assertEqual(answer.twist.linear.x, 0.0)
        self.assertIn("no /scan_horizontal with a reading", answer.reason)
        MoveBaseTest.clock_s += 2.0
        wait_until(lambda: self.tick(ranges=np.nan) and "nothing is seen ahead" in self.diagnostics.message(), "the word on /diagnostics")
        self.assertGreater([self.tick() for _ in range(10)][-1].twist.linear.x, 0.1)

    def test_time_that_jumps_back_starts_afresh(self) -> None:
        self.tick()
        forward_s = self.clock_s
        MoveBaseTest.clock_s = forward_s - 10.0
        self.tick()
        MoveBaseTest.clock_s = forward_s + 10.0

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        for parameter, expected in (
            ("follower/max_sped_mps:=0.3", "did you mean max_speed_mps?"),
            ("costmap/resolutoin_m:=0.1", "resolution"),
        ):
            code, stderr = run_misconfigured(NODE, parameter)
            self.assertEqual(code, 2, stderr)
            self.assertIn(expected, one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("move_base_test")
    rostest.rosrun("explore_3dnav", "move_base", MoveBaseTest, sys.argv)
