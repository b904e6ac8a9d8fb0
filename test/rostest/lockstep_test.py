#!/usr/bin/env python3
"""stop_scan_and_go_node in lock-step: when it answers a tick."""

import sys
import time
import unittest

import rospy
from explore_3dnav.msg import ExplorationDecision, FollowerCommand, RunEvent, SimulationTick
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from node_testing import QUIET_S, Inbox, feed, joints, odometry, wait_for_node, wait_until
from sensor_msgs.msg import JointState
from std_msgs.msg import Header
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse

import rostest
from ros_adapters.conversions import header, ros_time

TICK_S = 0.05


class LockstepTest(unittest.TestCase):
    clock_s = 100.0
    commands_sent = clouds = 0

    @classmethod
    def setUpClass(cls) -> None:
        cls.services = [
            rospy.Service("start_sweep", Trigger, lambda _: TriggerResponse(True, "")),
            rospy.Service("move_base_node/hold", SetBool, lambda _: SetBoolResponse(True, "")),
        ]
        cls.odometry, cls.joints = feed("/odom", Odometry), feed("/joint_states", JointState)
        cls.commands = feed("/cmd_vel/move_base", FollowerCommand)
        cls.decisions = feed("/exploration/decision", ExplorationDecision)
        cls.terrains = feed("/move_base_node/terrain_taken", Header)
        cls.ticks = feed("/simulation/tick/move_base_node", SimulationTick)
        wait_for_node("stop_scan_and_go_node")
        cls.velocities = Inbox("/cmd_vel", Twist).wait_until_connected()
        cls.done = Inbox("/simulation/tick_done", SimulationTick).wait_until_connected()
        cls.events = Inbox("/exploration/event", RunEvent).wait_until_connected()

    def send(self, tilt_rad: float = 0.0, *, command: bool = True, told_commands: int | None = None) -> float:
        """A tick and what belongs to it, in an order that no node may count on."""
        cls = LockstepTest
        cls.clock_s = round(cls.clock_s + TICK_S, 3)
        cls.commands_sent += command
        counts = {"/cmd_vel/move_base": told_commands or cls.commands_sent, "/sweep_cloud": cls.clouds}
        self.ticks.publish(SimulationTick(header(cls.clock_s, ""), list(counts), list(counts.values()), 0))
        if command:
            self.commands.publish(FollowerCommand(header=header(cls.clock_s, "base_link"), state="following"))
        self.joints.publish(joints(cls.clock_s - 0.013, tilt_rad))
        self.odometry.publish(odometry(cls.clock_s - 0.004))
        time.sleep(0.005)
        return cls.clock_s

    def answered(self, stamp_s: float) -> bool:
        return any(abs(m.header.stamp.to_sec() - stamp_s) < 1e-6 for m in self.done.messages)

    def tick(self, tilt_rad: float = 0.0) -> None:
        stamp_s = self.send(tilt_rad)
        wait_until(lambda: self.answered(stamp_s), f"the answer to the tick at {stamp_s} s")

    def state(self) -> str:
        return self.events.messages[-1].state if self.events.messages else ""

    def test_1_tick_is_answered_once_all_that_was_sent_is_here(self) -> None:
        self.tick()
        stamp_s = self.send(told_commands=LockstepTest.commands_sent + 2)  # one more than this tick's is still on its way
        time.sleep(QUIET_S)
        self.assertFalse(self.answered(stamp_s))
        LockstepTest.commands_sent += 1
        self.commands.publish(FollowerCommand(header=header(self.clock_s, "base_link"), state="following"))
        wait_until(lambda: self.answered(stamp_s), "the answer")

    def test_2_tick_without_a_command_is_answered_with_none(self) -> None:
        self.tick()
        velocities = self.done.messages[-1].counts[0]
        stamp_s = self.send(command=False)
        wait_until(lambda: self.answered(stamp_s), "the answer")
        self.assertEqual(self.done.messages[-1].counts[0], velocities)
        wait_until(lambda: len(self.velocities.messages) == velocities, "as many velocities as are told")

    def test_3_clock_goes_on_until_the_cloud_is_out_and_stands_until_decision_and_terrain(self) -> None:
        for _ in range(80):
            self.tick()
            if self.state() == "sweeping":
                break
        for tilt_rad in (0.5,) * 4 + (0.0,) * 8:
            self.tick(tilt_rad)
        wait_until(lambda: self.state() == "mapping", "the sweep to be over")
        LockstepTest.clouds += 1
        stamp_s = self.send()
        time.sleep(QUIET_S)
        self.assertFalse(self.answered(stamp_s))
        self.decisions.publish(ExplorationDecision(header=header(stamp_s, "map"), kind="goal", reason="in the test", has_terrain=True))
        time.sleep(QUIET_S)
        self.assertFalse(self.answered(stamp_s))
        self.terrains.publish(Header(stamp=ros_time(stamp_s)))
        wait_until(lambda: self.answered(stamp_s), "the answer")
        wait_until(lambda: self.state() == "driving", "the decision to be taken")

    def test_4_decision_about_a_robot_that_was_not_found_waits_for_no_terrain(self) -> None:
        LockstepTest.clouds += 1
        stamp_s = self.send()
        time.sleep(QUIET_S)
        self.assertFalse(self.answered(stamp_s))
        self.decisions.publish(ExplorationDecision(header=header(stamp_s, "map"), kind="keep", reason="not found", has_terrain=False))
        wait_until(lambda: self.answered(stamp_s), "the answer")


if __name__ == "__main__":
    rospy.init_node("lockstep_test")
    rostest.rosrun("explore_3dnav", "lockstep", LockstepTest, sys.argv)
