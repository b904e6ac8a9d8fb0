"""Regulated pure pursuit: which curvature leads to the path ahead, and how fast to drive it."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from path_following.config import FollowerConfig
from path_following.reference_path import Pose, ReferencePath
from rigid_geometry import angle_difference

_SLOW_BELOW_RADIUS_M = 0.9  # curves tighter than this are driven slower in proportion


@dataclass(frozen=True)
class Steering:
    """The point steered for: heading error to it in radians, curvature 1/m of the arc that passes through it."""

    heading_error: float
    curvature: float


def lookahead_m(config: FollowerConfig, speed: float) -> float:
    """Distance of the point steered for, growing with the speed from its least to its largest value."""
    share = min(1.0, abs(speed) / config.max_speed_mps) if math.isfinite(speed) else 0.0
    return config.min_lookahead_m + share * (config.max_lookahead_m - config.min_lookahead_m)


def target_on(path: ReferencePath, xy: NDArray[np.float64], s: float, distance: float) -> NDArray[np.float64]:
    """(2,) the first point of the path after arc length `s` that is `distance` metres away.

    Near the end the path is thought to go on straight, so that the robot does not swing at its goal; past the end it is the goal.
    """
    if s >= path.length - 0.02:
        return path.goal
    along = s + np.arange(0.05, distance + 0.05, 0.05)
    points = path.points_at(along)
    far = np.nonzero(np.linalg.norm(points - xy, axis=1) >= distance)[0]
    target: NDArray[np.float64] = points[far[0] if far.size else -1]
    return target


def steering_to(pose: Pose, target: NDArray[np.float64]) -> Steering:
    """Heading error and curvature 2 sin(error) / distance of the arc tangent to the robot's heading through `target`."""
    dx, dy = target[0] - pose[0], target[1] - pose[1]
    distance = math.hypot(dx, dy)
    if distance < 1e-6:
        return Steering(0.0, 0.0)
    error = angle_difference(math.atan2(dy, dx), pose[2])
    return Steering(error, 2.0 * math.sin(error) / max(distance, 0.2))


def regulated_speed(config: FollowerConfig, steering: Steering, cost: int, remaining: float) -> float:
    """Speed in m/s: slower in tight curves, off heading, where the cost under the centre is high, and towards the goal."""
    speed = config.max_speed_mps
    bend = abs(steering.curvature)
    if bend * _SLOW_BELOW_RADIUS_M > 1.0:
        speed /= bend * _SLOW_BELOW_RADIUS_M
    speed *= max(0.3, math.cos(min(abs(steering.heading_error), math.pi / 2)))
    if cost < 255:
        speed *= 1.0 - (1.0 - config.slowest_share_near_obstacles) * min(1.0, cost / 252)
    speed = min(speed, 0.8 * remaining + 0.05)
    if bend > 0:
        speed = min(speed, config.max_turn_rate_radps / bend)
    return max(speed, config.min_speed_mps)


def approached(value: float, wanted: float, largest_rise: float, largest_fall: float) -> float:
    """`wanted`, or as near to it as the change of magnitude from `value` in one step allows."""
    limit = largest_rise if abs(wanted) > abs(value) and wanted * value >= 0 else largest_fall
    return value + max(-limit, min(limit, wanted - value))
