"""The clock of one sensor: when it measures, when that is delivered, and how often. Times are whole nanoseconds."""

from dataclasses import dataclass

import numpy as np

from pybullet_simulation.sensor_faults import SILENT
from pybullet_simulation.timing_config import TimingConfig

_MOST_SIGMAS = 3.0
_RESIDUES = 7  # stamps of each sensor leave their own remainder, so that no two sensors ever share one


@dataclass(frozen=True)
class SensorTimes:
    """A sensor's nature: its topic, period, how long a measurement takes, and how long after its stamp it is delivered."""

    topic: str
    period_s: float
    duration_s: float
    latency_s: float


@dataclass(frozen=True)
class Measurement:
    """A measurement at a stamp, delivered `copies` times: 0 when it was lost. `fault`: its kind, empty for none."""

    stamp_ns: int
    delivery_ns: int
    copies: int
    fault: str = ""


class SensorClock:
    """Measurements of a sensor, one after another; phase, jitter, and what is lost or doubled have random streams of their own."""

    def __init__(self, timing: TimingConfig, sensor: SensorTimes, begin_ns: int, seed: tuple[int, ...], remainder: int) -> None:
        """The first measurement begins after `begin_ns`, or with it when it takes time; `remainder` (0 to 6) is this sensor's own."""
        self._timing, self._begin_ns, self._remainder = timing, begin_ns, remainder
        self._period_ns, self._duration_ns, self._latency_ns = (
            nanoseconds(t) for t in (sensor.period_s, sensor.duration_s, sensor.latency_s)
        )
        self._faults = [fault for fault in timing.sensor_faults() if fault.topic == sensor.topic]
        phase_rng, self._jitter_rng, self._line_rng = (np.random.default_rng([*seed, stream]) for stream in range(3))
        phase_ns = round(timing.phase_share * phase_rng.random() * self._period_ns)
        self._next_ns = self._own(begin_ns + phase_ns + (0 if self._duration_ns else self._period_ns))

    def measured(self, until_ns: int) -> list[Measurement]:
        """The measurements that are complete by then and were not handed out yet."""
        found = []
        while self._next_ns + self._duration_ns <= until_ns:
            found.append(self._measurement(self._next_ns))
            self._next_ns = self._own(self._next_ns + self._interval_ns())
        return found

    def _measurement(self, stamp_ns: int) -> Measurement:
        delivery_ns = stamp_ns + self._latency_ns
        fault = self._fault_at(delivery_ns)
        return Measurement(stamp_ns, delivery_ns, 0 if fault == SILENT else self._copies(), fault)

    def _copies(self) -> int:
        draw = self._line_rng.random()
        if draw < self._timing.lost_share:
            return 0
        return 2 if draw > 1.0 - self._timing.doubled_share else 1

    def _fault_at(self, delivery_ns: int) -> str:
        since_s = (delivery_ns - self._begin_ns) / 1e9
        return next((fault.kind for fault in self._faults if fault.begin_s <= since_s < fault.end_s), "")

    def _interval_ns(self) -> int:
        sigmas = float(np.clip(self._jitter_rng.standard_normal(), -_MOST_SIGMAS, _MOST_SIGMAS))
        return round(self._period_ns * (1.0 + self._timing.jitter_share * sigmas))

    def _own(self, stamp_ns: int) -> int:
        if not self._timing.jitter_share:
            return stamp_ns
        return stamp_ns + (self._remainder - stamp_ns) % _RESIDUES


def nanoseconds(seconds: float) -> int:
    """The nearest whole number of them."""
    return round(seconds * 1e9)
