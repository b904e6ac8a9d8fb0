"""How late messages come: on a computer that is too slow they wait for seconds before a node hears them."""

import time

import rospy
from rosgraph_msgs.msg import Clock

from ros_adapters.node import Node

_EARLY_S = 0.1  # two clocks that chrony keeps, and stamps of the middle of a measurement, differ by less
_TOO_SLOW = "this computer is too slow, or its clock is not the robot's"


class Lateness:
    """Asks the clock of ROS, which stamps come from: the time of day, or /clock with /use_sim_time."""

    def __init__(self, node: Node) -> None:
        self._waits = node.lockstep
        self._simulated_s = 0.0
        self._is_simulated = bool(rospy.get_param("/use_sim_time", False))
        if self._is_simulated and not self._waits:
            self._subscriber = rospy.Subscriber("/clock", Clock, self._on_clock, queue_size=1, tcp_nodelay=True)

    def words(self, stamp_s: float, limit_s: float) -> str:
        """How late a stamp is, and why; empty up to `limit_s`, and in lock-step, where the clock waits for the nodes.

        Or that it is ahead of this computer's clock: what is late then looks in time. /clock may come after what it stamps.
        """
        late_s = self.age_s(stamp_s)
        if late_s is None:
            return ""
        if late_s < -_EARLY_S and not self._is_simulated:
            return f"stamped {-late_s:.1f} s ahead of this computer's clock: give them one clock"
        return f"{late_s:.1f} s late: {_TOO_SLOW}" if late_s > limit_s else ""

    def age_s(self, stamp_s: float) -> float | None:
        """Seconds since a stamp, negative where it is ahead; None in lock-step."""
        return None if self._waits else (self._simulated_s if self._is_simulated else time.time()) - stamp_s

    def _on_clock(self, message: Clock) -> None:
        self._simulated_s = message.clock.to_sec()
