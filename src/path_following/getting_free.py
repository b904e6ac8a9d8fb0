"""Out of where there is no room to turn, arc by arc: a recovery."""

import math
from dataclasses import dataclass, replace

from path_following.config import FollowerConfig
from path_following.manoeuvres import RECOVERY_LIMIT_S, Arc, Motion
from path_following.reference_path import Pose
from path_following.surroundings import Surroundings


@dataclass(eq=False)
class GettingFree:
    """Along the arcs of `Surroundings.way_to_room`, looked for anew where one ends, for none is driven exactly."""

    begun_s: float
    limit_s: float
    arc: Arc
    arc_s: float | None = None
    """When that arc began: a robot that does not come to its end does not come free."""

    def paused(self, seconds: float) -> "GettingFree":
        """The same after a time in which the robot might not drive."""
        arc_s = None if self.arc_s is None else self.arc_s + seconds
        return replace(self, begun_s=self.begun_s + seconds, arc_s=arc_s)

    def motion_from(self, config: FollowerConfig, around: Surroundings, pose: Pose) -> Motion | None:
        """The command at a pose; None where no way leads on."""
        if not self.arc.goes_on(around, pose):
            arcs = _arcs(config, around, pose)
            if not arcs or not arcs[0].goes_on(around, pose):
                return None
            self.arc, self.arc_s = arcs[0], None
        return self.arc.motion

    def is_done(self, _config: FollowerConfig, around: Surroundings, pose: Pose, stamp: float) -> bool:
        """True where the robot may turn, or when an arc or all of them took too long."""
        self.arc_s = stamp if self.arc_s is None else self.arc_s
        is_late = stamp - self.arc_s > RECOVERY_LIMIT_S or stamp - self.begun_s > self.limit_s
        return is_late or around.has_room(pose)


def getting_free(config: FollowerConfig, around: Surroundings, pose: Pose, stamp: float) -> GettingFree | None:
    """The way to where the robot may turn; None where it may turn already, or no way leads there."""
    arcs = [] if around.has_room(pose) else _arcs(config, around, pose)
    if not arcs or not arcs[0].goes_on(around, pose):
        return None
    limit_s = RECOVERY_LIMIT_S + 2.0 * sum(arc.length_m for arc in arcs) / config.back_off_speed_mps
    return GettingFree(stamp, limit_s, arcs[0])


def _arcs(config: FollowerConfig, around: Surroundings, pose: Pose) -> list[Arc]:
    """Each no longer than it takes half of `RECOVERY_LIMIT_S`."""
    v, way = config.back_off_speed_mps, around.way_to_room(pose)
    most_m = 0.5 * RECOVERY_LIMIT_S * v
    signed = [(math.copysign(v, metres), bend, abs(metres)) for metres, bend in way]
    return [Arc(Motion(speed, speed * bend), pose, min(length_m, most_m)) for speed, bend, length_m in signed]
