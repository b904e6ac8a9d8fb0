#!/usr/bin/env python3
"""pybullet_sim_node in lock-step, with a chain of nodes that is this test: every tick is complete, and waits for all of its commands."""

import sys
import time
import unittest

import rospy
from explore_3dnav.msg import SimulationTick
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from node_testing import DiagnosticsOf, Inbox, feed, wait_until
from sensor_msgs.msg import Imu, JointState, LaserScan
from std_msgs.msg import String
from std_srvs.srv import Trigger

import rostest
from ros_adapters.conversions import stamp_of
from ros_adapters.kernel_loading import LOADING_TOPIC
from ros_adapters.node import READY_TOPIC

QUIET_S = 0.5


class LockstepSimTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        kinds = {"/scan": LaserScan, "/joint_states": JointState, "/imu/data": Imu, "/wheel_odom": Odometry}
        cls.sensors = {topic: Inbox(topic, kind).wait_until_connected() for topic, kind in kinds.items()}
        cls.ticks = Inbox("/simulation/tick", SimulationTick).wait_until_connected()
        cls.velocity, cls.done = feed("/cmd_vel", Twist), feed("/simulation/tick_done", SimulationTick)
        cls.diagnostics = DiagnosticsOf("pybullet_sim_node")
        cls.sent = cls.answered = 0
        loading = feed(LOADING_TOPIC, String)
        for _ in range(17):  # longer than the simulator waits for a node that says nothing
            loading.publish("chain")
            time.sleep(1.0)
        cls.ready = rospy.Publisher(READY_TOPIC, String, latch=True, queue_size=1)
        cls.ready.publish("chain")

    def next_tick(self) -> SimulationTick:
        """The next tick that is not answered, when all that it counts has come."""
        wait_until(lambda: len(self.ticks.messages) > self.answered, "a tick")
        tick = self.ticks.messages[self.answered]
        for topic, count in zip(tick.topics, tick.counts, strict=True):
            wait_until(lambda topic=topic, count=count: len(self.sensors[topic].messages) >= count, f"{count} of {topic}")
        return tick

    def command(self, *turn_rates: float) -> None:
        for w in turn_rates:
            message = Twist()
            message.angular.z = w
            self.velocity.publish(message)

    def answer(self, tick: SimulationTick, commands: int) -> None:
        """When so many commands belong to the tick."""
        type(self).sent += commands
        type(self).answered += 1
        self.done.publish(SimulationTick(tick.header, ["/cmd_vel"], [self.sent], tick.recount))

    def go_on(self, ticks: int, *turn_rates: float) -> None:
        """Each tick with these commands."""
        for _ in range(ticks):
            tick = self.next_tick()
            self.command(*turn_rates)
            self.answer(tick, len(turn_rates))

    def turn_rate(self) -> float:
        """By the newest wheel odometry."""
        self.next_tick()
        return float(self.sensors["/wheel_odom"].messages[-1].twist.twist.angular.z)

    def test_1_simulator_stands_until_a_tick_is_answered(self) -> None:
        self.next_tick()
        time.sleep(QUIET_S)
        self.assertEqual(len(self.ticks.messages), self.answered + 1)

    def test_2_every_tick_counts_exactly_what_was_sent(self) -> None:
        for _ in range(20):
            tick = self.next_tick()
            self.assertEqual([len(self.sensors[topic].messages) for topic in tick.topics], list(tick.counts))
            self.assertTrue(all(stamp_of(box.messages[-1]) < stamp_of(tick) for box in self.sensors.values() if box.messages))
            self.answer(tick, 0)

    def test_3_answer_whose_commands_have_not_come_is_waited_for(self) -> None:
        tick = self.next_tick()
        self.answer(tick, 1)
        time.sleep(QUIET_S)
        self.assertEqual(len(self.ticks.messages), self.answered)
        self.command(0.0)
        self.next_tick()

    def test_4_newest_of_several_commands_counts(self) -> None:
        self.go_on(12, -0.6, 0.6)
        self.assertGreater(self.turn_rate(), 0.4)

    def test_5_ticks_without_a_command_go_on_with_the_last_for_a_quarter_of_a_second(self) -> None:
        self.go_on(12, 0.6)
        self.go_on(4)
        self.assertGreater(self.turn_rate(), 0.4)
        self.go_on(8)
        self.assertLess(abs(self.turn_rate()), 0.02)

    def test_6_answer_that_counts_no_commands_is_dropped_and_told(self) -> None:
        tick = self.next_tick()
        self.done.publish(SimulationTick(tick.header, [], [], tick.recount))
        time.sleep(QUIET_S)
        self.assertEqual(len(self.ticks.messages), self.answered + 1)
        self.go_on(30, 0.0)
        self.diagnostics.wait_for_dropped("bad SimulationTick")

    def test_7_silent_sensor_sends_nothing_in_its_time_and_the_others_go_on(self) -> None:
        self.go_on(100 - self.answered, 0.0)
        begin_s = stamp_of(self.ticks.messages[0]) - 0.05
        stamps = [stamp_of(m) - begin_s for m in self.sensors["/imu/data"].messages]
        self.assertFalse([s for s in stamps if 3.0 < s + 0.003 < 4.0])
        self.assertGreater(len([s for s in stamps if 4.0 < s < 4.5]), 40)
        self.assertGreater(len([m for m in self.sensors["/scan"].messages if 3.0 < stamp_of(m) - begin_s < 4.0]), 30)

    def test_8_sweep_of_a_standing_robot_goes_a_few_ticks_ahead_of_the_answers(self) -> None:
        self.go_on(2, 0.0)
        self.next_tick()
        self.assertTrue(rospy.ServiceProxy("start_sweep", Trigger)().success)
        self.go_on(1, 0.0)
        wait_until(lambda: len(self.ticks.messages) >= self.answered + 5, "ticks ahead of the answers")
        time.sleep(QUIET_S)
        self.assertEqual(len(self.ticks.messages), self.answered + 5)
        self.go_on(130, 0.0)
        self.next_tick()
        time.sleep(QUIET_S)
        self.assertEqual(len(self.ticks.messages), self.answered + 1)

    def comes_back(self) -> int:
        """This chain is ready once more; the recount that follows."""
        before = self.ticks.messages[-1].recount
        self.ready.publish("chain")
        wait_until(lambda: self.ticks.messages[-1].recount > before, "a recount")
        return int(self.ticks.messages[-1].recount)

    def test_9_node_that_is_ready_once_more_has_the_last_tick_told_again_and_all_count_anew(self) -> None:
        before = self.next_tick()
        for _ in range(3):  # 21 s together, and after 15 in which none came back it would be over
            self.comes_back()
            time.sleep(7.0)
        recount, told = self.comes_back(), len(self.ticks.messages)
        self.assertEqual((stamp_of(self.ticks.messages[-1]), self.ticks.messages[-1].counts), (stamp_of(before), before.counts))
        self.done.publish(SimulationTick(before.header, ["/cmd_vel"], [self.sent], before.recount))  # of the process before
        time.sleep(QUIET_S)
        self.assertEqual(len(self.ticks.messages), told)
        self.done.publish(SimulationTick(before.header, ["/cmd_vel"], [0], recount))  # of one that has sent nothing yet
        wait_until(lambda: len(self.ticks.messages) > told, "the next tick")
        after = self.ticks.messages[told]
        self.assertEqual((round(stamp_of(after) - stamp_of(before), 3), after.recount), (0.05, recount))


if __name__ == "__main__":
    rospy.init_node("chain", disable_rostime=True)
    rostest.rosrun("explore_3dnav", "lockstep_sim", LockstepSimTest, sys.argv)
