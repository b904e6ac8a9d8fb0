"""What every node does the same way: parameters, subscriptions under one lock, diagnostics, and the word that it is ready."""

import sys
import threading
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rospy.numpy_msg import numpy_msg
from std_msgs.msg import String

from robot_body import RobotBody
from ros_adapters.conversions import ros_time
from ros_adapters.urdf_mount import robot_of_parameters
from stage_config import ConfigError, load_config

C = TypeVar("C")
M = TypeVar("M")
R = TypeVar("R")

READY_TOPIC = "/simulation/ready"
_DIAGNOSTICS_PERIOD_S = 1.0
_NEWS_PERIOD_S = 0.5  # wall time, as rospy.spin looks for the shutdown


def heard_publishers(subscriber: rospy.Subscriber) -> set[str]:
    """Names of the nodes from which messages arrive by now.

    rospy counts a connection before it has called the publisher; only the answer to its handshake gives the publisher's name.
    """
    return {c.callerid_pub for c in subscriber.impl.connections} - {"unknown"}


class Diagnostics:
    """Counts what was dropped and why; publishes the counters on /diagnostics once a second of stamped time; later news too."""

    def __init__(self, name: str) -> None:
        self._name = name
        self._counts: Counter[str] = Counter()
        self._last_text: dict[str, str] = {}
        self._published_at: float | None = None
        self._published: list[tuple[str, str]] = []
        self._publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        self.values: dict[str, Any] = {}

    def dropped(self, what: str, text: str) -> None:
        """Counts a dropped input under `what` and warns of it, at most once a second."""
        self._counts[what] += 1
        self._last_text[what] = text
        rospy.logwarn_throttle(1.0, f"{self._name}: {what}: {text} ({self._counts[what]} so far)")

    def report(self, stamp_s: float) -> None:
        """Publishes when a second has passed since the last time, or time jumped back."""
        last = self._published_at
        if last is None or not 0.0 <= stamp_s - last < _DIAGNOSTICS_PERIOD_S:
            self._publish(stamp_s)

    def report_news(self) -> None:
        """Publishes, with the last stamp, when something has changed since: also a node whose input has ceased tells why."""
        if self._items() != self._published:
            self._publish(self._published_at or 0.0)

    def _items(self) -> list[tuple[str, str]]:
        dropped = [(f"dropped: {what}", f"{n}, last: {self._last_text[what]}") for what, n in self._counts.items()]
        return [(str(k), str(v)) for k, v in self.values.items()] + dropped

    def _publish(self, stamp_s: float) -> None:
        self._published_at, self._published = stamp_s, self._items()
        level = DiagnosticStatus.WARN if self._counts else DiagnosticStatus.OK
        message = "; ".join(f"{n} x {what}" for what, n in self._counts.items()) or "ok"
        values = [KeyValue(k, v) for k, v in self._published]
        array = DiagnosticArray(status=[DiagnosticStatus(level, self._name, message, "explore_3dnav", values)])
        array.header.stamp = ros_time(stamp_s)
        self._publisher.publish(array)


class Node:
    """A rospy node whose callbacks run one at a time, drop what is wrong, and live on.

    Small topics are received without a queue and with tcp_nodelay: in lock-step every hop counts. One re-entrant lock guards all
    callbacks of a node; no callback waits for ROS time, nor reads it: stamps come with the messages, and /clock is not listened to.
    """

    def __init__(self, name: str) -> None:
        rospy.init_node(name, disable_rostime=True)
        self.name = name
        self.lock = threading.RLock()
        self.lockstep = bool(rospy.get_param("/lockstep", False))
        self.diagnostics = Diagnostics(name)
        self._required: list[Callable[[], bool]] = []

    def parameters(self, cls: type[C], *, section: str = "", own: tuple[str, ...] = ("out",)) -> C:
        """The stage's configuration from the private parameters, or those below `section`; `own` are the node's, not the stage's.

        A wrong name or value ends the node with exit code 2.
        """
        try:
            values = rospy.get_param("~" + section, {})
            values = {k: v for k, v in values.items() if k not in own}
            return load_config(cls, values, section)
        except ConfigError as error:
            sys.stderr.write(f"{self.name}: wrong parameter: {'; '.join(str(error).splitlines())}\n")
            sys.exit(2)

    def robot(self) -> RobotBody:
        """The robot that all nodes share; a wrong value ends the node with exit code 2."""
        return robot_of_parameters(self.name)

    def run_folder(self) -> Path | None:
        """The folder of ~out, made when it is not there; None when nothing is to be written."""
        out = str(rospy.get_param("~out", ""))
        if not out:
            return None
        Path(out).mkdir(parents=True, exist_ok=True)
        return Path(out)

    def guarded(self, callback: Callable[[M], R]) -> Callable[[M], R | None]:
        """`callback` under the node's lock; a ValueError drops the message and is counted, as does a service that fails."""

        def run(message: M) -> R | None:
            with self.lock:
                try:
                    return callback(message)
                except ValueError as error:
                    self.diagnostics.dropped(f"bad {getattr(message, '_type', '').rpartition('/')[2]}", str(error))
                except rospy.ServiceException as error:
                    self.diagnostics.dropped("service that failed", str(error))
                except rospy.ROSException:
                    if not rospy.core.is_shutdown_requested():  # then topics are closed while messages still come
                        raise
                return None

        return run

    def subscribe(
        self, topic: str, message_type: type[M], callback: Callable[[M], object], *, large: bool = False, required: bool = True
    ) -> rospy.Subscriber:
        """Subscribes; `large` messages get a short queue, and what is not `required` need not be there when the clock starts.

        Arrays of numbers arrive as numpy arrays.
        """
        subscriber = rospy.Subscriber(
            topic,
            numpy_msg(message_type),
            self.guarded(callback),
            queue_size=5 if large else None,
            buff_size=2**25 if large else 65536,
            tcp_nodelay=True,
        )
        if required:
            self.require(lambda: bool(heard_publishers(subscriber)))
        return subscriber

    def require(self, condition: Callable[[], bool]) -> None:
        """The node is not ready before `condition` holds."""
        self._required.append(condition)

    def publisher(self, topic: str, message_type: type, *, large: bool = False, latch: bool = False) -> rospy.Publisher:
        return rospy.Publisher(topic, message_type, queue_size=5 if large else None, tcp_nodelay=True, latch=latch)

    def run(self) -> None:
        """Waits for what it listens to, says that it is ready, and serves until shutdown."""
        ready = rospy.Publisher(READY_TOPIC, String, latch=True, queue_size=1)
        if self.lockstep:
            while not rospy.is_shutdown() and not all(holds() for holds in self._required):
                time.sleep(0.02)
        ready.publish(String(self.name))
        while not rospy.core.is_shutdown_requested():
            time.sleep(_NEWS_PERIOD_S)
            self.guarded(lambda _: self.diagnostics.report_news())(None)
