"""The follower itself: answers every observation with one command; `doing` has its states, `deciding` what follows which."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from path_following.config import FollowerConfig
from path_following.deciding import STAND, back_off, decide
from path_following.doing import AwaitingGround, Doing, Ended, Following, Waiting
from path_following.interface import FollowerObservation, FollowerOutput, FollowerState
from path_following.known_ground import KnownGround
from path_following.manoeuvres import Motion
from path_following.obedience import Obedience
from path_following.reference_path import Pose, ReferencePath
from path_following.surroundings import Slide, Surroundings, footprint_lattice
from path_following.task import Moment, Ramp, Task
from path_following.trail import Trail
from rigid_geometry import yaw_of
from robot_body import RobotBody

_SMOOTHING_M = 0.20  # the path is averaged over this much to each side: steps of a grid vanish
_MAX_GAP_S = 0.5  # a longer gap between two steps does not count as time without progress


class PathFollower:
    """Follows one path at a time (thesis 5.5.2): `set_path`, then `step` with every observation until the state `is_over`.

    `latest`: the answer of the last step, which holds until the next.
    """

    def __init__(self, config: FollowerConfig, robot: RobotBody) -> None:
        """An idle follower; ValueError as `configure`."""
        self._robot = robot
        self.configure(config)
        self._ground = KnownGround.under(robot)
        self._trail, self._base = Trail(), Obedience()
        self._task: Task | None
        self._doing: Doing
        self._command: Motion
        self.clear("no path yet")

    def configure(self, config: FollowerConfig) -> None:
        """From the next step on, its speeds and accelerations cut to what the robot can. ValueError lists what is wrong with it."""
        robot = self._robot
        config = replace(
            config,
            max_speed_mps=min(config.max_speed_mps, robot.max_speed_mps),
            max_turn_rate_radps=min(config.max_turn_rate_radps, robot.max_turn_rate_radps),
            max_acceleration_mps2=min(config.max_acceleration_mps2, robot.max_acceleration_mps2),
            max_deceleration_mps2=min(config.max_deceleration_mps2, robot.max_acceleration_mps2),
            max_turn_acceleration_radps2=min(config.max_turn_acceleration_radps2, robot.max_turn_acceleration_radps2),
        )
        problems = config.validate()
        if problems:
            raise ValueError("; ".join(problems))
        self._config, self._slide_m = config, config.turn_slide_factor * robot.turning_slide_m
        length, width, more = robot.length_m, robot.width_m, 2 * config.turn_margin_m
        self._footprints = footprint_lattice(length, width, 0.05), footprint_lattice(length + more, width + more, 0.05)

    @property
    def state(self) -> FollowerState:
        """What the follower does now."""
        return self._doing.state

    @property
    def disobeyed(self) -> str:
        """That the base stands though it is told to drive, as words; empty while it obeys."""
        return self._base.words

    def clear(self, reason: str) -> None:
        """Forget the path and stand; `reason` is told at every step."""
        self._begin(None, Ended(reason, FollowerState.IDLE))
        self.latest = self._output(STAND, reason)

    def set_path(self, points: ArrayLike, goal_yaw: float | None, straight: Sequence[bool] = (), *, exact: bool = False) -> None:
        """Follow (K, 3) points in map, metres, and face `goal_yaw` radians at the end unless it is None; ValueError if not finite.

        `straight` (K,) or empty: whether from a point to the next the path leads through a passage in which the robot cannot turn.
        A robot that drives goes over to the new path at its speed, from where it is by now: beside it, or first back to its beginning by
        the way that it came. One that waits goes on waiting if that is no better. `exact` halves the goal's tolerances.
        """
        if goal_yaw is not None and not math.isfinite(goal_yaw):
            raise ValueError(f"goal_yaw is a finite heading or None, not {goal_yaw!r}")
        task = self._from_here(Task(ReferencePath(points, _SMOOTHING_M, straight), goal_yaw, exact), points, straight)
        stands = self._command == STAND and not isinstance(self._doing, Waiting | AwaitingGround)
        if self._task is None or self._pose is None or stands:
            self._begin(task, Following("new path"))
        else:
            task.takes_over(self._task, self._pose)
            self._task, self._doing = task, self._doing.on_another_path()

    def _from_here(self, task: Task, points: ArrayLike, straight: Sequence[bool]) -> Task:
        """A task whose path begins where the robot was when it was decided; it may have driven on for seconds."""
        way = self._trail.back_to(task.path.xy[0])
        if self._pose is None or self.state.is_over or len(way) < 2:
            return task
        gone_m = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
        if abs(task.locate(self._pose, gone_m).off_path) <= self._config.max_off_path_m:
            return task
        whole = np.vstack([way, np.asarray(points, dtype=np.float64)[:, :2]])
        flags = [*[False] * len(way), *straight] if len(straight) else ()
        return Task(ReferencePath(whole, _SMOOTHING_M, flags), task.goal_yaw, task.exact)

    def _begin(self, task: Task | None, doing: Doing) -> None:
        self._task, self._doing = task, doing
        self._pose: Pose | None = None
        self._stamp: float | None = None
        self._command = STAND
        self._has_stood = True
        self._base.reset()

    def step(self, observation: FollowerObservation) -> FollowerOutput:
        """The command for this moment; zero, with the reason, whenever something that it needs is not known."""
        dt = self._elapsed(observation.stamp_s)
        if self.state.is_over or self._task is None:
            self._base.reset()
            return self._output(STAND, self._doing.reason)
        missing = self._missing(observation)
        if missing or observation.held:
            self._sit_out(dt)
            self._has_stood = True
            return self._output(STAND, missing or ("held" if observation.held else self._doing.reason))
        assert observation.T_map_base is not None and observation.costmap is not None
        T = observation.T_map_base
        pose = (float(T[0, 3]), float(T[1, 3]), yaw_of(T))
        slide = Slide((float(T[0, 2]), float(T[1, 2])), self._slide_m)
        if self._has_stood:  # for a sweep, perhaps, that corrected the map
            self._trail.carry_to(pose)
        self._has_stood = False
        self._pose = pose
        self._trail.add(pose)
        around = Surroundings(observation.costmap, *self._footprints, slide, self._trail)
        if not around.contains(pose):
            self._sit_out(dt)
            return self._output(STAND, f"the costmap does not contain the robot at ({pose[0]:.2f}, {pose[1]:.2f})")
        sent = self._command if observation.sent is None else Motion(*observation.sent)
        self._let_pass(self._base.take_in(observation.stamp_s, sent, observation.twist))
        ramp, speed = Ramp(self._config, self._command, dt), self._command.v if observation.twist is None else observation.twist[0]
        at = self._task.locate(pose)
        now = Moment(self._config, self._task, at, pose, around, observation.stamp_s, speed, ramp, self._ground)
        self._doing, self._command = decide(self._doing, now) if self._base.obeys else self._coax(now)
        words = "" if isinstance(self._doing, Ended) else self._base.words
        return self._output(self._command, words or self._doing.reason)

    def _coax(self, now: Moment) -> tuple[Doing, Motion]:
        """A base that does not obey is told to creep, and once to back off; no drive fails by it."""
        doing = self._doing
        if self._base.takes_recovery(now.stamp_s):
            doing, _ = back_off(now, FollowerState.STUCK, self._base.words)
        if not isinstance(doing, Ended):
            doing, command = decide(doing, now)
        if isinstance(doing, Ended) and doing.how is FollowerState.STUCK:
            return Following(self._base.words), STAND
        return doing, self._base.crept(command)

    def _elapsed(self, stamp: float) -> float:
        """Seconds since the last step; 0, and no time without progress, at the first one and where time jumped."""
        if not math.isfinite(stamp):
            raise ValueError(f"stamp_s is a finite time, not {stamp!r}")
        last, self._stamp = self._stamp, stamp
        if last is None:
            return 0.0
        dt = stamp - last
        if 0.0 <= dt <= _MAX_GAP_S:
            return dt
        self._sit_out(dt)
        return 0.0

    def _missing(self, observation: FollowerObservation) -> str:
        if observation.silent:
            return observation.silent
        if observation.T_map_base is None:
            return "no pose"
        if not np.isfinite(observation.T_map_base).all():
            return "the pose is not finite"
        return "no costmap" if observation.costmap is None else ""

    def _sit_out(self, seconds: float) -> None:
        self._command = STAND
        self._base.reset()
        self._doing = self._doing.held(seconds)
        if self._task:
            self._task.pause(seconds)

    def _let_pass(self, seconds: float) -> None:
        """Time in which the base does not obey is no lack of progress."""
        if seconds == 0.0:
            return
        self._doing = self._doing.paused(seconds)
        if self._task:
            self._task.pause(seconds)

    def _output(self, motion: Motion, reason: str) -> FollowerOutput:
        self.latest = FollowerOutput(motion.v, motion.w, self.state, reason)
        return self.latest
