"""What stop, scan and go is told at a tick and what it answers."""

import enum
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


class DriveState(enum.Enum):
    """What the robot does; FAILED it stands until a sweep is asked for. LOOKING: it stands while its mount nods, until the next decision.

    PAUSED: somebody has stopped exploration. Paused or FINISHED, it drives when the follower has a path, to somebody's goal.
    TAKEN_OVER: somebody drives it by joystick.
    """

    STARTING = "starting"
    SETTLING = "settling"
    SWEEPING = "sweeping"
    MAPPING = "mapping"
    DRIVING = "driving"
    LOOKING = "looking"
    PAUSED = "paused"
    TAKEN_OVER = "taken_over"
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
    """What the planner says after a sweep: a new goal, the same goal, nothing left to explore, or no way anywhere.

    LOOK: another sweep, for nobody knows where the robot is, or no ground is found beneath it.
    ENDED: somebody or a budget has ended it. WAIT: until somebody asks for more; the follower is paused then.
    """

    GOAL = "goal"
    KEEP = "keep"
    LOOK = "look"
    EXPLORED = "explored"
    TRAPPED = "trapped"
    ENDED = "ended"
    WAIT = "wait"


NO_TILT = "no joint state of the tilting mount"
_FOLLOWER_IDLE, _FOLLOWER_PAUSED, _FOLLOWER_RECALLED = "idle", "paused", "recalled"
_FOLLOWER_ENDS = {"reached": SweepKind.REACHED, "stuck": SweepKind.STUCK, "blocked": SweepKind.BLOCKED, _FOLLOWER_RECALLED: SweepKind.IDLE}
"""The follower's states without a path to go, by the name under which they cross the stages; in all others it drives."""


@dataclass(frozen=True)
class TickObservation:
    """All of one tick; None is "not known".

    `stamp_s`; `T_odom_base` (4, 4); measured `twist` (v m/s, w rad/s); `tilt_rad` of the laser, 0 horizontal; the follower's
    `command` (v, w), its state by name and its reason; `pose_sigma_m`, sigma of the position, None when nobody tracks it; `displaced`:
    odometry knows nothing of the way since the tick before; the joystick's `teleop` (v, w), None when nobody drives by it; `cloud_s`, the
    newest stamp of a sweep's cloud, -inf before the first, None where nobody hears of them.
    """

    stamp_s: float
    T_odom_base: NDArray[np.float64] | None
    twist: tuple[float, float] | None
    tilt_rad: float | None
    command: tuple[float, float] | None
    follower_state: str
    follower_reason: str
    pose_sigma_m: float | None = None
    displaced: bool = False
    teleop: tuple[float, float] | None = None
    cloud_s: float | None = None

    @property
    def finite_pose(self) -> NDArray[np.float64] | None:
        """T_odom_base, or None when a number in it is none."""
        T = self.T_odom_base
        return T if T is not None and np.isfinite(T).all() else None

    @property
    def missing(self) -> str:
        """What a robot that drives has to know, and does not; empty where it knows all."""
        if self.finite_pose is None:
            return "no odometry"
        if self.tilt_rad is None:
            return NO_TILT
        is_told = self.command is not None and all(math.isfinite(c) for c in self.command)
        return "" if is_told else "no command from the follower"

    @property
    def tracked_sigma_m(self) -> float | None:
        """pose_sigma_m, or None when it is no number."""
        return self.pose_sigma_m if self.pose_sigma_m is not None and math.isfinite(self.pose_sigma_m) else None

    @property
    def drive_end(self) -> SweepKind | None:
        """How the follower's drive has ended; None when it has not."""
        return _FOLLOWER_ENDS.get(self.follower_state)

    @property
    def is_idle(self) -> bool:
        """Whether the follower has been given no path."""
        return self.follower_state == _FOLLOWER_IDLE

    @property
    def is_paused(self) -> bool:
        """Whether it has none because somebody has stopped exploration."""
        return self.follower_state == _FOLLOWER_PAUSED

    @property
    def is_recalled(self) -> bool:
        """Whether it has none because a sweep is to decide anew, at once."""
        return self.follower_state == _FOLLOWER_RECALLED

    @property
    def has_path(self) -> bool:
        """Whether the follower has a path to go."""
        return not (self.is_idle or self.is_paused or self.drive_end)


@dataclass(frozen=True)
class TickAction:
    """Command `v` m/s and `w` rad/s for the wheels, and whether a sweep is to start now.

    `sweep_kind` is that of the sweep being prepared, made or mapped, None while driving.
    """

    v: float
    w: float
    start_sweep: bool
    state: DriveState
    reason: str
    sweep_kind: SweepKind | None = None
