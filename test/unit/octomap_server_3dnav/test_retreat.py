"""Going back to known ground when sweeps find no place in the map."""

import numpy as np
import pytest

from octomap_server_3dnav.exploration.decision import DecisionKind
from octomap_server_3dnav.exploration.retreat import Retreat, way_back
from octomap_server_3dnav.navigation.passages import TerrainSettings, navigable_terrain
from octomap_server_3dnav.navigation.planner import PlannerConfig
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from rigid_geometry import transform_from_rpy

POSES = np.array([transform_from_rpy((float(k), 0.0, 0.0)) for k in range(9)])


def retreat_after(pattern, after=2):
    """`pattern` of sweeps: m matched, r refused."""
    retreat = Retreat(after, 2)
    for k, outcome in enumerate(pattern):
        retreat.add_sweep(k, outcome == "m")
    target = retreat.target(POSES[: len(pattern)])
    return None if target is None else target[0]


@pytest.mark.parametrize(
    ("pattern", "place"),
    [("m", None), ("mmr", None), ("mmrr", 1.0), ("mmmrrr", 1.0), ("mmrrrrr", 0.0), ("mmrrm", None), ("mrmrr", 2.0), ("rr", None)],
)
def test_second_refusal_sends_back_to_the_last_match_and_every_further_one_beyond_it(pattern, place):
    assert retreat_after(pattern) == place


def test_retreat_can_be_switched_off():
    assert retreat_after("mmrrrr", after=0) is None


def floor_with_wall():
    """8 x 8 m of floor, a wall across it with a gap at one end."""
    states = np.zeros((100, 100, 20), dtype=np.uint8)
    states[:, :, 3], states[:, :, 4:] = 2, 1
    states[50, :70, 4:] = 2
    return ColumnRuns.from_dense(states, (0, 0, -4), 0.08)


def go_back(target, at=(6.0, 2.0)):
    T_map_base = transform_from_rpy((*at, 0.132))
    return way_back(
        lambda radius: navigable_terrain(floor_with_wall(), T_map_base, TerrainSettings(), radius), 4.0, T_map_base, target, PlannerConfig()
    )


def test_way_back_leads_around_the_wall_to_the_target():
    decision = go_back(np.array([2.0, 2.0, 0.1]))
    assert decision.kind is DecisionKind.GOAL and decision.frontier == (2.0, 2.0, 0.1) and "4.0 m" in decision.reason
    np.testing.assert_allclose(decision.path[-1][:2], [2.0, 2.0], atol=0.1)
    assert decision.path[:, 1].max() > 5.6


def test_no_way_back_is_no_decision():
    assert go_back(np.array([2.0, 30.0, 0.1])) is None
