"""What a replay has in place of a simulator: a clock paced by the wall clock, and somebody who watches."""

import time
from collections.abc import Callable

import numpy as np
import rospy
from rosgraph_msgs.msg import Clock

from ros_adapters.conversions import ros_time
from ros_adapters.node import Node

_VIEWER_WAIT_S = 60.0
_LONGEST_NAP_S = 0.1
_STATUS_PERIOD_S = 0.5
_CLOCK_STEP_S = 0.02
_FLUSH_S = 0.5  # the last messages are sent by threads of their own


def say(text: str) -> None:
    """One line for whoever started the replay."""
    print(f"[replay] {text}", flush=True)


class Stage:
    """The clock that is shown, and who watches."""

    def __init__(self, node: Node, seconds_until: Callable[[float, float], float], viewer: bool) -> None:
        """`seconds_until` tells how long a stamp is off at a reading of the wall clock; with a viewer all waits for rviz."""
        self._seconds_until = seconds_until
        self._viewer = viewer
        self._clock = node.publisher("/clock", Clock)
        self._shown_s = self._status_due = -np.inf

    def open(self, stamp_s: float, publisher: rospy.Publisher) -> None:
        """Waits until the viewer listens; the clock stands meanwhile, but there is one: rviz waits for it."""
        deadline = time.monotonic() + _VIEWER_WAIT_S
        while self._viewer and not publisher.get_num_connections() and time.monotonic() < deadline:
            self._clock.publish(Clock(ros_time(stamp_s)))
            self._nap(_LONGEST_NAP_S)

    def tick(self, stamp_s: float) -> bool:
        """Waits until a stamp is due and puts the clock to it; whether it moved by as much as is shown."""
        while (left := self._seconds_until(stamp_s, time.monotonic())) > 0:
            self._nap(min(left, _LONGEST_NAP_S))
        self._nap(0.0)
        if 0.0 <= stamp_s - self._shown_s < _CLOCK_STEP_S:
            return False
        self._shown_s = stamp_s
        self._clock.publish(Clock(ros_time(stamp_s)))
        return True

    def status(self, text: str) -> None:
        """Says `text`, unless it has just said something."""
        if time.monotonic() >= self._status_due:
            self._status_due = time.monotonic() + _STATUS_PERIOD_S
            say(text)

    def stay(self) -> None:
        """Until shutdown when there is a viewer."""
        while self._viewer:
            self._nap(_LONGEST_NAP_S)
        self._nap(_FLUSH_S)

    def _nap(self, seconds: float) -> None:
        if rospy.core.is_shutdown_requested():
            raise rospy.ROSInterruptException("shut down")
        time.sleep(seconds)
