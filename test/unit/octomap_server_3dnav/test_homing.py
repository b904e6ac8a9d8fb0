"""Going home: when somebody asks, at the end, and when the budget needs it; and what is told where home cannot be reached."""

import math

import numpy as np
import pytest
from terrain_worlds import BELOW, OCCUPIED, opening, pose, room, runs_of

from octomap_server_3dnav.exploration.budget import Budget
from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.decide import Errand, Explorer, State
from octomap_server_3dnav.exploration.decision import Decision, DecisionKind
from octomap_server_3dnav.exploration.observation import Observation, SweepOutcome
from octomap_server_3dnav.navigation.passages import navigable_terrain

GOAL, KEEP, EXPLORED = DecisionKind.GOAL, DecisionKind.KEEP, DecisionKind.EXPLORED
ENDED, WAIT = DecisionKind.ENDED, DecisionKind.WAIT
HOME, AWAY = (2.0, 2.0, 0.7), (5.0, 4.5, 0.0)  # x, y, yaw


class Run:
    """A robot that is put somewhere for each sweep; `s` and `m` go on by what it is told."""

    def __init__(self, world: np.ndarray | None = None, *, explores: bool = True, **config: object) -> None:
        self.explorer = Explorer(ExplorationConfig(**config), explores=explores)  # type: ignore[arg-type]
        self.runs = runs_of(opening(room()) if world is None else world)
        self.poses: list[np.ndarray] = []
        self.s = self.m = self.height_m = 0.0

    def sweep(self, at: tuple[float, float, float], *, s: float = 0.0, m: float = 0.0, **told: object) -> Decision:
        self.s, self.m = self.s + s, self.m + m
        here = pose(*at[:2], self.height_m, at[2])
        self.poses.append(here)
        within = lambda radius_m: navigable_terrain(self.runs, here, self.explorer.terrain_settings, radius_m)  # noqa: E731
        told = {"elapsed_s": self.s, "driven_m": self.m, **told}
        return self.explorer.step(Observation(SweepOutcome.MATCHED, np.array(self.poses), within, **told))  # type: ignore[arg-type]


def sent_home(**config: object) -> Run:
    run = Run(**config)
    run.sweep(HOME)
    run.explorer.ask(Errand.HOME, "asked for")
    return run


def test_robot_that_is_asked_home_is_led_to_the_place_and_heading_of_its_first_sweep() -> None:
    run = sent_home()
    decision = run.sweep(AWAY)
    assert (decision.kind, run.explorer.state, decision.exact) == (GOAL, State.GOING_HOME, True)
    assert decision.goal is not None and "going home" in decision.reason and "asked for" in decision.reason
    np.testing.assert_allclose((*decision.goal[:2], decision.goal[3]), HOME, atol=1e-6)


def test_home_moves_with_the_map() -> None:
    run = sent_home()
    run.poses[0] = pose(2.3, 2.1, yaw=0.6)  # a loop was closed
    decision = run.sweep(AWAY)
    assert decision.goal is not None
    np.testing.assert_allclose((*decision.goal[:2], decision.goal[3]), (2.3, 2.1, 0.6), atol=1e-6)


def test_home_of_a_session_that_goes_on_is_where_it_was_begun_this_time() -> None:
    run = Run()
    run.poses = [pose(6.0, 6.0)]  # of the session before
    run.sweep(HOME)
    run.explorer.ask(Errand.HOME, "asked for")
    decision = run.sweep(AWAY)
    assert decision.goal is not None
    np.testing.assert_allclose(decision.goal[:2], HOME[:2], atol=1e-6)


def test_path_is_kept_at_each_sweep_on_the_way_and_at_home_the_robot_waits() -> None:
    run = sent_home()
    first = run.sweep(AWAY)
    kept = run.sweep((3.0, 3.0, 1.0), on_the_way=True, at_goal=False)
    assert kept.kind is KEEP and kept.path is first.path and kept.exact
    there = run.sweep((2.1, 2.05, 0.75))
    assert (there.kind, run.explorer.state, there.path) == (WAIT, State.HOME, None)
    assert "home, 0.11 m and 0.05 rad from the start" in there.reason


def test_robot_on_its_way_home_that_finds_no_ground_beneath_looks_once_more() -> None:
    run = sent_home()
    run.sweep(AWAY)
    run.height_m = 0.6
    decision = run.sweep((3.0, 3.0, 1.0), on_the_way=True, at_goal=False)
    assert (decision.kind, decision.path, run.explorer.state) == (DecisionKind.LOOK, None, State.GOING_HOME)
    run.height_m = 0.0
    assert run.sweep((3.0, 3.0, 1.0), at_goal=False).kind is GOAL


def test_path_on_the_way_home_that_is_blocked_or_whose_end_has_moved_is_planned_anew() -> None:
    run = sent_home()
    run.sweep(AWAY)
    world = opening(room())
    world[38:42, 35:45, BELOW + 1 :] = OCCUPIED
    run.runs = runs_of(world)
    assert run.sweep((4.2, 4.0, -2.4), on_the_way=True, at_goal=False).kind is GOAL
    run.poses[0] = pose(2.3, 2.1, yaw=0.7)  # a loop was closed
    again = run.sweep((4.2, 4.0, -2.4), on_the_way=True, at_goal=False)
    assert again.kind is GOAL and again.goal is not None
    np.testing.assert_allclose(again.goal[:2], (2.3, 2.1), atol=1e-6)


def test_robot_that_drives_by_is_not_home_yet_and_what_it_saw_before_it_stood_is_no_failure() -> None:
    run = sent_home()
    run.sweep(AWAY)
    for _ in range(5):
        assert run.sweep((2.3, 2.0, 0.7), on_the_way=True, stands=False, at_goal=False).kind is KEEP
        assert run.sweep((2.1, 2.0, 0.7), on_the_way=True, stands=False, at_goal=False).kind is KEEP
        assert run.sweep((2.3, 2.0, 0.7), stands=False, at_goal=False).kind is GOAL
    assert run.sweep((2.1, 2.0, 0.7)).kind is WAIT


def test_robot_that_is_stopped_on_its_way_home_has_not_failed_to_come_there() -> None:
    run = sent_home()
    for _ in range(5):  # paused and resumed, or taken over by joystick
        assert run.sweep(AWAY, at_goal=False).kind is GOAL
    assert run.sweep(HOME).kind is WAIT


@pytest.mark.parametrize("at", [(2.2, 2.0, 0.7), (2.0, 2.0, 1.0)])
def test_beside_home_or_turned_away_is_not_home_and_another_drive_leads_there(at: tuple[float, float, float]) -> None:
    run = sent_home()
    run.sweep(AWAY)
    assert run.sweep(at).kind is GOAL
    assert run.sweep(HOME).kind is WAIT


def test_robot_that_comes_no_nearer_says_so_and_stays() -> None:
    run = sent_home()
    run.sweep(AWAY)
    run.sweep((2.3, 2.0, 0.7))
    last = run.sweep((2.3, 2.0, 0.7))
    assert last.kind is WAIT and "not home, 0.30 m and 0.00 rad from the start" in last.reason


def test_drives_that_fail_on_the_way_home_end_it_with_the_reason_but_not_those_before() -> None:
    run = sent_home(max_failures=2)
    assert run.sweep(AWAY, drive_failure="of exploration").kind is GOAL
    assert run.sweep(AWAY, drive_failure="a box").kind is GOAL
    last = run.sweep(AWAY, drive_failure="a box still")
    assert last.kind is WAIT and "not home" in last.reason and "a box still" in last.reason


def test_drives_that_failed_far_apart_on_the_way_home_do_not_end_it() -> None:
    run = Run(opening(room(300, 60)), max_failures=2)
    run.sweep(HOME)
    run.explorer.ask(Errand.HOME, "asked for")
    run.sweep((22.0, 2.0, 3.1))
    for x in (18.0, 12.0, 6.0, 4.0):
        assert run.sweep((x, 2.0, 3.1), drive_failure="a person").kind is GOAL
    assert run.sweep((4.0, 2.0, 3.1), drive_failure="a person still").kind is WAIT


def test_goals_that_somebody_gave_on_the_way_home_are_no_failures_to_come_there() -> None:
    run = sent_home()
    run.sweep(AWAY)
    for _ in range(5):
        run.explorer.overrule()
        assert run.sweep(AWAY).kind is GOAL
    assert run.sweep(HOME).kind is WAIT


def with_a_door() -> np.ndarray:
    """Home on one side, and where it is told to go home from on the other, or before the door."""
    states = room(120, 90)
    states[55:57, :30, BELOW + 1 :] = states[55:57, 41:, BELOW + 1 :] = OCCUPIED
    return states


BEYOND = (8.0, 2.8, 3.14)


def test_way_home_through_a_door_is_driven_up_to_it_and_on_from_there_also_backward() -> None:
    """Where it could not turn before the door, it drives backward; a path from beside the door would lead it out again."""
    run = Run(with_a_door())
    run.sweep(HOME)
    run.explorer.ask(Errand.HOME, "asked for")
    before = run.sweep(BEYOND)
    assert before.goal is not None and not before.exact and before.goal[0] > 57 * 0.08
    x, y = before.goal[:2]
    on = run.sweep((x, y, 0.0))
    assert (on.kind, on.exact) == (GOAL, True)
    for _ in range(4):
        x -= 0.3
        assert run.sweep((x, y, 0.0), on_the_way=True, at_goal=False).kind is KEEP


def test_part_of_the_way_that_is_reached_and_brings_the_robot_no_nearer_is_a_drive_that_failed() -> None:
    run = Run(with_a_door(), max_failures=2)
    run.sweep(HOME)
    run.explorer.ask(Errand.HOME, "asked for")
    for _ in range(3):  # what it hears is that it is there; the sweep says that it is not
        decision = run.sweep(BEYOND)
        assert decision.kind is GOAL and not decision.exact
    last = run.sweep(BEYOND)
    assert last.kind is WAIT and "no nearer after another drive" in last.reason


def test_home_that_is_walled_in_is_come_as_near_to_as_the_ground_allows() -> None:
    run = sent_home()
    world = opening(room())
    world[15:36, [15, 35], BELOW:] = world[[15, 35], 15:36, BELOW:] = OCCUPIED  # 1.6 m around home
    run.runs = runs_of(world)
    decision = run.sweep(AWAY)
    assert decision.kind is GOAL and decision.goal is not None
    off = math.dist(decision.goal[:2], HOME[:2])
    assert 0.8 < off < 2.2
    run.sweep((*decision.goal[:2], decision.goal[3]))
    last = run.sweep((*decision.goal[:2], decision.goal[3]))
    assert last.kind is WAIT and "not home" in last.reason


def test_at_the_end_of_exploration_the_robot_goes_home_only_if_it_is_told_to() -> None:
    assert (stays := Run(room(), at_end="stay")).sweep(AWAY).kind is EXPLORED and stays.explorer.state is State.EXPLORED
    run = Run(opening(room()), at_end="home")
    run.sweep(HOME)
    run.runs = runs_of(room())
    back = run.sweep(AWAY)
    assert back.kind is GOAL and back.goal is not None and "no reachable frontier" in back.reason
    there = run.sweep(HOME)
    assert there.kind is EXPLORED and there.reason.startswith("no reachable frontier") and "; home, " in there.reason


def test_somebody_ends_exploration_here_or_at_home() -> None:
    run = sent_home()
    run.explorer.ask(Errand.END, "told to stop")
    assert (run.sweep(AWAY).kind, run.explorer.state) == (ENDED, State.ENDED)
    run = sent_home(at_end="home")
    run.explorer.ask(Errand.END, "told to stop")
    assert run.explorer.is_going_home
    assert (run.sweep(AWAY).kind, run.sweep(HOME).kind) == (GOAL, ENDED)


@pytest.mark.parametrize("where", [AWAY, HOME])
def test_robot_that_is_told_to_explore_does_so_on_the_way_home_and_there(where: tuple[float, float, float]) -> None:
    run = sent_home()
    run.sweep(where)
    run.explorer.ask(Errand.EXPLORE, "")
    assert not run.explorer.is_going_home
    decision = run.sweep(where)
    assert decision.kind is GOAL and decision.reason.startswith("frontier") and run.explorer.state is State.UNDER_WAY


# -- budget


def test_without_a_budget_time_and_way_do_not_matter() -> None:
    run = Run()
    run.sweep(HOME)
    assert "frontier" in run.sweep(AWAY, s=1e6, m=1e5).reason


@pytest.mark.parametrize(
    ("budget", "goes_on"),
    [({"budget_m": 17.5}, True), ({"budget_m": 15.5}, False), ({"budget_s": 175.0}, True), ({"budget_s": 155.0}, False)],
)
def test_way_home_and_twice_the_dearest_leg_are_kept(budget: dict[str, float], goes_on: bool) -> None:
    """Driven 4 m in 40 s in one leg, the way home is 4.0 to 4.3 m: 4 + 4 + 2 * 4, and ten times as many seconds."""
    run = Run(**budget)
    run.sweep(HOME)
    assert run.sweep(AWAY, s=40.0, m=4.0).reason.startswith("frontier") == goes_on


def test_what_the_first_sweep_took_is_kept_for_the_last() -> None:
    """A first sweep of 30 s, then 2 m in 20 s, and the way back: 30 + 20 + 2 * 20 / 2 + 2 * 20 + 30 = 140."""
    for budget_s, goes_on in ((150.0, True), (130.0, False)):
        run = Run(budget_s=budget_s)
        run.sweep(HOME, s=30.0)
        assert run.sweep((HOME[0] + 2.0, HOME[1], 0.0), s=20.0, m=2.0).reason.startswith("frontier") == goes_on


def test_robot_that_has_hardly_driven_needs_no_more_for_the_way_home_than_it_has_spent() -> None:
    """The path home leads to the next voxel, the way driven was half a millimetre: that is no pace to reckon with."""
    budget = Budget(ExplorationConfig(budget_s=60.0), since_start=True)
    budget.spend(7.0, 0.0, np.zeros(3), 0.0)
    budget.spend(14.0, 0.0005, np.array([0.0005, 0.0, 0.0]), 0.0)
    assert budget.why_over(0.1) == ""


def test_pause_is_spent_and_is_no_pace_of_driving() -> None:
    """40 s for 4 m, then 600 s of which 590 s were a pause: 640 + 4 * 50 / 4 + 2 * 40 = 770, and not 640 + 640 + 2 * 600."""
    for budget_s, goes_on in ((790.0, True), (700.0, False)):
        run = Run(budget_s=budget_s)
        run.sweep(HOME)
        run.sweep(AWAY, s=40.0, m=4.0)
        assert (run.sweep(AWAY, s=600.0, m=0.0, paused_s=590.0).kind, run.explorer.is_going_home) == (GOAL, not goes_on)


def test_spent_budget_ends_at_home_whatever_it_costs_and_says_what_was_spent() -> None:
    run = Run(budget_s=100.0)
    run.sweep(HOME)
    back = run.sweep(AWAY, s=60.0, m=4.0)
    assert back.kind is GOAL and "60 of 100 s are spent" in back.reason
    assert run.sweep((3.5, 3.5, 0.0), s=60.0, m=2.0, on_the_way=True, at_goal=False).kind is KEEP  # it is late: home all the same
    last = run.sweep(HOME, s=20.0, m=2.0)
    assert last.kind is ENDED and "60 of 100 s" in last.reason and "; home" in last.reason


def test_robot_whose_budget_ended_at_home_is_not_sent_home_again_from_where_somebody_drove_it() -> None:
    run = Run(budget_s=100.0)
    run.sweep(HOME)
    run.sweep(AWAY, s=60.0, m=4.0)
    assert run.sweep(HOME, s=60.0, m=4.0).kind is ENDED
    assert "going home" not in run.sweep(AWAY, s=60.0, m=4.0).reason


def test_told_to_explore_on_the_robot_has_its_budget_anew() -> None:
    run = Run(budget_s=100.0)
    run.sweep(HOME)
    run.sweep(AWAY, s=99.0, m=4.0)
    assert run.sweep(HOME, s=99.0, m=4.0).kind is ENDED
    run.explorer.ask(Errand.EXPLORE, "")
    assert run.sweep(HOME, s=10.0).reason.startswith("frontier")


def test_where_no_way_home_is_known_the_last_one_and_what_was_driven_since_count() -> None:
    run = Run(budget_m=30.0)
    run.sweep(HOME)
    run.sweep(AWAY, m=4.0)
    world, (x, y) = opening(room()), (round(v / 0.08) for v in AWAY[:2])
    world[x - 8 : x + 9, [y - 8, y + 8], BELOW:] = world[[x - 8, x + 8], y - 8 : y + 9, BELOW:] = OCCUPIED  # a closet around the robot
    run.runs = runs_of(world)
    terrain = navigable_terrain(run.runs, run.poses[-1], run.explorer.terrain_settings, None)
    homing = run.explorer._homing
    assert 3.9 <= homing._way_m <= 4.4
    assert homing.way_m(np.array(run.poses), terrain, 2.0) == pytest.approx(homing._way_m)
    assert 5.9 <= homing._way_m <= 6.4


def tuned(run: Run, **config: object) -> None:
    e = run.explorer
    e.configure(ExplorationConfig(**config), e.frontier_config, e.planner_config)  # type: ignore[arg-type]


def test_budget_that_is_set_on_the_way_knows_what_was_spent_before_and_what_the_first_sweep_took() -> None:
    run = Run()
    run.sweep(HOME, s=20.0)
    run.sweep(AWAY, s=20.0, m=4.0)
    tuned(run, budget_s=200.0)
    assert run.sweep(AWAY, s=20.0, m=4.0).kind is GOAL and run.explorer.state is State.UNDER_WAY
    tuned(run, budget_s=90.0)
    run.sweep(AWAY, s=20.0, m=4.0)
    assert run.explorer.state is State.GOING_HOME


def test_way_of_a_robot_that_drives_counts_though_odometry_tells_of_it_a_leg_later() -> None:
    run = Run(budget_m=9.0)
    run.sweep(HOME)
    run.sweep(AWAY)  # 3.9 m away, and 3.9 m are left for the way home, beside twice as much
    assert run.explorer.state is State.GOING_HOME


def test_at_end_that_is_set_on_the_way_is_obeyed() -> None:
    run = Run(room())
    run.sweep(HOME)
    tuned(run, at_end="home")
    assert run.sweep(AWAY).kind is GOAL and run.explorer.state is State.GOING_HOME


def test_configuration_that_contradicts_itself_is_refused_and_changes_nothing() -> None:
    run = Run()
    with pytest.raises(ValueError, match="max_goals"):
        tuned(run, max_goals=1)
    assert run.explorer.config == ExplorationConfig()


def test_robot_that_does_not_explore_waits_after_every_sweep_and_is_led_home_when_asked() -> None:
    run = Run(explores=False)
    assert [run.sweep(at).kind for at in (HOME, AWAY)] == [WAIT, WAIT]
    run.explorer.ask(Errand.HOME, "asked for")
    way = run.sweep(AWAY)
    assert (way.kind, run.explorer.state) == (GOAL, State.GOING_HOME)
    assert way.goal is not None
    np.testing.assert_allclose(way.goal[:2], HOME[:2], atol=1e-6)
    assert run.sweep(HOME, at_goal=True).kind is WAIT and run.explorer.state is State.HOME
