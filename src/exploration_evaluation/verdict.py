"""Whether a run succeeded, and what speaks against it.

Last in the judge: a success is a run that did as it was asked, and no harm. Asked to explore, it ended because all was explored, and its
map is there and holds what can be reached. A robot that stayed where it began and saw all from there has succeeded, too. One that somebody
told to end, or that had a budget, may have explored less; a budget is kept, with the way home. One that was only to drive to goals in a
finished map explores nothing, and goes on until the user interrupts it or its time is over.
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from exploration_evaluation.start_distance import StartDistance

ENDED = "ended"  # begins a stop reason: somebody asked for it, or the budget was spent
INTERRUPTED = "interrupted"  # the reason of a run that its user interrupts
TIME_LIMIT = "time limit"  # begins the reason of a run whose simulated time is over

_MIN_COVERAGE = 0.95  # share of the reachable ground that a success has to exceed; runs that end well have over 0.99
_MAX_MISSED_PIECE_M2 = 5.0  # largest connected piece of reachable ground that a success may lack: a small room or a deck
_STAYED_M = 1.0  # the robot's length: one that came no farther has never left its start
_STAYED_COVERAGE = 0.995  # from which one that stayed has seen all that there is
_OUTSIDE_M = 0.05  # by which the outline may come to where the robot may not be
_HOME_M, _HOME_RAD = 0.2, 0.2  # one that was to end at home is there within this distance and this heading
_BUDGET_SHARE = 1.05  # of its budget that a run may have spent: odometry counts the metres


class Fault(StrEnum):
    """What speaks against a run; stands in the summary's "faults"."""

    NOT_EXPLORED = "not explored"
    BROKEN_OFF = "broken off"
    FELL = "fell"
    TOUCHED = "collision"
    NOT_SAVED = "no map"
    NOT_ON_DISK = "not on disk"
    MISSED = "coverage"
    STAYED = "stayed"
    NOT_HOME = "not home"
    OUTSIDE = "outside"
    LATE = "over budget"


@dataclass(frozen=True)
class Outcome:
    """What is known of a run; None where it is not.

    coverage: share of the reachable ground in the map. missed_piece_m2: the largest connected piece that it lacks.
    start: how far the robot was from its start. outside_m: by how much it came to where it may not be, None where it may be everywhere.
    explores: False for a robot that was only to drive to goals. budget_share: what it spent of its budget, None without one.
    on_disk: False where something could not be written.
    """

    stop_reason: str | None
    fell: bool | None
    collisions: int | None
    map_saved: bool
    coverage: float | None
    missed_piece_m2: float | None
    start: StartDistance | None
    outside_m: float | None = None
    explores: bool = True
    budget_share: float | None = None
    on_disk: bool = True

    @property
    def is_to_be_whole(self) -> bool:
        """Whether nothing may be missing: nobody ended exploration before it was done."""
        return self.explores and not (self.stop_reason or "").startswith(ENDED)


def faults(outcome: Outcome) -> tuple[Fault, ...]:
    """All that is known to speak against a run."""
    o, whole, reason = outcome, outcome.is_to_be_whole, outcome.stop_reason
    against = {
        Fault.NOT_EXPLORED: whole and reason is not None and not reason.startswith("explored"),
        Fault.BROKEN_OFF: not o.explores and reason is not None and not reason.startswith((ENDED, INTERRUPTED, TIME_LIMIT)),
        Fault.FELL: o.fell is True,
        Fault.TOUCHED: o.collisions is not None and o.collisions > 0,
        Fault.NOT_SAVED: o.explores and not o.map_saved,
        Fault.NOT_ON_DISK: not o.on_disk,
        Fault.MISSED: whole and _is_missed(o.coverage, o.missed_piece_m2),
        Fault.STAYED: whole and _has_stayed(o),
        Fault.NOT_HOME: _is_not_home(o),
        Fault.OUTSIDE: o.outside_m is not None and o.outside_m > _OUTSIDE_M,
        Fault.LATE: o.budget_share is not None and o.budget_share > _BUDGET_SHARE,
    }
    return tuple(fault for fault, holds in against.items() if holds)


def succeeded(outcome: Outcome) -> bool | None:
    """False when anything known speaks against it, None when something is not known, True otherwise."""
    if faults(outcome):
        return False
    o = outcome
    needed = (o.stop_reason, o.fell, o.collisions, *((o.coverage, o.missed_piece_m2, o.start) if o.is_to_be_whole else ()))
    return None if any(part is None for part in needed) else True


def succeeded_alone(stop_reason: str, driven_m: float, set_aside: int) -> bool:
    """Success as the robot itself knows it, without a true world: ended as somebody asked for, or explored, and not just given up on all
    that it never drove to."""
    if "; not home, " in stop_reason:
        return False
    return stop_reason.startswith(ENDED) or stop_reason.startswith("explored") and (driven_m >= _STAYED_M or set_aside == 0)


def largest_piece_m2(cells: ArrayLike, cell_m: float) -> float:
    """Area of the largest piece of (N, 3) cells of ground, in which each is beside or cornerwise of the next on about its level."""
    points = np.asarray(cells, dtype=np.float64).reshape(-1, 3)
    if not len(points):
        return 0.0
    pairs = cKDTree(points).query_pairs(2.0 * cell_m, output_type="ndarray")
    near = np.abs(points[pairs[:, 0], :2] - points[pairs[:, 1], :2]).max(axis=1) <= 1.1 * cell_m
    a, b = pairs[near].T
    graph = coo_array((np.ones(len(a), dtype=np.int8), (a, b)), shape=(len(points), len(points)))
    piece = connected_components(graph, directed=False)[1]
    return float(np.bincount(piece).max() * cell_m**2)


def _is_missed(coverage: float | None, piece_m2: float | None) -> bool:
    too_little = coverage is not None and coverage <= _MIN_COVERAGE
    return too_little or (piece_m2 is not None and piece_m2 > _MAX_MISSED_PIECE_M2)


def _has_stayed(outcome: Outcome) -> bool:
    if outcome.start is None or outcome.start.farthest_m >= _STAYED_M:
        return False
    return outcome.coverage is None or outcome.coverage < _STAYED_COVERAGE


def _is_not_home(outcome: Outcome) -> bool:
    """Whether the robot was to end at home, as its stop reason tells, and did not, by its own word or by the true poses."""
    reason, start = outcome.stop_reason or "", outcome.start
    if "; home, " not in reason or start is None:
        return "; not home, " in reason
    return start.end_m > _HOME_M or start.end_rad > _HOME_RAD
