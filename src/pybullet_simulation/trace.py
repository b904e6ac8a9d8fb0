"""What physics did in the last ticks, for sensors that ask at any instant; linear between the steps of the physics."""

from collections import deque
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.beam_casting import Motion
from pybullet_simulation.records import Contact
from simulated_movers import MovingParts, joined_parts

Array = NDArray[np.float64]

KEPT_TICKS = 3  # a revolution of 0.1 s that ends in this tick began in the one before the last


@dataclass(frozen=True)
class Tilts:
    """Angles of the tilting mount at steps (S,): how the laser truly lies, and angle and rate as the encoder has them, without noise."""

    true: Array
    measured: Array
    rates: Array


@dataclass(frozen=True)
class PhysicsTick:
    """A tick of physics at its S steps, the first and last included.

    `rotations` (S, 3, 3), `positions` (S, 3), `angular` (S, 3) and `imu_velocities` (S, 3) in world axes. Of the wheels' encoders:
    angles (W,) at the beginning, and how far they turned (H, W) in each of H equal parts of the tick. `movers` from its begin to its end.
    """

    begin_ns: int
    rotations: Array
    positions: Array
    angular: Array
    imu_velocities: Array
    tilts: Tilts
    encoders: Array
    turns: Array
    contacts: tuple[Contact, ...] = ()
    movers: MovingParts | None = None


@dataclass(frozen=True)
class Instant:
    """The robot at an instant: as in `PhysicsTick`, without the first dimension."""

    R_world_base: Array
    angular: Array
    imu_velocity: Array
    tilt_measured: float
    tilt_rate: float


@dataclass(frozen=True)
class Trace:
    """The last ticks, of `tick_ns` each, at `rate_hz` steps a second; an IndexError for instants that are not kept."""

    tick_ns: int
    rate_hz: int
    ticks: deque[PhysicsTick] = field(default_factory=lambda: deque(maxlen=KEPT_TICKS))

    def append(self, tick: PhysicsTick) -> None:
        """Goes on by a tick; the oldest is forgotten."""
        self.ticks.append(tick)

    def motion_from(self, stamp_ns: int) -> tuple[Motion, float]:
        """The motion since the tick in which a stamp lies, and the seconds from its first step to the stamp."""
        first = self._index(stamp_ns)
        ticks = list(self.ticks)[first:]
        motion = Motion(
            _joined([t.rotations for t in ticks]),
            _joined([t.positions for t in ticks]),
            _joined([t.tilts.true for t in ticks]),
            1.0 / self.rate_hz,
            joined_parts([t.movers for t in ticks if t.movers is not None]),
        )
        return motion, (stamp_ns - ticks[0].begin_ns) / 1e9

    def at(self, stamp_ns: int) -> Instant:
        """The robot at a stamp."""
        tick = self.ticks[self._index(stamp_ns - 1)]  # where two ticks meet, the end of the first
        step, rest = divmod((stamp_ns - tick.begin_ns) * self.rate_hz, 1_000_000_000)
        share = rest / 1e9
        values = (tick.rotations, tick.angular, tick.imu_velocities, tick.tilts.measured, tick.tilts.rates)
        R, angular, velocity, tilt, rate = (v[step] if not rest else (1.0 - share) * v[step] + share * v[step + 1] for v in values)
        return Instant(R, angular, velocity, float(tilt), float(rate))

    def turned(self, from_ns: int, to_ns: int) -> Array:
        """(W,) how far the encoders turned in between, in rad."""
        parts = []
        for tick in self.ticks:
            length = self.tick_ns // len(tick.turns)
            for i, turn in enumerate(tick.turns):
                begin = tick.begin_ns + i * length
                shared = min(to_ns, begin + length) - max(from_ns, begin)
                if shared > 0:
                    parts.append(shared / length * turn)
        return np.asarray(np.array(parts).sum(axis=0))

    def encoders(self, stamp_ns: int) -> Array:
        """(W,) angles of the encoders at a stamp, in rad."""
        tick = self.ticks[self._index(stamp_ns - 1)]
        length, angles = self.tick_ns // len(tick.turns), tick.encoders
        for i, turn in enumerate(tick.turns):
            share = min(1.0, (stamp_ns - tick.begin_ns - i * length) / length)
            if share > 0.0:
                angles = angles + share * turn
        return angles

    def _index(self, stamp_ns: int) -> int:
        """Of the tick with begin <= stamp < end; IndexError when none is kept."""
        if not self.ticks or stamp_ns < self.ticks[0].begin_ns:
            raise IndexError(f"{stamp_ns} ns is before the kept ticks")
        return (stamp_ns - self.ticks[0].begin_ns) // self.tick_ns


def _joined(parts: list[Array]) -> Array:
    """Arrays of consecutive ticks as one: the first step of each is the last of the one before."""
    return parts[0] if len(parts) == 1 else np.concatenate([parts[0], *(part[1:] for part in parts[1:])])
