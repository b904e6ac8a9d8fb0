"""Scan while driving: the mount nods all the time, and each half of a nod is a sweep. The robot stands only where it has to.

It stands until the next decision at a goal, where the follower has failed, where it has come far without a decision, and where odometry
jumped. It stands for a whole sweep at the start, where a look from the same place did not help, after matches that were refused, and on a
way backward, where a mount that nods does not look.
"""

import math

from stop_scan_and_go.config import StopScanAndGoConfig
from stop_scan_and_go.interface import Decision, DriveState, SweepKind, TickAction, TickObservation
from stop_scan_and_go.machine import StopScanAndGo

_LOOKED_WITHIN_M = 0.5  # where it looked so near before, it stands for a whole sweep
_MAX_POSE_LEAP_M = 0.06  # where the position's sigma grows by more in one tick, odometry has jumped, and it stands to look
_MAX_REFUSED = 2  # so many refused matches in a row ask for a whole sweep


class ScanWhileDriving(StopScanAndGo):
    """The same machine, with LOOKING beside DRIVING."""

    def __init__(self, config: StopScanAndGoConfig) -> None:
        """A machine before its first tick; ValueError lists what is wrong with `config`."""
        super().__init__(config)
        self._answers[DriveState.LOOKING] = self._looking
        self._looked_at_m = -math.inf  # way driven when it last stood to look
        self._refused = 0  # matches in a row
        self._sigma_m: float | None = None  # of the position, at the last tick
        self._leap_m = 0.0  # by which it grew since
        self._back_m = 0.0  # way backward, less what it came forward again, since it last looked all around

    @property
    def looks(self) -> bool:
        """Whether sweeps come by themselves, without being asked for."""
        return self._state in (DriveState.DRIVING, DriveState.LOOKING)

    @property
    def nods(self) -> bool:
        """Whether the mount is to nod."""
        return self.looks

    def stalled_s(self, stamp_s: float) -> float:
        """How long it has stood by now for a sweep that does not come; 0 while that may still be on its way."""
        looks_s = stamp_s - self._entered_s if self._state is DriveState.LOOKING else 0.0
        return looks_s if looks_s > self._config.nod_patience_s else 0.0

    def on_decision(self, stamp_s: float, kind: Decision | str, reason: str, *, refused: bool = False) -> TickAction | None:
        """Take the planner's decision about the sweep that ended at `stamp_s`; `refused`: its match was. ValueError for an unknown kind."""
        decision = Decision(kind)
        self._refused = self._refused + 1 if refused else 0
        if not self.looks:
            return super().on_decision(stamp_s, decision, reason)
        if self._is_before_displacement(stamp_s):
            return None
        self._sweeps += 1
        self._travel.restart()
        if self._state is DriveState.DRIVING and self._is_over and decision is not Decision.GOAL:
            return None  # it is on the way to somebody's goal
        if decision is Decision.KEEP and (self._state is DriveState.DRIVING or stamp_s <= self._entered_s):
            return None
        return self._decided(decision, reason)

    def step(self, tick: TickObservation) -> TickAction:
        """The answer to one tick, called once when all its data are there; ValueError when its stamp is not finite."""
        before_m, self._sigma_m = self._sigma_m, tick.pose_sigma_m
        self._leap_m = 0.0 if before_m is None or self._sigma_m is None else self._sigma_m - before_m
        driven_m = self._travel.total_m
        action = super().step(tick)
        driven_m = self._travel.total_m - driven_m
        self._back_m = max(0.0, self._back_m + (driven_m if _is_backward(tick) else -driven_m))
        return action

    def _end_drive(self, kind: SweepKind, reason: str) -> TickAction:
        here_m = self._travel.total_m
        is_seen, self._looked_at_m = here_m - self._looked_at_m < _LOOKED_WITHIN_M, here_m
        if is_seen and kind is not SweepKind.INTERMEDIATE:
            self._looked_at_m = -math.inf
            return self._prepare_sweep(kind, reason)
        self._kind = kind
        self._enter(DriveState.LOOKING, reason)
        return self._answer()

    def _too_far(self, tick: TickObservation) -> tuple[SweepKind, str] | None:
        if self._travel.distance_m > self._config.max_distance_m:
            return SweepKind.INTERMEDIATE, f"{self._travel.distance_m:.2f} m without a decision"
        if self._leap_m > _MAX_POSE_LEAP_M:
            return (
                SweepKind.INTERMEDIATE,
                f"odometry jumped: all at once the position is known to {100 * (self._sigma_m or 0.0):.0f} cm only",
            )
        return None

    def _driving(self, tick: TickObservation) -> TickAction:
        if self._refused >= _MAX_REFUSED:
            self._refused = 0
            return self._prepare_sweep(SweepKind.INTERMEDIATE, "matches were refused")
        if self._is_blind(tick):
            return self._prepare_sweep(SweepKind.INTERMEDIATE, f"{self._back_m:.2f} m backward, where the laser does not look")
        return super()._driving(tick)

    def _is_blind(self, tick: TickObservation) -> bool:
        """Whether it has come far, and goes on, to where it does not look."""
        return self._back_m > self._config.max_backward_m and _is_backward(tick)

    def _end_sweep(self, stamp: float) -> TickAction:
        self._back_m = 0.0
        return super()._end_sweep(stamp)

    def _looking(self, tick: TickObservation) -> TickAction:
        if tick.stamp_s - self._entered_s > self._config.decision_limit_s:
            is_unseen = tick.cloud_s is not None and tick.cloud_s <= self._entered_s
            missing = "no cloud of a sweep" if is_unseen else "no decision about a sweep"
            self._enter(DriveState.FAILED, f"{missing} within {self._config.decision_limit_s:.0f} s")
        return self._answer()


class LookWhileDriving(ScanWhileDriving):
    """The same with a lidar that is fixed: it looks all the time. In place of a whole sweep the robot stands until the next decision."""

    @property
    def nods(self) -> bool:
        """Nothing can."""
        return False

    def _prepare_sweep(self, kind: SweepKind, reason: str) -> TickAction:
        self._kind = kind
        self._enter(DriveState.LOOKING, reason)
        return self._answer()

    def _is_blind(self, tick: TickObservation) -> bool:
        """It sees all around."""
        return False


def _is_backward(tick: TickObservation) -> bool:
    return tick.command is not None and tick.command[0] < 0.0
