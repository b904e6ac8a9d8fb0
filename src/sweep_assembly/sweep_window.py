"""When a sweep begins and ends, told from the tilt angle alone, or of a lidar that is fixed from the way that the robot has come."""

from collections import Counter
from dataclasses import dataclass
from enum import Enum, auto

from rigid_geometry import inverse, rotation_angle, translation_distance
from sweep_assembly.geometry import FloatArray


@dataclass(frozen=True)
class SweepWindow:
    """From the last horizontal joint sample before a sweep to the first one after it, in seconds, or from one turn of a nod to the next.

    Of a lidar that is fixed: from one odometry sample to another.
    """

    start_stamp_s: float
    end_stamp_s: float
    from_rest: bool = True


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

    def forget(self) -> None:
        """What moves now is no sweep; the next one begins at rest."""
        self._phase, self._start_stamp_s, self._midway = TiltPhase.UNKNOWN, None, True

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


_TURNED_BACK_RAD = 0.02  # from the outermost tilt: less may be the encoder's noise


class NodWindowDetector:
    """Finds the half-periods of a mount that nods, each from one turn to the next.

    A movement from rest to beyond all nods is a whole sweep, and ends at rest, as without nodding.
    """

    def __init__(self, rest: SweepWindowDetector, whole_sweep_rad: float, least_rad: float) -> None:
        """`whole_sweep_rad`: no nod tilts lower; `least_rad`: a shorter way from turn to turn is none."""
        self._rest, self._whole_sweep_rad, self._least_rad = rest, whole_sweep_rad, least_rad
        self._is_whole = False
        self._forget_turns()

    @property
    def needed_from_s(self) -> float | None:
        """Nothing before this stamp can belong to the present or a coming sweep; None before the first sample."""
        return self._rest.needed_from_s if self._turn is None else self._turn[0]

    def add(self, stamp_s: float, tilt_rad: float) -> SweepWindow | None:
        """Takes the next joint sample (stamps increase); a window when with this sample a sweep, or half a nod, is seen to have ended."""
        at_rest = self._rest.add(stamp_s, tilt_rad)
        self._is_whole = self._is_whole or tilt_rad > self._whole_sweep_rad
        if self._rest.phase is TiltPhase.HORIZONTAL:
            window, self._is_whole = (at_rest if self._is_whole else None), False
            self._forget_turns()
            return window
        return None if self._is_whole else self._after(stamp_s, tilt_rad)

    def _forget_turns(self) -> None:
        self._turn: tuple[float, float] | None = None  # stamp and tilt of the last one
        self._outermost: tuple[float, float] | None = None
        self._direction = 0.0

    def _after(self, stamp_s: float, tilt_rad: float) -> SweepWindow | None:
        if self._outermost is None:
            self._outermost = stamp_s, tilt_rad
        back_rad = tilt_rad - self._outermost[1]
        if back_rad * self._direction > 0.0:
            self._outermost = stamp_s, tilt_rad
        elif abs(back_rad) > _TURNED_BACK_RAD:
            return self._turned(stamp_s, tilt_rad)
        return None

    def _turned(self, stamp_s: float, tilt_rad: float) -> SweepWindow | None:
        """The mount has left its outermost tilt: there it turned, but where it came from rest."""
        assert self._outermost is not None
        before, turn, moved = self._turn, self._outermost, self._direction != 0.0
        self._direction, self._outermost = (1.0 if tilt_rad > turn[1] else -1.0), (stamp_s, tilt_rad)
        if not moved:
            return None
        self._turn = turn
        self._rest.forget()
        if before is None or abs(turn[1] - before[1]) < self._least_rad:
            return None
        return SweepWindow(before[0], turn[0], from_rest=False)


class TravelWindowDetector:
    """Cuts the way of a robot into sweeps that follow on each other: each so long, or so much of a turn, or of a robot that stands so late.

    Of a lidar that is fixed every moment is like the other; what a part of the way shows depends on the way alone.
    """

    def __init__(self, most_m: float, most_rad: float, most_s: float) -> None:
        """A sweep ends with the first odometry sample so far from where it began, turned by so much, or so long after it."""
        self._most_m, self._most_rad, self._most_s = most_m, most_rad, most_s
        self._began: tuple[float, FloatArray] | None = None

    @property
    def needed_from_s(self) -> float | None:
        """Nothing before this stamp can belong to the present or a coming sweep; None before the first sample."""
        return None if self._began is None else self._began[0]

    def add(self, stamp_s: float, T_odom_base: FloatArray) -> SweepWindow | None:
        """Takes the next odometry sample (stamps increase); a window when with this sample a sweep has ended."""
        if self._began is None:
            self._began = stamp_s, T_odom_base
            return None
        began_s, T_odom_began = self._began
        if stamp_s - began_s < self._most_s and not self._is_far(T_odom_began, T_odom_base):
            return None
        self._began = stamp_s, T_odom_base
        return SweepWindow(began_s, stamp_s, from_rest=False)

    def _is_far(self, T_odom_began: FloatArray, T_odom_base: FloatArray) -> bool:
        turned = rotation_angle(inverse(T_odom_began) @ T_odom_base)
        return translation_distance(T_odom_began, T_odom_base) >= self._most_m or turned >= self._most_rad
