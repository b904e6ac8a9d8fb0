"""What makes a run a success, and what speaks against one."""

from dataclasses import replace

import numpy as np
import pytest

from exploration_evaluation.start_distance import StartDistance
from exploration_evaluation.verdict import Fault, Outcome, faults, largest_piece_m2, succeeded, succeeded_alone
from rigid_geometry import transform_from_rpy

GOOD = Outcome(
    "explored: all", fell=False, collisions=0, map_saved=True, coverage=0.999, missed_piece_m2=0.1, start=StartDistance(9.0, 5.0, 1.0)
)
HOME = "ended: 520 of 600 s are spent, and the way home of 9.0 m needs the rest; home, 0.05 m and 0.01 rad from the start"


def test_good_run_succeeds() -> None:
    assert (succeeded(GOOD), faults(GOOD)) == (True, ())


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"stop_reason": "time limit: 1800 s simulated"}, Fault.NOT_EXPLORED),
        ({"fell": True}, Fault.FELL),
        ({"collisions": 1}, Fault.TOUCHED),
        ({"map_saved": False}, Fault.NOT_SAVED),
        ({"on_disk": False}, Fault.NOT_ON_DISK),
        ({"coverage": 0.95}, Fault.MISSED),  # five parts in a hundred are missing
        ({"coverage": 0.98, "missed_piece_m2": 5.1}, Fault.MISSED),  # a storey of a large building
        ({"coverage": 0.98, "start": StartDistance(0.9, 0.9, 0.0)}, Fault.STAYED),
        (
            {"stop_reason": "explored: all; home, 0.05 m and 0.01 rad from the start", "start": StartDistance(9.0, 0.21, 0.0)},
            Fault.NOT_HOME,
        ),
        (
            {"stop_reason": "explored: all; home, 0.05 m and 0.01 rad from the start", "start": StartDistance(9.0, 0.0, 0.21)},
            Fault.NOT_HOME,
        ),
        ({"outside_m": 0.051}, Fault.OUTSIDE),
        ({"stop_reason": "explored: all; not home, 1.05 m and 0.01 rad from the start: a box"}, Fault.NOT_HOME),
        ({"coverage": None, "start": StartDistance(0.9, 0.9, 0.0)}, Fault.STAYED),
        ({"stop_reason": "ended: 520 of 600 s are spent; not home, 3.00 m and 0.01 rad from the start: a box"}, Fault.NOT_HOME),
        ({"stop_reason": HOME, "start": StartDistance(9.0, 0.21, 0.0)}, Fault.NOT_HOME),
        ({"stop_reason": HOME, "start": StartDistance(9.0, 0.1, 0.0), "budget_share": 1.06}, Fault.LATE),
        ({"stop_reason": HOME, "start": StartDistance(9.0, 0.1, 0.0), "map_saved": False}, Fault.NOT_SAVED),
        ({"stop_reason": "interrupted", "explores": False, "collisions": 1}, Fault.TOUCHED),
    ],
)
def test_each_fault_alone_is_no_success(changed: dict[str, object], fault: Fault) -> None:
    outcome = replace(GOOD, **changed)  # type: ignore[arg-type]
    assert (succeeded(outcome), faults(outcome)) == (False, (fault,))


@pytest.mark.parametrize(
    "changed",
    [
        {"coverage": 0.951},
        {"coverage": 0.98, "missed_piece_m2": 4.9},
        {"stop_reason": "explored: all; home, 0.05 m and 0.01 rad from the start", "start": StartDistance(9.0, 0.19, 0.19)},
        {"coverage": 0.996, "start": StartDistance(0.0, 0.0, 0.0)},
    ],
)
def test_what_is_just_enough_is_a_success(changed: dict[str, object]) -> None:
    assert succeeded(replace(GOOD, **changed)) is True  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "changed",
    [
        {"stop_reason": HOME, "start": StartDistance(9.0, 0.1, 0.0), "budget_share": 0.98},
        {"coverage": None, "missed_piece_m2": None},
        {"start": StartDistance(0.0, 0.0, 0.0)},
    ],
)
def test_run_that_was_to_end_before_all_is_explored_succeeds_with_less(changed: dict[str, object]) -> None:
    little = replace(GOOD, stop_reason="ended: told to stop", coverage=0.4, missed_piece_m2=60.0)
    assert succeeded(replace(little, **changed)) is True  # type: ignore[arg-type]


def test_robot_that_only_drove_to_goals_succeeds_without_a_map() -> None:
    driven = replace(GOOD, stop_reason="interrupted", map_saved=False, coverage=None, missed_piece_m2=None, explores=False)
    assert succeeded(driven) is True
    assert succeeded(replace(driven, collisions=None)) is None
    assert succeeded(replace(driven, stop_reason="time limit: 1800 s simulated")) is True


@pytest.mark.parametrize("reason", ["node died: pybullet_sim_node", "roslaunch was killed", "the first sweep was not found in the map"])
def test_robot_that_only_drove_to_goals_fails_when_nobody_ended_it(reason: str) -> None:
    driven = replace(GOOD, stop_reason=reason, map_saved=False, coverage=None, missed_piece_m2=None, explores=False)
    assert (succeeded(driven), faults(driven)) == (False, (Fault.BROKEN_OFF,))


@pytest.mark.parametrize("unknown", ["stop_reason", "fell", "collisions", "coverage", "missed_piece_m2", "start"])
def test_what_is_not_known_leaves_the_verdict_open(unknown: str) -> None:
    assert succeeded(replace(GOOD, **{unknown: None})) is None


def test_robot_alone_knows_whether_it_ever_left_its_start() -> None:
    reason = "explored: no reachable frontier is left in the whole map; 12 set aside"
    assert not succeeded_alone(reason, driven_m=0.5, set_aside=12)
    assert succeeded_alone(reason, driven_m=0.5, set_aside=0)
    assert succeeded_alone(reason, driven_m=5.0, set_aside=12)
    assert not succeeded_alone("stuck", driven_m=5.0, set_aside=0)
    assert succeeded_alone(HOME, driven_m=5.0, set_aside=12)
    assert not succeeded_alone(HOME.replace("; home", "; not home"), driven_m=5.0, set_aside=12)


def test_largest_piece_is_of_neighbouring_cells_of_one_level() -> None:
    square = np.stack(np.meshgrid(np.arange(5), np.arange(5), [0]), axis=-1).reshape(-1, 3) * [0.1, 0.1, 1.0]
    cornerwise = np.array([[0.5, 0.5, 0.0]])
    apart, above = np.array([[1.0, 0.0, 0.0]]), np.array([[0.2, 0.2, 1.0]])
    assert largest_piece_m2(np.vstack([square, cornerwise, apart, above]), 0.1) == pytest.approx(0.26)
    assert largest_piece_m2(np.zeros((0, 3)), 0.1) == 0.0


def test_distance_from_the_start_is_taken_at_the_farthest_and_at_the_end() -> None:
    poses = np.array([transform_from_rpy((x, 0.0, 0.0), (0.0, 0.0, yaw)) for x, yaw in ((1.0, 3.0), (7.0, 0.0), (1.5, -3.0))])
    found = StartDistance.of(poses)
    assert (found.farthest_m, found.end_m) == (6.0, 0.5)
    assert found.end_rad == pytest.approx(2 * np.pi - 6.0)
