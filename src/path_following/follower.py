"""The follower itself: a state machine that answers every observation with one command."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from path_following.config import FollowerConfig
from path_following.interface import FollowerObservation, FollowerOutput, FollowerState
from path_following.manoeuvres import Arc, Motion, Recovery, detour, make_room, recovery, turn_by
from path_following.progress import ProgressWatch
from path_following.pursuit import Steering, approached, lookahead_m, regulated_speed, steering_to, target_on
from path_following.reference_path import Pose, Projection, ReferencePath, Stretch
from path_following.straight_driving import StraightDrive, WayOut
from path_following.surroundings import Slide, Surroundings, Unknown, arc_poses, footprint_lattice
from path_following.trail import Trail
from rigid_geometry import angle_difference, yaw_of
from robot_body import RobotBody

_STAND = Motion(0.0, 0.0)
_BEFORE_M = 1.0  # so far before a passage its beginning is steered for
_RUN_UP_M = 0.3  # where it begins there is room to turn, if not always to drift
_AT_BEGIN_M = 0.08  # and so near to it the robot is there
_AT_ENTRY_M = 0.02  # a path that ends before a passage is driven on to where so little of it is left


class PathFollower:
    """Follows one path at a time (thesis 5.5.2): `set_path`, then `step` with every observation until the state `is_over`."""

    def __init__(self, config: FollowerConfig, robot: RobotBody) -> None:
        """An idle follower; ValueError lists what is wrong with `config`, its speeds cut to what the robot can."""
        config = replace(
            config,
            max_speed_mps=min(config.max_speed_mps, robot.max_speed_mps),
            max_turn_rate_radps=min(config.max_turn_rate_radps, robot.max_turn_rate_radps),
        )
        problems = config.validate()
        if problems:
            raise ValueError("; ".join(problems))
        self._config, self._slide_m = config, config.turn_slide_factor * robot.turning_slide_m
        length, width, more = robot.length_m, robot.width_m, 2 * config.turn_margin_m
        self._footprints = footprint_lattice(length, width, 0.05), footprint_lattice(length + more, width + more, 0.05)
        self._trail = Trail()
        self.clear("no path yet")

    @property
    def state(self) -> FollowerState:
        """What the follower does now."""
        return self._state

    def clear(self, reason: str) -> None:
        """Forget the path and stand; `reason` is told at every step."""
        self._path: ReferencePath | None = None
        self._goal_yaw: float | None = None
        self._begin(FollowerState.IDLE, reason)

    def set_path(self, points: ArrayLike, goal_yaw: float | None, straight: Sequence[bool] = ()) -> None:
        """Follow (K, 3) points in map, metres, and face `goal_yaw` radians at the end unless it is None; ValueError if not finite.

        `straight` (K,) or empty: whether from a point to the next the path leads through a passage in which the robot cannot turn.
        """
        if goal_yaw is not None and not math.isfinite(goal_yaw):
            raise ValueError(f"goal_yaw is a finite heading or None, not {goal_yaw!r}")
        self._path = ReferencePath(points, self._config.smoothing_m, straight)
        self._goal_yaw = goal_yaw
        self._begin(FollowerState.FOLLOWING, "new path")

    def _begin(self, state: FollowerState, reason: str) -> None:
        self._state, self._reason = state, reason
        self._s = 0.0
        self._off_path: float | None = None
        self._stamp: float | None = None
        self._command = _STAND
        self._speed = 0.0
        self._turn_side = 0.0
        self._watch: ProgressWatch | None = None
        self._blocked_since: float | None = None
        self._recovery: Recovery | WayOut | None = None
        self._room: Arc | None = None
        self._entered: Stretch | None = None
        self._after_recovery = (FollowerState.STUCK, "")
        self._has_stood = True

    def step(self, observation: FollowerObservation) -> FollowerOutput:
        """The command for this moment; zero, with the reason, whenever something that it needs is not known."""
        dt = self._elapsed(observation.stamp_s)
        if self._state.is_over or self._path is None:
            return self._output(_STAND, self._reason)
        missing = self._missing(observation)
        if missing or observation.held:
            self._sit_out(dt)
            self._has_stood = True
            return self._output(_STAND, missing or ("held" if observation.held else self._reason))
        assert observation.T_map_base is not None and observation.costmap is not None
        T = observation.T_map_base
        pose = (float(T[0, 3]), float(T[1, 3]), yaw_of(T))
        slide = Slide((float(T[0, 2]), float(T[1, 2])), self._slide_m)
        if self._has_stood:  # for a sweep, perhaps, that corrected the map
            self._trail.carry_to(pose)
        self._has_stood = False
        self._trail.add(pose)
        around = Surroundings(observation.costmap, *self._footprints, slide, self._trail)
        if not around.contains(pose):
            self._sit_out(dt)
            return self._output(_STAND, f"the costmap does not contain the robot at ({pose[0]:.2f}, {pose[1]:.2f})")
        self._speed = self._command.v if observation.twist is None else observation.twist[0]
        self._command = self._decide(self._path, pose, around, dt)
        return self._output(self._command, self._reason)

    def _elapsed(self, stamp: float) -> float:
        """Seconds since the last step; 0, and no time without progress, at the first one and where time jumped."""
        if not math.isfinite(stamp):
            raise ValueError(f"stamp_s is a finite time, not {stamp!r}")
        last, self._stamp = self._stamp, stamp
        if last is None:
            return 0.0
        dt = stamp - last
        if 0.0 <= dt <= self._config.max_gap_s:
            return dt
        self._sit_out(dt)
        return 0.0

    def _missing(self, observation: FollowerObservation) -> str:
        if observation.T_map_base is None:
            return "no pose"
        if not np.isfinite(observation.T_map_base).all():
            return "the pose is not finite"
        return "no costmap" if observation.costmap is None else ""

    def _sit_out(self, seconds: float) -> None:
        self._command = _STAND
        if self._watch:
            self._watch.pause(seconds)
        if self._blocked_since is not None:
            self._blocked_since += seconds

    def _output(self, motion: Motion, reason: str) -> FollowerOutput:
        remaining = None if self._path is None or self._off_path is None else self._path.length - self._s
        return FollowerOutput(motion.v, motion.w, self._state, reason, self._off_path, remaining)

    def _decide(self, path: ReferencePath, pose: Pose, around: Surroundings, dt: float) -> Motion:
        at = self._locate(path, pose)
        if self._recovery is not None:
            return self._recover(self._recovery, pose, around, dt)
        if self._state is not FollowerState.TURNING_TO_GOAL and abs(at.off_path) > self._config.max_off_path_m:
            return self._end(FollowerState.STUCK, f"{abs(at.off_path):.2f} m from the path")
        if self._is_stalled(pose):
            return self._give_up(pose, around)
        if self._is_at_goal(path, pose):
            return self._turn_to_goal(pose, around, dt)
        return self._follow(path, at, pose, around, dt)

    def _locate(self, path: ReferencePath, pose: Pose) -> Projection:
        # Near the last place only: the path may pass over or under itself.
        at = path.project(np.array(pose[:2]), self._s - 0.5, self._s + 1.0)
        self._s, self._off_path = at.s, at.off_path
        return at

    def _is_stalled(self, pose: Pose) -> bool:
        assert self._stamp is not None
        if self._watch is None:
            self._watch = ProgressWatch(self._config, self._stamp, self._s, pose[2])
        return self._state is not FollowerState.WAITING and self._watch.is_stalled(self._stamp, self._s, pose[2])

    def _is_at_goal(self, path: ReferencePath, pose: Pose) -> bool:
        distance = math.hypot(path.goal[0] - pose[0], path.goal[1] - pose[1])
        # Skid steering drifts while it turns: once there, a little more is still there.
        tolerance = self._config.goal_tolerance_m * (2.0 if self._state is FollowerState.TURNING_TO_GOAL else 1.0)
        if path.length - self._s > max(tolerance, 0.05) or distance > tolerance:
            return False
        # The last metre is driven on until the end itself is beside the robot, not only near; before a passage to the very end.
        left, near = (_AT_ENTRY_M, 0.0) if path.ends_at_passage else (0.05, 0.5 * tolerance)
        return self._state is FollowerState.TURNING_TO_GOAL or path.length - self._s < left or distance < near

    def _turn_to_goal(self, pose: Pose, around: Surroundings, dt: float) -> Motion:
        error = 0.0 if self._goal_yaw is None else angle_difference(self._goal_yaw, pose[2])
        settled = self._config.goal_yaw_tolerance_rad * (0.5 if self._state is FollowerState.TURNING_TO_GOAL else 1.0)
        if abs(error) <= settled:
            return self._end(FollowerState.REACHED, "at the goal")
        angle = turn_by(error, self._turn_side)
        if not around.is_free_turn(pose, angle, drifting=True):
            return self._end(FollowerState.REACHED, f"at the goal; the turn of {error:.2f} rad to face it is not free")
        self._be(FollowerState.TURNING_TO_GOAL, f"{error:.2f} rad to turn")
        return self._turn(angle, dt)

    def _follow(self, path: ReferencePath, at: Projection, pose: Pose, around: Surroundings, dt: float) -> Motion:
        stretch = path.stretch_at(at.s, _BEFORE_M)
        if stretch is not None and self._is_in(stretch, at.s, pose):
            return self._go_straight(path, stretch, at, pose, around, dt)
        lookahead = lookahead_m(self._config, self._speed)
        if stretch is not None:  # to its beginning, without cutting the corner there
            lookahead = min(lookahead, max(stretch.begin - at.s, 1.5 * _AT_BEGIN_M))
        steering = steering_to(pose, target_on(path, np.array(pose[:2]), at.s, lookahead))
        turning = self._state is FollowerState.TURNING_TO_PATH
        limit = self._config.turn_in_place_until_rad if turning else self._config.turn_in_place_above_rad
        if abs(steering.heading_error) > limit:
            return self._turn_to_path(pose, steering.heading_error, around, dt)
        self._turn_side, self._room = 0.0, None
        return self._drive(path, at, pose, steering, around, dt)

    def _is_in(self, stretch: Stretch, s: float, pose: Pose) -> bool:
        """Whether the robot is where the stretch begins, or was: a turn there may take it a little back."""
        at_begin = s >= stretch.begin or math.dist(stretch.begin_xy, pose[:2]) < _AT_BEGIN_M
        self._entered = stretch if at_begin else self._entered
        return self._entered is stretch

    def _go_straight(self, path: ReferencePath, stretch: Stretch, at: Projection, pose: Pose, around: Surroundings, dt: float) -> Motion:
        """Into the line of a passage where there is room to turn, and along it; to its end backward where the robot is turned away."""
        self._room = None
        way = 1.0 if abs(angle_difference(stretch.heading, pose[2])) <= math.pi / 2 else -1.0
        drive = StraightDrive(path, stretch, way)
        error = steering_to(pose, stretch.point_at(at.s + self._config.passage_lookahead_m)).heading_error
        is_turning = self._state is FollowerState.TURNING_TO_PATH
        is_at_begin = at.s < stretch.begin + _RUN_UP_M
        is_turned_off = abs(error) > (self._config.passage_heading_rad if is_turning else self._config.passage_turn_rad)
        begins_inside = stretch.begin < _AT_BEGIN_M  # with a path that begins in its line the robot may stand where it cannot turn
        if is_turned_off and (way > 0.0 or (is_at_begin and not begins_inside)):
            angle = turn_by(error, self._turn_side)
            if around.is_free_turn(pose, angle, drifting=True) or (is_at_begin and around.is_free_turn(pose, angle, drifting=False)):
                self._be(FollowerState.TURNING_TO_PATH, f"{angle:.2f} rad to turn into the line of a passage")
                return self._turn(angle, dt)
        self._turn_side = 0.0
        curvature = drive.free_curvature(self._config, around, pose, at.s)
        if curvature is None:
            return self._wait(pose, around, "the passage ahead is not free")
        self._be(FollowerState.FOLLOWING, "straight through a passage")
        speed = max(self._config.min_speed_mps, self._config.passage_speed_mps * (1.0 - min(1.0, 0.35 * abs(curvature))))
        return self._ramped_along(drive.way * speed, curvature, dt)

    def _turn_to_path(self, pose: Pose, error: float, around: Surroundings, dt: float) -> Motion:
        if self._room is not None and self._room.goes_on(around, pose):
            return self._ramped(self._room.motion, dt)  # to its end: half the way would leave hardly room enough
        angle, self._room = turn_by(error, self._turn_side), None
        options = [(drifting, far) for far in (False, True) for drifting in (True, False)]
        for drifting, far in options:  # where there is no room around the turn, room for the outline must do
            if not far and around.is_free_turn(pose, angle, drifting=drifting):
                self._be(FollowerState.TURNING_TO_PATH, f"{angle:.2f} rad to turn")
                return self._turn(angle, dt)
            self._room = make_room(self._config, around, pose, error, drifting=drifting, far=far)
            if self._room is not None:
                self._be(FollowerState.FOLLOWING, "making room for a turn")
                return self._ramped(self._room.motion, dt)
        return self._wait(pose, around, f"no free turn of {error:.2f} rad")

    def _turn(self, angle: float, dt: float) -> Motion:
        self._turn_side = math.copysign(1.0, angle)
        rate = min(max(1.5 * abs(angle), self._config.min_turn_rate_radps), self._config.max_turn_rate_radps)
        return self._ramped(Motion(0.0, math.copysign(rate, angle)), dt)

    def _drive(self, path: ReferencePath, at: Projection, pose: Pose, steering: Steering, around: Surroundings, dt: float) -> Motion:
        stretch = path.stretch_at(at.s, _BEFORE_M)
        remaining = (path.length if stretch is None else stretch.begin) - at.s
        ahead = min(self._config.check_ahead_m, remaining + 0.05)
        if around.is_free(arc_poses(pose, 1.0, steering.curvature, ahead), Unknown.ALLOWED):
            self._be(FollowerState.FOLLOWING, "on the path")
            speed = regulated_speed(self._config, steering, around.cost_under(pose), remaining)
            return self._ramped_along(speed, steering.curvature, dt)
        motion = detour(self._config, around, pose, path, at.s)
        if motion is None:
            return self._wait(pose, around, "the way ahead is not free")
        self._be(FollowerState.FOLLOWING, "round an obstacle")
        return self._ramped(motion, dt)

    def _be(self, state: FollowerState, reason: str) -> None:
        self._state, self._reason = state, reason
        self._blocked_since = None

    def _ramped(self, wanted: Motion, dt: float) -> Motion:
        config = self._config
        v = approached(self._command.v, wanted.v, config.max_acceleration_mps2 * dt, config.max_deceleration_mps2 * dt)
        turn_change = config.max_turn_acceleration_radps2 * dt
        w = approached(self._command.w, wanted.w, turn_change, turn_change)
        return Motion(v, max(-config.max_turn_rate_radps, min(config.max_turn_rate_radps, w)))

    def _ramped_along(self, speed: float, curvature: float, dt: float) -> Motion:
        # The turn rate follows the speed that is possible now, so that the robot starts on the arc that was checked.
        v = self._ramped(Motion(speed, 0.0), dt).v
        return self._ramped(Motion(speed, v * curvature), dt)

    def _wait(self, pose: Pose, around: Surroundings, reason: str) -> Motion:
        assert self._stamp is not None
        if self._blocked_since is None:
            self._blocked_since = self._stamp
        self._state, self._reason = FollowerState.WAITING, reason
        if self._stamp - self._blocked_since >= self._config.blocked_patience_s:
            return self._start_recovery(FollowerState.BLOCKED, reason, pose, around)
        return _STAND

    def _give_up(self, pose: Pose, around: Surroundings) -> Motion:
        if self._state is FollowerState.TURNING_TO_GOAL:
            return self._end(FollowerState.REACHED, "at the goal; the turn to face it got no further")
        reason = f"no progress for {self._config.progress_patience_s:.1f} s while {self._state.value}"
        return self._start_recovery(FollowerState.STUCK, reason, pose, around)

    def _start_recovery(self, then: FollowerState, reason: str, pose: Pose, around: Surroundings) -> Motion:
        assert self._stamp is not None
        self._after_recovery = (then, reason)
        self._recovery = self._way_out(around, pose, self._stamp) or recovery(self._config, around, pose, self._stamp)
        if self._recovery is None:
            return self._end(then, f"{reason}; nowhere to back off")
        self._state, self._reason = FollowerState.BACKING_OFF, reason
        return _STAND

    def _way_out(self, around: Surroundings, pose: Pose, stamp: float) -> WayOut | None:
        """Back to where the robot came into a passage, if it is in one nose first."""
        stretch = None if self._path is None else self._path.stretch_at(self._s, 0.0)
        if self._path is None or stretch is None or abs(angle_difference(stretch.heading, pose[2])) > math.pi / 4:
            return None
        way_out = WayOut(StraightDrive(self._path, stretch, -1.0), stamp)
        return way_out if way_out.motion_from(self._config, around, pose) else None

    def _recover(self, motion: Recovery | WayOut, pose: Pose, around: Surroundings, dt: float) -> Motion:
        assert self._stamp is not None
        command = motion.motion_from(self._config, around, pose)
        if command is None or motion.is_done(self._config, pose, self._stamp):
            return self._end(*self._after_recovery)
        return self._ramped(command, dt)

    def _end(self, state: FollowerState, reason: str) -> Motion:
        self._state, self._reason, self._recovery = state, reason, None
        return _STAND
