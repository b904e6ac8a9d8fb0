"""What the time of a run went to: the simulated seconds by what the robot meant to do, and by how it moved, and the seconds of computing.

Between the monitor's events.csv, which has a line for every change of what the robot does, the true trajectory, and the summary.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid_geometry import rotation_angles

# The states that stop, scan and go tells of; a robot that starts, comes to rest before a sweep, or is somebody else's, waits.
_ACTIVITIES = {
    "starting": "waiting",
    "settling": "waiting",
    "sweeping": "sweeping",
    "mapping": "mapping",
    "driving": "driving",
    "looking": "sweeping",  # it stands while its mount nods
    "paused": "waiting",
    "taken_over": "waiting",
}
_ENDS = ("finished", "failed")
_STEP_S = 0.2  # over which a motion is told from the tremble of a robot that stands
STILL_SPEED_MPS = 0.02  # up to which the robot stands
_STILL_TURN_RATE_RADPS = 0.02  # turn up to which it stands


@dataclass(frozen=True)
class ActivityTimes:
    """Where the time went.

    simulated_s: simulated seconds spent driving, sweeping, mapping and waiting; mapping has some only where the clock does not stand
    for it. compute_s: wall seconds of mapping, that is from the end of a sweep to the decision about it, in which sweeps are
    matched, ground is classified and the way planned; None when the run was cut off in it, for its end is not known.
    """

    simulated_s: dict[str, float]
    compute_s: float | None


def activity_times(stamps: ArrayLike, wall_s: ArrayLike, states: Sequence[str], end_s: float) -> ActivityTimes:
    """Activities of a run from its (N,) changes of state: simulated stamps, wall clock, and the states entered.

    `end_s` is the simulated time at which the run ended; it ends the last state, unless that is for good. ValueError without a
    change, for a state that is none, or for a clock that goes back.
    """
    at, wall = np.asarray(stamps, dtype=np.float64), np.asarray(wall_s, dtype=np.float64)
    if not len(at) == len(wall) == len(states) or not len(at):
        raise ValueError(f"every change of state has two times, and there is one: {len(at)} stamps, {len(wall)} wall, {len(states)} states")
    unknown = sorted(set(states) - {*_ACTIVITIES, *_ENDS})
    if unknown:
        raise ValueError(f"the robot is not {', '.join(unknown)}; it can be {', '.join((*_ACTIVITIES, *_ENDS))}")
    if (np.diff(wall) < 0).any():
        raise ValueError("the changes of state are not in order of time")
    at = np.maximum.accumulate(at)  # a decision has the stamp of its sweep, and is acted on later: on a busy computer by seconds
    spent = dict.fromkeys(dict.fromkeys(_ACTIVITIES.values()), 0.0)
    for state, begin, end in zip(states, at, np.append(at[1:], max(end_s, at[-1])), strict=True):
        if state not in _ENDS:
            spent[_ACTIVITIES[state]] += float(end - begin)
    return ActivityTimes(spent, _compute_s(wall.tolist(), states))


def time_spent(
    stamps: ArrayLike,
    states: Sequence[str],
    truth: tuple[NDArray[np.float64], NDArray[np.float64]],
    body_radius_m: float,
) -> dict[str, float]:
    """Seconds of driving, turning on the spot, standing to sweep, and waiting.

    stamps (N,), states: the changes of state. truth: (M,) stamps and (M, 4, 4) true poses.

    How it moves comes first, so that a sweep while driving is driving. It turns on the spot when it turns about a point under its own
    body, `body_radius_m` around the centre. Standing without a sweep is waiting: coming to rest, matching, planning. ValueError as above,
    and for fewer than two poses.
    """
    times, poses = truth
    kept = np.flatnonzero(np.diff(np.floor((times - times[0]) / _STEP_S + 1e-3), prepend=-1.0))
    at, moved = np.maximum.accumulate(np.asarray(stamps, dtype=np.float64)), poses[kept]
    if len(kept) < 2 or not len(at) == len(states) > 0:
        raise ValueError(f"two true poses and a state that begins with every change, not {len(kept)}, {len(states)} and {len(at)}")
    lasts = np.diff(times[kept])
    speed = np.linalg.norm(np.diff(moved[:, :3, 3], axis=0), axis=1) / lasts
    rate = rotation_angles(moved[:-1, :3, :3].transpose(0, 2, 1) @ moved[1:, :3, :3]) / lasts
    state = np.searchsorted(at, 0.5 * (times[kept][:-1] + times[kept][1:]), side="right") - 1
    sweeps = np.array([_ACTIVITIES.get(name) == "sweeping" for name in states])[state] & (state >= 0)
    turning = (rate > _STILL_TURN_RATE_RADPS) & (speed < body_radius_m * rate)
    driving = (speed > STILL_SPEED_MPS) & ~turning
    parts = {"driving_s": driving, "turning_s": turning, "sweeping_s": sweeps & ~driving & ~turning}
    spent = {name: float(lasts[part].sum()) for name, part in parts.items()}
    return {**spent, "waiting_s": float(lasts.sum()) - sum(spent.values())}


def _compute_s(wall: Sequence[float], states: Sequence[str]) -> float | None:
    if states[-1] == "mapping":
        return None
    return float(sum(end - begin for state, (begin, end) in zip(states, pairwise(wall), strict=False) if state == "mapping"))
