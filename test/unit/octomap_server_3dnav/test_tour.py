"""Views by a tour: what is seen from where, from how near a place is looked at again, and which view comes first."""

import math

import numpy as np
import pytest
from terrain_worlds import BELOW, FREE, OCCUPIED, RESOLUTION, UNKNOWN, decide, opening, pose, room, runs_of, terrain_of

from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.exploration.decision import DecisionKind
from octomap_server_3dnav.exploration.frontiers import FrontierConfig, find_frontiers
from octomap_server_3dnav.exploration.sight import seen_distances
from octomap_server_3dnav.exploration.tour import Tour, TourConfig
from octomap_server_3dnav.navigation.planner import PlannerConfig

LEAST_M = ExplorationConfig().min_trim_m
EYE_M = TourConfig().eye_m


def tours(**config):
    return Tour(TourConfig(enabled=True, **config), LEAST_M, FrontierConfig().angle_weight_m_per_rad, PlannerConfig())


def frontiers_of(terrain, at):
    return find_frontiers(terrain, at, FrontierConfig(), PlannerConfig())


def with_gaps(*places, nx=90, ny=90):
    """A room whose wall at the end of x was not seen at some places along y, in voxels."""
    states = room(nx, ny)
    for place in places:
        states[-1, place - 6 : place + 6] = UNKNOWN
    return states


# -- sight


def seen(states, eye, target, reach_m=6.0, from_above=False):
    terrain = terrain_of(states, pose(1.5, 3.6))
    return float(seen_distances(terrain, np.array([eye]), np.array([target]), np.array([from_above]), reach_m)[0, 0])


def test_what_nothing_hides_is_seen_within_reach():
    assert seen(room(), (2.0, 3.6, EYE_M), (6.0, 3.6, 0.1)) == pytest.approx(4.0)
    assert seen(room(), (2.0, 3.6, EYE_M), (6.0, 3.6, 0.1), reach_m=3.9) == np.inf


def test_wall_hides_what_is_behind_it_and_a_low_one_only_what_is_near_it():
    states = room()
    states[50, :, BELOW:] = OCCUPIED
    assert seen(states, (2.0, 3.6, EYE_M), (6.0, 3.6, 0.1)) == np.inf
    states[50, :, BELOW + 5 :] = FREE  # 0.4 m high, 2 m from the eye
    assert seen(states, (2.0, 3.6, EYE_M), (4.6, 3.6, 0.1)) == np.inf
    assert seen(states, (2.0, 3.6, EYE_M), (6.8, 3.6, 0.1)) == pytest.approx(4.8)


def test_edge_of_a_deck_is_seen_from_above_only():
    states = room()
    assert seen(states, (2.0, 3.6, EYE_M), (4.0, 3.6, 1.2)) == pytest.approx(2.0)
    assert seen(states, (2.0, 3.6, EYE_M), (4.0, 3.6, 1.2), from_above=True) == np.inf
    assert seen(states, (2.0, 3.6, EYE_M), (4.0, 3.6, 0.1), from_above=True) == pytest.approx(2.0)


# -- from how near


def reach_after(at, *stands, **config):
    """How near the gap in the wall, at (7.1, 3.6), has to be looked at after sweeps from some stands."""
    terrain = terrain_of(with_gaps(45), at)
    (frontier,) = frontiers_of(terrain, at)
    return float(tours(**config).reaches_m([frontier], terrain, np.array([pose(*stand) for stand in stands]))[0])


def test_place_that_stays_is_looked_at_from_ever_nearer_and_then_no_more():
    at = pose(1.5, 3.6)
    assert reach_after(at, (0.9, 3.6)) == TourConfig().range_m  # 6.2 m away: nobody saw it yet
    assert reach_after(at, (2.1, 3.6)) == pytest.approx(TourConfig().nearer * 5.0, abs=0.1)
    assert reach_after(at, (2.1, 3.6), (4.1, 3.6), (3.1, 3.6)) == pytest.approx(TourConfig().nearer * 3.0, abs=0.1)
    assert reach_after(at, (5.7, 3.6)) == pytest.approx(TourConfig().nearer * 1.4, abs=0.1)
    assert reach_after(at, (6.2, 3.6)) == 0.0


def test_place_that_no_look_changes_ends_the_exploration_set_aside():
    explorer, at, before = Explorer(tour=TourConfig(enabled=True)), pose(2.0, 3.6), []
    for _ in range(6):
        decision = decide(explorer, runs_of(with_gaps(45)), at, earlier=before)
        if decision.kind is not DecisionKind.GOAL:
            break
        before.append(at)
        at = pose(*decision.goal[:2], yaw=decision.goal[3])
    assert decision.kind is DecisionKind.EXPLORED and decision.set_aside == 1
    assert LEAST_M <= math.dist(at[:2, 3], (7.16, 3.6)) <= LEAST_M / TourConfig().nearer + 0.1


# -- which view


def test_view_shows_several_places_at_once_and_keeps_off_floor_that_was_not_seen():
    at = pose(0.9, 3.6)
    terrain = terrain_of(with_gaps(30, 45, 60), at)
    frontiers = frontiers_of(terrain, at)
    view = tours().first_view(frontiers, terrain, at, np.full(len(frontiers), 3.0))
    assert (len(frontiers), view.shown, view.views) == (3, 3, 1)
    x, y = terrain.centers(np.array([view.node]))[0, :2]
    assert all(LEAST_M <= math.dist((x, y), f.xyz[:2]) <= 3.0 for f in frontiers)
    assert view.way_m == pytest.approx(x - 0.9, abs=0.8)  # and so far away it is


def test_places_that_no_view_shows_together_take_a_view_each():
    at = pose(3.6, 3.6)
    states = with_gaps(20)
    states[0, 64:76] = UNKNOWN  # at the other end
    terrain = terrain_of(states, at)
    frontiers = frontiers_of(terrain, at)
    view = tours().first_view(frontiers, terrain, at, np.full(len(frontiers), 2.0))
    assert (len(frontiers), view.shown, view.views) == (2, 1, 2)


def test_robot_looks_first_where_it_faces():
    states = with_gaps(45)
    states[0, 39:51] = UNKNOWN
    for yaw, ahead in ((0.0, 7.16), (math.pi, 0.04)):
        at = pose(3.6, 3.6, yaw=yaw)
        terrain = terrain_of(states, at)
        frontiers = frontiers_of(terrain, at)
        view = tours().first_view(frontiers, terrain, at, np.full(len(frontiers), 2.0))
        assert view.frontier.xyz[0] == pytest.approx(ahead, abs=0.1)


def test_nothing_that_can_be_shown_is_no_view():
    at = pose(3.6, 3.6)
    terrain = terrain_of(with_gaps(45), at)
    frontiers = frontiers_of(terrain, at)
    assert tours().first_view(frontiers, terrain, at, np.zeros(len(frontiers))) is None
    assert tours().first_view([], terrain, at, np.empty(0)) is None


def test_goal_is_the_whole_map_s_first_view_with_the_heading_of_arrival():
    decision = decide(Explorer(tour=TourConfig(enabled=True)), runs_of(opening(room())), pose(2.0, 2.0))
    assert decision.kind is DecisionKind.GOAL and decision.scope == "global" and decision.reason.startswith("view 1 of 1")
    (ax, ay), (bx, by) = decision.path[[-4, -1], :2]
    assert decision.goal[3] == pytest.approx(math.atan2(by - ay, bx - ax))
    assert decision.path[-1] == pytest.approx(decision.goal[:3])
    assert LEAST_M <= math.dist(decision.frontier[:2], decision.goal[:2]) <= TourConfig().nearer * 5.4


def test_robot_that_was_sent_to_where_a_passage_begins_goes_on_through_it():
    states = room(120, 70)
    states[60, :, BELOW:] = OCCUPIED
    states[60, 30:42, BELOW + 1 :] = FREE  # a door of 0.96 m
    states[-1, 20:50] = UNKNOWN
    explorer, at = Explorer(tour=TourConfig(enabled=True, range_m=3.0)), pose(1.5, 2.0)
    to_the_door = decide(explorer, runs_of(states), at)
    assert to_the_door.frontier[0] > 9.0 and to_the_door.goal[0] < 60 * RESOLUTION
    states[30:50, 0] = UNKNOWN  # something else turns up, beside the robot
    there = pose(*to_the_door.goal[:2], yaw=to_the_door.goal[3])
    assert decide(Explorer(tour=TourConfig(enabled=True, range_m=3.0)), runs_of(states), there, earlier=[at]).frontier[1] < 0.5
    on = decide(explorer, runs_of(states), there, earlier=[at])
    assert on.frontier[0] > 9.0 and on.straight is not None and on.straight.any()


def test_wrong_configuration_is_refused():
    with pytest.raises(ValueError, match="nearer"):
        Explorer(tour=TourConfig(nearer=1.5))
