#!/usr/bin/env python3
"""stop_scan_and_go_node running free with a made-up laser and follower: when it sweeps, what it forwards, when it stands."""

import sys
import time
import unittest

import rospy
from dynamic_reconfigure.client import Client
from explore_3dnav.msg import ExplorationDecision, FollowerCommand, RunEvent
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from node_testing import (
    DiagnosticsOf,
    Inbox,
    clock,
    feed,
    joints,
    odometry,
    one_line_of,
    run_misconfigured,
    slowness,
    wait_for_node,
    wait_until,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, SetBoolResponse, Trigger, TriggerResponse

import rostest
from ros_adapters.conversions import header

NODE = "stop_scan_and_go_node"
TICK_S = 0.05


class StopScanAndGoTest(unittest.TestCase):
    clock_s = 100.0
    answered = 0  # velocities before the last tick
    sweeps_asked_for = 0
    refusals = 0  # of the next sweeps that are asked for
    held: list[bool] = []
    x = 0.0

    @classmethod
    def setUpClass(cls) -> None:
        cls.services = [rospy.Service("start_sweep", Trigger, cls.start_sweep), rospy.Service("move_base_node/hold", SetBool, cls.hold)]
        wait_for_node(NODE)
        cls.velocities = Inbox("/cmd_vel", Twist).wait_until_connected()
        cls.events = Inbox("/exploration/event", RunEvent).wait_until_connected()
        cls.diagnostics = DiagnosticsOf(NODE).wait_until_connected()
        cls.clock = feed("/clock", Clock)
        cls.odometry = feed("/odom", Odometry)
        cls.joints = feed("/joint_states", JointState)
        cls.commands = feed("/cmd_vel/move_base", FollowerCommand)
        cls.decisions = feed("/exploration/decision", ExplorationDecision)
        cls.joystick = feed("/joy_teleop/cmd_vel", Twist)

    @classmethod
    def start_sweep(cls, _: object) -> TriggerResponse:
        cls.sweeps_asked_for += 1
        cls.refusals -= 1
        return TriggerResponse(cls.refusals < 0, "busy")

    @classmethod
    def hold(cls, request: object) -> SetBoolResponse:
        cls.held.append(request.data)
        return SetBoolResponse(True, "")

    def tick(
        self, tilt_rad: float = 0.0, v: float = 0.0, state: str = "following", moving: float = 0.0, without: str = "", late_s: float = 0.0
    ) -> None:
        """All inputs of the next moment, each on its own phase, but for the one `without` which it is; waits for its answer."""
        cls = StopScanAndGoTest
        cls.clock_s = round(cls.clock_s + TICK_S, 3)
        cls.x += moving * TICK_S
        self.clock.publish(clock(self.clock_s + late_s))
        answers = cls.answered = len(self.velocities.messages)
        if without != "/joint_states":
            self.joints.publish(joints(self.clock_s - 0.0113, tilt_rad))
        if without != "/odom":
            self.odometry.publish(odometry(self.clock_s - 0.0042, x=self.x, v=moving))
        time.sleep(0.002)
        command = FollowerCommand(header=header(self.clock_s, "base_link"), state=state)
        command.twist.linear.x = v
        self.commands.publish(command)
        wait_until(lambda: len(self.velocities.messages) > answers, "the velocity of the tick")

    def assert_driven(self, v: float) -> None:
        """The last tick had this answer. On a busy machine zeros come between ticks: the node stands while it hears no command."""
        wait_until(lambda: any(abs(m.linear.x - v) < 1e-7 for m in self.velocities.messages[self.answered :]), f"{v} m/s")

    def tick_until_driven(self, v: float, limit: int = 20) -> None:
        """After a silence: a command that is heard before what was silent is answered with zero."""
        for _ in range(limit):
            self.tick(v=v)
            if any(abs(m.linear.x - v) < 1e-7 for m in self.velocities.messages[self.answered :]):
                return
        self.fail(f"not {v} m/s after {limit} ticks")

    def state(self) -> str:
        return self.events.messages[-1].state if self.events.messages else ""

    def tick_until(self, wanted: str, limit: int = 80, **inputs: object) -> None:
        for _ in range(limit):
            self.tick(**inputs)
            if self.state() == wanted:
                return
        self.fail(f"not {wanted} after {limit} ticks but {self.state()}: {self.events.messages[-1].reason}")

    def play_sweep(self) -> float:
        """The laser tilts and comes back; the stamp at which the sweep was seen to be over."""
        for _ in range(4):
            self.tick(tilt_rad=0.5)
        sweeps = self.events.messages[-1].sweeps
        for _ in range(10):
            self.tick()
            if self.events.messages[-1].sweeps > sweeps:
                return self.clock_s
        self.fail("the sweep did not end")

    def decide(self, kind: str) -> None:
        """The decision about the sweep that has just ended."""
        self.decisions.publish(ExplorationDecision(header=header(self.clock_s, "map"), kind=kind, reason="in the test", has_terrain=True))

    def drive(self) -> None:
        """Up to driving, from wherever the last test left the robot."""
        if self.state() == "driving":
            return
        self.tick_until("sweeping")
        self.play_sweep()
        self.decide("goal")
        wait_until(lambda: self.state() == "driving", "the decision to be taken")
        self.tick()
        self.assertEqual(self.state(), "driving")

    def test_0_joystick_that_falls_silent_before_the_first_command_leaves_the_robot_standing(self) -> None:
        twist = Twist()
        twist.linear.x = 0.15
        wait_until(lambda: (self.joystick.publish(twist), self.velocities.messages)[1], "the joystick to drive")
        self.assertEqual(self.velocities.messages[0].linear.x, 0.15)
        wait_until(lambda: self.velocities.messages[-1].linear.x == 0.0, "the robot to stand when the joystick lets go")

    def test_1_first_sweep_is_asked_for_once_the_robot_stands(self) -> None:
        self.tick_until("sweeping")
        self.assertEqual(self.sweeps_asked_for, 1)
        self.assertTrue(self.held[-1])
        self.assertEqual(self.velocities.messages[-1].linear.x, 0.0)

    def test_2_robot_stands_until_the_decision_is_there(self) -> None:
        self.play_sweep()
        self.assertEqual(self.state(), "mapping")
        self.tick(v=0.3)
        self.assertEqual(self.velocities.messages[-1].linear.x, 0.0)
        self.decide("goal")
        wait_until(lambda: self.state() == "driving", "the decision to be taken")

    def test_3_follower_drives_after_the_decision(self) -> None:
        self.drive()
        self.assertFalse(self.held[-1])
        self.tick(v=0.37, moving=0.37)
        self.assert_driven(0.37)

    def test_4_distance_since_the_last_sweep_asks_for_the_next(self) -> None:
        self.drive()
        asked = self.sweeps_asked_for
        self.tick_until("settling", v=0.5, moving=0.5, limit=150)
        self.assertTrue(self.events.messages[-1].intermediate)
        self.assertEqual(self.velocities.messages[-1].linear.x, 0.0)
        self.tick_until("sweeping")
        self.assertEqual(self.sweeps_asked_for, asked + 1)

    def test_4_sweep_that_was_refused_is_asked_for_again(self) -> None:
        self.drive()
        StopScanAndGoTest.refusals, asked = 2, self.sweeps_asked_for
        self.tick_until("settling", v=0.5, moving=0.5, limit=150)
        self.tick_until("sweeping")
        for _ in range(30):
            self.tick()
        self.assertEqual((self.state(), self.sweeps_asked_for), ("sweeping", asked + 3))
        self.play_sweep()
        self.decide("goal")
        wait_until(lambda: self.state() == "driving", "the decision to be taken")

    def test_4_distance_is_changed_on_the_way(self) -> None:
        client = Client(NODE, timeout=60.0)
        self.drive()
        before = self.x
        client.update_configuration({"max_distance_m": 0.5})
        self.tick_until("settling", v=0.5, moving=0.5, limit=150)
        client.update_configuration({"max_distance_m": 2.5})
        self.assertLess(self.x - before, 0.7)

    def test_5_failure_of_the_follower_is_passed_on(self) -> None:
        self.drive()
        self.tick_until("settling", state="stuck", limit=40)
        self.assertIn("stuck", self.events.messages[-1].failure)

    def test_6_odometry_that_is_no_pose_is_counted(self) -> None:
        self.drive()
        self.odometry.publish(odometry(self.clock_s + 0.01, x=float("nan")))
        self.diagnostics.wait_for_dropped("bad Odometry")

    def test_6_robot_stands_while_odometry_or_joint_states_are_silent_and_goes_on_afterwards(self) -> None:
        for silent in ("/odom", "/joint_states"):
            self.drive()
            self.tick(v=0.2)
            self.assert_driven(0.2)
            for _ in range(7):
                self.tick(v=0.2, without=silent)
            time.sleep(0.2)  # answers of a busy machine are late
            noticed = len(self.velocities.messages)
            for _ in range(3):
                self.tick(v=0.2, without=silent)
            self.assertEqual({m.linear.x for m in self.velocities.messages[noticed:]}, {0.0})
            self.tick_until_driven(0.2)

    def test_6_robot_stands_while_commands_come_late_and_goes_on_afterwards(self) -> None:
        self.drive()
        self.tick(v=0.2, late_s=0.2)
        self.assert_driven(0.2)
        self.tick(v=0.2, late_s=0.4)
        noticed = len(self.velocities.messages)
        for _ in range(3):
            self.tick(v=0.2, late_s=0.4)
        self.assertEqual({m.linear.x for m in self.velocities.messages[noticed:]}, {0.0})
        wait_until(lambda: (self.tick(late_s=0.4), "commands come late" in self.diagnostics.message())[1], "the word of it")
        self.tick(v=0.2)
        self.tick_until_driven(0.2)

    def test_6_zero_is_sent_when_commands_cease_and_the_silence_is_named(self) -> None:
        second_s, said = slowness(), "no /cmd_vel/move_base"
        self.drive()
        wait_until(lambda: (self.tick(v=0.2), said not in self.diagnostics.message())[1], "no word of silence")
        answers, silent_s = len(self.velocities.messages), time.monotonic()
        wait_until(lambda: any(m.linear.x == 0.0 for m in self.velocities.messages[answers:]), "a zero", 0.5 * second_s)
        wait_until(lambda: said in self.diagnostics.message(), "the word of it", silent_s + second_s - time.monotonic())
        self.assertEqual(self.velocities.messages[-1].linear.x, 0.0)
        self.tick(v=0.2)
        self.assert_driven(0.2)

    def steer(self, v: float, w: float, seconds: float) -> float:
        """A joystick at 20 Hz, of which the follower knows nothing; when it spoke last."""
        twist = Twist()
        twist.linear.x, twist.angular.z = v, w
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            last = time.monotonic()
            self.joystick.publish(twist)
            time.sleep(0.005)
            self.tick(v=0.3, moving=v)
            time.sleep(0.04)
        return last

    def test_6_joystick_wins_for_as_long_as_it_comes_and_exploration_goes_on_with_a_sweep(self) -> None:
        self.drive()
        last = self.steer(-0.2, 0.4, 1.0)
        newest = self.velocities.messages[-1]
        self.assertEqual((newest.linear.x, newest.angular.z, self.state()), (-0.2, 0.4, "taken_over"))
        self.assertTrue(self.held[-1])
        while self.state() == "taken_over":
            self.tick(v=0.3, moving=-0.2)
            time.sleep(0.02)
        self.assertGreater(time.monotonic() - last, 0.3)
        self.assertLess(time.monotonic() - last, 5.0 * slowness())
        self.assertEqual((self.velocities.messages[-1].linear.x, self.state()), (0.0, "settling"))
        self.drive()
        self.tick(v=0.3)
        self.assert_driven(0.3)

    def test_6_joystick_that_says_no_number_is_counted_and_moves_nothing(self) -> None:
        self.drive()
        twist = Twist()
        twist.linear.x = float("nan")
        self.joystick.publish(twist)
        self.diagnostics.wait_for_dropped("bad Twist")
        self.tick(v=0.3)
        self.assert_driven(0.3)

    def test_6_joystick_drives_while_the_follower_is_silent(self) -> None:
        self.drive()
        self.tick(v=0.2)
        time.sleep(0.5)
        twist = Twist()
        twist.linear.x = 0.15
        before = len(self.velocities.messages)
        for _ in range(10):
            self.joystick.publish(twist)
            time.sleep(0.05)
        wait_until(lambda: any(abs(m.linear.x - 0.15) < 1e-7 for m in self.velocities.messages[before:]), "the joystick to drive")
        wait_until(lambda: self.velocities.messages[-1].linear.x == 0.0, "the robot to stand when the joystick lets go")

    def test_6_robot_stands_while_exploration_is_paused_and_sweeps_when_it_goes_on(self) -> None:
        self.drive()
        self.tick(v=0.0, state="paused")
        asked = self.sweeps_asked_for
        for _ in range(150):
            self.tick(v=0.0, state="paused")
        self.assertEqual((self.state(), self.sweeps_asked_for), ("paused", asked))
        self.tick_until("sweeping", state="idle")
        self.play_sweep()
        self.decide("goal")
        wait_until(lambda: self.state() == "driving", "the decision to be taken")

    def test_7_decision_of_an_unknown_kind_is_counted_and_dropped(self) -> None:
        self.drive()
        self.decisions.publish(ExplorationDecision(header=header(self.clock_s - 100.0, "map"), kind="maybe"))
        for _ in range(30):
            self.tick()
        self.diagnostics.wait_for_dropped("bad ExplorationDecision")
        self.assertEqual(self.state(), "driving")

    def test_8_time_that_jumps_back_starts_afresh(self) -> None:
        self.drive()
        StopScanAndGoTest.clock_s -= 60.0
        self.decisions.publish(ExplorationDecision(header=header(self.clock_s, "map"), kind="goal", has_terrain=True))
        self.tick(v=0.2)
        self.assert_driven(0.2)

    def test_9_last_decision_ends_the_run_with_its_reason(self) -> None:
        self.drive()
        self.tick_until("sweeping", state="reached", limit=150)
        self.play_sweep()
        self.decide("explored")
        self.assertTrue(self.events.wait_for(lambda m: m.state == "finished").reason.startswith("explored"))

    def test_9_then_a_goal_is_driven_to(self) -> None:
        self.assertEqual(self.state(), "finished")
        for _ in range(15):
            self.tick(state="idle")
        self.assertEqual((self.state(), self.held[-1]), ("finished", True))
        self.tick_until("driving", state="following", limit=5)
        self.tick(v=0.3)
        self.assert_driven(0.3)
        self.assertFalse(self.held[-1])

    def test_wrong_parameter_ends_the_node_with_the_nearest_name(self) -> None:
        code, stderr = run_misconfigured(NODE, "max_distance:=3.0")
        self.assertEqual(code, 2, stderr)
        self.assertIn("did you mean max_distance_m?", one_line_of(stderr))


if __name__ == "__main__":
    rospy.init_node("stop_scan_and_go_test")
    rostest.rosrun("explore_3dnav", "stop_scan_and_go", StopScanAndGoTest, sys.argv)
