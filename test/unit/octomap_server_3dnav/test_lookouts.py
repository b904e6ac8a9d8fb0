"""Looks from where the robot cannot turn: up a ramp of its own width, and out again where that leads nowhere."""

import math

import numpy as np
import pytest
from terrain_worlds import BELOW, OCCUPIED, RESOLUTION, grid_of_heights
from virtual_explorer import explore

from octomap_server_3dnav.exploration import DecisionKind, ExplorationPlanner
from octomap_server_3dnav.exploration_config import ExplorationConfig

BLOCK_M, SLOPE = 1.2, math.tan(math.radians(15.0))
FOOT_X, HEAD_X = 2.4, 2.4 + BLOCK_M / SLOPE
RAMP_Y = (2.4, 3.5)  # 14 voxels


def ramp_to_a_block(block_end_x, block_y):
    """A walled floor with a ramp on which the robot cannot turn, up to a block whose top cannot be seen from below."""

    def height(x, y):
        on_ramp = (y > RAMP_Y[0]) & (y < RAMP_Y[1]) & (x > FOOT_X) & (x < HEAD_X)
        on_block = (x >= HEAD_X) & (x < block_end_x) & (y > block_y[0]) & (y < block_y[1])
        return 0.04 + np.where(on_block, BLOCK_M, np.where(on_ramp, (x - FOOT_X) * SLOPE, 0.0))

    states = grid_of_heights(height, 130, 74, top_m=3.6)
    layer, top = np.arange(states.shape[2]), (states == OCCUPIED).argmax(axis=2)
    states[(layer <= top[:, :, None]) & (layer >= BELOW)] = OCCUPIED
    for edge in (np.s_[0], np.s_[-1]):
        states[edge, :, BELOW:] = states[:, edge, BELOW:] = OCCUPIED
    return states


@pytest.mark.parametrize("lookouts", [True, False])
def test_block_at_the_head_of_a_narrow_ramp_is_looked_at_from_the_ramp_and_driven_onto(lookouts):
    world = ramp_to_a_block(HEAD_X + 2.1, (1.9, 4.0))
    journey = explore(world, 1.2, 2.9, 0.0, ExplorationPlanner(ExplorationConfig(lookouts=lookouts)))
    highest = max(T[2, 3] for T in journey.poses)
    assert journey.decisions[-1].kind is DecisionKind.EXPLORED
    top = journey.known[int((HEAD_X + 1.0) / RESOLUTION), int(2.95 / RESOLUTION)]
    assert bool(highest > 0.5) is lookouts
    assert bool((top == OCCUPIED).any()) is lookouts
