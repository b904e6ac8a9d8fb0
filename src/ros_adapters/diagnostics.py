"""What a node says of itself: what it waits for, what it dropped, how its inputs are."""

import math
import time
from collections import Counter
from typing import Any

import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from ros_adapters.conversions import ros_time
from ros_adapters.inputs import InputWatch

_PERIOD_S = 1.0  # on the steady clock


def status_name(node: str) -> str:
    """What a node of this robot is called on /diagnostics, where all robots of a master speak: its name with the namespace."""
    return str(rospy.resolve_name(node)).lstrip("/")


class Diagnostics:
    """What a node says of itself on /diagnostics once a second of the steady clock, and at once when its state changes.

    It tells what was dropped and why, which input is silent since when, and the rate and age of every input.
    """

    def __init__(self, name: str) -> None:
        self._name, self._status_name = name, status_name(name)
        self._counts: Counter[str] = Counter()
        self._last_text: dict[str, str] = {}
        self._conditions: dict[str, str] = {}
        self._published_at = -math.inf
        self._published: tuple[int, str] | None = None
        self._stamp_s: float | None = None
        self._publisher = rospy.Publisher("/diagnostics", DiagnosticArray, queue_size=10)
        self.inputs: list[InputWatch] = []
        self.values: dict[str, Any] = {}

    def dropped(self, what: str, text: str) -> None:
        """Counts a dropped input under `what` and warns of it, at most once a second."""
        self._last_text[what] = text
        self._counts[what] += 1  # last: the thread that reports asks for the text of what is counted
        rospy.logwarn_throttle(1.0, f"{self._name}: {what}: {text} ({self._counts[what]} so far)")

    def holds(self, what: str, text: str) -> None:
        """Warns of a condition as long as `text` says of it; logged when it begins, empty when it is over."""
        if text and what not in self._conditions:
            rospy.logwarn(f"{self._name}: {what}: {text}")
        if text:
            self._conditions[what] = text
        else:
            self._conditions.pop(what, None)

    def on_terminal(self, what: str, text: str) -> None:
        """As `holds`, of what a person has to mend: when it begins and when it is over `./explore` shows it, too."""
        if bool(text) != (what in self._conditions):
            rospy.logwarn(f"[explore] {self._name}: {what}: {text or 'no longer'}")
            self._conditions.setdefault(what, text)
        self.holds(what, text)

    def report(self, stamp_s: float) -> None:
        """Publishes when a second has passed or something is new; `stamp_s` is that of the newest data."""
        self._stamp_s = stamp_s
        self.report_news()

    def report_news(self) -> None:
        """The same with the last stamp: also a node whose input has ceased, or never came, tells of it."""
        now_s = time.monotonic()
        state = self._state(now_s)
        if state != self._published or now_s - self._published_at >= _PERIOD_S:
            self._published_at, self._published = now_s, state
            self._publish(now_s, *state)

    def _state(self, now_s: float) -> tuple[int, str]:
        """Level and message; without numbers that change all the time."""
        silent = [watch for watch in self.inputs if watch.silence(now_s)]
        words = [f"no {watch.topic}" if watch.count else f"waits for {watch.topic}" for watch in silent]
        words += list(self._conditions)
        words += [f"{n} x {what}" for what, n in list(self._counts.items())]
        if any(watch.count for watch in silent):
            return DiagnosticStatus.ERROR, "; ".join(words)
        return (DiagnosticStatus.WARN, "; ".join(words)) if words else (DiagnosticStatus.OK, "ok")

    def _publish(self, now_s: float, level: int, message: str) -> None:
        values = [KeyValue(str(k), str(v)) for k, v in list(self.values.items())]
        values += [KeyValue(f"dropped: {what}", f"{n}, last: {self._last_text[what]}") for what, n in list(self._counts.items())]
        values += [KeyValue(what, text) for what, text in list(self._conditions.items())]
        values += [KeyValue(f"input: {watch.topic}", watch.described(now_s)) for watch in self.inputs]
        array = DiagnosticArray(status=[DiagnosticStatus(level, self._status_name, message, "explore_3dnav", values)])
        array.header.stamp = ros_time(time.time() if self._stamp_s is None else self._stamp_s)
        self._publisher.publish(array)
