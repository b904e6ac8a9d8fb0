"""Paths over, under and around: A*, shortcuts, trimming (thesis 5.5.1, 6.2.2)."""

import itertools
import math

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra
from terrain_worlds import BELOW, FREE, OCCUPIED, RESOLUTION, grid_of_heights, pose, robot_with, terrain_of

from octomap_server_3dnav.navigation.path_search import Ways, cheapest_way, distances, edge_cost
from octomap_server_3dnav.navigation.planner import (
    WAYPOINT_SPACING_M,
    Path,
    PlannerConfig,
    distances_over_ground,
    nearest_traversable,
    plan_path,
    trim_path,
)
from octomap_server_3dnav.terrain.classify import TerrainClass

CONFIG = PlannerConfig()
NOT_KNOWN = np.empty(0)  # what is left to the goal


def flat(nx=90, ny=60):
    return grid_of_heights(lambda x, y: 0.04 + 0 * x * y, nx, ny)


def path_to(terrain, x, y, z):
    node = terrain.surface_near((x, y, z))
    return None if node is None else plan_path(terrain, node, CONFIG)


def test_path_over_open_floor_is_a_straight_line():
    path = path_to(terrain_of(flat(), pose(0.6, 0.6)), 6.5, 3.7, 0.04)
    straight = math.dist(path.points[0], path.points[-1])
    assert path.length_m == pytest.approx(straight, rel=0.01)
    assert (np.linalg.norm(np.diff(path.points, axis=0), axis=1) <= WAYPOINT_SPACING_M + 1e-9).all()


def test_path_over_the_ramp_reaches_the_plateau_with_smooth_heights():
    slope = math.tan(math.radians(20))
    states = grid_of_heights(lambda x, y: np.clip((x - 2.0) * slope, 0.0, 1.2) + 0.04 + 0 * y, 100, 40)
    path = path_to(terrain_of(states, pose(1.0, 1.6)), 7.0, 1.6, 1.24)
    assert path.points[-1][2] == pytest.approx(1.24, abs=0.08)
    assert np.abs(np.diff(path.points[:, 2])).max() < 0.09


def test_path_leads_under_the_bridge():
    states = flat(90, 60)
    states[30:60, :, BELOW + 20] = OCCUPIED
    path = path_to(terrain_of(states, pose(1.0, 2.4)), 6.4, 2.4, 0.04)
    assert path is not None and path.points[:, 2].max() < 0.1


def test_goal_without_a_height_lies_on_the_storey_of_the_robot():
    slope = math.tan(math.radians(20))
    states = grid_of_heights(lambda x, y: np.clip((x - 2.0) * slope, 0.0, 2.4) + 0.04 + 0 * y, 130, 40)
    states[115:, :, BELOW] = OCCUPIED  # what lies under the plateau is not reached
    terrain = terrain_of(states, pose(1.0, 1.6))
    node = nearest_traversable(terrain, (9.4, 1.6, math.nan), 0.5)
    assert terrain.centers()[node] == pytest.approx((9.4, 1.6, 2.44), abs=0.13)
    assert nearest_traversable(terrain, (9.4, 1.6, 0.04), 0.5) is None
    assert nearest_traversable(terrain, (40.0, 1.6, math.nan), 0.5) is None


def test_path_keeps_the_inflation_radius_from_walls_and_likes_the_middle():
    states = flat()
    states[40, :22, BELOW:] = OCCUPIED
    states[40, 48:, BELOW:] = OCCUPIED
    terrain = terrain_of(states, pose(1.0, 1.0))
    path = path_to(terrain, 6.0, 1.0, 0.04)
    walls = terrain.centers(terrain.nodes_of(TerrainClass.OBSTACLE))
    gaps = np.linalg.norm(path.points[:, None, :2] - walls[None, :, :2], axis=2)
    assert gaps.min() > 0.75  # 0.6 m is allowed, the soft strip wants more


def test_no_path_through_a_closed_wall():
    states = flat()
    states[40, :, BELOW:] = OCCUPIED
    states[45:, :, BELOW] = OCCUPIED
    terrain = terrain_of(states, pose(1.0, 2.4))
    assert terrain.surface_near((6.0, 2.4, 0.04)) is None


def test_goal_in_the_inflation_or_on_an_obstacle_has_no_path():
    states = flat()
    states[40, :, BELOW:] = OCCUPIED
    terrain = terrain_of(states, pose(1.0, 2.4))
    assert plan_path(terrain, int(terrain.nodes_of(TerrainClass.INFLATION)[0]), CONFIG) is None
    assert plan_path(terrain, int(terrain.nodes_of(TerrainClass.OBSTACLE)[0]), CONFIG) is None


def test_robot_in_the_inflation_leaves_it_first_and_never_over_an_obstacle():
    states = flat()
    states[40, :, BELOW:] = OCCUPIED
    terrain = terrain_of(states, pose(37.5 * RESOLUTION, 2.4))
    path = path_to(terrain, 0.6, 2.4, 0.04)
    assert path.points[0][0] == pytest.approx(37.5 * RESOLUTION)
    assert (np.diff(path.points[:, 0]) < 0).all()


def test_unknown_node_is_refused():
    with pytest.raises(ValueError, match="node"):
        plan_path(terrain_of(flat(), pose(1, 1)), 10**6, CONFIG)


def test_distances_agree_with_scipy_on_the_same_graph():
    random = np.random.default_rng(3)
    states = grid_of_heights(lambda x, y: 0.15 * np.sin(x) * np.cos(y) + 0.1, 70, 60)
    for _ in range(4):
        ix, iy = random.integers(10, 60, 2)
        states[ix, iy, BELOW : BELOW + 12] = OCCUPIED
    terrain = terrain_of(states, pose(0.8, 0.8))
    mine = distances_over_ground(terrain, CONFIG)
    voxels = {v: i for i, v in enumerate(zip(terrain.ix.tolist(), terrain.iy.tolist(), strict=True)) if math.isfinite(terrain.cost[i])}
    rows = []
    for (x, y), i in voxels.items():
        for dx, dy in itertools.product((-1, 0, 1), repeat=2):
            around = [voxels.get((x + dx, y)), voxels.get((x, y + dy)), voxels.get((x + dx, y + dy))]
            if (dx or dy) and None not in around:
                rise = float(terrain.z[i]) - float(terrain.z[around[2]])
                rows.append((i, around[2], math.sqrt(dx * dx + dy * dy + rise * rise) * RESOLUTION))
    i, j, w = zip(*rows, strict=True)
    n = terrain.label.size
    oracle = dijkstra(coo_matrix((w, (i, j)), (n, n)).tocsr(), indices=terrain.departure)
    offset = mine[terrain.departure]
    open_nodes = np.array(sorted(voxels.values()))
    np.testing.assert_allclose(mine[open_nodes] - offset, oracle[open_nodes], atol=1e-5)


def cost_of(ways: Ways, chain: np.ndarray) -> float:
    """What a chain of nodes costs, edge by edge."""
    lengths = np.hypot(np.diff(ways.ix[chain]), np.diff(ways.iy[chain]))
    return sum(edge_cost(a, b, length, ways.z, ways.cost, ways.climb) for a, b, length in zip(chain[:-1], chain[1:], lengths, strict=True))


def test_a_star_costs_what_dijkstra_costs_and_a_weighted_one_at_most_so_much_more():
    states = flat()
    states[40, :40, BELOW:] = OCCUPIED
    t = terrain_of(states, pose(1.0, 1.0))
    goal = t.surface_near((6.0, 1.0, 0.04))
    ways = Ways(t.neighbours, t.ix, t.iy, t.z, t.cost, 0.3, np.zeros((0, 2), np.int64), np.zeros(0))
    least = distances(ways, t.departure)[goal]
    assert cost_of(ways, cheapest_way(ways, t.departure, goal, 1.0, NOT_KNOWN, 10**6)[0]) == pytest.approx(least)
    assert least * (1 - 1e-9) <= cost_of(ways, cheapest_way(ways, t.departure, goal, 1.5, NOT_KNOWN, 10**6)[0]) <= 1.5 * least


def far_round():
    """Walls that one has to go round, one after the other; the terrain, its ways and a goal behind them."""
    states = flat()
    for wall, opening in ((20, slice(0, 48)), (35, slice(12, None)), (50, slice(0, 48)), (65, slice(12, None))):
        states[wall, opening, BELOW:] = OCCUPIED
    t = terrain_of(states, pose(0.8, 0.8), robot=robot_with(0.16, 0.16))
    ways = Ways(t.neighbours, t.ix, t.iy, t.z, t.cost, 0.3, np.zeros((0, 2), np.int64), np.zeros(0))
    return t, ways, t.surface_near((6.0, 1.0, 0.04))


@pytest.mark.parametrize("weight", [1.0, 1.1, 1.5])
def test_way_far_round_costs_at_most_its_weight_more_and_fewer_nodes_are_tried_where_what_is_left_is_known(weight):
    t, ways, goal = far_round()
    least = distances(ways, t.departure)[goal]
    plain = ways._replace(cost=np.where(np.isfinite(ways.cost), 1.0, np.inf).astype(np.float32), climb=0.0)
    left = distances(plain, goal)  # both ways cost the same
    tried = []
    for known in (NOT_KNOWN, left):
        cost = cost_of(ways, cheapest_way(ways, t.departure, goal, weight, known, 10**6)[0])
        assert least * (1 - 1e-9) <= cost <= weight * least * (1 + 1e-9)
        tried.append(next(most for most in range(0, 10**4, 50) if not cheapest_way(ways, t.departure, goal, weight, known, most)[1]))
    assert tried[1] < tried[0]


def test_a_search_tells_whether_it_gave_up_or_there_is_no_way():
    t, ways, goal = far_round()
    closed = ways._replace(cost=np.where(t.ix < 50, t.cost, np.inf).astype(np.float32))
    way, gave_up = cheapest_way(closed, t.departure, goal, 1.0, NOT_KNOWN, 10**6)
    assert not way.size and not gave_up
    for most in (0, 30):
        way, gave_up = cheapest_way(closed, t.departure, goal, 1.0, NOT_KNOWN, most)
        assert not way.size and gave_up


def test_a_path_is_the_same_whether_or_not_the_ground_was_measured_from_the_robot_before():
    t, _, goal = far_round()
    before = plan_path(t, goal, CONFIG)
    distances_over_ground(t, CONFIG)
    assert plan_path(t, goal, CONFIG).length_m == pytest.approx(before.length_m, rel=0.02)


def test_nothing_leads_to_a_closed_node_and_a_link_leads_where_the_ground_does_not():
    states = flat()
    states[40, :, BELOW:] = OCCUPIED
    t = terrain_of(states, pose(1.0, 1.0))
    near, across = t.departure, t.surface_near((2.0, 2.0, 0.04))
    ways = Ways(t.neighbours, t.ix, t.iy, t.z, t.cost, 0.3, np.array([[near, across]], np.int64), np.array([0.5]))
    closed = int(np.flatnonzero(~np.isfinite(t.cost))[0])
    assert not cheapest_way(ways, near, closed, 1.0, NOT_KNOWN, 10**6)[0].size and np.isinf(distances(ways, near)[closed])
    assert cheapest_way(ways, near, across, 1.0, NOT_KNOWN, 10**6)[0].tolist() == [near, across]
    assert distances(ways, near)[across] == 0.5


@pytest.mark.parametrize("seed", range(5))
def test_distances_along_a_chain_with_cheap_and_dear_links_agree_with_scipy(seed):
    random, n = np.random.default_rng(seed), 3000
    graph = np.full((n, 4), -1, np.int32)
    graph[:-1, 0], graph[1:, 2] = np.arange(1, n), np.arange(n - 1)
    links, link_cost = random.integers(0, n, (60, 2)), random.choice([1e-3, 0.3, 0.999, 5.0, 700.0], 60)
    nowhere = np.zeros(n, np.int32)
    ways = Ways(graph, np.arange(n, dtype=np.int32), nowhere, nowhere.astype(np.int16), np.ones(n, np.float32), 0.0, links, link_cost)
    edges = np.full((n, n), np.inf)
    edges[np.arange(n - 1), np.arange(1, n)] = edges[np.arange(1, n), np.arange(n - 1)] = 1.0
    np.minimum.at(edges, (links[:, 0], links[:, 1]), link_cost)
    oracle = dijkstra(np.where(np.isinf(edges), 0.0, edges), indices=7)
    np.testing.assert_allclose(distances(ways, 7), oracle, rtol=1e-9)


def test_trimmed_path_ends_the_distance_before_the_frontier():
    path = Path(np.column_stack([np.linspace(0, 5, 51), np.zeros(51), np.zeros(51)]))
    trimmed = trim_path(path, np.array([5.1, 0.0, 0.0]), 0.9)
    assert trimmed.points[-1][0] == pytest.approx(4.2)
    assert trim_path(path, np.array([0.2, 0.0, 0.0]), 9.0).points.shape == (1, 3)


def test_free_space_above_a_hole_is_not_crossed_by_a_shortcut():
    states = flat()
    states[35:50, 20:40, : BELOW + 1] = FREE
    terrain = terrain_of(states, pose(1.0, 2.4))
    path = path_to(terrain, 6.4, 2.4, 0.04)
    in_hole = (path.points[:, 0] > 34 * RESOLUTION) & (path.points[:, 0] < 51 * RESOLUTION) & (abs(path.points[:, 1] - 2.4) < 0.8 + 0.6)
    assert not in_hole.any()
