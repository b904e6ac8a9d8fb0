"""The turn to a frontier (thesis 5.5) is the short way round, also across the heading of pi at which angles start again."""

import math

import numpy as np
import pytest
from terrain_worlds import BELOW, OCCUPIED, UNKNOWN, grid_of_heights, pose, terrain_of

from octomap_server_3dnav.exploration.frontiers import FrontierConfig, find_frontiers
from octomap_server_3dnav.navigation.planner import PlannerConfig


def turn_to_the_opening_behind(y: float, yaw: float) -> float:
    """What the turn costs, in radians, from (3.2, y) to an opening in the wall x = 0, around y = 3.2."""
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 80, 80)
    for edge in (np.s_[0], np.s_[-1]):
        states[edge, :, BELOW:] = OCCUPIED
        states[:, edge, BELOW:] = OCCUPIED
    states[0, 36:44] = UNKNOWN
    at = pose(3.2, y, yaw=yaw)
    weights = (FrontierConfig(angle_weight_m_per_rad=w, gain_weight_m_per_m2=0.0) for w in (0.0, 1.0))
    (free,), (weighed,) = (find_frontiers(terrain_of(states, at), at, config, PlannerConfig()) for config in weights)
    return weighed.cost - free.cost


@pytest.mark.parametrize(
    ("y", "yaw", "turn_rad"),
    [(3.8, math.pi - 0.05, 0.25), (2.6, -math.pi + 0.05, 0.25), (3.8, -math.pi + 0.05, 0.15), (3.2, 0.0, math.pi)],
    ids=["over pi from the left", "over pi from the right", "not over pi", "all the way"],
)
def test_turn_to_a_frontier_is_the_short_way(y: float, yaw: float, turn_rad: float) -> None:
    assert turn_to_the_opening_behind(y, yaw) == pytest.approx(turn_rad, abs=0.12)
