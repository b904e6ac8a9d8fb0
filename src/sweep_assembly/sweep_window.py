"""When a sweep begins and ends, told from the tilt angle alone."""

from collections import Counter
from dataclasses import dataclass
from enum import Enum, auto


@dataclass(frozen=True)
class SweepWindow:
    """The time from the last horizontal joint sample before a sweep to the first one after it, in seconds."""

    start_stamp_s: float
    end_stamp_s: float


class TiltPhase(Enum):
    """What the mount is doing."""

    UNKNOWN = auto()  # not seen horizontal yet: a sweep in progress has no known beginning
    HORIZONTAL = auto()
    SWEEPING = auto()


class SweepWindowDetector:
    """Finds sweeps in the joint samples: tilt leaves the horizontal, and later comes to rest there.

    The slow part of a sweep passes the horizon, therefore horizontal alone is not the end: two samples in a row must be
    horizontal and the mount must not have moved between them. The window ends at the first of the two.
    """

    def __init__(self, tolerance_rad: float, still_rate_rad_s: float, max_duration_s: float, dropped: Counter[str]) -> None:
        """Reasons for sweeps that are given up are counted in `dropped`."""
        self._tolerance_rad = tolerance_rad
        self._still_rate_rad_s = still_rate_rad_s
        self._max_duration_s = max_duration_s
        self._dropped = dropped
        self._phase = TiltPhase.UNKNOWN
        self._last: tuple[float, float] | None = None
        self._start_stamp_s: float | None = None
        self._midway = False

    @property
    def phase(self) -> TiltPhase:
        """What the mount was doing at the latest sample."""
        return self._phase

    @property
    def needed_from_s(self) -> float | None:
        """Nothing before this stamp can belong to the present or a coming sweep; None before the first sample."""
        if self._phase is TiltPhase.SWEEPING:
            return self._start_stamp_s
        return self._last[0] if self._last else None

    def add(self, stamp_s: float, tilt_rad: float) -> SweepWindow | None:
        """Takes the next joint sample (stamps increase); a window when with this sample a sweep has ended."""
        before, self._last = self._last, (stamp_s, tilt_rad)
        if not self._level(tilt_rad):
            self._leave_horizontal(before, stamp_s)
            return None
        if before is None or not self._rests(before, stamp_s, tilt_rad):
            return None
        return self._settle(before[0])

    def _level(self, tilt_rad: float) -> bool:
        return abs(tilt_rad) <= self._tolerance_rad

    def _rests(self, before: tuple[float, float], stamp_s: float, tilt_rad: float) -> bool:
        still = abs(tilt_rad - before[1]) <= self._still_rate_rad_s * (stamp_s - before[0])
        return still and self._level(before[1])

    def _leave_horizontal(self, before: tuple[float, float] | None, stamp_s: float) -> None:
        if self._phase is TiltPhase.HORIZONTAL and before is not None:
            self._phase, self._start_stamp_s = TiltPhase.SWEEPING, before[0]
        elif self._phase is TiltPhase.UNKNOWN and not self._midway:
            self._midway = True
            self._dropped["sweep_without_start"] += 1
        elif self._phase is TiltPhase.SWEEPING and self._start_stamp_s is not None and stamp_s - self._start_stamp_s > self._max_duration_s:
            self._phase, self._midway = TiltPhase.UNKNOWN, True
            self._dropped["sweep_too_long"] += 1

    def _settle(self, end_stamp_s: float) -> SweepWindow | None:
        start, was = self._start_stamp_s, self._phase
        self._phase, self._start_stamp_s, self._midway = TiltPhase.HORIZONTAL, None, False
        if was is not TiltPhase.SWEEPING or start is None:
            return None
        return SweepWindow(start, end_stamp_s)
