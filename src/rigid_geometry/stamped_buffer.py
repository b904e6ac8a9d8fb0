"""Samples of one sensor or topic in the order of their stamps, bounded in time."""

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

V = TypeVar("V")

JUMP_BACK_S = 0.5  # a stamp so much older than its topic's newest is no late message: the clock was set back
STAMP_TOLERANCE_S = 1e-6  # stamps nearer than this are the same instant: sums of periods and nanoseconds round differently


class StampedBuffer(Generic[V]):
    """Values with increasing stamps; what is refused or overflows is counted under `<source>_late`, `time_jump`, `<source>_overflow`."""

    def __init__(self, source: str, keep_s: float, dropped: Counter[str]) -> None:
        self.source = source
        self._keep_s = keep_s
        self._dropped = dropped
        self._stamps: list[float] = []
        self._values: list[V] = []
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

    def jumps_back(self, stamp_s: float) -> bool:
        """Whether this stamp is too old for a late message."""
        return self._last_stamp_s is not None and stamp_s <= self._last_stamp_s - JUMP_BACK_S

    def takes(self, stamp_s: float, begin_again: Callable[[], None]) -> bool:
        """Whether a sample with this stamp is to be appended; one that is late is not. Calls `begin_again` first when time jumped back."""
        if self._last_stamp_s is None or stamp_s > self._last_stamp_s:
            return True
        if self.jumps_back(stamp_s):
            self._dropped["time_jump"] += 1
            begin_again()
            return True
        self._dropped[f"{self.source}_late"] += 1
        return False

    def append(self, stamp_s: float, value: V) -> None:
        """Adds the newest sample and forgets what is older than the buffer is long."""
        self._stamps.append(stamp_s)
        self._values.append(value)
        self._last_stamp_s = stamp_s
        surplus = bisect_left(self._stamps, stamp_s - self._keep_s)
        if surplus:
            self._dropped[f"{self.source}_overflow"] += surplus
            self._forget_first(surplus)

    def first(self) -> tuple[float, V] | None:
        """The oldest sample held."""
        return (self._stamps[0], self._values[0]) if self._stamps else None

    def drop_first(self) -> None:
        """Forgets the oldest sample held."""
        self._forget_first(1)

    def forget_before(self, stamp_s: float) -> None:
        """Forgets what is older than `stamp_s`, but for the last one at or before it: interpolation needs it."""
        self._forget_first(max(bisect_right(self._stamps, stamp_s) - 1, 0))

    def clear(self) -> None:
        """Forgets everything, also the latest stamp."""
        self._forget_first(len(self))
        self._last_stamp_s = None

    def between(self, low_s: float, high_s: float) -> tuple[NDArray[np.float64], list[V]]:
        """(M,) stamps in [low_s, high_s] and their values."""
        return self._part(bisect_left(self._stamps, low_s), bisect_right(self._stamps, high_s))

    def around(self, low_s: float, high_s: float) -> tuple[NDArray[np.float64], list[V]]:
        """(M,) stamps and values from the last at or before `low_s` to the first at or after `high_s`, as far as there are."""
        first = max(bisect_right(self._stamps, low_s) - 1, 0)
        return self._part(first, bisect_left(self._stamps, high_s - 2.0 * STAMP_TOLERANCE_S) + 1)

    def _part(self, first: int, last: int) -> tuple[NDArray[np.float64], list[V]]:
        return np.array(self._stamps[first:last], dtype=np.float64), self._values[first:last]

    def _forget_first(self, count: int) -> None:
        del self._stamps[:count], self._values[:count]
