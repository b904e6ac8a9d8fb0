"""When what of a run is shown: the frames of a replay, and the wall time at which each is due."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid_geometry import interpolate_transforms
from rigid_geometry.transforms import Transform

Floats = NDArray[np.float64]

_UNHURRIED_SPEED = 10.0  # whose frames are shown when nobody waits between them
_LONGEST_PAUSE_S, _SHOWN_PAUSE_S = 60.0, 1.0  # a longer one, as between two bags that were joined, is shown as so long


@dataclass(frozen=True, eq=False)
class Frame:
    """What is to be seen at one moment: the robot's pose, how many sweeps are in the map, how far it has driven."""

    stamp_s: float
    T_map_base: Transform
    sweeps: int
    distance_m: float


@dataclass(frozen=True, eq=False)
class ShownTime:
    """When what was recorded is shown: of (K,) increasing stamps `known_s` at (K,) `shown_s`, without long pauses between them."""

    known_s: Floats
    shown_s: Floats

    @classmethod
    def of(cls, *stamps_s: Floats) -> "ShownTime":
        """For all of these stamps."""
        known = np.unique(np.concatenate(stamps_s))
        steps = np.diff(known, prepend=known[0])
        return cls(known, known - np.cumsum(np.where(steps > _LONGEST_PAUSE_S, steps - _SHOWN_PAUSE_S, 0.0)))

    def at(self, stamps_s: ArrayLike) -> Floats:
        """(N,) for (N,) recorded stamps; before the first known one, and after the last, nothing is left out."""
        stamps = np.asarray(stamps_s, dtype=np.float64)
        within = np.clip(stamps, self.known_s[0], self.known_s[-1])
        return np.asarray(np.interp(within, self.known_s, self.shown_s) + (stamps - within))


@dataclass
class Pace:
    """Wall time at which stamps are due at `speed` simulated seconds a second; 0: at once."""

    speed: float
    _start: tuple[float, float] | None = field(default=None, init=False)

    def seconds_until(self, stamp_s: float, now_s: float) -> float:
        """Seconds of wall time from `now_s` until `stamp_s` is due, not below 0; the first stamp asked for is due at once."""
        if self.speed == 0.0:
            return 0.0
        if self._start is None:
            self._start = (stamp_s, now_s)
        first_stamp_s, begun_s = self._start
        return max(0.0, begun_s + (stamp_s - first_stamp_s) / self.speed - now_s)


def frame_step_s(speed: float, frame_rate_hz: float) -> float:
    """Simulated seconds between two frames."""
    return (speed or _UNHURRIED_SPEED) / frame_rate_hz


def frames(path_stamps_s: ArrayLike, path_poses: Floats, sweep_stamps_s: ArrayLike, step_s: float) -> list[Frame]:
    """Frames every `step_s` from the first stamp to the last, which is always one.

    (P,) increasing stamps and (P, 4, 4) T_map_base of the robot's way, and (V,) increasing stamps at which sweeps were in the map.
    Before and after its known way the robot stands still.
    """
    if not step_s > 0:
        raise ValueError(f"the step between two frames must be positive, not {step_s} s")
    path, sweeps = np.asarray(path_stamps_s, dtype=np.float64), np.asarray(sweep_stamps_s, dtype=np.float64)
    first, last = min(path[0], sweeps[0]), max(path[-1], sweeps[-1])
    stamps = np.append(np.arange(first, last - 1e-6, step_s), last)
    on_path = np.clip(stamps, path[0], path[-1])
    poses = interpolate_transforms(path, path_poses, on_path)
    distances = np.interp(on_path, path, driven_m(path_poses[:, :3, 3]))
    counts = np.searchsorted(sweeps, stamps + 1e-6, side="right")
    return [Frame(float(t), T, int(n), float(d)) for t, T, n, d in zip(stamps, poses, counts, distances, strict=True)]


def driven_m(positions: Floats) -> Floats:
    """(P,) length of the way up to each of (P, 3) positions."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(positions, axis=0), axis=1))])


def thinned(positions: Floats, step_m: float) -> NDArray[np.int64]:
    """Indices of the first position, the last, and one at least every `step_m` of the way, of (P, 3) positions."""
    steps = np.floor(driven_m(positions) / step_m)
    kept = np.diff(steps, prepend=-1.0) > 0
    kept[-1] = True
    return np.flatnonzero(kept)
