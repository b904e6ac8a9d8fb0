"""Parameters of the path follower and the only home of their defaults."""

import math
from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class FollowerConfig:
    """Limits, tolerances and patience of the path follower."""

    max_speed_mps: float = parameter(
        0.5, "m/s", "fastest forward speed, or the robot's own where that is less", low=0.05, high=2.0, at_runtime=True
    )
    min_speed_mps: float = parameter(0.08, "m/s", "slowest speed commanded while on the way", low=0.01, high=0.5)
    max_turn_rate_radps: float = parameter(0.9, "rad/s", "fastest turn, or the robot's own", low=0.1, high=3.0, at_runtime=True)
    min_turn_rate_radps: float = parameter(0.25, "rad/s", "slowest turn in place that still moves a skid-steered robot", low=0.0, high=1.0)
    max_acceleration_mps2: float = parameter(0.8, "m/s^2", "how fast the speed may grow", low=0.05, high=10.0, at_runtime=True)
    max_deceleration_mps2: float = parameter(1.5, "m/s^2", "how fast the speed may fall; a blocked way stops at once", low=0.05, high=10.0)
    max_turn_acceleration_radps2: float = parameter(3.0, "rad/s^2", "how fast the turn rate may change", low=0.1, high=20.0)
    min_lookahead_m: float = parameter(0.35, "m", "distance of the point steered for, when slow", low=0.1, high=3.0, at_runtime=True)
    max_lookahead_m: float = parameter(
        0.50, "m", "the same at full speed; longer is smoother and cuts corners more", low=0.1, high=3.0, at_runtime=True
    )
    turn_in_place_above_rad: float = parameter(
        0.87, "rad", "heading errors above this are turned away standing", low=0.2, high=3.2, at_runtime=True
    )
    slowest_share_near_obstacles: float = parameter(
        0.4, "-", "share of the speed left where the cost is 252", low=0.05, high=1.0, at_runtime=True
    )
    max_input_age_s: float = parameter(
        0.3, "s", "the robot stands when its scan or map->odom is older than this; a lidar of 5 Hz needs more", low=0.05, high=5.0
    )
    goal_tolerance_m: float = parameter(0.15, "m", "the goal is reached within this distance", low=0.02, high=1.0, at_runtime=True)
    goal_yaw_tolerance_rad: float = parameter(0.2, "rad", "and this heading, when one is asked for", low=0.02, high=3.2, at_runtime=True)
    max_off_path_m: float = parameter(1.0, "m", "farther than this from the path the follower gives up", low=0.2, high=10.0)
    turn_margin_m: float = parameter(
        0.08,
        "m",
        "room wanted around the robot for a turn in place: skidding wheels drift; where there is none it turns all the same",
        low=0.0,
        high=0.5,
    )
    turn_slide_factor: float = parameter(
        1.2, "-", "room wanted for what the robot slides aside in a turn on a slope, over what it slides on the average", low=0.0, high=5.0
    )
    check_ahead_m: float = parameter(0.6, "m", "so far ahead the footprint must be free along the arc", low=0.1, high=3.0, at_runtime=True)
    max_detour_m: float = parameter(
        0.4, "m", "an arc round an obstacle may end this far beside the path", low=0.0, high=3.0, at_runtime=True
    )
    detour_speed_mps: float = parameter(
        0.2, "m/s", "speed of such an arc, and of making room for a turn", low=0.02, high=1.0, at_runtime=True
    )
    passage_speed_mps: float = parameter(
        0.25, "m/s", "fastest speed where the path leads straight through a passage", low=0.05, high=2.0, at_runtime=True
    )
    passage_look_m: float = parameter(1.2, "m", "so far ahead the footprint must be free in a passage", low=0.1, high=3.0)
    known_ahead_m: float = parameter(
        0.0,
        "m",
        "so much known ground must lie ahead on the path: the robot drives no faster than it can stop there, and stands where "
        "less is known; 0: plans end before unknown ground, and nothing is asked",
        low=0.0,
        high=5.0,
    )
    reaction_s: float = parameter(
        0.4, "s", "until the robot brakes for what is new: how old the map is when it is used, and what commands take", low=0.0, high=5.0
    )
    ground_patience_s: float = parameter(
        4.0, "s", "wait this long for ground ahead to become known: half a nod of the mount, and the time to map it", low=0.0, high=60.0
    )
    blocked_patience_s: float = parameter(2.0, "s", "wait this long for a blocked way to become free", low=0.0, high=60.0, at_runtime=True)
    progress_patience_s: float = parameter(6.0, "s", "no progress for this long starts a recovery", low=0.5, high=120.0, at_runtime=True)
    back_off_distance_m: float = parameter(0.4, "m", "a recovery drives back so far, if that is free", low=0.05, high=2.0)
    back_off_speed_mps: float = parameter(0.15, "m/s", "speed of a recovery", low=0.02, high=1.0)

    def stopping_m(self, speed_mps: float) -> float:
        """How far the robot goes from a speed until it stands: reaction_s, then max_deceleration_mps2."""
        return speed_mps * self.reaction_s + speed_mps**2 / (2.0 * self.max_deceleration_mps2)

    def speed_within(self, way_m: float, speed_mps: float) -> float:
        """The speed from which the robot stands after `way_m`, as `stopping_m` has it, if it now drives at `speed_mps`.

        It goes on at that for `reaction_s`: of the way that is left then the brakes have all.
        """
        a, t = self.max_deceleration_mps2, self.reaction_s
        return min(_lasting(way_m, a, t), math.sqrt(2.0 * a * max(way_m - speed_mps * t, 0.0)))

    def turn_rate_within(self, angle_rad: float) -> float:
        """The turn rate from which the robot stands after `angle_rad`, by reaction_s and max_turn_acceleration_radps2; its limits kept."""
        lasting = _lasting(abs(angle_rad), self.max_turn_acceleration_radps2, self.reaction_s)
        return min(max(lasting, self.min_turn_rate_radps), self.max_turn_rate_radps)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        problems = check_ranges(self)
        for low, high in (
            ("min_speed_mps", "max_speed_mps"),
            ("min_turn_rate_radps", "max_turn_rate_radps"),
            ("min_lookahead_m", "max_lookahead_m"),
        ):
            if getattr(self, low) > getattr(self, high):
                problems.append(f"{low} = {getattr(self, low)} is above {high} = {getattr(self, high)}")
        return problems


def _lasting(way: float, a: float, reaction_s: float) -> float:
    """What is stopped from within `way`: reaction_s at that, then the deceleration `a`."""
    return a * (math.sqrt(reaction_s**2 + 2.0 * max(way, 0.0) / a) - reaction_s)
