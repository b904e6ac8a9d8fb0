"""What becomes of a sweep: every state of the exploration, and every way from one to another, without ROS (thesis algorithm 3, 6.2.2)."""

import math
import pickle

import numpy as np
import pytest
from terrain_worlds import BELOW, OCCUPIED, UNKNOWN, opening, pose, room, runs_of

from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.decide import Explorer, State
from octomap_server_3dnav.exploration.decision import Decision, DecisionKind
from octomap_server_3dnav.exploration.observation import Observation, SweepOutcome
from octomap_server_3dnav.navigation.passages import navigable_terrain
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.terrain.classified_terrain import Terrain

GOAL, KEEP, LOOK = DecisionKind.GOAL, DecisionKind.KEEP, DecisionKind.LOOK
EXPLORED, TRAPPED = DecisionKind.EXPLORED, DecisionKind.TRAPPED
MATCHED, REFUSED, UNPLACED, LOST = SweepOutcome.MATCHED, SweepOutcome.REFUSED, SweepOutcome.UNPLACED, SweepOutcome.LOST
AT, ON = (2.0, 2.0), (2.4, 2.2)  # where the robot starts, and a bit on


class Run:
    """An explorer, and what it was told: every sweep that came into the map is a vertex."""

    def __init__(self, world: np.ndarray, **config: int) -> None:
        self.explorer = Explorer(ExplorationConfig(**config))
        self.runs: ColumnRuns = runs_of(world)
        self.poses: list[np.ndarray] = []
        self.asked: list[float | None] = []

    def sweep(self, at: tuple[float, ...] = AT, outcome: SweepOutcome = MATCHED, **told: object) -> Decision:
        here = pose(*at)
        self.asked.clear()

        def terrain_within(radius_m: float | None) -> Terrain:
            self.asked.append(radius_m)
            return navigable_terrain(self.runs, here, self.explorer.terrain_settings, radius_m)

        self.poses += [here] if outcome in (MATCHED, REFUSED) else []
        poses = np.array([*self.poses, *([] if outcome in (MATCHED, REFUSED) else [here])])
        return self.explorer.step(Observation(outcome, poses, terrain_within, **told))

    @property
    def state(self) -> State:
        return self.explorer.state


def under_way() -> Run:
    run = Run(opening(room()))
    assert run.state is State.STARTING
    assert run.sweep().kind is GOAL and run.state is State.UNDER_WAY
    return run


def retreating() -> tuple[Run, Decision]:
    run = under_way()
    run.sweep((3.0, 2.0), REFUSED, on_the_way=True)
    back = run.sweep((4.0, 2.0), REFUSED, on_the_way=True)
    assert run.state is State.RETREATING
    return run, back


# -- starting


def test_first_sweep_chooses_among_what_is_near():
    run = Run(opening(room()))
    decision = run.sweep()
    assert (decision.kind, decision.scope, run.asked) == (GOAL, "local", [6.0])


def test_whole_map_is_asked_for_when_nothing_is_near_and_the_next_search_begins_near_again():
    run = Run(opening(room(150, 60)))
    far = run.sweep((1.6, 2.0))
    assert (far.kind, far.scope, run.asked, run.state) == (GOAL, "global", [6.0, None], State.UNDER_WAY)
    assert run.sweep((9.0, 2.4)).scope == "local" and run.asked == [6.0]


def test_closed_room_is_explored_at_once():
    run = Run(room())
    assert run.sweep().kind is EXPLORED and run.state is State.EXPLORED and run.asked == [6.0, None]


def test_robot_in_a_closet_is_trapped():
    closet = room()
    closet[[20, 34], 20:35, BELOW:] = closet[20:35, [20, 34], BELOW:] = OCCUPIED
    run = Run(closet)
    decision = run.sweep((2.2, 2.2))
    assert decision.kind is TRAPPED and run.state is State.TRAPPED and "near" in decision.reason and decision.path is None


def behind_posts() -> np.ndarray:
    """A hall with posts across it that the robot does not fit between, and floor that ends unseen a metre behind them."""
    hall = room(150, 60)
    hall[120:, 1:-1] = UNKNOWN
    for k in range(8):
        hall[106:108, 3 + 7 * k : 5 + 7 * k, BELOW : BELOW + 8] = OCCUPIED
    return hall


def test_floor_that_no_way_leads_to_is_looked_at_from_the_nearest_ground_unless_the_robot_was_there() -> None:
    run = Run(behind_posts())
    decision = run.sweep((1.6, 2.4))
    assert decision.kind is GOAL and decision.goal is not None and 6.5 < decision.goal[0] < 8.4
    assert run.sweep(decision.goal[:2]).kind is EXPLORED
    passed = Run(behind_posts())
    passed.poses.append(pose(*decision.path[-1, :2]))
    assert passed.sweep((1.6, 2.4)).kind is EXPLORED
    assert Run(behind_posts(), lookouts=False).sweep((1.6, 2.4)).kind is EXPLORED


# -- under way


def test_plan_is_kept_at_a_sweep_on_the_way():
    run = Run(opening(room()))
    first = run.sweep()
    kept = run.sweep(ON, on_the_way=True)
    assert kept.kind is KEEP and run.state is State.UNDER_WAY and run.asked == [6.0]
    assert kept.path is first.path and kept.goal == first.goal and kept.frontier == first.frontier and kept.scope == "local"
    assert run.sweep(ON, on_the_way=True).kind is KEEP


@pytest.mark.parametrize("off_m", [0.6, -0.6])
def test_robot_on_its_way_that_finds_no_ground_beneath_looks_once_more_and_drives_nowhere_without(off_m: float):
    run = under_way()
    decision = run.sweep((*ON, off_m), on_the_way=True)
    assert (decision.kind, decision.path, run.asked) == (LOOK, None, [6.0]) and "no ground beneath the robot" in decision.reason
    assert run.sweep((*ON, off_m)).kind is TRAPPED
    found = under_way()
    found.sweep((*ON, off_m), on_the_way=True)
    assert found.sweep(ON).kind is GOAL and found.state is State.UNDER_WAY


def test_new_goal_is_chosen_at_the_goal():
    assert under_way().sweep(ON).kind is GOAL


@pytest.mark.parametrize("what", ["path blocked", "frontier gone"])
def test_plan_that_does_not_hold_any_more_is_dropped_on_the_way(what):
    run, world = under_way(), opening(room())
    world[55, 10:70, BELOW:] = OCCUPIED  # across the way
    run.runs = runs_of(world if what == "path blocked" else room())
    decision = run.sweep(ON, on_the_way=True)
    assert decision.kind is (GOAL if what == "path blocked" else EXPLORED)


@pytest.mark.parametrize("ahead_m", [0.3, 0.56, 0.8])
def test_wall_that_appears_before_the_robot_is_driven_around_by_a_way_that_keeps_off_it(ahead_m):
    run, world = under_way(), opening(room())
    x = int((ON[0] + ahead_m) / 0.08)
    world[x : x + 2, 30:50, BELOW:] = OCCUPIED  # 1.6 m of it, across the way
    run.runs = runs_of(world)
    around = run.sweep(ON, on_the_way=True)
    assert around.kind is GOAL and around.path is not None
    beside = np.clip(around.path[:, :2], [x * 0.08, 30 * 0.08], [(x + 2) * 0.08, 50 * 0.08])
    off_m = np.linalg.norm(around.path[:, :2] - beside, axis=1)
    assert off_m.min() >= off_m[0] - 0.05 and off_m[len(off_m) // 3 :].min() > 0.4
    assert run.sweep(ON, on_the_way=True).kind is KEEP


def test_failed_drive_is_counted_against_its_frontier_until_that_is_set_aside():
    run = under_way()
    assert run.sweep(ON, drive_failure="blocked", on_the_way=True).kind is GOAL  # and not kept
    decision = run.sweep(ON, drive_failure="stuck")
    assert decision.kind is EXPLORED and run.state is State.EXPLORED and decision.set_aside == 1
    assert "2 tries: stuck" in run.explorer.set_aside()[0][1]


def test_sweep_that_is_not_in_the_map_leaves_the_plan():
    run = under_way()
    assert run.sweep(ON, UNPLACED, on_the_way=True).kind is KEEP


# -- sweeps that were not placed


def test_third_sweep_in_a_row_that_is_not_in_the_map_ends_the_run_whatever_the_plan():
    run = under_way()
    kinds = [run.sweep(ON, UNPLACED, on_the_way=True, trouble="too few points").kind for _ in range(2)]
    decision = run.sweep(ON, UNPLACED, on_the_way=True, trouble="too few points")
    assert kinds == [KEEP, KEEP] and decision.kind is TRAPPED and run.state is State.TRAPPED
    assert decision.reason == "3 sweeps in a row could not be placed in the map" and decision.path is None


def test_sweep_that_was_placed_ends_the_row():
    run = under_way()
    for outcome in (UNPLACED, UNPLACED, MATCHED, UNPLACED, UNPLACED):
        assert run.sweep(ON, outcome).kind is GOAL


def test_robot_that_is_lost_looks_again_and_is_trapped_with_the_reason_after_the_third_sweep_and_nobody_asks_for_terrain():
    run = under_way()
    for _ in range(2):
        decision = run.sweep(ON, LOST, trouble="not found in the map")
        assert (decision.kind, decision.reason, decision.path, run.asked) == (LOOK, "not found in the map", None, [])
    decision = run.sweep(ON, LOST, trouble="not found in the map")
    assert (decision.kind, run.state, run.asked) == (TRAPPED, State.TRAPPED, [])
    assert decision.reason == "3 sweeps in a row could not be placed in the map; not found in the map"
    assert decision.terrain is None and decision.path is None


def test_robot_that_was_displaced_and_found_itself_chooses_anew_from_where_it_is():
    run = under_way()
    run.sweep(ON, LOST, trouble="not found in the map")
    assert run.sweep(ON, on_the_way=False).kind is GOAL


# -- retreating


def test_second_refused_sweep_in_a_row_sends_the_robot_back_to_the_last_that_matched():
    run, back = retreating()
    assert back.kind is GOAL and math.dist(back.goal[:2], AT) < 0.2 and "back" in back.reason


def test_first_refused_sweep_on_the_way_leaves_the_plan():
    run = under_way()
    assert run.sweep(ON, REFUSED, on_the_way=True).kind is KEEP and run.state is State.UNDER_WAY


def test_retreat_is_decided_anew_at_every_sweep_and_is_over_with_one_that_matches():
    run, _ = retreating()
    assert run.sweep((3.5, 2.0), REFUSED, on_the_way=True).kind is GOAL and run.state is State.RETREATING
    onward = run.sweep((3.0, 2.0), MATCHED, on_the_way=True)
    assert onward.kind is GOAL and run.state is State.UNDER_WAY and "frontier" in onward.reason


def test_drive_that_fails_in_retreat_sets_no_frontier_aside():
    run, _ = retreating()
    run.sweep((4.0, 2.0), REFUSED, drive_failure="blocked")
    assert run.explorer.set_aside() == [] and run.state is State.RETREATING


@pytest.mark.parametrize("is_overruled", [False, True])
def test_goals_that_somebody_else_came_before_are_not_tried(is_overruled):
    """A person's goals, each with a sweep at its end, while exploration is paused: its frontiers are there still."""
    run = Run(opening(room()))
    run.sweep(AT)
    for k in range(8):
        if is_overruled:
            run.explorer.overrule()
        run.sweep((AT[0] + 0.1 * (k % 3), AT[1]))
    assert bool(run.explorer.set_aside()) != is_overruled and (run.state is State.UNDER_WAY) == is_overruled


def test_retreat_whose_drives_fail_is_given_up_until_a_sweep_matches():
    run, _ = retreating()
    for _ in range(2):
        decision = run.sweep((4.0, 2.0), REFUSED, drive_failure="blocked")
    assert run.state is State.UNDER_WAY and "frontier" in decision.reason and run.explorer.set_aside() == []
    run.sweep((4.0, 2.0), MATCHED)
    run.sweep((4.5, 2.0), REFUSED)
    run.sweep((5.0, 2.0), REFUSED)
    assert run.state is State.RETREATING


def test_robot_that_no_way_leads_back_explores_on():
    run, world = under_way(), opening(room())
    world[45, :, BELOW:] = OCCUPIED  # a wall between
    run.runs = runs_of(world)
    run.sweep((4.8, 3.0), REFUSED)
    decision = run.sweep((5.0, 3.0), REFUSED)
    assert decision.kind is GOAL and "frontier" in decision.reason and run.state is State.UNDER_WAY


def test_sweeps_of_an_earlier_session_count_for_the_retreat_until_the_map_begins_anew():
    run = Run(opening(room()))
    run.poses = [pose(2.0, 4.0)]
    run.explorer.know_sweep(0, True)
    run.sweep((3.0, 4.0), REFUSED)
    assert math.dist(run.sweep((4.0, 4.0), REFUSED).goal[:2], (2.0, 4.0)) < 0.2
    run.explorer.forget_sweeps()
    run.poses.clear()
    run.sweep((3.0, 4.0), REFUSED)
    assert "frontier" in run.sweep((4.0, 4.0), REFUSED).reason


# -- the end, and after it


def test_explored_robot_goes_on_when_there_is_something_to_see_again():
    run = Run(room())
    run.sweep()
    run.runs = runs_of(opening(room()))
    assert run.sweep(on_the_way=True).kind is GOAL and run.state is State.UNDER_WAY


def test_trapped_robot_goes_on_when_a_sweep_was_placed_again():
    run = under_way()
    for _ in range(3):
        run.sweep(ON, LOST, trouble="not found")
    assert run.state is State.TRAPPED
    assert run.sweep(ON).kind is GOAL and run.state is State.UNDER_WAY


def test_poses_that_are_none_are_refused_and_nothing_is_changed():
    run = under_way()
    bad = pose(*ON)
    bad[0, 3] = np.nan
    with pytest.raises(ValueError):
        run.explorer.step(Observation(UNPLACED, bad[None], lambda radius: None))
    assert run.state is State.UNDER_WAY
    assert run.sweep(ON, UNPLACED, on_the_way=True).kind is KEEP and run.sweep(ON, UNPLACED, on_the_way=True).kind is KEEP


def test_frontiers_that_no_path_leads_to_are_no_goal():
    world = room()
    world[60:62, :, BELOW:] = OCCUPIED
    world[-1, 30:50] = UNKNOWN
    run = Run(world)
    assert run.sweep().kind is EXPLORED


def test_explorer_that_was_kept_keeps_its_plan_what_it_set_aside_and_its_home():
    run, other = under_way(), under_way()
    other.explorer = pickle.loads(pickle.dumps(other.explorer))
    for r in (run, other):
        assert r.sweep(ON, on_the_way=True).kind is KEEP
        for _ in range(12):
            r.sweep(ON, drive_failure="stuck")
    assert run.explorer.set_aside() and other.explorer.set_aside() == run.explorer.set_aside()
    assert other.state is run.state
