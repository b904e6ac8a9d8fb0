"""Out of where there is no room to turn, arc by arc: a recovery."""

import math
from dataclasses import dataclass

from path_following.config import FollowerConfig
from path_following.manoeuvres import Arc, Motion
from path_following.reference_path import Pose
from path_following.surroundings import Surroundings


@dataclass(eq=False)
class GettingFree:
    """Along the arcs of `Surroundings.way_to_room`, looked for anew where one ends, for none is driven exactly."""

    begun_s: float
    limit_s: float
    arc: Arc

    def motion_from(self, config: FollowerConfig, around: Surroundings, pose: Pose) -> Motion | None:
        """The command at a pose; None where no way leads on."""
        if not self.arc.goes_on(around, pose):
            arcs = _arcs(config, around, pose)
            if not arcs or not arcs[0].goes_on(around, pose):
                return None
            self.arc = arcs[0]
        return self.arc.motion

    def is_done(self, _config: FollowerConfig, around: Surroundings, pose: Pose, stamp: float) -> bool:
        """True where the robot may turn, or when it took too long."""
        return around.has_room(pose) or stamp - self.begun_s > self.limit_s


def getting_free(config: FollowerConfig, around: Surroundings, pose: Pose, stamp: float) -> GettingFree | None:
    """The way to where the robot may turn; None where it may turn already, or no way leads there."""
    arcs = [] if around.has_room(pose) else _arcs(config, around, pose)
    if not arcs or not arcs[0].goes_on(around, pose):
        return None
    limit_s = config.recovery_limit_s + 2.0 * sum(arc.length_m for arc in arcs) / config.back_off_speed_mps
    return GettingFree(stamp, limit_s, arcs[0])


def _arcs(config: FollowerConfig, around: Surroundings, pose: Pose) -> list[Arc]:
    v = config.back_off_speed_mps
    way = around.way_to_room(pose)
    return [Arc(Motion(math.copysign(v, metres), math.copysign(v, metres) * bend), pose, abs(metres)) for metres, bend in way]
