"""Passages: straight through doors and over bridges that are too narrow to turn on, and through nothing else."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from terrain_worlds import BELOW, FREE, OCCUPIED, RESOLUTION, UNKNOWN, decide, grid_of_heights, pose, runs_of, terrain_of, way

from octomap_server_3dnav.exploration.approach import Approach
from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.exploration.decision import DecisionKind
from octomap_server_3dnav.exploration.frontiers import FrontierConfig
from octomap_server_3dnav.exploration.plan_validity import Validity, validity_in
from octomap_server_3dnav.navigation.passages import TerrainSettings, navigable_terrain, rest_from, with_passages
from octomap_server_3dnav.navigation.planner import WAYPOINT_SPACING_M, PlannerConfig, distances_over_ground
from octomap_server_3dnav.navigation.straight_lines import PassageConfig
from octomap_server_3dnav.terrain.classified_terrain import Passage, TerrainClass
from octomap_server_3dnav.terrain.classify import classify

WALL_X, MIDDLE_Y = 55, 35  # columns
CONFIG = PlannerConfig()


def floor(nx: int = 110, ny: int = 70) -> np.ndarray:
    """A room with walls all around."""
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, nx, ny)
    for rim in (np.s_[:1], np.s_[-1:], np.s_[:, :1], np.s_[:, -1:]):
        states[rim][..., BELOW:] = OCCUPIED
    return states


def with_door(columns: int, thick: int = 2) -> np.ndarray:
    """Two rooms with a wall between them and a door so many columns wide in it."""
    states = floor()
    low = MIDDLE_Y - columns // 2
    for wall in (np.s_[:low], np.s_[low + columns :]):
        states[WALL_X : WALL_X + thick, wall, BELOW:] = OCCUPIED
    return states


def bridge(columns: int, length: int = 30) -> np.ndarray:
    """Two grounds and a bridge between them over a pit that was seen."""
    states, low = floor(), MIDDLE_Y - columns // 2
    for beside in (np.s_[:low], np.s_[low + columns :]):
        states[40 : 40 + length, beside, 1 : BELOW + 1] = FREE
        states[40 : 40 + length, beside, 0] = OCCUPIED
    return states


BEFORE, BEHIND = pose(1.5, 2.8), (7.2, 2.8)


@pytest.mark.parametrize("kerb_column, is_straight_on", [(WALL_X + 12, False), (WALL_X + 30, True)], ids=["at the run-up", "beyond it"])
def test_passage_ends_where_wheels_may_turn(kerb_column: int, is_straight_on: bool) -> None:
    """Wheels should not turn from a column behind the door on: without a straight line the way ends as soon as there is room to turn."""
    settings = TerrainSettings()
    plain = classify(runs_of(with_door(12)), BEFORE, settings.terrain, settings.robot, None)
    terrain = with_passages(replace(plain, near_kerb=plain.near_kerb | (plain.ix >= kerb_column)), 0.0, settings)
    assert way(terrain, *BEHIND) is not None
    for passage in terrain.passages:
        assert not terrain.near_kerb[list(passage.nodes)].any()
        run_up = passage.line[:, 0].max() - (kerb_column - 1) * RESOLUTION
        assert (run_up < -0.8) == is_straight_on


@pytest.mark.parametrize("columns, is_open", [(7, False), (8, False), (10, True), (11, True), (12, True), (13, True), (14, True)])
def test_door_is_open_where_the_robot_fits(columns: int, is_open: bool) -> None:
    terrain = terrain_of(with_door(columns), BEFORE)
    assert (way(terrain, *BEHIND) is not None) is is_open
    assert bool(terrain.passages) is is_open
    assert bool(terrain.reached[terrain.surface_near((*BEHIND, 0.04))]) is is_open


def test_unknown_floor_in_the_room_behind_a_door_is_a_question_there_too() -> None:
    """Ground beside it is reached through the door, so that the robot will have a look; with the door closed it is not."""
    for columns in (12, 7):
        states = with_door(columns)
        states[100:, 20:50] = UNKNOWN
        terrain = terrain_of(states, BEFORE)
        assert terrain.reached[terrain.frontiers()].any() == (columns == 12)


def test_classes_are_what_they_were_without_passages() -> None:
    states = with_door(11)
    off = navigable_terrain(runs_of(states), BEFORE, TerrainSettings(passages=PassageConfig(enabled=False)), None)
    on = terrain_of(states, BEFORE)
    assert not off.passages and not off.narrow.any() and way(off, *BEHIND) is None
    assert np.array_equal(off.label, on.label) and np.array_equal(off.neighbours, on.neighbours) and np.array_equal(off.cost, on.cost)


def test_narrow_ground_is_inflated_ground_off_all_barriers() -> None:
    terrain = terrain_of(with_door(11), BEFORE)
    walls = terrain.centers(terrain.nodes_of(TerrainClass.OBSTACLE))[:, :2]
    narrow = np.flatnonzero(terrain.narrow)
    gaps = np.linalg.norm(terrain.centers(narrow)[:, None, :2] - walls[None], axis=2).min(axis=1)
    assert (terrain.label[narrow] == TerrainClass.INFLATION).all()
    assert gaps.min() > 0.385 - RESOLUTION / math.sqrt(2) - 1e-6 and gaps.max() <= 0.633


def swept_gap(line: np.ndarray, barriers: np.ndarray) -> float:
    """Least distance of barriers from the outline of 0.99 x 0.67 m along a line, brute force; negative inside of it."""
    a, b = line[0, :2], line[-1, :2]
    along = (b - a) / np.linalg.norm(b - a)
    off = barriers[:, :2] - a
    t, aside = off @ along, np.abs(off @ np.array([-along[1], along[0]]))
    beside = (t > -0.495) & (t < np.linalg.norm(b - a) + 0.495)
    return float((aside[beside] - 0.335).min())


@pytest.mark.parametrize("states", [with_door(11), with_door(12, thick=20), bridge(12)], ids=["door", "corridor", "bridge"])
def test_outline_swept_along_a_passage_is_clear_of_all_barriers(states: np.ndarray) -> None:
    terrain = terrain_of(states, BEFORE)
    (passage,) = terrain.passages
    kinds = (TerrainClass.OBSTACLE, TerrainClass.CLIFF, TerrainClass.FRONTIER)
    barriers = np.concatenate([terrain.centers(terrain.nodes_of(kind)) for kind in kinds])
    assert swept_gap(passage.line, barriers) >= 0.05 - 1e-6
    assert all(terrain.label[n] == TerrainClass.TRAVERSABLE for n in passage.nodes)


def test_path_is_straight_through_the_door_with_a_run_up_on_both_sides() -> None:
    terrain = terrain_of(with_door(11), pose(1.5, 1.2))
    path = way(terrain, 7.2, 4.4)
    assert path is not None and path.straight is not None
    inside = np.flatnonzero(path.straight)
    line = path.points[inside[0] : inside[-1] + 2, :2]
    assert np.array_equal(inside, np.arange(inside[0], inside[-1] + 1))
    bearings = np.arctan2(*np.diff(line, axis=0).T[::-1])
    assert np.ptp(bearings) < 1e-6 and abs(bearings[0]) < 0.1
    wall = WALL_X * RESOLUTION
    assert line[0, 0] < wall - 0.6 - 0.4 and line[-1, 0] > wall + 0.16 + 0.6 + 0.4
    assert np.linalg.norm(np.diff(path.points, axis=0), axis=1).max() <= WAYPOINT_SPACING_M + 0.01
    assert distances_over_ground(terrain, CONFIG)[terrain.surface_near((7.2, 4.4, 0.04))] > path.length_m + 4.0


def test_bridge_of_a_metre_is_crossed_and_one_with_a_hole_is_not() -> None:
    assert way(terrain_of(bridge(13), BEFORE), *BEHIND) is not None
    assert way(terrain_of(bridge(9), BEFORE), *BEHIND) is None
    holed = bridge(13)
    holed[50:56, MIDDLE_Y - 1 : MIDDLE_Y + 2, : BELOW + 1] = FREE
    assert way(terrain_of(holed, BEFORE), *BEHIND) is None


def test_passage_needs_turning_room_and_a_run_up_behind_it() -> None:
    closet = with_door(11)
    closet[WALL_X + 14 :, :, BELOW:] = OCCUPIED
    assert not terrain_of(closet, BEFORE).passages
    obstructed = with_door(11)
    obstructed[WALL_X + 8, MIDDLE_Y - 8 : MIDDLE_Y + 8, BELOW:] = OCCUPIED
    assert way(terrain_of(obstructed, BEFORE), *BEHIND) is None


def test_bend_without_room_to_turn_is_no_passage() -> None:
    states = floor()
    states[45:66, :, BELOW:] = OCCUPIED
    for part in (np.s_[45:58, 20:31], np.s_[47:58, 20:50], np.s_[47:66, 39:50]):
        states[(*part, slice(BELOW + 1, None))] = FREE
    assert way(terrain_of(states, BEFORE), *BEHIND) is None


def test_unknown_floor_under_the_wheels_closes_a_door() -> None:
    states = with_door(11)
    states[WALL_X - 2 : WALL_X + 4, MIDDLE_Y + 2 : MIDDLE_Y + 4] = UNKNOWN
    states[WALL_X - 2 : WALL_X + 4, MIDDLE_Y - 6 : MIDDLE_Y - 1, : BELOW + 1] = UNKNOWN
    assert not terrain_of(states, BEFORE).passages


def test_where_there_is_room_the_robot_takes_the_way_round() -> None:
    states = with_door(11)
    states[WALL_X : WALL_X + 2, 45:68, BELOW + 1 :] = FREE
    states[WALL_X : WALL_X + 2, 45:68, BELOW] = OCCUPIED
    path = way(terrain_of(states, BEFORE), *BEHIND)
    assert path is not None and not path.straight.any()


def test_robot_inside_of_a_passage_has_both_ways_out() -> None:
    terrain = terrain_of(with_door(11), pose(WALL_X * RESOLUTION + 0.05, MIDDLE_Y * RESOLUTION + 0.05))
    for x in (1.5, 7.2):
        path = way(terrain, x, 2.8)
        assert path is not None and path.straight[:8].sum() >= 6
        assert np.abs(np.diff(np.sign(np.diff(path.points[3:12, 0])))).max() == 0


def test_rest_of_a_passage_begins_where_the_robot_stands_in_it() -> None:
    passage = Passage((3, 9), np.column_stack([np.linspace(0, 2, 21), np.zeros(21), np.zeros(21)]))
    rest = rest_from(passage.turned(), (1.21, 0.05, 0.0), 7)
    assert rest is not None and rest.nodes == (7, 3) and rest.line[0, 0] == pytest.approx(1.2) and rest.line[-1, 0] == 0.0
    assert rest_from(passage, (1.2, 0.5, 0.0), 7) is None and rest_from(passage, (2.3, 0.0, 0.0), 7) is None


def test_robot_on_a_deck_stands_in_no_passage_below_it() -> None:
    passage = Passage((3, 9), np.column_stack([np.linspace(0, 2, 21), np.zeros(21), np.zeros(21)]))
    assert rest_from(passage, (1.21, 0.05, 0.1), 7) is not None
    assert rest_from(passage, (1.21, 0.05, 1.6), 7) is None and rest_from(passage, (1.21, 0.05, -1.6), 7) is None


def unknown_behind(columns: int) -> np.ndarray:
    states = with_door(columns)
    states[95:] = UNKNOWN
    return states


def test_robot_stops_in_line_before_the_door_and_drives_in_from_there() -> None:
    runs = runs_of(unknown_behind(11))
    far = decide(Explorer(), runs, BEFORE)
    assert far.kind is DecisionKind.GOAL and not far.straight[:-1].any() and far.straight[-1]
    x, y, _, yaw = far.goal
    assert x < WALL_X * RESOLUTION - 1.0 and abs(yaw) < 0.1
    near = decide(Explorer(), runs, pose(x, y, yaw=yaw))
    assert near.kind is DecisionKind.GOAL and near.straight.any() and near.goal[0] > WALL_X * RESOLUTION + 1.0
    valid_in = partial(validity_in, min_voxels=FrontierConfig().min_voxels)
    assert valid_in(near.terrain, near) is Validity.VALID
    assert valid_in(near.terrain, replace(near, straight=None)) is Validity.PATH_BLOCKED
    blocked = with_door(11)
    blocked[WALL_X + 4, MIDDLE_Y - 1 : MIDDLE_Y + 1, BELOW:] = OCCUPIED
    assert valid_in(terrain_of(blocked, BEFORE), near) is Validity.PATH_BLOCKED


def test_robot_stops_once_more_before_the_second_door_of_a_path() -> None:
    first, second = 45, 85
    states = floor(nx=140)
    for wall in (first, second):
        for beside in (np.s_[: MIDDLE_Y - 5], np.s_[MIDDLE_Y + 6 :]):
            states[wall : wall + 2, beside, BELOW:] = OCCUPIED
    states[125:] = UNKNOWN
    planner, runs = Explorer(), runs_of(states)
    at, stops = BEFORE, []
    for _ in range(3):
        decision = decide(planner, runs, at)
        assert decision.kind is DecisionKind.GOAL
        x, y, _, yaw = decision.goal
        stops.append(x)
        at = pose(x, y, yaw=yaw)
    assert stops[0] < first * RESOLUTION < stops[1] < second * RESOLUTION < stops[2]


def test_no_goal_lies_inside_of_a_passage() -> None:
    goals = 0
    for last in range(WALL_X + 3, 105, 2):
        states = with_door(11, thick=8)
        states[last:] = UNKNOWN
        here = pose(2.0, MIDDLE_Y * RESOLUTION)
        decision = decide(Explorer(), runs_of(states), here)
        if decision.kind is DecisionKind.GOAL:
            goals += 1
            node = decision.terrain.surface_near(decision.goal[:3])
            assert decision.terrain.label[node] == TerrainClass.TRAVERSABLE
    assert goals


def test_way_to_a_given_goal_is_driven_up_to_the_passage_and_on_from_there() -> None:
    approach, path = Approach(ExplorationConfig(), CONFIG.trim_m), way(terrain_of(with_door(11), BEFORE), *BEHIND)
    part, yaw, is_whole = approach.towards(path, BEFORE, 1.0)
    assert not is_whole and len(part.points) - 1 == path.entries()[0] and yaw == pytest.approx(0.0, abs=0.1)
    x, y, z = part.points[-1]
    part, yaw, is_whole = approach.towards(path, pose(x, y, yaw=yaw), 1.0)
    assert is_whole and yaw == 1.0 and len(part.points) == len(path.points)
