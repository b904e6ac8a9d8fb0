"""Scripted runs of the machine that maps while it drives: when it stands, for what, and when its mount nods."""

import pytest
from test_stop_scan_and_go import FORWARD, Script

from stop_scan_and_go import DriveState, LookWhileDriving, ScanWhileDriving, StopScanAndGoConfig, SweepKind


class DrivingScript(Script):
    def __init__(self, **changes: float) -> None:
        super().__init__()
        self.machine = ScanWhileDriving(StopScanAndGoConfig(**changes))

    def drive(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.05)):
            self.tick(FORWARD, "following")


@pytest.fixture
def script() -> DrivingScript:
    made = DrivingScript()
    return made.driving()


def test_first_sweep_is_made_standing_with_a_mount_that_does_not_nod() -> None:
    script = DrivingScript()
    script.until(DriveState.SWEEPING)
    assert not script.machine.nods
    script.until(DriveState.MAPPING)
    script.decide("goal")
    assert script.machine.nods and script.machine.state is DriveState.DRIVING


def test_drives_on_while_decisions_keep_the_plan_or_bring_a_new_one(script: DrivingScript) -> None:
    for kind in ("keep", "goal", "keep"):
        script.drive(2.0)
        script.decide(kind)
        assert script.tick(FORWARD, "following").v == FORWARD[0]
    assert script.states() == ["driving"]


def test_stands_where_no_decision_came_for_too_long_and_goes_on_with_the_next(script: DrivingScript) -> None:
    script.drive(6.0)
    assert script.machine.state is DriveState.LOOKING and script.actions[-1].sweep_kind is SweepKind.INTERMEDIATE
    assert script.actions[-1].v == 0.0
    script.t += 1.0
    script.decide("keep")
    assert script.machine.state is DriveState.DRIVING


def test_at_the_goal_it_looks_until_a_decision_about_a_later_sweep(script: DrivingScript) -> None:
    script.drive(1.0)
    script.tick((0.0, 0.0), "reached")
    reached_s = script.t
    assert script.machine.state is DriveState.LOOKING and script.machine.nods
    script.decide("keep", stamp=reached_s - 0.2)
    assert script.machine.state is DriveState.LOOKING
    script.decide("goal", stamp=reached_s + 1.0)
    assert script.machine.state is DriveState.DRIVING


def test_new_goal_from_a_sweep_on_the_way_is_driven_to_at_once(script: DrivingScript) -> None:
    script.drive(1.0)
    script.tick((0.0, 0.0), "reached")
    script.decide("goal", stamp=script.t - 0.2)
    assert script.machine.state is DriveState.DRIVING


def test_second_look_from_one_place_asks_for_a_whole_sweep_with_the_mount_at_rest_before_it(script: DrivingScript) -> None:
    script.drive(1.0)
    script.tick((0.0, 0.0), "reached")
    script.decide("goal", stamp=script.t + 1.0)
    for _ in range(20):
        script.tick((0.0, 0.0), "turning_to_path")
    script.tick((0.0, 0.0), "reached")
    assert script.machine.state is DriveState.SETTLING and not script.machine.nods
    for _ in range(40):
        assert not script.tick(tilt_rad=0.4).start_sweep
    script.until(DriveState.SWEEPING)
    assert script.sweeps_started == 2


def test_matches_refused_in_a_row_ask_for_a_whole_sweep(script: DrivingScript) -> None:
    for refused in (True, False, True, True):
        script.drive(1.0)
        script.machine.on_decision(script.t, "keep", "", refused=refused)
    script.tick(FORWARD, "following")
    assert script.machine.state is DriveState.SETTLING


BACKWARD = -FORWARD[0], 0.0


def backward(script: DrivingScript, metres: float) -> None:
    for _ in range(round(metres / (0.05 * FORWARD[0]))):
        script.tick(BACKWARD, "following")


def test_way_backward_is_looked_at_by_a_whole_sweep_and_goes_on(script: DrivingScript) -> None:
    """Somebody may come up behind it, where a mount that nods does not look."""
    backward(script, 0.4)
    script.drive(0.3 / FORWARD[0])
    backward(script, 0.3)
    assert script.machine.state is DriveState.DRIVING, "0.4 m backward in all"
    backward(script, 0.3)
    assert script.machine.state is DriveState.SETTLING and script.actions[-1].sweep_kind is SweepKind.INTERMEDIATE
    script.until(DriveState.MAPPING)
    script.decide("keep")
    backward(script, 0.4)
    assert script.machine.state is DriveState.DRIVING
    backward(script, 0.3)
    assert script.machine.state is DriveState.SETTLING


def test_what_ends_exploration_ends_it_while_driving(script: DrivingScript) -> None:
    script.drive(1.0)
    script.decide("explored")
    assert script.machine.state is DriveState.FINISHED and not script.machine.nods
    assert script.tick(FORWARD, "following").v == 0.0


def test_mount_that_does_not_come_to_rest_fails_the_run(script: DrivingScript) -> None:
    script.machine.on_decision(script.t, "keep", "", refused=True)
    script.machine.on_decision(script.t, "keep", "", refused=True)
    for _ in range(450):
        script.tick(FORWARD, "following", tilt_rad=0.5)
    assert script.machine.state is DriveState.FAILED


def test_mount_that_stops_nodding_is_told_after_a_while(script: DrivingScript) -> None:
    script.drive(6.0)
    assert script.machine.state is DriveState.LOOKING and script.machine.stalled_s(script.t) == 0.0
    for _ in range(130):
        script.tick((0.0, 0.0), "following")
    assert script.machine.stalled_s(script.t) > 6.0
    script.decide("keep")
    assert script.machine.state is DriveState.DRIVING and script.machine.stalled_s(script.t) == 0.0


# --- bad input --------------------------------------------------------------------------------------------------------------------------


def test_robot_whose_odometry_jumped_stands_and_goes_on_with_the_decision_about_a_later_sweep(script: DrivingScript) -> None:
    for _ in range(10):
        assert script.tick(FORWARD, "following", pose_sigma_m=0.02).v == FORWARD[0]
    action = script.tick(FORWARD, "following", pose_sigma_m=0.15)
    assert action.v == 0.0 and action.state is DriveState.LOOKING and "odometry jumped" in action.reason
    jumped_s = script.t
    script.decide("keep", stamp=jumped_s - 0.1)
    assert script.tick(FORWARD, "following", pose_sigma_m=0.02).v == 0.0
    script.decide("keep", stamp=jumped_s + 1.0)
    assert script.tick(FORWARD, "following", pose_sigma_m=0.02).v == FORWARD[0]


def test_position_that_is_known_worse_and_worse_stops_nobody(script: DrivingScript) -> None:
    for k in range(40):
        assert script.tick(FORWARD, "following", pose_sigma_m=0.01 * k).v == FORWARD[0]
    for sigma_m in (None, 0.3, None, 0.3, 0.05):
        assert script.tick(FORWARD, "following", pose_sigma_m=sigma_m).state is DriveState.DRIVING


def test_robot_that_stands_while_odometry_jumps_stands_for_no_other_reason() -> None:
    script = DrivingScript()
    for _ in range(10):
        script.tick(pose_sigma_m=0.01)
    script.tick(pose_sigma_m=0.3)
    script.driving()
    assert script.tick(FORWARD, "following", pose_sigma_m=0.3).v == FORWARD[0]


def test_third_refused_match_in_a_row_is_that_of_a_whole_sweep_and_the_robot_drives_on_as_decided(script: DrivingScript) -> None:
    for _ in range(2):
        script.drive(1.0)
        script.machine.on_decision(script.t, "keep", "", refused=True)
    assert script.tick(FORWARD, "following").v == 0.0
    script.until(DriveState.MAPPING)
    assert script.sweeps_started == 2
    script.machine.on_decision(script.t, "goal", "back to where one was placed", refused=True)
    assert script.tick(FORWARD, "following").v == FORWARD[0]
    script.drive(1.0)
    assert script.machine.state is DriveState.DRIVING
    script.machine.on_decision(script.t, "keep", "", refused=True)
    assert script.tick(FORWARD, "following").v == 0.0 and script.machine.state is DriveState.SETTLING


def test_way_that_a_new_terrain_blocks_is_given_up_for_what_is_decided_there_and_a_whole_sweep_is_the_second_answer(
    script: DrivingScript,
) -> None:
    script.drive(2.0)
    action = script.tick((0.0, 0.0), "blocked")
    assert action.v == 0.0 and action.state is DriveState.LOOKING and action.sweep_kind is SweepKind.BLOCKED
    script.decide("goal", stamp=script.t + 1.0)
    for _ in range(20):
        assert script.tick((0.0, 0.5), "turning_to_path").w == 0.5
    assert script.tick((0.0, 0.0), "blocked").state is DriveState.SETTLING
    script.until(DriveState.MAPPING)
    script.decide("goal")
    assert script.tick(FORWARD, "following").v == FORWARD[0]


class FixedScript(DrivingScript):
    def __init__(self, **changes: float) -> None:
        super().__init__()
        self.machine = LookWhileDriving(StopScanAndGoConfig(**changes))


def test_fixed_lidar_is_never_asked_for_a_sweep_and_the_robot_drives_with_the_first_decision() -> None:
    script = FixedScript()
    script.until(DriveState.LOOKING)
    assert script.actions[-1].sweep_kind is SweepKind.INITIAL
    script.decide("goal")
    script.drive(1.0)
    assert script.machine.state is DriveState.DRIVING
    assert not any(action.start_sweep for action in script.actions) and not script.machine.nods


def test_with_a_fixed_lidar_it_looks_again_where_it_looked_and_after_refusals() -> None:
    script = FixedScript()
    script.until(DriveState.LOOKING)
    script.decide("goal")
    for _ in range(3):
        script.drive(1.0)
        script.tick((0.0, 0.0), "stuck")
        assert script.machine.state is DriveState.LOOKING
        script.t += 1.0
        script.decide("goal")
    for _ in range(2):
        script.drive(0.5)
        script.machine.on_decision(script.t, "keep", "", refused=True)
    script.tick(FORWARD, "following")
    assert script.machine.state is DriveState.LOOKING
    assert not any(action.start_sweep for action in script.actions)


def test_fixed_lidar_sees_behind() -> None:
    script = FixedScript()
    script.until(DriveState.LOOKING)
    script.decide("goal")
    backward(script, 2.0)
    assert script.machine.state is DriveState.DRIVING


@pytest.mark.parametrize(("cloud_s", "missing"), [(0.5, "no cloud of a sweep"), (1e9, "no decision about a sweep"), (None, "no decision")])
def test_robot_that_stands_in_vain_names_what_did_not_come(script: DrivingScript, cloud_s: float | None, missing: str) -> None:
    script.drive(1.0)
    script.tick((0.0, 0.0), "reached")
    assert script.until(DriveState.FAILED, limit=2600, follower="reached", cloud_s=cloud_s).reason.startswith(missing)
