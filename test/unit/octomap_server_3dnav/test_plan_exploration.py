"""The choice of goals: local then whole map, setting aside, and journeys through small worlds to their end (thesis algorithm 3)."""

import math
from dataclasses import replace

import numpy as np
import pytest
from terrain_worlds import BELOW, FREE, OCCUPIED, RESOLUTION, UNKNOWN, decide, opening, pose, room, runs_of, terrain_of
from virtual_explorer import explore

from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.exploration.decision import DecisionKind
from octomap_server_3dnav.exploration.frontiers import FrontierConfig
from octomap_server_3dnav.exploration.plan_validity import Validity, path_is_free, validity_in
from octomap_server_3dnav.navigation.passages import TerrainSettings, navigable_terrain
from octomap_server_3dnav.navigation.planner import PlannerConfig
from octomap_server_3dnav.terrain.classified_terrain import TerrainClass

GOAL, EXPLORED, TRAPPED = DecisionKind.GOAL, DecisionKind.EXPLORED, DecisionKind.TRAPPED


def test_goal_lies_before_the_frontier_and_faces_it():
    decision = decide(Explorer(), runs_of(opening(room())), pose(2.0, 2.0))
    assert decision.kind is GOAL and decision.scope == "local" and decision.open_frontiers == 1
    x, y, _, yaw = decision.goal
    gap = math.hypot(decision.frontier[0] - x, decision.frontier[1] - y)
    assert PlannerConfig().trim_m <= gap < PlannerConfig().trim_m + 0.2
    assert yaw == pytest.approx(math.atan2(decision.frontier[1] - y, decision.frontier[0] - x))
    assert decision.path[-1] == pytest.approx(decision.goal[:3])


def test_small_opening_beside_inflated_ground_only_is_looked_at_when_nothing_else_is_left():
    states = room()
    states[-1, 36:44] = UNKNOWN
    states[84:89, :36, BELOW:] = states[84:89, 44:, BELOW:] = OCCUPIED
    planner, at = Explorer(), pose(5.0, 3.2)
    last = decide(planner, runs_of(states), at)
    assert last.kind is GOAL and last.frontier[0] > 7.0
    states[0, 58:78] = UNKNOWN  # far behind the robot, beyond the local map
    assert decide(Explorer(), runs_of(states), at).frontier[0] < 0.5
    states[0, 58:78] = OCCUPIED
    after = [decide(planner, runs_of(states), at, "blocked").kind for _ in range(ExplorationConfig().max_failures)]
    assert after == [GOAL, EXPLORED]


def test_path_keeps_clear_of_floor_that_was_not_seen():
    states = opening(room(), 40, 50)
    states[40:55, 30:62] = UNKNOWN  # a pit, for all that is known, on the straight way from the robot to the opening
    decision = decide(Explorer(), runs_of(states), pose(1.4, 3.6))
    terrain = decision.terrain
    unknown = terrain.centers(terrain.nodes_of(TerrainClass.FRONTIER))[:, :2]
    away = np.linalg.norm(decision.path[:, None, :2] - unknown[None], axis=2).min(axis=1)
    assert decision.kind is GOAL and away.min() >= ExplorationConfig().unknown_clearance_m
    gap = math.hypot(decision.frontier[0] - decision.goal[0], decision.frontier[1] - decision.goal[1])
    assert gap >= ExplorationConfig().min_trim_m - 0.1


def test_another_look_is_never_taken_from_beside_unknown_floor():
    planner, runs = Explorer(ExplorationConfig(max_looks=5)), runs_of(opening(room()))
    at = pose(4.0, 3.2)
    for _ in range(4):
        decision = decide(planner, runs, at)
        if decision.kind is not GOAL:
            break
        x, y, _, yaw = decision.goal
        assert math.hypot(decision.frontier[0] - x, decision.frontier[1] - y) >= ExplorationConfig().min_trim_m - 0.1
        at = pose(x, y, yaw=yaw)


def test_goal_beside_a_kerb_is_moved_back_along_its_path():
    states, at = opening(room()), pose(2.0, 3.2)
    plain = decide(Explorer(), lambda radius: navigable_terrain(runs_of(states), at, TerrainSettings(), radius), at)

    def kerb_at_the_goal(radius):
        terrain = navigable_terrain(runs_of(states), at, TerrainSettings(), radius)
        terrain.near_kerb[terrain.ix > (plain.goal[0] - 0.5) / RESOLUTION] = True
        return terrain

    decision = decide(Explorer(), kerb_at_the_goal, at)
    assert decision.kind is GOAL
    assert 0.4 < plain.goal[0] - decision.goal[0] < 0.8
    kept = decide(Explorer(ExplorationConfig(most_back_m=0.2)), kerb_at_the_goal, at)
    assert kept.goal == plain.goal


@pytest.mark.parametrize("degrees, faces", [(0, True), (15, False)])
def test_robot_does_not_turn_to_the_frontier_on_a_slope(degrees, faces):
    slope = math.tan(math.radians(degrees))
    states = room(90, 60, lambda x, y: 0.04 + slope * x + 0 * y)
    states[60:80, -1] = UNKNOWN  # an opening beside the way up
    decision = decide(Explorer(), runs_of(states), pose(2.0, 2.4, ground=2.0 * slope))
    (x, y, _, yaw), (a, b) = decision.goal, decision.path[[-4, -1], :2]
    facing, arriving = math.atan2(decision.frontier[1] - y, decision.frontier[0] - x), math.atan2(b[1] - a[1], b[0] - a[0])
    assert abs(facing - arriving) > 0.1
    assert yaw == pytest.approx(facing if faces else arriving)


def test_whole_map_is_searched_when_nothing_is_near():
    asked = []

    def terrain_within(radius):
        asked.append(radius)
        return terrain_of(opening(room(150, 60)), pose(1.6, 2.0), radius)

    decision = decide(Explorer(), terrain_within, pose(1.6, 2.0))
    assert decision.kind is GOAL and decision.scope == "global" and asked == [6.0, None]


def test_closed_room_is_explored():
    decision = decide(Explorer(), runs_of(room()), pose(2.0, 2.0))
    assert decision.kind is EXPLORED and "no reachable frontier" in decision.reason
    assert decision.path is None and decision.goal is None


def test_robot_without_ground_and_robot_in_a_closet_are_trapped():
    planner = Explorer()
    assert decide(planner, runs_of(room()), pose(2.0, 2.0, ground=2.0)).kind is TRAPPED
    closet = room()
    closet[[20, 34], 20:35, BELOW:] = OCCUPIED
    closet[20:35, [20, 34], BELOW:] = OCCUPIED
    decision = decide(planner, runs_of(closet), pose(27.5 * RESOLUTION, 27.5 * RESOLUTION))
    assert decision.kind is TRAPPED and "near" in decision.reason


def test_frontier_that_cannot_be_reached_is_set_aside_after_the_failures():
    planner, runs = Explorer(ExplorationConfig(max_failures=2)), runs_of(opening(room()))
    assert decide(planner, runs, pose(2.0, 2.0)).kind is GOAL
    assert decide(planner, runs, pose(2.0, 2.0), "no progress").kind is GOAL
    decision = decide(planner, runs, pose(2.0, 2.0), "no progress")
    assert decision.kind is EXPLORED and decision.set_aside == 1 and "1 set aside" in decision.reason
    assert "no progress" in planner.set_aside()[0][1]


def test_next_frontier_is_tried_when_the_first_is_set_aside():
    states = opening(room())
    states[30:50, -1] = UNKNOWN
    planner = Explorer(ExplorationConfig(max_failures=1))
    first = decide(planner, runs_of(states), pose(2.0, 2.0))
    second = decide(planner, runs_of(states), pose(2.0, 2.0), "blocked")
    assert second.kind is GOAL and math.dist(first.frontier, second.frontier) > 3.0


def test_frontier_that_no_look_changes_is_approached_more_closely_and_then_set_aside():
    planner, runs = Explorer(), runs_of(opening(room()))
    here, gaps = pose(2.0, 2.0), []
    for _ in range(20):
        decision = decide(planner, runs, here)
        if decision.kind is not GOAL:
            break
        x, y, z, yaw = decision.goal
        gaps.append(math.hypot(decision.frontier[0] - x, decision.frontier[1] - y))
        here = pose(x, y, 0.0, yaw)
    assert decision.kind is EXPLORED and "unchanged" in planner.set_aside()[0][1]
    assert len(gaps) == 2 and gaps[1] < gaps[0]


def test_robot_that_never_gets_near_ends_by_the_number_of_goals():
    planner, runs = Explorer(ExplorationConfig(max_goals=4)), runs_of(opening(room()))
    kinds = [decide(planner, runs, pose(2.0, 2.0)).kind for _ in range(5)]
    assert kinds == [GOAL] * 4 + [EXPLORED]


def test_robot_that_swings_between_two_goals_without_coming_nearer_to_either_sets_both_aside_and_ends():
    states = opening(room())
    states[0, 30:50] = UNKNOWN
    planner, runs = Explorer(ExplorationConfig(max_goals=4)), runs_of(states)
    swings, goals = [pose(2.4, 3.2, yaw=math.pi), pose(4.8, 3.2)], []
    for k in range(40):
        decision = decide(planner, runs, swings[k % 2])
        if decision.kind is not GOAL:
            break
        goals.append(decision.frontier[0] > 3.6)
    assert decision.kind is EXPLORED and goals[:6] == [False, True] * 3
    assert len(goals) <= 8 and [reason for _, reason in planner.set_aside()] == ["no nearer after 4 goals"] * 2


def test_far_frontier_chosen_anew_on_the_way_to_it_is_not_set_aside():
    planner, runs = Explorer(ExplorationConfig(max_goals=3)), runs_of(opening(room(150, 60), 20, 40))
    decisions = [decide(planner, runs, pose(1.6 + 0.7 * k, 2.4)) for k in range(10)]
    assert [d.kind for d in decisions] == [GOAL] * 10
    assert planner.set_aside() == []


def test_frontier_nearer_than_the_trim_is_faced_from_where_the_robot_stands():
    states = opening(room())
    here = pose(79.5 * RESOLUTION, 40.5 * RESOLUTION, yaw=math.pi)
    decision = decide(Explorer(planner=PlannerConfig(trim_m=2.0)), runs_of(states), here)
    assert decision.path.shape == (1, 3)
    (x, y, _), (x0, y0) = decision.frontier, here[:2, 3]
    assert x > x0 and decision.goal[3] == pytest.approx(math.atan2(y - y0, x - x0), abs=0.1)


def test_plan_stays_valid_until_the_path_is_blocked_or_the_frontier_is_gone():
    states = opening(room())
    decision = decide(Explorer(), runs_of(states), pose(2.0, 2.0))

    def after(world):
        terrain = navigable_terrain(runs_of(world), pose(2.3, 2.2), TerrainSettings(), 6.0)
        return validity_in(terrain, decision, FrontierConfig().min_voxels)

    assert after(states) is Validity.VALID
    assert after(room()) is Validity.FRONTIER_GONE
    blocked = states.copy()
    blocked[55, 10:70, BELOW:] = OCCUPIED
    assert after(blocked) is Validity.PATH_BLOCKED


@pytest.mark.parametrize(("beyond_m", "expected"), [(1.5, Validity.PATH_BLOCKED), (3.4, Validity.VALID)])
def test_path_whose_ground_is_gone_from_what_was_classified_anew_is_no_way_and_what_lies_outside_is_unchanged(beyond_m, expected):
    states = opening(room())
    decision, at = decide(Explorer(), runs_of(states), pose(2.0, 2.0)), pose(2.3, 2.2)
    away_m = np.linalg.norm(decision.path[:, :2] - at[:2, 3], axis=1)
    x, y = (decision.path[np.argmax(away_m > beyond_m), :2] / RESOLUTION).astype(int)
    states[x - 1 : x + 2, y - 1 : y + 2] = UNKNOWN
    terrain = navigable_terrain(runs_of(states), at, TerrainSettings(), 3.2)
    assert validity_in(terrain, decision, FrontierConfig().min_voxels) is expected


def test_path_that_leads_out_of_what_was_classified_and_in_again_where_the_flood_did_not_come_is_unchanged():
    states = opening(room(150, 90), 20, 40)
    states[:70, 44:46, BELOW:] = OCCUPIED  # a long wall beside the robot, and the way around its far end
    around = [(2.0, 2.4), (6.6, 2.4), (6.6, 4.8), (2.0, 4.8)]
    points = [(*np.linspace(a, b, 40)[k], 0.04) for a, b in zip(around, around[1:], strict=False) for k in range(40)]
    decision = replace(decide(Explorer(), runs_of(states), pose(2.0, 2.4)), path=np.array(points), straight=None)
    for radius_m, is_reached in ((3.0, False), (8.0, True)):
        terrain = navigable_terrain(runs_of(states), pose(2.0, 2.4), TerrainSettings(), radius_m)
        assert (terrain.surface_near((2.0, 4.8, 0.04)) is not None) == is_reached
        assert path_is_free(terrain, decision)


def test_decision_without_a_path_has_no_validity():
    explored = decide(Explorer(), runs_of(room()), pose(2.0, 2.0))
    with pytest.raises(ValueError, match="explored"):
        validity_in(explored.terrain, explored, 6)


def test_wrong_configuration_is_refused():
    with pytest.raises(ValueError, match="max_goals"):
        Explorer(ExplorationConfig(max_goals=1, max_looks=3))


def coverage(journey, world, start):
    true = navigable_terrain(runs_of(world), start, TerrainSettings(), None).traversable_area_m2
    return journey.decisions[-1].terrain.traversable_area_m2 / true


def test_two_rooms_are_explored_to_the_end():
    world = room(110, 80)
    world[55, :, BELOW : BELOW + 30] = OCCUPIED
    world[55, 50:70, BELOW + 1 :] = FREE
    journey = explore(world, 2.0, 2.0, 0.04, Explorer(), most=20)
    assert journey.decisions[-1].kind is EXPLORED
    assert coverage(journey, world, pose(2.0, 2.0)) > 0.97


def two_levels():
    slope = math.tan(math.radians(18))
    world = room(
        150, 110, lambda x, y: np.where((abs(y - 4.4) < 1.5) & (x > 2.5), np.clip((x - 2.5) * slope, 0, 1.6) * (x < 7.6), 0.0) + 0.04
    )
    deck = BELOW + 20
    world[95:135, 20:95, deck - 1 : deck + 1] = OCCUPIED
    world[95:135, 20:95, deck + 1 :] = FREE
    return world


def test_deck_is_explored_above_and_below_and_its_edges_are_never_left():
    world = two_levels()
    journey = explore(world, 1.5, 1.5, 0.04, Explorer(), most=30)
    last = journey.decisions[-1]
    assert last.kind is EXPLORED
    assert coverage(journey, world, pose(1.5, 1.5)) > 0.95
    edge = navigable_terrain(runs_of(world), pose(1.5, 1.5), TerrainSettings(), None)
    cliffs = edge.centers(edge.nodes_of(TerrainClass.CLIFF))
    for T_map_base in journey.poses:
        ground = T_map_base[:3, 3] - [0, 0, 0.132]
        level = np.abs(cliffs[:, 2] - ground[2]) < 0.3
        assert np.linalg.norm(cliffs[level, :2] - ground[:2], axis=1).min(initial=9.0) > 0.5


def test_rough_ground_with_range_noise_ends_explored():
    random = np.random.default_rng(4)
    hills = [(*random.uniform(0, 9, 2), random.uniform(0.8, 2.0), random.uniform(-0.35, 0.35)) for _ in range(14)]
    world = room(110, 110, lambda x, y: 0.4 + sum(a * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / s**2) for cx, cy, s, a in hills))
    ground = ((world[50, 50] == OCCUPIED).nonzero()[0].max() - BELOW + 0.5) * RESOLUTION
    journey = explore(world, 50.5 * RESOLUTION, 50.5 * RESOLUTION, ground, Explorer(), most=30, noise_m=0.015)
    assert journey.decisions[-1].kind is EXPLORED
    assert coverage(journey, world, pose(50.5 * RESOLUTION, 50.5 * RESOLUTION, ground)) > 0.6  # of voxels alone noise reads as steps
