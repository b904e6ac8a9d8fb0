"""Where there is no room to turn: straight along the path, forward or backward, and out again the way it came."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from path_following.config import FollowerConfig
from path_following.manoeuvres import RECOVERY_LIMIT_S, Motion
from path_following.pursuit import steering_to
from path_following.reference_path import Pose, ReferencePath, Stretch
from path_following.surroundings import Surroundings, arc_poses

_SPACING_M = 0.05
_FARTHER = (1.0, 2.0, 4.0)  # times the distance of the point steered for: longer arcs, if the shorter is not free
_LEFT_M = 0.05  # a way out with so little left is over
PASSAGE_LOOKAHEAD_M = 0.30  # distance of the point steered for in a passage


@dataclass(frozen=True)
class StraightDrive:
    """A drive along a straight stretch: `way` is +1 forward on the path and on the robot's nose, -1 with the robot's rear ahead."""

    path: ReferencePath
    stretch: Stretch
    way: float

    def free_curvature(self, config: FollowerConfig, around: Surroundings, pose: Pose, s: float) -> float | None:
        """Curvature 1/m of the shortest free arc that leads to the line and on along it, or 0 for straight ahead; None if neither is free.

        Where it is narrow the corners of a robot beside the line may not swing out far: a long arc may be free that leads back slowly.
        """
        for farther in _FARTHER:
            lookahead = farther * PASSAGE_LOOKAHEAD_M
            to_line = _curvature(self.stretch.point_at(s + lookahead), pose, self.way)
            if around.is_clear(self._poses(pose, s, to_line, lookahead, self._look(config, s, lookahead))):
                return to_line
        return 0.0 if around.is_clear(arc_poses(pose, self.way, 0.0, self._look(config, s, PASSAGE_LOOKAHEAD_M))) else None

    def goes_on_free(self, around: Surroundings, beyond_m: float) -> bool:
        """Whether its line is free for so many metres beyond the end, too."""
        return around.is_clear(arc_poses((*self.stretch.point_at(self.stretch.end), self._yaw), self.way, 0.0, beyond_m))

    @property
    def _yaw(self) -> float:
        """Of the robot on the line, rad."""
        return self.stretch.heading + (0.0 if self.way > 0 else math.pi)

    def _look(self, config: FollowerConfig, s: float, lookahead: float) -> float:
        """How far ahead the way must be free: no farther than to its end, where the robot may turn."""
        return max(_LEFT_M, min(max(lookahead, config.passage_look_m), self.stretch.end - s))

    def _poses(self, pose: Pose, s: float, curvature: float, lookahead: float, look: float) -> NDArray[np.float64]:
        """(K, 3) poses along an arc and then along the line, `look` metres in all."""
        arc = arc_poses(pose, self.way, curvature, min(lookahead, look))
        left = np.arange(s + lookahead, s + look, _SPACING_M)
        return np.concatenate([arc, [(*self.stretch.point_at(at), self._yaw) for at in left]]) if left.size else arc


def _curvature(target: NDArray[np.float64], pose: Pose, way: float) -> float:
    """Of the arc from a pose through a target ahead or, with `way` -1, behind."""
    seen_from = pose if way > 0 else (pose[0], pose[1], pose[2] + math.pi)
    return way * steering_to(seen_from, target).curvature


@dataclass(frozen=True)
class WayOut:
    """Backward along a straight stretch to where it began; a recovery."""

    drive: StraightDrive
    begun_s: float

    def paused(self, seconds: float) -> "WayOut":
        """The same after a time in which the robot might not drive."""
        return replace(self, begun_s=self.begun_s + seconds)

    def motion_from(self, config: FollowerConfig, around: Surroundings, pose: Pose) -> Motion | None:
        """The command at a pose; None when the next part of the way does not stay off everything."""
        v = config.back_off_speed_mps
        for curvature in (_curvature(self.drive.stretch.point_at(self._s(pose) - PASSAGE_LOOKAHEAD_M), pose, -1.0), 0.0):
            if around.is_clear(arc_poses(pose, -1.0, curvature, PASSAGE_LOOKAHEAD_M)):
                return Motion(-v, -v * curvature)
        return None

    def is_done(self, config: FollowerConfig, _around: Surroundings, pose: Pose, stamp: float) -> bool:
        """True when it is out, or took too long."""
        stretch = self.drive.stretch
        limit = RECOVERY_LIMIT_S + 2.0 * (stretch.end - stretch.begin) / config.back_off_speed_mps
        return self._s(pose) < stretch.begin + _LEFT_M or stamp - self.begun_s > limit

    def _s(self, pose: Pose) -> float:
        stretch = self.drive.stretch
        return self.drive.path.project(np.array(pose[:2]), stretch.begin, stretch.end).s
