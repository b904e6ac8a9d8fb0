"""Samples of one sensor in the order of their stamps, bounded in time."""

from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Sequence
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

STAMP_TOLERANCE_S = 1e-6  # stamps nearer than this are the same instant: sums of periods and nanoseconds round differently


class Arrival(Enum):
    """How a sample's stamp stands to the latest one of its sensor."""

    IN_ORDER = auto()
    LATE = auto()
    TIME_JUMP = auto()


class SampleBuffer:
    """Rows of floats with increasing stamps; refusals are counted under `<sensor>_late`, `time_jump`, `<sensor>_overflow`."""

    def __init__(self, sensor: str, jump_back_s: float, keep_s: float, dropped: Counter[str]) -> None:
        self.sensor = sensor
        self._jump_back_s = jump_back_s
        self._keep_s = keep_s
        self._dropped = dropped
        self._stamps: list[float] = []
        self._rows: list[Sequence[float]] = []
        self._last_stamp_s: float | None = None

    def __len__(self) -> int:
        return len(self._stamps)

    @property
    def last_stamp_s(self) -> float | None:
        """The latest stamp ever added, in seconds; None before the first."""
        return self._last_stamp_s

    def judge(self, stamp_s: float) -> Arrival:
        """Whether a sample with this stamp comes in order; counts it when not."""
        if self._last_stamp_s is None or stamp_s > self._last_stamp_s:
            return Arrival.IN_ORDER
        if stamp_s > self._last_stamp_s - self._jump_back_s:
            self._dropped[f"{self.sensor}_late"] += 1
            return Arrival.LATE
        self._dropped["time_jump"] += 1
        return Arrival.TIME_JUMP

    def append(self, stamp_s: float, row: Sequence[float]) -> None:
        """Adds the newest sample and forgets what is older than the buffer is long."""
        self._stamps.append(stamp_s)
        self._rows.append(row)
        self._last_stamp_s = stamp_s
        surplus = bisect_left(self._stamps, stamp_s - self._keep_s)
        if surplus:
            self._dropped[f"{self.sensor}_overflow"] += surplus
            del self._stamps[:surplus], self._rows[:surplus]

    def forget_before(self, stamp_s: float) -> None:
        """Forgets what is older than `stamp_s`, but for the last one at or before it: interpolation needs it."""
        surplus = bisect_right(self._stamps, stamp_s) - 1
        if surplus > 0:
            del self._stamps[:surplus], self._rows[:surplus]

    def first(self) -> tuple[float, Sequence[float]] | None:
        """The oldest sample held."""
        return (self._stamps[0], self._rows[0]) if self._stamps else None

    def drop_first(self) -> None:
        """Forgets the oldest sample held."""
        del self._stamps[:1], self._rows[:1]

    def clear(self) -> None:
        """Forgets everything, also the latest stamp."""
        self._stamps.clear()
        self._rows.clear()
        self._last_stamp_s = None

    def around(self, low_s: float, high_s: float) -> tuple[FloatArray, FloatArray]:
        """(M,) stamps and (M, C) rows from the last at or before `low_s` to the first at or after `high_s`, as far as there are."""
        first = max(bisect_right(self._stamps, low_s) - 1, 0)
        last = bisect_left(self._stamps, high_s - 2.0 * STAMP_TOLERANCE_S) + 1
        return np.array(self._stamps[first:last]), np.array(self._rows[first:last], dtype=np.float64)
