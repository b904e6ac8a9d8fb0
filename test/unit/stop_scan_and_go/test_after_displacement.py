"""A robot moved otherwise than by its wheels stands, sweeps when it is left alone, and drives once a sweep has told where it is."""

import pytest
from test_scan_while_driving import DrivingScript
from test_stop_scan_and_go import FORWARD, Script

from stop_scan_and_go import DriveState, LookWhileDriving, StopScanAndGoConfig, SweepKind


@pytest.fixture(params=[Script, DrivingScript])
def script(request: pytest.FixtureRequest) -> Script:
    made: Script = request.param()
    return made.driving()


def test_it_stands_at_once_and_drives_with_the_decision_about_a_sweep_made_after_it(script: Script) -> None:
    assert script.tick(FORWARD, "following").v == FORWARD[0]
    action = script.tick(FORWARD, "following", displaced=True)
    assert (action.v, action.w, action.state, action.sweep_kind) == (0.0, 0.0, DriveState.SETTLING, SweepKind.IDLE)
    assert "moved" in action.reason
    displaced_s = script.t
    script.until(DriveState.MAPPING, command=FORWARD, follower="following")
    assert all((a.v, a.w) == (0.0, 0.0) for a in script.actions[2:])
    assert script.decide("keep", stamp=displaced_s - 0.1) is None
    script.decide("goal")
    assert script.machine.state is DriveState.DRIVING


def test_no_sweep_begins_as_long_as_it_is_moved(script: Script) -> None:
    for _ in range(100):
        assert not script.tick(FORWARD, "following", displaced=True).start_sweep
    script.until(DriveState.SWEEPING)
    assert script.sweeps_started == 2


def test_sweep_in_which_it_is_moved_is_made_again_once_the_mount_rests(script: Script) -> None:
    script.tick(displaced=True)
    script.until(DriveState.SWEEPING)
    for _ in range(20):
        script.tick()
    assert script.tick(displaced=True).state is DriveState.SETTLING
    while script.tilts:
        assert not script.tick().start_sweep
    script.until(DriveState.SWEEPING)
    assert script.sweeps_started == 3


def test_who_is_still_lost_sweeps_again(script: Script) -> None:
    script.tick(displaced=True)
    script.until(DriveState.MAPPING)
    script.decide("look", "not found in the map")
    assert script.machine.state is DriveState.SETTLING
    script.until(DriveState.MAPPING)
    script.decide("trapped", "not found in the map")
    assert script.machine.state is DriveState.FINISHED


def test_robot_that_was_carried_after_the_end_looks_where_it_is_before_it_drives_to_a_goal(script: Script) -> None:
    script.tick(displaced=True)
    script.until(DriveState.MAPPING)
    script.decide("explored")
    assert script.tick(displaced=True).state is DriveState.FINISHED
    for _ in range(20):
        action = script.tick(FORWARD, "following")
    assert action.state is not DriveState.DRIVING and (action.v, action.w) == (0.0, 0.0)
    script.until(DriveState.MAPPING)
    script.decide("goal")
    assert script.machine.state is DriveState.DRIVING


def test_lidar_that_is_fixed_looks_until_a_decision_about_a_sweep_made_after_it() -> None:
    script = DrivingScript()
    script.machine = LookWhileDriving(StopScanAndGoConfig())
    script.until(DriveState.LOOKING)
    script.decide("goal", stamp=script.t + 0.1)
    script.tick(FORWARD, "following")
    assert script.tick(FORWARD, "following", displaced=True).state is DriveState.LOOKING
    assert script.machine.on_decision(script.t - 0.1, "goal", "") is None and script.machine.state is DriveState.LOOKING
    script.decide("look", "not found", stamp=script.t + 1.0)
    assert script.machine.state is DriveState.LOOKING
    script.t += 3.0
    script.decide("goal")
    assert script.machine.state is DriveState.DRIVING


@pytest.mark.parametrize("changes", [{}, {"T_odom_base": None}], ids=["at once", "after a tick without odometry"])
def test_odometry_that_begins_anew_elsewhere_has_driven_no_way_there(script: Script, changes: dict[str, object]) -> None:
    script.tick(FORWARD, "following")
    before_m, script.x = script.machine.distance_m, -10.0
    script.tick(FORWARD, "following", displaced=True, **changes)
    script.tick(FORWARD, "following", twist=FORWARD)  # it slows down
    assert script.machine.distance_m == pytest.approx(before_m, abs=0.05)
