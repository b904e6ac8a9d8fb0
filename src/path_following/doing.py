"""The states of the follower: each owns what only it needs, and is left with it.

A state knows no path and no costmap; `deciding` tells which state follows another.
"""

from dataclasses import dataclass, replace

from path_following.config import FollowerConfig
from path_following.getting_free import GettingFree
from path_following.interface import FollowerState
from path_following.manoeuvres import Arc, Motion, Recovery
from path_following.reference_path import Pose
from path_following.straight_driving import WayOut
from path_following.surroundings import Surroundings


@dataclass(frozen=True)
class Doing:
    """What the follower does, as others are told, and why."""

    reason: str

    @property
    def state(self) -> FollowerState:
        """Its name."""
        raise NotImplementedError

    @property
    def turning_side(self) -> float:
        """To which side a turn has begun that is not over: +1 left, -1 right, 0 none; what lies behind is turned to by it."""
        return 0.0

    def paused(self, _seconds: float) -> "Doing":
        """The same after a time in which the robot might not drive, or its base did not obey."""
        return self

    def held(self, seconds: float) -> "Doing":
        """The same after a time in which the robot might not drive."""
        return self.paused(seconds)

    def on_another_path(self) -> "Doing":
        """What it does first on a path that takes over."""
        return Following("new path")


@dataclass(frozen=True)
class Ended(Doing):
    """Standing without a task: none yet (idle), reached, blocked or stuck."""

    how: FollowerState

    @property
    def state(self) -> FollowerState:
        """How it ended."""
        return self.how


@dataclass(frozen=True)
class Following(Doing):
    """On the path, beside it round an obstacle, or straight through a passage."""

    state = FollowerState.FOLLOWING


@dataclass(frozen=True)
class _Turning(Doing):
    """With a turn that has begun, or is due, to a `side`: +1 left, -1 right, 0 not known yet."""

    side: float

    @property
    def turning_side(self) -> float:
        """The side."""
        return self.side


@dataclass(frozen=True)
class MakingRoom(_Turning):
    """On an arc to where the turn that is due is free."""

    arc: Arc
    state = FollowerState.FOLLOWING


@dataclass(frozen=True)
class TurningToPath(_Turning):
    """Turning on the spot towards the path or into the line of a passage."""

    state = FollowerState.TURNING_TO_PATH


@dataclass(frozen=True)
class TurningToGoal(_Turning):
    """At the goal, turning to the heading that is asked for there."""

    state = FollowerState.TURNING_TO_GOAL


@dataclass(frozen=True)
class Waiting(_Turning):
    """Standing since a stamp for the way to become free, or for the turn that was due."""

    since_s: float
    state = FollowerState.WAITING

    def paused(self, seconds: float) -> "Waiting":
        """Time in which it might not drive is no waiting."""
        return replace(self, since_s=self.since_s + seconds)

    def on_another_path(self) -> "Waiting":
        """It waits on, if that is not free either."""
        return replace(self, side=0.0)


@dataclass(frozen=True)
class AwaitingGround(Doing):
    """Braking or standing since a stamp until more of the ground ahead is known than `known_m` metres; None: not known yet on this path."""

    since_s: float
    known_m: float | None
    state = FollowerState.AWAITING_GROUND

    def paused(self, seconds: float) -> "AwaitingGround":
        """Time in which it might not drive is no waiting."""
        return replace(self, since_s=self.since_s + seconds)

    def on_another_path(self) -> "AwaitingGround":
        """It waits on, if too little is known there either."""
        return replace(self, known_m=None)


@dataclass(frozen=True)
class BackingOff(Doing):
    """In a recovery, after which it ends as `then` for the reason that it has now."""

    recovery: Recovery | WayOut | GettingFree
    then: FollowerState
    state = FollowerState.BACKING_OFF

    def held(self, seconds: float) -> "BackingOff":
        """That is no time of the recovery. Time in which the base does not obey is: it ends by that."""
        return replace(self, recovery=self.recovery.paused(seconds))

    def motion(self, config: FollowerConfig, around: Surroundings, pose: Pose, stamp_s: float) -> Motion | None:
        """The next command; None when it is over or not free."""
        command = self.recovery.motion_from(config, around, pose)
        return None if self.recovery.is_done(config, around, pose, stamp_s) else command
