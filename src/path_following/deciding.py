"""Which state follows which, and the command meanwhile: the follower's decisions, from a moment and the state before."""

import math

import numpy as np

from path_following.doing import AwaitingGround, BackingOff, Doing, Ended, Following, MakingRoom, TurningToGoal, TurningToPath, Waiting
from path_following.getting_free import getting_free
from path_following.interface import FollowerState
from path_following.manoeuvres import Motion, detour, make_room, recovery, turn_by
from path_following.progress import PROGRESS_DISTANCE_M
from path_following.pursuit import Steering, lookahead_m, regulated_speed, steering_to, target_on
from path_following.reference_path import Stretch
from path_following.straight_driving import PASSAGE_LOOKAHEAD_M, StraightDrive, WayOut
from path_following.surroundings import Unknown, arc_poses
from path_following.task import AT_BEGIN_M, Moment
from rigid_geometry import angle_difference

STAND = Motion(0.0, 0.0)
_BEFORE_M = 1.0  # so far before a passage its beginning is steered for
_RUN_UP_M = 0.3  # where it begins there is room to turn, if not always to drift
_AT_ENTRY_M = 0.02  # a path that ends before a passage is driven on to where so little of it is left

Decided = tuple[Doing, Motion]
_PASSAGE_TURN_RAD = 0.3  # heading errors above this are turned away standing before a passage, where that is free
_PASSAGE_HEADING_RAD = 0.08  # and such a turn ends below this error
_TURN_IN_PLACE_UNTIL_RAD = 0.15  # a turn in place towards the path ends below this error


def decide(doing: Doing, now: Moment) -> Decided:
    """The next state and its command."""
    config, task = now.config, now.task
    if isinstance(doing, BackingOff):
        command = doing.motion(config, now.around, now.pose, now.stamp_s)
        return _end(doing.then, doing.reason) if command is None else (doing, now.ramp.to(command))
    if not isinstance(doing, TurningToGoal) and abs(now.at.off_path) > config.max_off_path_m:
        return _end(FollowerState.STUCK, f"{abs(now.at.off_path):.2f} m from the path")
    if task.is_stalled(config, now.stamp_s, now.pose[2], is_waiting=isinstance(doing, Waiting | AwaitingGround)):
        return _give_up(doing, now)
    return _turn_to_goal(doing, now) if _is_at_goal(doing, now) else _follow(doing, now)


def _is_at_goal(doing: Doing, now: Moment) -> bool:
    path, is_turning = now.task.path, isinstance(doing, TurningToGoal)
    distance = math.hypot(path.goal[0] - now.pose[0], path.goal[1] - now.pose[1])
    # Skid steering drifts while it turns: once there, a little more is still there.
    tolerance = now.config.goal_tolerance_m * now.task.tolerance_share * (2.0 if is_turning else 1.0)
    if path.length - now.at.s > max(tolerance, 0.05) or distance > tolerance:
        return False
    # The last metre is driven on until the end itself is beside the robot, not only near; before a passage to the very end.
    left, near = (_AT_ENTRY_M, 0.0) if path.ends_at_passage else (0.05, 0.5 * tolerance)
    return is_turning or path.length - now.at.s < left or distance < near


def _turn_to_goal(doing: Doing, now: Moment) -> Decided:
    error = 0.0 if now.task.goal_yaw is None else angle_difference(now.task.goal_yaw, now.pose[2])
    settled = now.config.goal_yaw_tolerance_rad * now.task.tolerance_share * (0.5 if isinstance(doing, TurningToGoal) else 1.0)
    if abs(error) <= settled:
        return _end(FollowerState.REACHED, "at the goal")
    angle = turn_by(error, doing.turning_side)
    if not now.around.is_free_turn(now.pose, angle, drifting=True):
        return _end(FollowerState.REACHED, f"at the goal; the turn of {error:.2f} rad to face it is not free")
    return TurningToGoal(f"{error:.2f} rad to turn", math.copysign(1.0, angle)), now.ramp.turning(angle)


def _follow(doing: Doing, now: Moment) -> Decided:
    path, s = now.task.path, now.at.s
    stretch = path.stretch_at(s, _BEFORE_M, now.task.farthest)
    if stretch is not None and now.task.is_in(stretch, s, now.pose):
        return _go_straight(doing, now, stretch)
    lookahead = lookahead_m(now.config, now.speed)
    if stretch is not None:  # to its beginning, without cutting the corner there
        lookahead = min(lookahead, max(stretch.begin - s, 1.5 * AT_BEGIN_M))
    steering = steering_to(now.pose, target_on(path, np.array(now.pose[:2]), s, lookahead))
    is_turning = isinstance(doing, TurningToPath)
    limit = _TURN_IN_PLACE_UNTIL_RAD if is_turning else now.config.turn_in_place_above_rad
    if abs(steering.heading_error) > limit:
        return _turn_to_path(doing, now, steering.heading_error)
    return _drive(doing, now, steering, (path.length if stretch is None else stretch.begin) - s)


def _go_straight(doing: Doing, now: Moment, stretch: Stretch) -> Decided:
    """Into the line of a passage where there is room to turn, and along it; to its end backward where the robot is turned away."""
    config, pose, s = now.config, now.pose, now.at.s
    way = 1.0 if abs(angle_difference(stretch.heading, pose[2])) <= math.pi / 2 else -1.0
    turn = _turn_into_line(doing, now, stretch, way)
    if turn is not None:
        return TurningToPath(f"{turn:.2f} rad to turn into the line of a passage", math.copysign(1.0, turn)), now.ramp.turning(turn)
    drive = StraightDrive(now.task.path, stretch, way)
    curvature = drive.free_curvature(config, now.around, pose, s)
    if curvature is None:
        return _wait(doing, now, "the passage ahead is not free", 0.0)
    on_known_ground = _speed_on_known_ground(doing, now) if way > 0.0 else math.inf
    if on_known_ground < config.min_speed_mps:
        return _await_ground(doing, now)
    speed = max(config.min_speed_mps, config.passage_speed_mps * (1.0 - min(1.0, 0.35 * abs(curvature))))
    speed = min(speed, on_known_ground)
    if _turns_after(now, stretch) or not drive.goes_on_free(now.around, config.stopping_m(speed)):
        speed = min(speed, max(config.min_speed_mps, config.speed_within(stretch.over - s, speed)))
    return Following("straight through a passage"), now.ramp.along(way * speed, curvature)


def _turns_after(now: Moment, stretch: Stretch) -> bool:
    """Whether the robot turns on the spot where a stretch ends."""
    beyond = now.task.path.heading_at(stretch.end + now.config.min_lookahead_m)
    return stretch.leads_to_corner or abs(angle_difference(beyond, stretch.heading)) > now.config.turn_in_place_above_rad


def _turn_into_line(doing: Doing, now: Moment, stretch: Stretch, way: float) -> float | None:
    """The turn on the spot into the line of a passage; None where none is due or free.

    With its nose ahead, where there is room; at a corner, where there may be little, with that end ahead that is nearer.
    """
    pose, s, around = now.pose, now.at.s, now.around
    error = steering_to(pose, stretch.point_at(s + PASSAGE_LOOKAHEAD_M)).heading_error
    is_at_begin = s < stretch.begin + _RUN_UP_M
    is_at_corner = stretch.from_corner and is_at_begin
    begins_inside = stretch.begin < AT_BEGIN_M  # with a path that begins in its line the robot may stand where it cannot turn
    limit = _PASSAGE_HEADING_RAD if isinstance(doing, TurningToPath) or is_at_corner else _PASSAGE_TURN_RAD
    errors = [error] if way > 0.0 or (is_at_begin and not begins_inside) else []
    if is_at_corner:
        errors = sorted([error, angle_difference(error, math.pi)], key=abs)
    if any(abs(e) <= limit for e in errors):
        return None
    for angle in (turn_by(e, doing.turning_side) for e in errors):
        if around.is_free_turn(pose, angle, drifting=True) or (is_at_begin and around.is_free_turn(pose, angle, drifting=False)):
            return angle
    return None


def _turn_to_path(doing: Doing, now: Moment, error: float) -> Decided:
    if isinstance(doing, MakingRoom) and doing.arc.goes_on(now.around, now.pose):
        return doing, now.ramp.to(doing.arc.motion)  # to its end: half the way would leave hardly room enough
    side = doing.turning_side
    angle = turn_by(error, side)
    options = [(drifting, far) for far in (False, True) for drifting in (True, False)]
    for drifting, far in options:  # where there is no room around the turn, room for the outline must do
        if not far and now.around.is_free_turn(now.pose, angle, drifting=drifting):
            return TurningToPath(f"{angle:.2f} rad to turn", math.copysign(1.0, angle)), now.ramp.turning(angle)
        arc = make_room(now.config, now.around, now.pose, error, drifting=drifting, far=far)
        if arc is not None:
            return MakingRoom("making room for a turn", side, arc), now.ramp.to(arc.motion)
    return _wait(doing, now, f"no free turn of {error:.2f} rad", side)


def _drive(doing: Doing, now: Moment, steering: Steering, remaining: float) -> Decided:
    config, pose, around = now.config, now.pose, now.around
    on_known_ground = _speed_on_known_ground(doing, now)
    if on_known_ground < config.min_speed_mps:
        return _await_ground(doing, now)
    ahead = min(now.look_m(), remaining + 0.05)
    if around.is_free(arc_poses(pose, 1.0, steering.curvature, ahead), Unknown.ALLOWED):
        speed = min(regulated_speed(config, steering, around.cost_under(pose), remaining), on_known_ground)
        return Following("on the path"), now.ramp.along(speed, steering.curvature)
    motion = detour(config, around, pose, now.task.path, now.at.s)
    if motion is None:
        return _wait(doing, now, "the way ahead is not free", 0.0)
    return Following("round an obstacle"), now.ramp.to(motion)


def _wait(doing: Doing, now: Moment, reason: str, side: float) -> Decided:
    waiting = Waiting(reason, side, doing.since_s if isinstance(doing, Waiting) else now.stamp_s)
    if now.stamp_s - waiting.since_s >= now.config.blocked_patience_s:
        return back_off(now, FollowerState.BLOCKED, reason)
    return waiting, STAND


def _speed_on_known_ground(doing: Doing, now: Moment) -> float:
    """The fastest at which the robot stops on the ground that is known; 0 while it waits and no more of it is known than before."""
    known_m = now.known_ahead_m
    least_m = doing.known_m if isinstance(doing, AwaitingGround) else None
    return 0.0 if least_m is not None and known_m < least_m + PROGRESS_DISTANCE_M else now.speed_within(known_m - now.config.known_ahead_m)


def _await_ground(doing: Doing, now: Moment) -> Decided:
    known_m = now.known_ahead_m
    since_s, least_m = (doing.since_s, doing.known_m) if isinstance(doing, AwaitingGround) else (now.stamp_s, None)
    reason = f"{known_m:.2f} m of known ground ahead"
    awaiting = AwaitingGround(reason, since_s, known_m if least_m is None else min(least_m, known_m))
    if now.stamp_s - awaiting.since_s >= now.config.ground_patience_s:
        return _end(FollowerState.BLOCKED, reason)
    return awaiting, now.ramp.to(STAND)


def _give_up(doing: Doing, now: Moment) -> Decided:
    if isinstance(doing, TurningToGoal):
        return _end(FollowerState.REACHED, "at the goal; the turn to face it got no further")
    reason = f"no progress for {now.config.progress_patience_s:.1f} s while {doing.state.value}"
    return back_off(now, FollowerState.STUCK, reason)


def back_off(now: Moment, then: FollowerState, reason: str) -> Decided:
    """A recovery that ends as `then`; ended at once where none is free, or the last one has not helped."""
    watch = now.task.watch
    if watch is not None and watch.has_recovered:  # on the path before this one
        return _end(then, reason)
    seen = now.config, now.around, now.pose, now.stamp_s
    motion = _way_out(now) or getting_free(*seen) or recovery(*seen)
    if motion is None:
        return _end(then, f"{reason}; nowhere to back off")
    if watch is not None:
        watch.has_recovered = True
    return BackingOff(reason, motion, then), STAND


def _way_out(now: Moment) -> WayOut | None:
    """Back to where the robot came into a passage, if it is in one nose first."""
    stretch = now.task.path.stretch_at(now.at.s, 0.0)
    if stretch is None or abs(angle_difference(stretch.heading, now.pose[2])) > math.pi / 4:
        return None
    way_out = WayOut(StraightDrive(now.task.path, stretch, -1.0), now.stamp_s)
    return way_out if way_out.motion_from(now.config, now.around, now.pose) else None


def _end(how: FollowerState, reason: str) -> Decided:
    return Ended(reason, how), STAND
