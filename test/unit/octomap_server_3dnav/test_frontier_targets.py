"""Frontier voxels as targets: clusters, sizes, costs (thesis 5.5)."""

import math

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components
from terrain_worlds import BELOW, FREE, OCCUPIED, RESOLUTION, UNKNOWN, grid_of_heights, pose, terrain_of

from octomap_server_3dnav.exploration.frontiers import FrontierConfig, find_frontiers
from octomap_server_3dnav.navigation.planner import PlannerConfig
from octomap_server_3dnav.octree.voxel_clusters import cluster_voxels
from octomap_server_3dnav.terrain.classify import TerrainClass


def room(nx=80, ny=80, openings=()):
    """A walled floor; each opening is (slice, slice) of columns that were not seen at all."""
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, nx, ny)
    for edge in (np.s_[0], np.s_[-1]):
        states[edge, :, BELOW:] = OCCUPIED
        states[:, edge, BELOW:] = OCCUPIED
    for opening in openings:
        states[opening] = UNKNOWN
    return states


def targets(states, T_map_base, **config):
    return find_frontiers(terrain_of(states, T_map_base), T_map_base, FrontierConfig(**config), PlannerConfig())


def test_closed_room_has_no_frontier():
    assert targets(room(), pose(3.2, 3.2)) == []


def test_opening_in_the_wall_is_one_target_in_its_middle():
    found = targets(room(openings=[np.s_[-1, 30:50]]), pose(3.2, 3.2))
    assert len(found) == 1
    assert found[0].xyz[:2] == pytest.approx((79.5 * RESOLUTION, 40 * RESOLUTION), abs=0.05)


def test_small_cluster_is_dropped():
    states = room(openings=[np.s_[40:42, 50:52]])
    assert targets(states, pose(1.6, 1.6), min_voxels=1) == []  # bridged: a hole and no frontier
    states = room(openings=[np.s_[40:46, 50:56]])
    assert len(targets(states, pose(1.6, 1.6), min_voxels=6)) == 1
    assert targets(states, pose(1.6, 1.6), min_voxels=40) == []


def test_target_in_front_is_preferred_to_one_behind_at_equal_distance():
    openings = [np.s_[-1, 30:50], np.s_[0, 30:50]]
    ahead = targets(room(openings=openings), pose(3.2, 3.2, yaw=0.0))
    behind = targets(room(openings=openings), pose(3.2, 3.2, yaw=math.pi))
    assert ahead[0].xyz[0] > 6.0 and behind[0].xyz[0] < 0.5
    assert ahead[1].cost - ahead[0].cost == pytest.approx(0.5 * math.pi, abs=0.2)


def test_distance_over_the_ground_counts_the_way_round_a_wall():
    states = room(openings=[np.s_[-1, 30:50]])
    states[60, 10:, BELOW:] = OCCUPIED
    states[60, :10, BELOW + 1 :] = 1
    states[60, 10:22, BELOW + 1 :] = 1
    path, straight = (targets(states, pose(3.2, 4.8), frontier_distance=choice)[0] for choice in ("path", "euclidean"))
    assert path.distance_m > straight.distance_m + 1.0


def test_long_frontier_is_split_into_targets_of_limited_extent():
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 80, 80)
    found = targets(states, pose(3.2, 3.2))
    terrain = terrain_of(states, pose(3.2, 3.2))
    assert len(found) > 10
    assert sorted(v for f in found for v in f.voxels) == terrain.nodes_of(TerrainClass.FRONTIER).tolist()


def test_frontier_in_a_corridor_hardly_wider_than_the_robot_counts():
    states = room(80, 18, openings=[np.s_[-1, 1:17]])
    found = targets(states, pose(1.6, 0.72))
    assert len(found) == 1 and found[0].node >= 0


def test_frontier_beside_inflated_ground_only_is_approached_from_the_nearest_open_ground():
    states = room(openings=[np.s_[-1, 30:50]])
    states[70, :36, BELOW:] = OCCUPIED  # a gap of 0.64 m leads to the opening
    states[70, 44:, BELOW:] = OCCUPIED
    terrain = terrain_of(states, pose(1.6, 3.2))
    found = find_frontiers(terrain, pose(1.6, 3.2), FrontierConfig(approach_m=2.0), PlannerConfig())
    assert found and all(terrain.label[f.node] == TerrainClass.TRAVERSABLE for f in found)
    assert find_frontiers(terrain, pose(1.6, 3.2), FrontierConfig(approach_m=0.5), PlannerConfig()) == []


def test_small_target_beside_inflated_ground_only_counts_where_a_look_may_show_much():
    states = room(openings=[np.s_[-1, 36:44]])
    states[74:79, :36, BELOW:] = states[74:79, 44:, BELOW:] = OCCUPIED  # 0.64 m wide, to the end
    found = targets(states, pose(1.6, 3.2))
    assert [(f.last, len(f.voxels)) for f in found] == [(True, 8)] and found[0].gain_m2 > 3.0
    assert targets(states, pose(1.6, 3.2), least_last_gain_m2=found[0].gain_m2 + 0.1) == []
    assert [f.last for f in targets(states, pose(1.6, 3.2), min_inflated_voxels=8)] == [False]


def test_look_into_the_open_shows_more_than_one_at_a_hole_between_walls():
    states = room(openings=[np.s_[-1, 30:50]])
    states[40:44, 36:44] = UNKNOWN
    found = sorted(targets(states, pose(1.6, 3.2), gain_radius_m=1.0), key=lambda f: f.gain_m2)
    assert len(found) >= 2
    assert found[0].gain_m2 == pytest.approx(4 * 8 * 0.08**2, rel=0.5) and found[-1].xyz[0] > 6.0
    assert found[-1].gain_m2 > 2 * found[0].gain_m2


@pytest.mark.parametrize(("hole", "unseen_m2"), [(np.s_[46:56, 46:56], 0.32), (np.s_[40:46, 40:46], 0.23)], ids=["corner", "middle"])
def test_where_air_was_seen_beyond_an_edge_a_look_shows_no_ground(hole, unseen_m2):
    states = grid_of_heights(lambda x, y: np.where((abs(x - 3.2) < 1.2) & (abs(y - 3.2) < 1.2), 1.64, 0.04), 80, 80)  # a deck over a floor
    states[hole] = UNKNOWN
    (found,) = targets(states, pose(2.6, 2.6, ground=1.6), min_inflated_voxels=1)
    assert unseen_m2 / 2 < found.gain_m2 < 1.5


def test_deck_that_was_seen_from_below_only_is_ground_that_a_look_may_show():
    states = grid_of_heights(lambda x, y: np.where(x < 3.2, 3.24, 0.04), 80, 80, top_m=5.0)
    states[0, :, BELOW:] = states[:, (0, -1), BELOW:] = OCCUPIED
    states[40:48], states[48:, :, BELOW + 1 :] = UNKNOWN, FREE
    states[48:, :, BELOW + 42 : BELOW + 44] = OCCUPIED  # a little above the ground that leads up to it
    states[48:, :, BELOW + 44 :] = UNKNOWN
    found = targets(states, pose(1.6, 3.2, ground=3.2), gain_radius_m=3.0)
    assert found and min(f.gain_m2 for f in found) > 10.0


def test_what_a_look_may_show_is_worth_a_longer_way():
    states = room(openings=[np.s_[-1, 30:50]])
    states[40:44, 36:44] = UNKNOWN  # a hole in the floor on the way to the opening
    near, far = (targets(states, pose(1.6, 3.2), gain_weight_m_per_m2=weight, gain_radius_m=2.0)[0] for weight in (0.0, 5.0))
    assert near.distance_m + 1.0 < far.distance_m and near.gain_m2 < far.gain_m2


def test_edge_over_which_a_beam_passed_is_a_target_of_its_own_kind():
    states = room(openings=[np.s_[-1, 30:50]])
    assert [f.potential_cliff for f in targets(states, pose(1.6, 3.2))] == [False]
    states[-1, 30:50, BELOW:] = FREE
    assert [f.potential_cliff for f in targets(states, pose(1.6, 3.2))] == [True]


def test_clusters_agree_with_scipy():
    voxels = np.random.default_rng(0).integers(0, 30, (200, 3))
    gap = np.abs(voxels[:, None] - voxels[None])
    linked = (gap[:, :, 0] <= 2) & (gap[:, :, 1] <= 2) & (gap[:, :, 2] <= 3)
    count, oracle = connected_components(linked, directed=False)
    mine = cluster_voxels(voxels)
    assert len(set(zip(mine.tolist(), oracle.tolist(), strict=True))) == count == mine.max() + 1


def test_order_is_by_cost():
    found = targets(grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 80, 80), pose(2.0, 3.2))
    assert [f.cost for f in found] == sorted(f.cost for f in found)
