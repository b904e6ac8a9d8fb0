#!/usr/bin/env python3
"""dynamic_reconfigure's own client at move_base_node: what it reads, changes and is refused, and that the run remembers."""

import json
import os
import signal
import sys
import xmlrpc.client
from pathlib import Path

import rosgraph
import rospy
from dynamic_reconfigure import DynamicReconfigureCallbackException
from dynamic_reconfigure.client import Client
from dynamic_reconfigure.msg import Config, DoubleParameter
from dynamic_reconfigure.srv import Reconfigure
from fed_move_base import NODE, FedMoveBase
from node_testing import wait_for_node, wait_until

import rostest
from ros_adapters.reconfigure import values_of

SPEED = "follower_max_speed_mps"


class ReconfigureTest(FedMoveBase):
    """One robot that drives straight ahead."""

    @classmethod
    def setUpClass(cls) -> None:
        super().setUpClass()
        wait_for_node("exploration_monitor_node")
        cls.client = Client(NODE, timeout=60.0)
        cls.client.get_configuration(timeout=60.0)

    def setUp(self) -> None:
        super().setUp()
        self.client.update_configuration({SPEED: 0.5, "follower_passage_speed_mps": 0.25, "costmap_inflation_radius_m": 0.9})

    def top_speed(self) -> float:
        return max(self.tick().twist.linear.x for _ in range(40))

    def test_client_reads_names_ranges_units_and_values(self) -> None:
        described = {p["name"]: p for p in self.client.get_parameter_descriptions()}
        speed = described[SPEED]
        self.assertEqual((speed["min"], speed["max"], speed["type"]), (0.05, 2.0, "double"))
        self.assertIn("[m/s]", speed["description"])
        wait_until(lambda: self.client.get_configuration()[SPEED] == 0.5, "who listens to hear of it")
        self.assertTrue({"costmap_inflation_radius_m", "monitor_margin_m"} <= described.keys())
        self.assertNotIn("costmap_size_m", described)

    def test_robot_that_drives_obeys_from_the_next_tick_on(self) -> None:
        self.store_straight_ahead()
        self.assertAlmostEqual(self.top_speed(), 0.5, places=2)
        answer = self.client.update_configuration({SPEED: 0.2})
        self.assertEqual(answer[SPEED], 0.2)
        self.tick()
        self.assertLess(self.tick().twist.linear.x, 0.5)
        for _ in range(5):
            self.tick()
        self.assertAlmostEqual(self.top_speed(), 0.2, places=2)
        wait_until(lambda: self.client.get_configuration()[SPEED] == 0.2, "who listens to hear of it")

    def test_what_is_out_of_range_or_contradicts_another_is_refused_and_nothing_changes(self) -> None:
        for changes in (
            {SPEED: 9.0},
            {SPEED: float("nan")},
            {SPEED: 0.05, "follower_passage_speed_mps": 0.1},  # below the slowest speed
            {SPEED: 0.3, "costmap_inflation_radius_m": 0.1},  # less than the robot is wide: only the robot tells
        ):
            with self.assertRaises(DynamicReconfigureCallbackException):
                self.client.update_configuration(changes)
        self.assertEqual(self.client.update_configuration({})[SPEED], 0.5)
        self.store_straight_ahead()
        self.assertAlmostEqual(self.top_speed(), 0.5, places=2)

    def test_refusal_names_parameter_and_reason(self) -> None:
        call = rospy.ServiceProxy(f"/{NODE}/set_parameters", Reconfigure)
        for name, value, why in (
            (SPEED, 9.0, "max_speed_mps = 9.0 is above 2.0"),
            ("follower_max_sped_mps", 0.3, f"did you mean {SPEED}"),
            ("costmap_size_m", 4.0, "costmap_size_m cannot be changed while the node runs"),
            ("costmap_inflation_radius_m", 0.1, "inflation_radius_m = 0.1 is below half of the robot's width"),
        ):
            with self.assertRaisesRegex(rospy.ServiceException, why):
                call(Config(doubles=[DoubleParameter(name, value)]))

    def test_change_is_in_the_run_s_folder_and_not_on_the_parameter_server(self) -> None:
        self.tick()
        self.client.update_configuration({SPEED: 0.45})
        path = Path(rospy.get_param("/exploration_monitor_node/out")) / "run.json"

        def told() -> dict[str, object]:
            return (json.loads(path.read_text())["parameter_changes"] or [{}])[-1]

        wait_until(lambda: path.is_file() and told().get("value") == 0.45, "the change in run.json")
        self.assertEqual((told()["node"], told()["parameter"], told()["before"]), (NODE, SPEED, 0.5))
        self.assertAlmostEqual(told()["stamp_s"], self.clock_s, places=3)
        self.assertNotEqual(rospy.get_param(f"/{NODE}/follower/max_speed_mps", None), 0.45)

    def test_when_it_is_started_again_the_node_has_what_it_was_told(self) -> None:
        """Last of all tests: the others are heard by the first process."""
        self.client.update_configuration({SPEED: 0.35, "costmap_inflation_radius_m": 0.8})
        pid = self.pid()
        os.kill(pid, signal.SIGKILL)
        wait_until(lambda: self.pid() not in (0, pid), "the next process of the node", 120.0)
        wait_until(lambda: self.told().get(SPEED) == 0.35, "its parameters", 120.0)
        self.assertEqual(self.told()["costmap_inflation_radius_m"], 0.8)

    def pid(self) -> int:
        """Of the node's process, 0 while there is none."""
        try:
            return int(xmlrpc.client.ServerProxy(rosgraph.Master("/test").lookupNode(f"/{NODE}")).getPid("/test")[2])
        except (OSError, rosgraph.MasterError):
            return 0

    def told(self) -> dict[str, object]:
        try:
            return values_of(rospy.ServiceProxy(f"/{NODE}/set_parameters", Reconfigure)(Config()).config)
        except rospy.ServiceException:
            return {}


if __name__ == "__main__":
    rospy.init_node("reconfigure_test")
    rostest.rosrun("explore_3dnav", "reconfigure", ReconfigureTest, sys.argv)
