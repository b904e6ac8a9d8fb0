"""What a sweep is made of, whichever sensor measured it: ends of beams in `laser`, each with its time."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import STAMP_TOLERANCE_S
from sweep_assembly.geometry import FloatArray
from sweep_assembly.revolution import LidarConfig, Revolution, free_directions
from sweep_assembly.scan import Scan

Reading = TypeVar("Reading")
"""One scan or one revolution."""


@dataclass(frozen=True, eq=False)
class Beams:
    """(N, 3) hits and (M, 3) ends of free beams in `laser`, metres, with their (N,) and (M,) times, in the order of measurement."""

    times_s: FloatArray
    hits: FloatArray
    free_times_s: FloatArray
    free_ends: FloatArray


@dataclass(frozen=True)
class FreeBeams:
    """How beams that met nothing are used: cut at `range_m`, one in `stride` of them."""

    range_m: float
    stride: int


class Sensor(Protocol[Reading]):
    """Readings of one kind, a scan or a revolution each."""

    def duration_of(self, reading: Reading) -> float:
        """Seconds from the first beam of a reading to the last one."""

    def period_of(self, reading: Reading) -> float:
        """Seconds from a reading to the next one; 0 where nobody tells."""

    def checked(self, reading: object) -> Reading:
        """The reading as it is kept; ValueError when it is not one of this sensor."""

    def known_until(self, stamp_s: float) -> float:
        """With a reading of this stamp, all beams up to here have come."""

    def beams(self, stamps_s: FloatArray, readings: Sequence[Reading], span_s: tuple[float, float], free: FreeBeams) -> Beams:
        """The beams of readings that were fired within a span of time."""


class LaserScans:
    """A 2-D laser's: one `Scan` after the other, finite where something was hit and +inf where nothing is in range."""

    def duration_of(self, reading: Scan) -> float:
        return reading.geometry.duration_s

    def period_of(self, reading: Scan) -> float:
        return reading.period_s

    def checked(self, reading: object) -> Scan:
        if not isinstance(reading, Scan):
            raise ValueError(f"a reading of a laser is a Scan, not {type(reading).__name__}")
        return reading

    def known_until(self, stamp_s: float) -> float:
        return stamp_s  # the laser looks away for a part of its turn: the scan's last beam does not tell when the next begins

    def beams(self, stamps_s: FloatArray, readings: Sequence[Scan], span_s: tuple[float, float], free: FreeBeams) -> Beams:
        return _joined([self._beams(stamp, one, span_s, free) for stamp, one in zip(stamps_s, readings, strict=True)])

    def _beams(self, stamp_s: float, scan: Scan, span_s: tuple[float, float], free: FreeBeams) -> Beams:
        times, ranges, directions = stamp_s + scan.geometry.beam_times, scan.ranges, scan.geometry.directions
        inside = _inside(times, span_s)
        hits = np.flatnonzero(inside & np.isfinite(ranges))
        nothing = np.flatnonzero(inside & np.isposinf(ranges))
        nothing = nothing[nothing % free.stride == 0]
        ends, free_ends = ranges[hits, None] * directions[hits], min(free.range_m, scan.range_max_m) * directions[nothing]
        return Beams(times[hits], ends, times[nothing], free_ends)


@dataclass(frozen=True)
class LidarRevolutions:
    """A spinning lidar's: one `Revolution` after the other, without a pause."""

    config: LidarConfig

    def duration_of(self, reading: Revolution) -> float:
        return self.config.duration_s

    def period_of(self, reading: Revolution) -> float:
        return self.config.duration_s

    def checked(self, reading: object) -> Revolution:
        if not isinstance(reading, Revolution):
            raise ValueError(f"a reading of a spinning lidar is a Revolution, not {type(reading).__name__}")
        return reading

    def known_until(self, stamp_s: float) -> float:
        return stamp_s + self.config.duration_s

    def beams(self, stamps_s: FloatArray, readings: Sequence[Revolution], span_s: tuple[float, float], free: FreeBeams) -> Beams:
        return _joined([self._beams(stamp, one, span_s, free) for stamp, one in zip(stamps_s, readings, strict=True)])

    def _beams(self, stamp_s: float, whole: Revolution, span_s: tuple[float, float], free: FreeBeams) -> Beams:
        inside, nothing = _inside(stamp_s + whole.times_s, span_s), whole.met_nothing
        thinned = inside[nothing] & (np.arange(len(nothing))[nothing] % free.stride == 0)
        directions = free_directions(whole, self.config)
        thinned &= np.isfinite(directions[:, 0])
        hit, free_times = inside & ~nothing, stamp_s + whole.times_s[nothing][thinned]
        hits = whole.points[hit].astype(np.float64)
        return Beams(stamp_s + whole.times_s[hit], hits, free_times, free.range_m * directions[thinned])


def _joined(parts: Sequence[Beams]) -> Beams:
    return Beams(
        np.concatenate([part.times_s for part in parts]),
        np.concatenate([part.hits for part in parts]),
        np.concatenate([part.free_times_s for part in parts]),
        np.concatenate([part.free_ends for part in parts]),
    )


def _inside(times_s: FloatArray, span_s: tuple[float, float]) -> NDArray[np.bool_]:
    return np.asarray((times_s >= span_s[0]) & (times_s <= span_s[1] + STAMP_TOLERANCE_S))
