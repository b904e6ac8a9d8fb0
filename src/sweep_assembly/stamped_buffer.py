"""Messages of one topic in the order of their stamps, bounded in time."""

from collections import Counter, deque
from enum import Enum, auto
from itertools import islice
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

V = TypeVar("V")


class Arrival(Enum):
    """How a message's stamp stands to the latest one of its topic."""

    IN_ORDER = auto()
    LATE = auto()
    TIME_JUMP = auto()


class StampedBuffer(Generic[V]):
    """Values with increasing stamps; what is refused or overflows is counted under `<topic>_late`, `time_jump`, `<topic>_overflow`."""

    def __init__(self, topic: str, jump_back_s: float, keep_s: float, dropped: Counter[str]) -> None:
        self._topic = topic
        self._jump_back_s = jump_back_s
        self._keep_s = keep_s
        self._dropped = dropped
        self._stamps: deque[float] = deque()
        self._values: deque[V] = deque()
        self._last_stamp_s: float | None = None

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def last_stamp_s(self) -> float | None:
        """The latest stamp ever appended, in seconds; None before the first."""
        return self._last_stamp_s

    @property
    def stamps(self) -> NDArray[np.float64]:
        """(M,) stamps held."""
        return np.array(self._stamps, dtype=np.float64)

    @property
    def values(self) -> list[V]:
        """The M values held."""
        return list(self._values)

    def judge(self, stamp_s: float) -> Arrival:
        """Whether a message with this stamp comes in order; counts it when not."""
        if self._last_stamp_s is None or stamp_s > self._last_stamp_s:
            return Arrival.IN_ORDER
        if stamp_s > self._last_stamp_s - self._jump_back_s:
            self._dropped[f"{self._topic}_late"] += 1
            return Arrival.LATE
        self._dropped["time_jump"] += 1
        return Arrival.TIME_JUMP

    def append(self, stamp_s: float, value: V) -> None:
        """Adds the newest message and forgets what is older than the buffer is long."""
        self._stamps.append(stamp_s)
        self._values.append(value)
        self._last_stamp_s = stamp_s
        while self._stamps[0] < stamp_s - self._keep_s:
            self._drop_oldest()
            self._dropped[f"{self._topic}_overflow"] += 1

    def forget_before(self, stamp_s: float) -> None:
        """Forgets what is older than `stamp_s`, but for the last one at or before it: interpolation needs it."""
        while len(self._stamps) > 1 and self._stamps[1] <= stamp_s:
            self._drop_oldest()

    def between(self, low_s: float, high_s: float) -> tuple[NDArray[np.float64], list[V]]:
        """(M,) stamps in [low_s, high_s] and their values."""
        stamps = self.stamps
        first, last = np.searchsorted(stamps, low_s, side="left"), np.searchsorted(stamps, high_s, side="right")
        return stamps[first:last], list(islice(self._values, int(first), int(last)))

    def _drop_oldest(self) -> None:
        self._stamps.popleft()
        self._values.popleft()
