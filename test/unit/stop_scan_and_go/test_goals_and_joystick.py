"""Scripted runs in which people have a say: a paused exploration, goals in a finished map, a joystick that takes over."""

import pytest
from test_scan_while_driving import DrivingScript
from test_stop_scan_and_go import FORWARD, Script

from stop_scan_and_go import DriveState, SweepKind

BY_HAND = (-0.2, 0.4)


def finished() -> Script:
    script = Script()
    script.until(DriveState.MAPPING)
    script.decide("explored")
    for _ in range(20):
        script.tick()
    script.actions.clear()
    return script


def paused() -> Script:
    script = Script().driving()
    script.tick(follower="paused", follower_reason="a goal was cancelled")
    return script


# -- paused


def test_robot_stands_without_a_sweep_as_long_as_exploration_is_paused() -> None:
    script = paused()
    sweeps = script.sweeps_started
    for _ in range(600):
        action = script.tick(follower="paused")
        assert (action.state, action.v, action.w) == (DriveState.PAUSED, 0.0, 0.0)
    assert action.reason == "a goal was cancelled" and script.sweeps_started == sweeps


def test_exploration_that_goes_on_begins_with_a_sweep_for_a_new_goal() -> None:
    script = paused()
    action = script.tick(follower="idle")
    assert action.state is DriveState.SETTLING and action.sweep_kind is SweepKind.IDLE
    script.until(DriveState.MAPPING)
    script.decide("goal")
    assert script.tick(FORWARD, "following").v == FORWARD[0]


def test_goal_is_driven_to_while_exploration_is_paused_and_swept_at() -> None:
    script = paused()
    script.tick(FORWARD, "following")
    assert script.tick(FORWARD, "following").v == FORWARD[0]
    assert script.until(DriveState.SETTLING, follower="reached").sweep_kind is SweepKind.REACHED
    script.until(DriveState.MAPPING)
    script.decide("goal")
    assert script.tick(follower="paused").state is DriveState.PAUSED


# -- after exploration


def test_goal_is_driven_to_after_exploration_with_the_sweeps_of_every_drive() -> None:
    script = finished()
    script.tick(FORWARD, "following")
    assert script.tick(FORWARD, "following").v == FORWARD[0]
    assert script.until(DriveState.SETTLING, command=FORWARD, follower="following").sweep_kind is SweepKind.INTERMEDIATE
    script.until(DriveState.MAPPING, follower="following")
    script.decide("explored")
    script.until(DriveState.DRIVING, follower="following", limit=20)
    script.until(DriveState.SETTLING, follower="reached")
    script.until(DriveState.MAPPING)
    assert script.decide("explored").state is DriveState.FINISHED


def test_driving_to_a_goal_after_exploration_decisions_that_all_is_explored_do_not_stop_it() -> None:
    script = DrivingScript()
    script.until(DriveState.MAPPING)
    script.decide("explored")
    for _ in range(20):
        script.tick()
    script.drive(1.0)
    assert script.decide("explored") is None
    script.drive(1.0)
    assert script.actions[-1].v == FORWARD[0]
    script.tick(follower="reached")
    script.t += 1.0
    assert script.decide("explored").state is DriveState.FINISHED


# -- the joystick


@pytest.mark.parametrize("state", [s for s in DriveState if s not in (DriveState.LOOKING, DriveState.TAKEN_OVER)])
def test_joystick_wins_whatever_the_robot_does(state: DriveState) -> None:
    script = Script()
    if state in (DriveState.SETTLING, DriveState.SWEEPING, DriveState.MAPPING):
        script.until(state)
    elif state is DriveState.DRIVING:
        script.driving()
    elif state is DriveState.PAUSED:
        script = paused()
    elif state is DriveState.FINISHED:
        script = finished()
    elif state is DriveState.FAILED:
        script.obeys_sweeps = False
        script.until(DriveState.FAILED)
    assert script.machine.state is state
    action = script.tick(FORWARD, "following", teleop=BY_HAND)
    assert (action.v, action.w, action.state, action.start_sweep) == (*BY_HAND, DriveState.TAKEN_OVER, False)
    for _ in range(300):
        assert script.tick(teleop=BY_HAND).state is DriveState.TAKEN_OVER
    after = script.tick(follower="paused" if state is DriveState.PAUSED else "idle")
    stays = state in (DriveState.STARTING, DriveState.PAUSED, DriveState.FINISHED, DriveState.FAILED)
    assert after.state is (state if stays else DriveState.SETTLING) and (after.v, after.w) == (0.0, 0.0)


def test_exploration_goes_on_with_a_sweep_from_where_the_robot_was_driven_to() -> None:
    script = Script().driving()
    sweeps = script.sweeps_started
    for _ in range(200):
        script.tick(FORWARD, "following", teleop=BY_HAND)
    assert script.tick(FORWARD, "following").sweep_kind is SweepKind.IDLE
    script.until(DriveState.MAPPING)
    assert script.sweeps_started == sweeps + 1
    script.decide("goal")
    assert script.tick(FORWARD, "following").v == FORWARD[0]


def test_decision_about_a_sweep_that_the_joystick_has_spoilt_is_not_taken() -> None:
    script = Script()
    script.until(DriveState.SWEEPING)
    script.tick(teleop=BY_HAND)
    assert script.decide("goal") is None and script.machine.state is DriveState.TAKEN_OVER


def test_way_driven_by_joystick_is_counted() -> None:
    script = Script().driving()
    before_m = script.machine.distance_m
    for _ in range(20):
        script.tick(teleop=FORWARD)
    assert script.machine.distance_m - before_m == pytest.approx(20 * FORWARD[0] * 0.05, rel=0.1)


def test_mount_rests_while_a_robot_that_maps_as_it_drives_is_driven_by_joystick() -> None:
    script = DrivingScript().driving()
    assert script.machine.nods
    script.tick(teleop=BY_HAND)
    assert not script.machine.nods
    assert script.tick(follower="following").state is DriveState.SETTLING


# -- asked for something else


@pytest.mark.parametrize("state", ["driving", "paused", "finished", "ended"])
def test_recalled_robot_is_swept_at_once_whatever_it_did(state: str) -> None:
    script = paused() if state == "paused" else Script().driving()
    if state in ("finished", "ended"):
        script.tick(follower="reached")
        script.until(DriveState.MAPPING)
        script.decide("explored" if state == "finished" else "ended")
        for _ in range(20):
            assert script.tick().state is DriveState.FINISHED
    begun = script.t
    script.until(DriveState.SWEEPING, follower="recalled", follower_reason="asked for something else")
    assert script.t - begun < 1.5


def test_robot_that_is_to_wait_is_paused_with_the_reason_that_its_follower_tells() -> None:
    script = Script().driving()
    script.tick(follower="reached")
    script.until(DriveState.MAPPING)
    script.decide("wait", "home")
    action = script.tick(follower="paused", follower_reason="home, 0.05 m from the start")
    assert (action.state, action.reason) == (DriveState.PAUSED, "home, 0.05 m from the start")
