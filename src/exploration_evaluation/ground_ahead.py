"""How far ahead the ground was known to a robot at full speed: the metres to the first place of its way that no sweep had shown by then.

The way is the one that it drove, up to where it stood next: where a plan ends, nothing is asked of the ground beyond.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from exploration_evaluation.activity import STILL_SPEED_MPS

Floats = NDArray[np.float64]

_STEP_S = 0.1
START_BLIND_M = 1.2  # so near its start the laser sees no ground, and the robot assumes it
_FULL_SPEED_SHARE = 0.9  # of the speed that it seldom exceeds; faster is full speed
_TOP_PERCENTILE = 95.0  # of the speeds of a robot that drives: single ones are its suspension's


@dataclass(frozen=True)
class GroundAhead:
    """Metres of known ground ahead, the least and the 5th percentile, over `moments` at full speed, a tenth of a second each."""

    least_m: float
    p05_m: float
    moments: int


def ground_ahead(cells: ArrayLike, shown_s: ArrayLike, truth: tuple[Floats, Floats]) -> GroundAhead | None:
    """What was known ahead; None where the robot never came to an unknown place at full speed without having stood.

    cells (N, 3), shown_s (N,): ground and when it was shown, infinite for never. truth: (M,) stamps and (M, 4, 4) true poses. Ground that
    was never shown does not count, nor what the robot assumes around its start, up to `START_BLIND_M`. ValueError without ground.
    """
    ground, at = np.asarray(cells, dtype=np.float64), np.asarray(shown_s, dtype=np.float64)
    if ground.ndim != 2 or not len(ground) or at.shape != (len(ground),):
        raise ValueError(f"ground and the times at which it was shown are (N, 3) and (N,), not {ground.shape} and {at.shape}")
    times, places = _resampled(*truth)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    speed, gone = np.append(steps / _STEP_S, 0.0), np.append(0.0, np.cumsum(steps))
    _, under = cKDTree(ground).query(places)
    needed_s = np.where(np.isfinite(at[under]), at[under], -np.inf)
    needed_s[np.linalg.norm(places - places[0], axis=1) < START_BLIND_M] = -np.inf
    found = [_first_unknown_m(k, times, gone, speed, needed_s) for k in _at_full_speed(speed)]
    ahead = np.array([metres for metres in found if np.isfinite(metres)])
    return GroundAhead(float(ahead.min()), float(np.percentile(ahead, 5.0)), len(found)) if len(ahead) else None


def _resampled(stamps: Floats, poses: Floats) -> tuple[Floats, Floats]:
    times = np.arange(stamps[0], stamps[-1] + 1e-9, _STEP_S)
    return times, np.column_stack([np.interp(times, stamps, poses[:, axis, 3]) for axis in range(3)])


def _at_full_speed(speed: Floats) -> list[int]:
    drives = speed > STILL_SPEED_MPS
    top = np.percentile(speed[drives], _TOP_PERCENTILE) if drives.any() else np.inf
    return [int(k) for k in np.flatnonzero(speed >= _FULL_SPEED_SHARE * top)]


def _first_unknown_m(k: int, times: Floats, gone: Floats, speed: Floats, needed_s: Floats) -> float:
    """Metres from moment `k` to the first place ahead that was shown later; infinite where the robot stood before."""
    unknown, stands = needed_s[k:] > times[k], speed[k:] <= STILL_SPEED_MPS
    first = int(np.argmax(unknown)) if unknown.any() else len(unknown)
    stand = int(np.argmax(stands)) if stands.any() else len(stands)
    return float(gone[k + first] - gone[k]) if first < stand else np.inf
