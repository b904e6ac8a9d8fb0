"""How late messages come: what a node hears in time on a computer that is fast enough may be seconds old on one that is not."""

import time

import rospy
from rosgraph_msgs.msg import Clock

from ros_adapters.node import Node

TOO_SLOW = "this computer is too slow, or its clock is not the robot's"


class Lateness:
    """Asks the clock of ROS, which stamps come from: the time of day, or /clock with /use_sim_time."""

    def __init__(self, node: Node) -> None:
        self._waits = node.lockstep  # there the clock waits for the nodes
        self._simulated_s = 0.0
        self._is_simulated = bool(rospy.get_param("/use_sim_time", False))
        if self._is_simulated and not self._waits:
            self._subscriber = rospy.Subscriber("/clock", Clock, self._on_clock, queue_size=1, tcp_nodelay=True)

    def of(self, stamp_s: float) -> float:
        """Seconds from a stamp until now; 0 in lock-step."""
        if self._waits:
            return 0.0
        return (self._simulated_s if self._is_simulated else time.time()) - stamp_s

    def words(self, stamp_s: float, limit_s: float) -> str:
        """By how much more than `limit_s` a stamp is late, and why; empty when it is not."""
        late_s = self.of(stamp_s)
        return f"{late_s:.1f} s late: {TOO_SLOW}" if late_s > limit_s else ""

    def _on_clock(self, message: Clock) -> None:
        self._simulated_s = message.clock.to_sec()
