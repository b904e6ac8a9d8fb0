"""move_base_node fed by a made-up robot that does as it is told, on flat ground that a made-up planner knows."""

import math
import threading
import time
import unittest
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import rospy
from actionlib_msgs.msg import GoalID
from explore_3dnav.msg import FollowerCommand
from explore_3dnav.msg import TerrainGrid as TerrainGridMessage
from explore_3dnav.srv import PlanPath, PlanPathRequest, PlanPathResponse, StorePlan
from nav_msgs.msg import Odometry
from node_testing import DiagnosticsOf, Inbox, clock, feed, odometry, scan, wait_for_node, wait_until
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Bool, Header
from std_srvs.srv import Empty, SetBool
from tf2_msgs.msg import TFMessage

from octomap_server_3dnav.navigation.local_grid import TerrainGrid
from ros_adapters.conversions import path_message, transform_stamped
from ros_adapters.grid_messages import message_of_grid

NODE = "move_base_node"
TICK_S = 0.05
CELLS, RESOLUTION_M = 100, 0.08
HALF_M = CELLS * RESOLUTION_M / 2
REACHABLE_M = 5.0  # no path leads farther from the map's origin


def grid_of(cost: np.ndarray) -> TerrainGrid:
    """Level terrain whose middle is that of the map; of distances nothing is known."""
    height, unknown = np.zeros(cost.shape, np.float32), np.full(cost.shape, np.nan, np.float32)
    return TerrainGrid(cost, height, unknown, (-HALF_M, -HALF_M), RESOLUTION_M)


class MoveBaseFeeds(unittest.TestCase):
    """All that the node hears, and what it says; a subclass plans the paths to goals."""

    clock_s = 100.0

    @classmethod
    def setUpClass(cls) -> None:
        wait_for_node(NODE)
        cls.commands = Inbox("/cmd_vel/move_base", FollowerCommand).wait_until_connected()
        cls.taken = Inbox("/move_base_node/terrain_taken", Header).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.clock = feed("/clock", Clock)
        cls.odometry = feed("/odom", Odometry)
        cls.scans = feed("/scan_horizontal", LaserScan)
        cls.terrain = feed("/terrain_grid", TerrainGridMessage)
        cls.tf = feed("/tf", TFMessage)
        cls.cancel = feed("/move_base/cancel", GoalID)
        cls.resume = feed("/explore/resume", Bool)
        cls.store_plan = rospy.ServiceProxy("storePlan", StorePlan)
        cls.clear_costmaps = rospy.ServiceProxy("/move_base/clear_costmaps", Empty)
        cls.hold = rospy.ServiceProxy(f"/{NODE}/hold", SetBool)
        cls.hold(False)
        cls.goals = []
        rospy.Service("/octomap_server_3dnav_node/plan_path", PlanPath, cls.plan_path)

    @classmethod
    def plan_path(cls, request: PlanPathRequest) -> PlanPathResponse:
        """To a goal of the user's, which belongs into `goals`."""
        raise NotImplementedError

    def publish_terrain(self, cost: np.ndarray) -> None:
        """Terrain whose middle is the map's origin; the next command is that of a robot that knows it."""
        self.terrain.publish(message_of_grid(self.clock_s, "map", grid_of(cost)))
        self.taken.wait_for(lambda m: abs(m.stamp.to_sec() - self.clock_s) < 1e-6)

    def store_straight_ahead(self) -> None:
        """What exploration decides."""
        points = np.column_stack([np.linspace(0.0, 3.0, 31), np.zeros(31), np.full(31, 0.04)])
        answer = self.store_plan(plan=path_message(self.clock_s, "map", points, 0.0))
        self.assertTrue(answer.accepted, answer.message)


class FedMoveBase(MoveBaseFeeds):
    """Before each test the robot stands at the origin of odom, knows flat ground, and has no goal; exploration goes on."""

    at = (0.0, 0.0, 0.0)  # x, y, yaw in odom
    driven = (0.0, 0.0)  # m/s and rad/s of the last command
    T_map_odom = np.eye(4)
    ranges: object = np.inf

    @classmethod
    def plan_path(cls, request: PlanPathRequest) -> PlanPathResponse:
        """Straight to the goal from where the robot is."""
        goal, start = request.goal.pose.position, request.start.pose.position
        cls.goals.append(request.goal)
        if math.hypot(goal.x, goal.y) > REACHABLE_M:
            return PlanPathResponse()
        points = np.linspace([start.x, start.y, 0.0], [goal.x, goal.y, 0.0], 20)
        heading = math.atan2(goal.y - start.y, goal.x - start.x)
        return PlanPathResponse(path_message(cls.clock_s, "map", points, heading), [], True)

    def setUp(self) -> None:
        cls = type(self)
        cls.clock_s, cls.at, cls.ranges, cls.T_map_odom = round(cls.clock_s + 2.0, 3), (0.0, 0.0, 0.0), np.inf, np.eye(4)
        self.cancel.publish(GoalID())
        wait_until(lambda: self.tick().state == "paused", "the robot to stand")
        self.resume.publish(True)
        wait_until(lambda: self.tick().state == "recalled", "exploration to go on")
        self.publish_terrain(np.zeros((CELLS, CELLS), np.int8))
        self.clear_costmaps()
        self.goals.clear()

    def tick(self) -> FollowerCommand:
        """The answer to the next odometry; the robot has done what the one before said."""
        cls = type(self)
        cls.clock_s = round(cls.clock_s + TICK_S, 3)
        self.clock.publish(clock(self.clock_s))
        self.scans.publish(scan(self.clock_s - 0.025, self.ranges))
        self.tf.publish(TFMessage([transform_stamped(self.clock_s, "map", "odom", self.T_map_odom)]))
        time.sleep(0.01)  # what belongs to an odometry is there before it: topics are not ordered among each other
        x, y, yaw = self.at
        self.odometry.publish(odometry(self.clock_s, x, y, yaw, *cls.driven))
        answer = self.commands.wait_for_stamp(self.clock_s)
        v, w = cls.driven = answer.twist.linear.x, answer.twist.angular.z
        cls.at = (x + v * TICK_S * math.cos(yaw), y + v * TICK_S * math.sin(yaw), yaw + w * TICK_S)
        return answer

    def tick_until(self, state: str, limit: int = 400) -> FollowerCommand:
        """The first answer with this state."""
        for _ in range(limit):
            answer = self.tick()
            if answer.state == state:
                return answer
        self.fail(f"not {state} after {limit} ticks but {answer.state}: {answer.reason}")

    @contextmanager
    def ticking(self) -> Iterator[None]:
        """Meanwhile the robot goes on by itself."""
        over = threading.Event()

        def go_on() -> None:
            while not over.is_set():
                self.tick()

        thread = threading.Thread(target=go_on)
        thread.start()
        try:
            yield
        finally:
            over.set()
            thread.join()

    def assert_stands(self, state: str) -> None:
        """For a second."""
        answers = [self.tick() for _ in range(20)]
        self.assertEqual({(a.state, a.twist.linear.x, a.twist.angular.z) for a in answers}, {(state, 0.0, 0.0)}, answers[-1].reason)
