#!/usr/bin/env python3
"""pybullet_sim_node in lock-step with a tracked robot: it never goes ahead of the answers, so that a busy machine changes nothing."""

import sys
import time
import unittest

import rospy
from explore_3dnav.msg import SimulationTick
from geometry_msgs.msg import Twist
from node_testing import Inbox, feed, wait_until
from std_msgs.msg import String
from std_srvs.srv import Trigger

import rostest
from ros_adapters.node import READY_TOPIC

QUIET_S = 0.5
TICKS = 5


class LockstepTrackedSimTest(unittest.TestCase):
    def test_sweep_of_a_standing_robot_waits_for_every_answer(self) -> None:
        ticks = Inbox("/simulation/tick", SimulationTick).wait_until_connected()
        velocity, done = feed("/cmd_vel", Twist), feed("/simulation/tick_done", SimulationTick)
        ready = rospy.Publisher(READY_TOPIC, String, latch=True, queue_size=1)
        ready.publish("scan_tracking_node")
        for number in range(TICKS):
            wait_until(lambda number=number: len(ticks.messages) > number, "a tick")
            if number == 1:
                self.assertTrue(rospy.ServiceProxy("start_sweep", Trigger)().success)
            velocity.publish(Twist())
            done.publish(SimulationTick(ticks.messages[number].header, ["/cmd_vel"], [number + 1], ticks.messages[number].recount))
        time.sleep(QUIET_S)
        self.assertEqual(len(ticks.messages), TICKS + 1)


if __name__ == "__main__":
    rospy.init_node("lockstep_tracked_sim_test")
    rostest.rosrun("explore_3dnav", "lockstep_tracked_sim", LockstepTrackedSimTest, sys.argv)
