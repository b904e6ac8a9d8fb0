"""What else may be done when the straightforward motion is not free: make room, go round, back off."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from path_following.config import FollowerConfig
from path_following.reference_path import Pose, ReferencePath
from path_following.surroundings import Surroundings, Unknown, arc_poses
from rigid_geometry import angle_difference

_ARC_DONE_M = 0.02  # an arc with so little left is over
_NEAR = (0.1, 0.2, 0.3, 0.45), (0.0, 1.5, -1.5)  # lengths in metres and curvatures in 1/m of arcs that make room for a turn
_FAR = (0.45, 0.7, 1.0), (0.0, 0.5, -0.5)  # and of those beside a wall: only gentle ones get away from it
_RECOVERY_TURN_RAD = 0.6  # a recovery turns so far where driving back is not free
RECOVERY_LIMIT_S = 6.0  # a recovery ends after this time at the latest


@dataclass(frozen=True)
class Motion:
    """A command: `v` m/s, `w` rad/s."""

    v: float
    w: float


def turn_by(error: float, side: float) -> float:
    """The turn in radians that takes away a heading error: the short way, but what lies nearly behind is turned to by `side`.

    `side` is +1, -1 or 0 for none yet; without it noise swaps sides for ever. Round the long way there is never room where the
    short way has none: the corners of the outline then sweep the whole circle.
    """
    return error - math.copysign(2 * math.pi, error) if abs(error) > 2.0 and side * error < 0 else error


@dataclass(frozen=True)
class Arc:
    """A motion that ends after `length_m`, begun at a pose."""

    motion: Motion
    begun_at: Pose
    length_m: float

    def goes_on(self, around: Surroundings, pose: Pose) -> bool:
        """True while some of it is left, and free."""
        left = self.length_m - math.hypot(pose[0] - self.begun_at[0], pose[1] - self.begun_at[1])
        if left < _ARC_DONE_M:
            return False
        poses = arc_poses(pose, math.copysign(1.0, self.motion.v), self.motion.w / self.motion.v, left)
        return around.is_free(poses, Unknown.NOT_UNDER_THE_FOOTPRINT)


def make_room(config: FollowerConfig, around: Surroundings, pose: Pose, error: float, *, drifting: bool, far: bool = False) -> Arc | None:
    """The shortest free arc, forward or backward, after which a heading error of now `error` can be turned away; None if none.

    `drifting`: with room around the turn for more than the robot slides. `far`: longer, gentler arcs, where no short one will do.
    """
    lengths, curvatures = _FAR if far else _NEAR
    for length in lengths:
        for curvature in curvatures:
            for sign in (1.0, -1.0):
                poses = arc_poses(pose, sign, curvature, length)
                x, y, yaw = around.slide.along(poses)[-1]
                end = (float(x), float(y), float(yaw))
                left = angle_difference(pose[2] + error, end[2])
                if around.is_free(poses, Unknown.NOT_UNDER_THE_FOOTPRINT) and around.is_free_turn(end, left, drifting=drifting):
                    return Arc(Motion(sign * config.back_off_speed_mps, sign * config.back_off_speed_mps * curvature), pose, length)
    return None


def detour(config: FollowerConfig, around: Surroundings, pose: Pose, path: ReferencePath, s: float) -> Motion | None:
    """The best free arc that gets on along the path without leaving it far; None when there is none."""
    best: tuple[float, Motion] | None = None
    for motion, poses in _arcs(config, pose):
        cost = _detour_cost(config, around, poses, path, s)
        if cost is not None and (best is None or cost < best[0]):
            best = (cost, motion)
    return best[1] if best else None


def _arcs(config: FollowerConfig, pose: Pose) -> Iterator[tuple[Motion, NDArray[np.float64]]]:
    v = config.detour_speed_mps
    # Straight ahead first, then by growing curvature: of equals the gentlest wins.
    for bend in range(9):
        for side in (1.0, -1.0) if bend else (1.0,):
            curvature = side * bend * 0.3
            yield Motion(v, v * curvature), arc_poses(pose, 1.0, curvature, config.check_ahead_m)


def _detour_cost(config: FollowerConfig, around: Surroundings, poses: NDArray[np.float64], path: ReferencePath, s: float) -> float | None:
    end = poses[-1]
    at = path.project(end[:2], s, s + 1.5 * config.check_ahead_m)
    gained = min(at.s, path.length) - s
    if gained < 0.25 * config.check_ahead_m or abs(at.off_path) > config.max_detour_m:
        return None
    if not around.is_free(poses, Unknown.NOT_UNDER_THE_FOOTPRINT):
        return None
    askew = abs(angle_difference(float(end[2]), path.heading_at(at.s)))
    return abs(at.off_path) - gained + 0.3 * askew + 0.5 * around.mean_cost(poses)


@dataclass(frozen=True)
class Recovery:
    """A motion of its own that ends after `distance_m` or `angle_rad`, begun at a pose and stamp."""

    motion: Motion
    begun_at: Pose
    begun_s: float
    distance_m: float
    angle_rad: float

    def is_done(self, _config: FollowerConfig, _around: Surroundings, pose: Pose, stamp: float) -> bool:
        """True when it went far enough, or for too long."""
        moved = math.hypot(pose[0] - self.begun_at[0], pose[1] - self.begun_at[1])
        turned = abs(angle_difference(pose[2], self.begun_at[2]))
        far = moved >= self.distance_m if self.motion.v else turned >= self.angle_rad
        return far or stamp - self.begun_s > RECOVERY_LIMIT_S

    def paused(self, seconds: float) -> "Recovery":
        """The same after a time in which the robot might not drive."""
        return replace(self, begun_s=self.begun_s + seconds)

    def motion_from(self, _config: FollowerConfig, around: Surroundings, pose: Pose) -> Motion | None:
        """The command at a pose; None when the next part is not free."""
        return self.motion if self.is_free(around, pose) else None

    def is_free(self, around: Surroundings, pose: Pose) -> bool:
        """True when the next part of the motion stays off everything that is not known to be free."""
        if self.motion.v:
            done = math.hypot(pose[0] - self.begun_at[0], pose[1] - self.begun_at[1])
            left = max(0.05, min(0.3, self.distance_m - done))
            return around.is_free(arc_poses(pose, -1.0, 0.0, left), Unknown.NOT_UNDER_THE_FOOTPRINT)
        left = math.copysign(max(0.1, self.angle_rad - abs(angle_difference(pose[2], self.begun_at[2]))), self.motion.w)
        return around.is_free_turn(pose, left, drifting=False)


def recovery(config: FollowerConfig, around: Surroundings, pose: Pose, stamp: float) -> Recovery | None:
    """Straight back if that is free, else a turn to the side that is; None when nothing is."""
    for motion in (Motion(-config.back_off_speed_mps, 0.0), Motion(0.0, 0.4), Motion(0.0, -0.4)):
        option = Recovery(motion, pose, stamp, config.back_off_distance_m, _RECOVERY_TURN_RAD)
        if option.is_free(around, pose):
            return option
    return None
