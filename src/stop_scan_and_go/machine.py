"""The state machine: one `step` a tick, one `on_decision` a sweep."""

import math

from rigid_geometry import clock_leap_s
from stop_scan_and_go.config import StopScanAndGoConfig
from stop_scan_and_go.interface import NO_TILT, Decision, DriveState, SweepKind, TickAction, TickObservation
from stop_scan_and_go.travel import TravelMeter, too_far
from stop_scan_and_go.watches import FOLLOWER_GRACE_S, DriveWatch, HeldFor, RockingWatch, SweepWatch, is_moving, leap_s

_DISPLACED = "the robot was moved, or slid: it looks where it is"
_STANDING = (DriveState.STARTING, DriveState.PAUSED, DriveState.FINISHED, DriveState.FAILED)
_START_DELAY_S = 1.0  # odometry must have been there for so long before the first sweep
_MOST_TRIES = 4  # of a sweep that does not begin, or of which nothing comes


class StopScanAndGo:
    """STARTING, then SETTLING, SWEEPING, MAPPING, DRIVING round and round until FINISHED or FAILED (thesis 6.2.1, figure 6.5).

    PAUSED or FINISHED it goes on driving, with the same sweeps, when the follower is given a path.
    """

    def __init__(self, config: StopScanAndGoConfig) -> None:
        """A machine before its first tick; ValueError lists what is wrong with `config`."""
        self.configure(config)
        self._state, self._reason = DriveState.STARTING, "waiting for odometry and laser"
        self._kind: SweepKind | None = SweepKind.INITIAL
        self._stamp: float | None = None
        self._entered_s, self._began_s = 0.0, math.nan
        self._travel = TravelMeter(config.slope_rad)
        self._ready = HeldFor(_START_DELAY_S)
        self._still = HeldFor(config.still_time_s)
        self._rocks, self._rocking = RockingWatch(), math.inf
        self._drive_watch = DriveWatch()
        self._watch: SweepWatch | None = None
        self._early: tuple[Decision, str] | None = None
        self._before = self._state, self._reason  # what it did when the joystick took over
        self._displaced_s: float | None = None  # since then nobody knows where it is
        self._is_over = False  # exploration has come to its end once
        self._is_repeated = False  # a sweep, for there was no decision about the one before
        self._in_vain, self._since_last_s = 0, 0.0  # sweeps in a row, and time since the last tick
        self.whole_sweep_rad: float | None = None  # the tilt that a sweep has to go beyond, where somebody knows
        self._sweeps = 0
        self._answers = {
            DriveState.STARTING: self._starting,
            DriveState.SETTLING: self._settling,
            DriveState.SWEEPING: self._sweeping,
            DriveState.MAPPING: self._mapping,
            DriveState.DRIVING: self._driving,
            DriveState.PAUSED: self._paused,
            DriveState.TAKEN_OVER: self._let_go,
            DriveState.FINISHED: self._finished,
            DriveState.FAILED: self._failed,
        }

    def configure(self, config: StopScanAndGoConfig) -> None:
        """From the next tick on. ValueError lists what is wrong with `config`."""
        if problems := config.validate():
            raise ValueError("; ".join(problems))
        self._config = config

    @property
    def state(self) -> DriveState:
        """What the robot does now."""
        return self._state

    @property
    def began_s(self) -> float:
        """When the run began, by the clock as it is set now."""
        return self._began_s

    @property
    def sweeps(self) -> int:
        """Sweeps that came to their end."""
        return self._sweeps

    @property
    def distance_m(self) -> float:
        """Way driven since the start by odometry, metres."""
        return self._travel.total_m

    def step(self, tick: TickObservation) -> TickAction:
        """The answer to one tick, called once when all its data are there; ValueError when its stamp is not finite."""
        if not math.isfinite(tick.stamp_s):
            raise ValueError(f"stamp_s is a finite time, not {tick.stamp_s!r}")
        self._take_stamp(tick.stamp_s)
        self._measure(tick)
        self._displaced_s = tick.stamp_s if tick.displaced else self._displaced_s
        if tick.teleop is not None:
            return self._taken_over(tick.teleop)
        if tick.displaced and self._state not in _STANDING:
            return self._prepare_sweep(SweepKind.IDLE, _DISPLACED)
        if tick.tilt_rad is None and self._state in (DriveState.SETTLING, DriveState.SWEEPING):
            return self._without_tilt()
        return self._answers[self._state](tick)

    @property
    def nods(self) -> bool:
        """Whether the mount is to nod."""
        return False

    def stalled_s(self, _stamp_s: float) -> float:
        """How long it has stood for a sweep that does not come: here a sweep that fails ends the run."""
        return 0.0

    def on_decision(self, stamp_s: float, kind: Decision | str, reason: str, *, refused: bool = False) -> TickAction | None:
        """Take the planner's decision about the sweep that ended at `stamp_s`; `refused`: its match was. ValueError for an unknown kind.

        Returns the answer to the tick that was held back, to be sent now. None when none was: a decision that overtakes the end
        of its sweep waits for it, any other is ignored.
        """
        decision = Decision(kind)
        if self._is_stale(stamp_s):
            return None
        if self._state is DriveState.SWEEPING:
            self._early = (decision, reason)
            return None
        return self._decided(decision, reason)

    def _is_stale(self, stamp_s: float) -> bool:
        if self._state not in (DriveState.SWEEPING, DriveState.MAPPING) or self._watch is None:
            return True
        return self._is_before_displacement(stamp_s) or not stamp_s > self._watch.begun_s

    def _is_before_displacement(self, stamp_s: float) -> bool:
        return self._displaced_s is not None and stamp_s <= self._displaced_s

    def _decided(self, decision: Decision, reason: str) -> TickAction:
        self._is_repeated, self._in_vain = False, 0
        if decision is Decision.LOOK:
            return self._prepare_sweep(SweepKind.IDLE, reason)
        self._displaced_s = None
        if decision in (Decision.EXPLORED, Decision.TRAPPED, Decision.ENDED):
            self._is_over = True
            self._enter(DriveState.FINISHED, f"{decision.value}: {reason}")
            self._kind = None
            return self._answer()
        return self._drive(f"{decision.value}: {reason}")

    def _drive(self, reason: str) -> TickAction:
        if self._displaced_s is not None:
            return self._prepare_sweep(SweepKind.IDLE, _DISPLACED)
        self._enter(DriveState.DRIVING, reason)
        self._drive_watch = DriveWatch()
        self._kind = None
        return self._answer()

    def _take_stamp(self, stamp: float) -> None:
        # What was waited for is still waited for; a leap of the clock is no waiting.
        leapt = leap_s(self._stamp, stamp)
        self._entered_s += leapt
        self._since_last_s = 0.0 if self._stamp is None or leapt else stamp - self._stamp
        self._began_s = stamp if self._stamp is None else self._began_s + clock_leap_s(self._stamp, stamp)
        if self._watch:
            self._watch.begun_s += leapt
        self._stamp = stamp

    def _measure(self, tick: TickObservation) -> None:
        self._rocking = self._rocks.rate(tick.stamp_s, tick.finite_pose)
        # Standing, the odometry's noise would add up to a way.
        settles = self._state is DriveState.SETTLING and is_moving(self._config, tick.twist)
        moves = settles or self._state in (DriveState.DRIVING, DriveState.TAKEN_OVER)
        self._travel.take(tick.finite_pose, moves=moves, displaced=tick.displaced)

    def _enter(self, state: DriveState, reason: str) -> None:
        assert self._stamp is not None
        self._state, self._reason, self._entered_s = state, reason, self._stamp

    def _answer(self, v: float = 0.0, w: float = 0.0, *, start_sweep: bool = False, reason: str = "") -> TickAction:
        return TickAction(v, w, start_sweep, self._state, reason or self._reason, self._kind)

    def _starting(self, tick: TickObservation) -> TickAction:
        known = tick.finite_pose is not None and tick.twist is not None and tick.tilt_rad is not None
        if self._ready.holds(tick.stamp_s, known):
            return self._prepare_sweep(SweepKind.INITIAL, "the first sweep")
        return self._answer()

    def _prepare_sweep(self, kind: SweepKind, reason: str) -> TickAction:
        self._kind = kind
        self._still = HeldFor(self._config.still_time_s)
        self._enter(DriveState.SETTLING, reason)
        return self._answer()

    def _without_tilt(self) -> TickAction:
        """Time that does not count."""
        self._entered_s += self._since_last_s
        if self._watch:
            self._watch.let_pass(self._since_last_s)
        return self._answer(reason=NO_TILT)

    def _sweep_again(self, why: str) -> TickAction:
        self._in_vain += 1
        if self._in_vain < _MOST_TRIES:
            return self._prepare_sweep(self._kind or SweepKind.IDLE, why)
        self._enter(DriveState.FAILED, f"{why}, for the {_MOST_TRIES}th time")
        return self._answer()

    def _settling(self, tick: TickObservation) -> TickAction:
        is_late = tick.stamp_s - self._entered_s > self._config.settle_limit_s
        is_level = tick.tilt_rad is not None and abs(tick.tilt_rad) <= self._config.level_tilt_rad
        is_still = not is_moving(self._config, tick.twist) and self._rocking <= self._config.still_rocking_radps
        if not self._still.holds(tick.stamp_s, is_level and is_still):
            if is_late and not is_level:
                self._enter(DriveState.FAILED, f"the mount was not level within {self._config.settle_limit_s:.0f} s")
            if not (is_late and is_level):
                return self._answer()
        self._watch, self._early = SweepWatch(self._config, tick.stamp_s), None
        self._enter(DriveState.SWEEPING, self._reason)
        return self._answer(start_sweep=True)

    def _sweeping(self, tick: TickObservation) -> TickAction:
        assert self._watch is not None
        tilt = tick.tilt_rad
        if tilt is not None and math.isfinite(tilt) and self._watch.is_over(tick.stamp_s, tilt):
            return self._end_sweep(tick.stamp_s)
        failure = self._watch.failure(tick.stamp_s)
        if failure and not self._watch.has_left:
            return self._sweep_again(failure)
        if failure:
            self._enter(DriveState.FAILED, failure)
        return self._answer()

    def _end_sweep(self, stamp: float) -> TickAction:
        self._sweeps += 1
        self._travel.restart()
        self._enter(DriveState.MAPPING, f"mapping sweep {self._sweeps}")
        early, self._early = self._early, None
        return self._decided(*early) if early else self._answer()

    def _mapping(self, tick: TickObservation) -> TickAction:
        assert self._watch is not None
        is_late = tick.stamp_s - self._entered_s > self._config.cloud_limit_s
        if is_late and tick.cloud_s is not None and not tick.cloud_s > self._watch.begun_s:
            return self._sweep_again(self._watch.without_cloud(self.whole_sweep_rad))
        if tick.stamp_s - self._entered_s > self._config.decision_limit_s:
            reason = f"no decision about the sweep within {self._config.decision_limit_s:.0f} s"
            if not self._is_repeated:
                self._is_repeated = True
                return self._prepare_sweep(SweepKind.IDLE, reason)
            self._enter(DriveState.FAILED, f"{reason}, nor about the one before")
        return self._answer()

    def _driving(self, tick: TickObservation) -> TickAction:
        if tick.is_paused:
            self._enter(DriveState.PAUSED, tick.follower_reason)
            return self._answer()
        ended = self._end_of_drive(tick)
        if ended is not None:
            return self._end_drive(*ended)
        if tick.command is None or tick.missing:
            return self._answer(reason=tick.missing)
        return self._answer(*tick.command)

    def _end_drive(self, kind: SweepKind, reason: str) -> TickAction:
        return self._prepare_sweep(kind, reason)

    def _end_of_drive(self, tick: TickObservation) -> tuple[SweepKind, str] | None:
        return self._drive_watch.end(tick, tick.stamp_s - self._entered_s) or self._too_far(tick)

    def _too_far(self, tick: TickObservation) -> tuple[SweepKind, str] | None:
        reason = too_far(self._config, self._travel, tick)
        return (SweepKind.INTERMEDIATE, reason) if reason else None

    def _taken_over(self, teleop: tuple[float, float]) -> TickAction:
        if self._state is not DriveState.TAKEN_OVER:
            self._before = self._state, self._reason
            self._kind = None
            self._enter(DriveState.TAKEN_OVER, "somebody drives by joystick")
        return self._answer(*teleop)

    def _let_go(self, _tick: TickObservation) -> TickAction:
        """Exploration goes on with a sweep from wherever the robot was driven to; what it was not driving for stays."""
        state, reason = self._before
        if state in _STANDING:
            self._enter(state, reason)
            return self._answer()
        return self._prepare_sweep(SweepKind.IDLE, "the joystick has let go")

    def _paused(self, tick: TickObservation) -> TickAction:
        if tick.is_paused:
            return self._answer()
        if tick.has_path:
            return self._drive("to a goal while exploration is paused")
        return self._end_drive(SweepKind.IDLE, "exploration goes on")

    def _finished(self, tick: TickObservation) -> TickAction:
        # The follower may still tell of its last path just after the decision.
        is_new = tick.stamp_s - self._entered_s >= FOLLOWER_GRACE_S
        if is_new and tick.has_path:
            return self._drive("to a goal after exploration")
        if is_new and tick.is_recalled:
            return self._end_drive(SweepKind.IDLE, tick.follower_reason)
        return self._answer()

    def _failed(self, tick: TickObservation) -> TickAction:
        if tick.is_recalled and tick.stamp_s - self._entered_s >= FOLLOWER_GRACE_S:
            self._in_vain, self._is_repeated = 0, False
            return self._prepare_sweep(SweepKind.IDLE, tick.follower_reason)
        return self._answer()
