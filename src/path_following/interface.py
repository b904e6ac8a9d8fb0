"""What the follower is told at a step and what it answers."""

import enum
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class CostGrid(Protocol):
    """Costs as costmap_2d has them (253 inscribed, 254 lethal, 255 unknown) on a grid of the map frame."""

    @property
    def cost(self) -> NDArray[np.uint8]:
        """(ny, nx) costs; row = y, column = x."""

    @property
    def unknown(self) -> NDArray[np.bool_] | None:
        """(ny, nx) where nothing is known of the ground, also where `cost` tells of what is near; None: where the cost is 255."""

    @property
    def origin_xy(self) -> tuple[float, float]:
        """Lower left corner in map, metres."""

    @property
    def resolution(self) -> float:
        """Side of a cell in metres."""


class FollowerState(enum.Enum):
    """What the follower does; REACHED, BLOCKED and STUCK last until the next path.

    AWAITING_GROUND: it stands because too little of the ground ahead is known; a sweep or a new terrain helps.
    """

    IDLE = "idle"
    FOLLOWING = "following"
    TURNING_TO_PATH = "turning_to_path"
    TURNING_TO_GOAL = "turning_to_goal"
    WAITING = "waiting"
    AWAITING_GROUND = "awaiting_ground"
    BACKING_OFF = "backing_off"
    REACHED = "reached"
    BLOCKED = "blocked"
    STUCK = "stuck"

    @property
    def is_over(self) -> bool:
        """True when the follower stands and waits for a path."""
        return self in (FollowerState.IDLE, FollowerState.REACHED, FollowerState.BLOCKED, FollowerState.STUCK)


@dataclass(frozen=True)
class FollowerObservation:
    """One moment: `stamp_s`, pose (4, 4) of base_link in map, costmap, measured `twist` (v m/s, w rad/s); None is "not known".

    `held`: somebody keeps the commands from the wheels, as during a sweep; that time is no lack of progress. `silent`: which sensor
    does not speak, so that the robot must stand; empty when all do. `sent` (v m/s, w rad/s): what of the last command went to the wheels;
    None for all of it.
    """

    stamp_s: float
    T_map_base: NDArray[np.float64] | None
    costmap: CostGrid | None
    twist: tuple[float, float] | None
    held: bool = False
    silent: str = ""
    sent: tuple[float, float] | None = None


@dataclass(frozen=True)
class FollowerOutput:
    """Command `v` m/s and `w` rad/s, what the follower does and why."""

    v: float
    w: float
    state: FollowerState
    reason: str
