"""Inputs by time: which value of a topic belongs to a moment, and whether the topic still speaks.

A node names one topic that drives it. Of every other input it takes the newest value that is not later, and not too old. Nothing
compares stamps of different sensors for equality: on a robot no two of them ever share one.
"""

import math
from bisect import bisect_right, insort
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Generic, TypeVar

from rigid_geometry import JUMP_BACK_S

V = TypeVar("V")

_KEPT = 200
_RATE_OVER = 20  # messages over which a rate is told


class TimedInput(Generic[V]):
    """The newest values of one topic by their stamps; late and doubled messages find their place."""

    def __init__(self, max_age_s: float) -> None:
        """`max_age_s`: an older value is not known any more."""
        self._max_age_s = max_age_s
        self._stamps: list[float] = []
        self._values: dict[float, V] = {}

    def add(self, stamp_s: float, value: V) -> None:
        """Takes a value. A stamp that is much older than the newest means that the clock was set back: older values are forgotten."""
        if self._stamps and stamp_s < self._stamps[-1] - JUMP_BACK_S:
            self._stamps.clear()
            self._values.clear()
        if stamp_s not in self._values:
            insort(self._stamps, stamp_s)
        self._values[stamp_s] = value
        while len(self._stamps) > _KEPT:
            del self._values[self._stamps.pop(0)]

    def newest(self, stamp_s: float) -> tuple[float, V] | None:
        """Stamp and value of the newest one at or before `stamp_s`; None when there is none, or only older ones than `max_age_s`."""
        last = bisect_right(self._stamps, stamp_s) - 1
        if last < 0 or stamp_s - self._stamps[last] > self._max_age_s:
            return None
        return self._stamps[last], self._values[self._stamps[last]]

    def at(self, stamp_s: float) -> V | None:
        """The value alone."""
        found = self.newest(stamp_s)
        return None if found is None else found[1]


class Driver(Generic[V]):
    """The topic that drives a node: every value once, in the order of their stamps; what is late or doubled is counted."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[float, V]] = deque(maxlen=_KEPT)
        self._last_s = -math.inf
        self.late = 0

    def add(self, stamp_s: float, value: V) -> None:
        """Takes a value; one that is not newer than the last is left out, unless the clock was set back."""
        if self._last_s - JUMP_BACK_S <= stamp_s <= self._last_s:
            self.late += 1
            return
        if stamp_s < self._last_s:
            self._waiting.clear()
        self._last_s = stamp_s
        self._waiting.append((stamp_s, value))

    def take(self, until_s: float = math.inf) -> Iterator[tuple[float, V]]:
        """Stamps up to `until_s` and their values that were not taken yet, oldest first."""
        while self._waiting and self._waiting[0][0] <= until_s:
            yield self._waiting.popleft()


@dataclass
class InputWatch:
    """Whether one topic speaks, on a steady clock in seconds: how often, and since when not.

    `silent_after_s`: a longer pause is silence; None for a topic that speaks only when there is something to say.
    """

    topic: str
    silent_after_s: float | None
    since_s: float
    count: int = 0
    _arrivals: deque[float] = field(default_factory=lambda: deque(maxlen=_RATE_OVER))

    def arrived(self, now_s: float) -> None:
        """A message is here."""
        self.since_s = now_s
        self._arrivals.append(now_s)
        self.count += 1  # last: the thread that reports looks at the others where this is above 0

    def silence(self, now_s: float) -> str:
        """What is missing, as words; empty while nothing is."""
        if self.silent_after_s is None or now_s - self.since_s <= self.silent_after_s:
            return ""
        never = "" if self.count else "nothing ever came on "
        return f"{never or 'no '}{self.topic} for {now_s - self.since_s:.1f} s"

    def described(self, now_s: float) -> str:
        """Rate, age and number of its messages."""
        if not self.count:
            return f"nothing for {now_s - self.since_s:.1f} s"
        span_s = self._arrivals[-1] - self._arrivals[0]
        rate = f"{(len(self._arrivals) - 1) / span_s:.1f} Hz, " if span_s > 0.0 and self.silent_after_s is not None else ""
        return f"{rate}{now_s - self.since_s:.2f} s old, {self.count} so far"
