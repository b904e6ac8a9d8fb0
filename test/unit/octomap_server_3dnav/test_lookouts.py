"""Looks from where the robot cannot turn: up a ramp of its own width, and out again where that leads nowhere."""

import math

import numpy as np
import pytest
from terrain_worlds import BELOW, OCCUPIED, RESOLUTION, UNKNOWN, decide, grid_of_heights, pose, runs_of, terrain_of
from virtual_explorer import explore

from octomap_server_3dnav.exploration.approach import Approach
from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.exploration.decision import DecisionKind
from octomap_server_3dnav.exploration.frontiers import FrontierConfig
from octomap_server_3dnav.exploration.lookouts import WayOut, find_lookouts
from octomap_server_3dnav.navigation.passages import TerrainSettings
from octomap_server_3dnav.navigation.planner import PlannerConfig, plan_into, plan_path
from octomap_server_3dnav.terrain.classified_terrain import Passage, TerrainClass

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


def dead_end(width=11, last_x=60, nx=70):
    """A room, and a corridor into its east wall that goes on unseen from column `last_x` on."""
    states = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, nx, 66)
    first = 32 - width // 2
    states[34:, :first, BELOW:] = states[34:, first + width :, BELOW:] = OCCUPIED
    states[last_x:, first : first + width] = UNKNOWN
    for edge in (np.s_[0], np.s_[-1]):
        states[edge, :, BELOW:] = states[:, edge, BELOW:] = OCCUPIED
    return states


def lookouts_in(states, least_m2=0.5):
    return find_lookouts(terrain_of(states, pose(1.2, 2.6)), FrontierConfig(least_lookout_gain_m2=least_m2), TerrainSettings())


@pytest.mark.parametrize("lookouts", [True, False])
def test_block_at_the_head_of_a_narrow_ramp_is_looked_at_from_the_ramp(lookouts):
    world = ramp_to_a_block(HEAD_X + 2.1, (1.9, 4.0))
    journey = explore(world, 1.2, 2.9, 0.0, Explorer(ExplorationConfig(lookouts=lookouts)))
    highest, last = max(T[2, 3] for T in journey.poses), journey.poses[-1]
    top = journey.known[int(HEAD_X / RESOLUTION) + 4 : int((HEAD_X + 1.8) / RESOLUTION), 30:44, BELOW + int(BLOCK_M / RESOLUTION)]
    assert journey.decisions[-1].kind is DecisionKind.EXPLORED and last[2, 3] < 0.3
    assert bool(highest > 0.5) is lookouts
    assert bool((top == OCCUPIED).mean() > 0.5) is lookouts


def test_robot_drives_straight_in_and_straight_out_again():
    journey = explore(ramp_to_a_block(HEAD_X + 2.1, (1.9, 4.0)), 1.2, 2.9, 0.0, Explorer(ExplorationConfig(lookouts=True)))
    on_ramp = [i for i, T in enumerate(journey.poses) if FOOT_X + 0.5 < T[0, 3] < HEAD_X and RAMP_Y[0] < T[1, 3] < RAMP_Y[1]]
    way_in, way_out = journey.decisions[on_ramp[0] - 1], journey.decisions[on_ramp[-1]]
    for decision in (way_in, way_out):
        high = decision.path[:, 2] > 0.2
        assert high.any() and decision.straight[:-1][high[:-1]].all()
        assert np.abs(decision.path[high, 1] - np.mean(RAMP_Y)).max() < 0.1
    assert way_out.goal[0] < FOOT_X and "out of" in way_out.reason


def test_lookout_is_the_middle_of_the_corridor_up_to_what_was_not_seen():
    (found,) = lookouts_in(dead_end())
    x, y, _ = found.line.T
    assert found.xyz[0] == pytest.approx(60.5 * RESOLUTION) and found.gain_m2 > 0.5
    assert np.abs(y - 32.5 * RESOLUTION).max() < 0.06 and x[-1] == pytest.approx(59.5 * RESOLUTION, abs=0.1)
    assert x[0] < 34 * RESOLUTION - TerrainSettings().robot.turning_radius_m
    way = found.way_in(1.0)
    assert way.line[-1, 0] == pytest.approx(x[-1] - 1.0, abs=0.09) and way.nodes == (found.nodes[0], found.nodes[len(way.line) - 1])
    assert found.way_in(10.0) is None


@pytest.mark.parametrize("states, least_m2", [(dead_end(width=8), 0.5), (dead_end(), 50.0), (dead_end(last_x=70), 0.5)])
def test_no_lookout_where_the_robot_does_not_fit_or_little_is_to_be_seen(states, least_m2):
    assert lookouts_in(states, least_m2) == []


def test_way_out_is_the_way_in_until_the_robot_can_turn():
    states, way_out = dead_end(), WayOut(TerrainSettings())
    way = lookouts_in(states)[0].way_in(1.0)
    inside, outside = terrain_of(states, pose(way.line[-1, 0], way.line[-1, 1])), terrain_of(states, pose(1.2, 2.6))
    assert way_out.from_inside(inside) is None and way_out.added_to(inside) is inside
    way_out.enter(way, outside)
    line = way_out.from_inside(inside)
    assert np.allclose(line[-1], way.line[0]) and math.dist(line[0, :2], way.line[-1, :2]) < 0.06
    (passage,) = way_out.added_to(inside).passages
    assert passage.nodes[0] == inside.start and inside.label[passage.nodes[1]] == TerrainClass.TRAVERSABLE
    assert way_out.added_to(outside) is outside and way_out.from_inside(inside) is not None  # a look at the map from elsewhere
    way_out.notice(inside, 0.0)
    assert not way_out.has_looked_from(way.line[-1])  # it is there
    way_out.notice(outside, 0.0)
    assert way_out.from_inside(inside) is None and way_out.has_looked_from(way.line[-1]) and not way_out.has_looked_from(way.line[0])


@pytest.mark.parametrize("yaw", [0.0, math.pi, 0.1, -0.1])
def test_robot_that_wakes_up_inside_leaves_straight_if_it_stands_in_line(yaw):
    x = 34 * RESOLUTION + 1.5
    decision = decide(Explorer(), runs_of(dead_end()), pose(x, 32.5 * RESOLUTION + 0.05, yaw=yaw))
    assert "out of" in decision.reason and decision.straight[:-1].all() and decision.goal[0] < 34 * RESOLUTION - 0.6
    assert np.abs(decision.path[:, 1] - 32.5 * RESOLUTION).max() < 0.1


def test_robot_that_wakes_up_inside_across_has_no_way_out():
    terrain, way_out = terrain_of(dead_end(), pose(34 * RESOLUTION + 1.5, 32.5 * RESOLUTION)), WayOut(TerrainSettings())
    way_out.notice(terrain, 1.2)
    assert way_out.from_inside(terrain) is None
    way_out.notice(terrain, 0.0)
    assert way_out.from_inside(terrain) is not None


def test_robot_beside_a_wall_is_not_inside():
    terrain, way_out = terrain_of(dead_end(), pose(1.2, 0.5)), WayOut(TerrainSettings())
    way_out.notice(terrain, 0.0)
    assert terrain.is_inside and way_out.from_inside(terrain) is None


def test_robot_that_goes_on_inside_comes_out_by_where_it_went_in():
    states, way_out = dead_end(), WayOut(TerrainSettings())
    (lookout,) = lookouts_in(states)
    way, aside = lookout.way_in(1.5), lookout.way_in(0.75)
    aside = Passage(aside.nodes, aside.line + [0.0, 0.1, 0.0])
    way_out.enter(way, terrain_of(states, pose(1.2, 2.6)))
    way_out.enter(aside, terrain_of(states, pose(way.line[-1, 0], way.line[-1, 1])))
    out = way_out.from_inside(terrain_of(states, pose(aside.line[-1, 0], aside.line[-1, 1])))
    assert math.dist(out[0, :2], aside.line[-1, :2]) < 0.09
    driven = out[:, 0] < way.line[-1, 0] - 0.05
    assert np.allclose(out[driven], way.line[::-1][-np.count_nonzero(driven) :])


def test_robot_inside_leaves_straight_although_there_is_ground_ahead_that_no_passage_leads_to():
    states, planner = dead_end(last_x=60, nx=82), Explorer(ExplorationConfig(lookouts=True, edge_trim_m=0.75))
    goal = decide(planner, runs_of(states), pose(1.2, 2.6)).goal
    decision = decide(planner, runs_of(states), pose(*goal[:2]))
    assert decision.goal[0] > 2.5 and decision.straight.any()  # in
    inside, known = pose(*decision.goal[:2]), dead_end(last_x=82, nx=82)
    known[60:77, 8:58], known[77:, :, BELOW:] = grid_of_heights(lambda x, y: 0.04 + 0 * x * y, 17, 50), OCCUPIED
    for jamb in (slice(8, 29), slice(36, 58)):
        known[58:60, jamb, BELOW:] = OCCUPIED  # too narrow to pass
    terrain = terrain_of(known, inside)
    assert terrain.centers(np.array([terrain.departure]))[0, 0] > 5.0 and not terrain.passages
    out = decide(planner, runs_of(known), inside)
    assert "out of" in out.reason and out.straight[:-1].all() and out.goal[0] < 2.5
    again = decide(planner, runs_of(states), inside)  # what was to be seen is unknown again: out all the same
    assert "out of" in again.reason
    assert np.ptp(out.path[:, 1]) < 0.1


@pytest.mark.parametrize("last_x, is_worth_it", [(63, True), (67, False)])
def test_robot_inside_goes_on_for_less_than_it_goes_in_for(last_x, is_worth_it):
    (seen,) = lookouts_in(dead_end())
    of = FrontierConfig(least_lookout_gain_m2=0.9 * seen.gain_m2)
    planner = Explorer(ExplorationConfig(edge_trim_m=0.75), frontier=of)
    assert decide(planner, runs_of(dead_end(last_x=last_x)), pose(1.2, 2.6)).kind is DecisionKind.EXPLORED
    goal = decide(planner, runs_of(dead_end()), pose(1.2, 2.6)).goal
    decide(planner, runs_of(dead_end()), pose(*goal[:2]))  # in
    decision = decide(planner, runs_of(dead_end(last_x=last_x)), pose(3.5, goal[1]))
    assert ("a look" in decision.reason) is is_worth_it and ("out of" in decision.reason) is not is_worth_it
    assert decide(planner, runs_of(dead_end(last_x=last_x)), pose(1.2, 2.6)).kind is DecisionKind.EXPLORED


def test_robot_goes_on_to_where_it_was_sent_to_look_until_that_was_seen_or_the_way_is_barred():
    (seen,) = lookouts_in(dead_end())
    of = FrontierConfig(least_lookout_gain_m2=0.9 * seen.gain_m2)
    less, barred = dead_end(last_x=61), dead_end(last_x=61)
    less[66:] = OCCUPIED  # less to see
    barred[44, :, BELOW:] = OCCUPIED
    for states, goes_on in ((less, True), (barred, False), (dead_end(last_x=70), False)):
        planner = Explorer(ExplorationConfig(edge_trim_m=0.75), frontier=of)
        assert decide(planner, runs_of(states), pose(1.2, 2.6)).kind is DecisionKind.EXPLORED
        first = decide(planner, runs_of(dead_end()), pose(1.2, 2.6))
        after = decide(planner, runs_of(states), pose(1.1, 2.6))
        assert (after.kind is DecisionKind.GOAL) is goes_on
        assert not goes_on or math.dist(after.goal[:2], first.goal[:2]) < 0.1


def test_path_out_is_driven_at_once_whichever_way_the_robot_faces():
    states, way_out = dead_end(), WayOut(TerrainSettings())
    way = lookouts_in(states)[0].way_in(1.0)
    way_out.enter(way, terrain_of(states, pose(1.2, 2.6)))
    T_map_base = pose(way.line[-1, 0], way.line[-1, 1])  # nose first
    terrain = way_out.added_to(terrain_of(states, T_map_base))
    path = plan_path(terrain, terrain.surface_near((1.2, 2.6, 0.04)), PlannerConfig())
    part, yaw, is_whole = Approach(ExplorationConfig(), PlannerConfig().trim_m).towards(path, T_map_base, 1.0)
    assert is_whole and yaw == 1.0 and len(part.points) == len(path.points)
    assert path.straight[0] and math.dist(path.points[0, :2], T_map_base[:2, 3]) < 0.1


@pytest.mark.parametrize(
    "yaw, aside_m, goes_on", [(0.0, 0.0, True), (0.3, 0.1, True), (1.0, 0.0, False), (math.pi, 0.0, False), (0.0, 0.5, False)]
)
def test_robot_on_its_way_in_goes_on_though_it_could_still_turn(yaw, aside_m, goes_on):
    (lookout,) = lookouts_in(dead_end())
    x, y = lookout.line[0, 0] + 0.6, lookout.line[0, 1] + aside_m
    assert not terrain_of(dead_end(), pose(x, y)).is_inside
    decision = decide(Explorer(), runs_of(dead_end()), pose(x, y, yaw=yaw))
    assert "a look at" in decision.reason
    assert bool(decision.path[:, 0].min() > x - 0.1) is goes_on
    assert bool(decision.goal[0] > x + 1.0) is goes_on


def test_robot_inside_goes_on_from_where_it_stands():
    (lookout,) = lookouts_in(dead_end())
    x, y, _ = lookout.line[np.argmin(np.abs(lookout.line[:, 0] - 3.5))]
    inside, outside = terrain_of(dead_end(), pose(x, y)), terrain_of(dead_end(), pose(1.2, 2.6))
    way = lookout.way_in(0.5)
    on, whole = plan_into(inside, way, 2.0, PlannerConfig()), plan_into(outside, way, 0.0, PlannerConfig())
    assert on.length_m == pytest.approx(way.line[-1, 0] - x, abs=0.05) and on.straight[:-1].all()
    assert whole.length_m > 2.0 and np.allclose(on.points[-1], whole.points[-1])
    assert not lookout.is_seen_from(outside, 5.0)
    left = lookout.line[-1, 0] - x
    assert lookout.is_seen_from(inside, left) and not lookout.is_seen_from(inside, left - 0.4)


@pytest.mark.parametrize("aside_m", [0.0, 0.03])
def test_way_out_leads_on_without_going_back_where_the_robot_was_sent_on_inside(aside_m):
    """The new way begins behind where the robot stands by the old one: the robot would go to and fro there."""
    states, way_out = dead_end(), WayOut(TerrainSettings())
    way = lookouts_in(states)[0].way_in(0.4)
    way_out.enter(way, terrain_of(states, pose(1.2, 2.6)))
    half = len(way.line) // 2
    on = Passage(way.nodes, np.concatenate([way.line[half - 1 : half] + [0.05, aside_m, 0.0], way.line[half + 1 :] + [0.0, aside_m, 0.0]]))
    inside = terrain_of(states, pose(float(way.line[half, 0]) + 0.01, float(way.line[half, 1])))
    way_out.enter(on, inside)
    out = way_out.from_inside(terrain_of(states, pose(float(way.line[-1, 0]), float(way.line[-1, 1]))))
    assert len(out) > half and (np.diff(out[:, 0]) < 0.0).all()
