"""What a step is decided on: the task with how far it is, the moment, and the command of the last step."""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from path_following.config import FollowerConfig
from path_following.known_ground import KnownGround
from path_following.manoeuvres import Motion
from path_following.progress import ProgressWatch
from path_following.pursuit import approached
from path_following.reference_path import Pose, Projection, ReferencePath, Stretch
from path_following.surroundings import Surroundings

_EXACTLY = 0.5  # of the tolerances, where the robot is to stand at the goal
AT_BEGIN_M = 0.08  # so near to where a passage begins the robot is there


@dataclass(eq=False)
class Task:
    """A path to follow and the heading wanted at its end, and how far the robot is with it.

    `s`: arc length of the place beside the robot, and the `farthest` so far;
    `entered`: the latest passage at whose beginning the robot was. `exact`: it is to stand at the end, not only to look from there.
    """

    path: ReferencePath
    goal_yaw: float | None
    exact: bool = False
    s: float = 0.0
    farthest: float = 0.0
    entered: Stretch | None = None
    watch: ProgressWatch | None = None

    @property
    def tolerance_share(self) -> float:
        """Of the tolerances of the goal, what counts here."""
        return _EXACTLY if self.exact else 1.0

    def locate(self, pose: Pose, gone_m: float = 0.0) -> Projection:
        """The place beside the robot; near the last one only, which may be `gone_m` behind: the path may pass over or under itself."""
        at = self.path.project(np.array(pose[:2]), self.s - 0.5, self.s + gone_m + 1.0)
        self.s = at.s
        self.farthest = max(self.farthest, at.s)
        return at

    def is_in(self, stretch: Stretch, s: float, pose: Pose) -> bool:
        """Whether the robot is where the stretch begins, or was: a turn there may take it a little back."""
        at_begin = s >= stretch.begin or math.dist(stretch.begin_xy, pose[:2]) < AT_BEGIN_M
        self.entered = stretch if at_begin else self.entered
        return self.entered is stretch

    def is_stalled(self, config: FollowerConfig, stamp_s: float, yaw: float, *, is_waiting: bool) -> bool:
        """Whether there was no progress for too long; waiting does not count."""
        if self.watch is None:
            self.watch = ProgressWatch(config, stamp_s, self.s, yaw)
        return not is_waiting and self.watch.is_stalled(stamp_s, self.s, yaw)

    def takes_over(self, before: "Task", pose: Pose) -> None:
        """Stand in for a task that the robot is driving on: what it lacked in progress there it lacks here."""
        at = self.locate(pose)
        if before.watch is not None:
            self.watch = before.watch
            self.watch.carry_to(at.s)

    def pause(self, seconds: float) -> None:
        """Let `seconds` count for nothing."""
        if self.watch:
            self.watch.pause(seconds)


@dataclass(frozen=True)
class Ramp:
    """From the `last` command to the next: what `dt` seconds allow."""

    config: FollowerConfig
    last: Motion
    dt: float

    def to(self, wanted: Motion) -> Motion:
        """The command nearest to what is wanted."""
        config, dt = self.config, self.dt
        v = approached(self.last.v, wanted.v, config.max_acceleration_mps2 * dt, config.max_deceleration_mps2 * dt)
        turn_change = config.max_turn_acceleration_radps2 * dt
        w = approached(self.last.w, wanted.w, turn_change, turn_change)
        return Motion(v, max(-config.max_turn_rate_radps, min(config.max_turn_rate_radps, w)))

    def along(self, speed: float, curvature: float) -> Motion:
        """The same on an arc: its turn rate follows the speed that is possible now, for the robot to start on that arc."""
        v = self.to(Motion(speed, 0.0)).v
        return self.to(Motion(speed, v * curvature))

    def turning(self, angle: float) -> Motion:
        """The same of a turn on the spot by an angle, slower towards its end."""
        return self.to(Motion(0.0, math.copysign(self.config.turn_rate_within(angle), angle)))


@dataclass(frozen=True)
class Moment:
    """Where the robot is in its task (`at`) and in map, what is around it, how fast it drives, and which ground its wheels need."""

    config: FollowerConfig
    task: Task
    at: Projection
    pose: Pose
    around: Surroundings
    stamp_s: float
    speed: float
    ramp: Ramp
    ground: KnownGround

    @cached_property
    def known_ahead_m(self) -> float:
        """Metres of known ground ahead on the path; inf where it is known as far as matters, or nothing is asked."""
        least, config = self.config.known_ahead_m, self.config
        if least == 0.0:
            return math.inf
        look_m = least + config.stopping_m(config.max_speed_mps) + self.ground.gap_m
        return self.ground.ahead_m(self.around, self.task.path, self.at.s, look_m)

    def speed_within(self, way_m: float) -> float:
        """The fastest from which the robot, as fast as it drives now, still stands after `way_m`; inf where that is inf."""
        return self.config.speed_within(way_m, max(self._speed(), abs(self.ramp.last.v)))

    def look_m(self) -> float:
        """So far ahead the footprint must be free: farther where the robot would not stop before."""
        return max(self.config.check_ahead_m, self.config.stopping_m(self._speed()))

    def _speed(self) -> float:
        return abs(self.speed) if math.isfinite(self.speed) else self.config.max_speed_mps
