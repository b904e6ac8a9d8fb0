"""What stop, scan and go is told at a tick and what it answers."""

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


class DriveState(enum.Enum):
    """What the robot does; FINISHED and FAILED are for good. LOOKING: it stands while its mount nods, until the next decision."""

    STARTING = "starting"
    SETTLING = "settling"
    SWEEPING = "sweeping"
    MAPPING = "mapping"
    DRIVING = "driving"
    LOOKING = "looking"
    FINISHED = "finished"
    FAILED = "failed"


class SweepKind(enum.Enum):
    """Why a sweep is made. After INTERMEDIATE the goal stays (thesis 6.2.2); after the others a new one has to be chosen."""

    INITIAL = "initial"
    REACHED = "reached"
    INTERMEDIATE = "intermediate"
    STUCK = "stuck"
    BLOCKED = "blocked"
    IDLE = "idle"


class Decision(enum.Enum):
    """What the planner says after a sweep: a new goal, the same goal, nothing left to explore, or no way anywhere."""

    GOAL = "goal"
    KEEP = "keep"
    EXPLORED = "explored"
    TRAPPED = "trapped"


FOLLOWER_ENDS = {"reached": SweepKind.REACHED, "stuck": SweepKind.STUCK, "blocked": SweepKind.BLOCKED}
"""The follower's states that end a drive, by the name under which they cross the stages; "idle" is none, all others drive."""


@dataclass(frozen=True)
class TickObservation:
    """All of one tick; None is "not known".

    `stamp_s`; `T_odom_base` (4, 4); measured `twist` (v m/s, w rad/s); `tilt_rad` of the laser, 0 horizontal; the follower's
    `command` (v, w), its state by name and its reason; `pose_sigma_m`, sigma of the position, None when nobody tracks it.
    """

    stamp_s: float
    T_odom_base: NDArray[np.float64] | None
    twist: tuple[float, float] | None
    tilt_rad: float | None
    command: tuple[float, float] | None
    follower_state: str
    follower_reason: str
    pose_sigma_m: float | None = None


@dataclass(frozen=True)
class TickAction:
    """Command `v` m/s and `w` rad/s for the wheels, whether a sweep is to start now, and whether the tick is answered.

    While `acknowledge` is False the clock stands. `sweep_kind` is that of the sweep being prepared, made or mapped, None while driving.
    """

    v: float
    w: float
    start_sweep: bool
    acknowledge: bool
    state: DriveState
    reason: str
    sweep_kind: SweepKind | None = None
