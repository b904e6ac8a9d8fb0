"""What the time of a run went to: the simulated seconds by activity, and the seconds for which the robot stood and computed.

Between the monitor's events.csv, which has a line for every change of what the robot does, and the summary.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

# The states that stop, scan and go tells of; a robot that starts, or comes to rest before a sweep, waits.
_ACTIVITIES = {"starting": "waiting", "settling": "waiting", "sweeping": "sweeping", "mapping": "mapping", "driving": "driving"}
_ENDS = ("finished", "failed")
_OLD_STAMP_S = 1.0  # a decision has the stamp of its sweep, a little before the tick that it is acted on


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
    if (np.diff(at) < -_OLD_STAMP_S).any() or (np.diff(wall) < 0).any():
        raise ValueError("the changes of state are not in order of time")
    at = np.maximum.accumulate(at)
    spent = dict.fromkeys(dict.fromkeys(_ACTIVITIES.values()), 0.0)
    for state, begin, end in zip(states, at, np.append(at[1:], max(end_s, at[-1])), strict=True):
        if state not in _ENDS:
            spent[_ACTIVITIES[state]] += float(end - begin)
    return ActivityTimes(spent, _compute_s(wall.tolist(), states))


def _compute_s(wall: Sequence[float], states: Sequence[str]) -> float | None:
    if states[-1] == "mapping":
        return None
    return float(sum(end - begin for state, (begin, end) in zip(states, pairwise(wall), strict=False) if state == "mapping"))
