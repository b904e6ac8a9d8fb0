"""Scripted runs of the machine: every tick's input is written down, the order of states and commands is what is tested."""

import math
import pickle
from dataclasses import replace

import pytest

from rigid_geometry import transform_from_rpy
from stop_scan_and_go import Decision, DriveState, StopScanAndGo, StopScanAndGoConfig, SweepKind, TickAction, TickObservation

TICK = 0.05
FORWARD = (0.5, 0.0)


def one_sweep() -> list[float]:
    """Tilts of a sweep, a tick each: over the nose to behind, slowly back below the horizon, and to the horizon again."""
    slew = [0.15 * k for k in range(1, 20)]
    slow = [2.85 - 0.05 * k for k in range(1, 70)]
    back = [-0.6 + 0.1 * k for k in range(1, 7)]
    return slew + slow + back


class Script:
    """Plays ticks to a machine: a robot that does what it is told at once, a laser that sweeps when it is told to."""

    def __init__(self, **changes: float) -> None:
        self.machine = StopScanAndGo(StopScanAndGoConfig(**changes))
        self.t, self.x, self.yaw = 1.0, 0.0, 0.0
        self.twist = (0.0, 0.0)
        self.tilts: list[float] = []
        self.sweeps_started = 0
        self.obeys_sweeps = True
        self.actions: list[TickAction] = []

    def tick(self, command: tuple[float, float] | None = (0.0, 0.0), follower: str = "idle", **changes: object) -> TickAction:
        self.t += TICK
        self.x += self.twist[0] * math.cos(self.yaw) * TICK
        self.yaw += self.twist[1] * TICK
        tilt = self.tilts.pop(0) if self.tilts else 0.0
        pose = transform_from_rpy([self.x, 0.0, 0.0], (0.0, 0.0, self.yaw))
        seen = TickObservation(self.t, pose, self.twist, tilt, command, follower, "")
        action = self.machine.step(replace(seen, **changes))
        self.twist = (action.v, action.w)
        if action.start_sweep:
            self.sweeps_started += 1
            self.tilts = one_sweep() if self.obeys_sweeps else []
        self.actions.append(action)
        return action

    def until(self, state: DriveState, limit: int = 1000, **inputs: object) -> TickAction:
        for _ in range(limit):
            action = self.tick(**inputs)
            if action.state is state:
                return action
        raise AssertionError(f"{state} was not reached, it is {action}")

    def decide(self, kind: str, reason: str = "", stamp: float | None = None) -> TickAction | None:
        return self.machine.on_decision(self.t if stamp is None else stamp, kind, reason)

    def driving(self) -> "Script":
        """Through the first sweep to the first tick of a drive."""
        self.until(DriveState.MAPPING)
        self.decide("goal")
        self.tick(FORWARD, "following")
        self.actions.clear()
        return self

    def states(self) -> list[str]:
        names = [a.state.value for a in self.actions]
        return [n for i, n in enumerate(names) if i == 0 or names[i - 1] != n]


def test_first_round_goes_from_start_over_the_sweep_to_mapping():
    script = Script()
    action = script.until(DriveState.MAPPING)
    assert script.states() == ["starting", "settling", "sweeping", "mapping"]
    assert all(a.v == a.w == 0.0 for a in script.actions)
    assert script.sweeps_started == 1 and script.machine.sweeps == 1
    assert action.sweep_kind is SweepKind.INITIAL


def test_robot_is_still_for_its_time_before_the_sweep():
    script = Script()
    script.until(DriveState.SETTLING)
    begun = script.t
    for _ in range(6):
        script.tick(twist=(0.1, 0.0))
    still_from = script.t
    script.until(DriveState.SWEEPING)
    assert script.t - still_from == pytest.approx(0.5 + TICK, abs=1e-6) and script.t > begun


def test_robot_that_slides_is_swept_after_a_while():
    script = Script(settle_limit_s=2.0)
    script.until(DriveState.SETTLING, twist=(0.1, 0.0))
    begun = script.t
    script.until(DriveState.SWEEPING, twist=(0.1, 0.0))
    assert script.t - begun == pytest.approx(2.0 + TICK, abs=1e-6)


@pytest.mark.parametrize("pitch_at", [lambda t: 0.04 * math.sin(8.0 * t), lambda t: 0.012 * t], ids=["to and fro", "slowly over"])
def test_robot_that_rocks_on_its_wheels_is_not_swept_until_it_has_come_to_rest(pitch_at):
    script = Script()
    script.until(DriveState.SETTLING)
    begun = script.t
    while script.sweeps_started == 0:
        pitch = pitch_at(min(script.t - begun, 1.5))
        script.tick(T_odom_base=transform_from_rpy([0.0, 0.0, 0.0], (0.0, pitch, 0.0)))
    assert 1.5 + 0.5 < script.t - begun < 1.5 + 0.5 + 0.3


def test_passing_the_horizon_in_a_sweep_is_not_its_end():
    script = Script()
    script.until(DriveState.SWEEPING)
    whole = len(one_sweep())
    script.until(DriveState.MAPPING)
    assert sum(a.state is DriveState.SWEEPING for a in script.actions) >= whole


def test_decision_after_the_sweep_is_driven_at_once():
    script = Script()
    script.until(DriveState.MAPPING)
    answer = script.decide("goal", "frontier 3")
    assert answer == TickAction(0.0, 0.0, False, DriveState.DRIVING, "goal: frontier 3", None)
    assert script.tick(FORWARD, "following") == TickAction(0.5, 0.0, False, DriveState.DRIVING, "goal: frontier 3", None)


def test_late_decision_is_waited_for_without_moving():
    script = Script()
    script.until(DriveState.MAPPING)
    end = script.t
    for _ in range(100):
        action = script.tick(FORWARD, "following")
        assert (action.v, action.state) == (0.0, DriveState.MAPPING)
    assert script.decide("goal", stamp=end).state is DriveState.DRIVING
    assert script.tick(FORWARD, "following").v == 0.5


def test_decision_that_does_not_come_where_the_clock_runs_is_asked_for_by_one_more_sweep():
    script = Script(decision_limit_s=2.0)
    script.until(DriveState.MAPPING)
    assert "no decision" in script.until(DriveState.SETTLING).reason
    script.until(DriveState.MAPPING)
    assert script.decide("goal").state is DriveState.DRIVING
    assert "failed" not in script.states()


def test_decision_that_never_comes_is_a_failure():
    script = Script(decision_limit_s=2.0)
    script.until(DriveState.MAPPING)
    script.until(DriveState.SETTLING)
    assert "nor about the one before" in script.until(DriveState.FAILED).reason
    assert script.machine.sweeps == 2


def test_decision_that_overtakes_the_end_of_its_sweep_is_used_then():
    script = Script()
    script.until(DriveState.SWEEPING)
    script.tick()
    assert script.decide("goal", "early") is None
    action = script.until(DriveState.DRIVING)
    assert action.reason == "goal: early" and script.machine.sweeps == 1
    assert "mapping" not in script.states()


def test_decision_that_nobody_awaits_is_ignored():
    script = Script()
    assert script.decide("goal") is None
    script.driving()
    assert script.decide("explored") is None
    script.until(DriveState.SWEEPING, command=FORWARD, follower="following")
    assert script.decide("explored", stamp=2.0) is None
    assert script.until(DriveState.MAPPING).v == 0.0


def test_unknown_decision_is_refused():
    with pytest.raises(ValueError, match="perhaps"):
        Script().decide("perhaps")


@pytest.mark.parametrize(("follower", "kind"), [("reached", SweepKind.REACHED), ("stuck", SweepKind.STUCK), ("blocked", SweepKind.BLOCKED)])
def test_end_of_a_drive_stops_and_sweeps_with_its_kind_and_reason(follower, kind):
    script = Script().driving()
    for _ in range(10):
        assert script.tick(FORWARD, "following").v == 0.5
    action = script.tick(FORWARD, follower, follower_reason="because")
    assert (action.v, action.w, action.state, action.sweep_kind) == (0.0, 0.0, DriveState.SETTLING, kind)
    assert action.reason == f"{follower}: because"
    assert script.until(DriveState.MAPPING).sweep_kind is kind
    assert script.machine.sweeps == 2


@pytest.mark.parametrize("follower", ["turning_to_path", "turning_to_goal", "waiting", "backing_off"])
def test_follower_on_its_way_is_left_to_it(follower):
    script = Script().driving()
    action = script.tick((-0.1, 0.2), follower)
    assert (action.v, action.w, action.state) == (-0.1, 0.2, DriveState.DRIVING)


def test_long_way_is_interrupted_by_a_sweep_and_goes_on_to_the_same_goal():
    script = Script(max_distance_m=2.0).driving()
    action = script.until(DriveState.SETTLING, command=FORWARD, follower="following")
    assert action.sweep_kind is SweepKind.INTERMEDIATE and action.v == 0.0 and "since the last sweep" in action.reason
    assert 2.0 < script.machine._travel.distance_m < 2.1
    script.until(DriveState.MAPPING, command=FORWARD, follower="following")
    assert script.machine._travel.distance_m == 0.0
    assert script.machine.distance_m == pytest.approx(script.x, abs=1e-9)
    assert script.decide("keep", "intermediate").state is DriveState.DRIVING
    assert script.tick(FORWARD, "following").v == 0.5
    script.until(DriveState.SETTLING, command=FORWARD, follower="following")
    assert script.machine.sweeps == 2 and script.machine.distance_m > 4.0


def test_tracked_robot_drives_on_until_its_position_is_not_known_well_enough():
    script = Script(max_distance_m=1.0, max_yaw_rad=1.0, max_tracked_distance_m=4.0, max_pose_sigma_m=0.03).driving()
    for k in range(100):
        command = FORWARD if k < 60 else (0.0, 0.8)
        assert script.tick(command, "following", pose_sigma_m=0.02).state is DriveState.DRIVING
    assert script.machine._travel.distance_m > 1.4 and script.machine._travel.yaw_rad > 1.4
    action = script.tick(FORWARD, "following", pose_sigma_m=0.04)
    assert action.sweep_kind is SweepKind.INTERMEDIATE and "known to 4.0 cm only" in action.reason


def test_tracked_robot_is_swept_where_the_terrain_that_it_knows_ends():
    script = Script(max_distance_m=1.0, max_tracked_distance_m=2.0).driving()
    action = script.until(DriveState.SETTLING, command=FORWARD, follower="following", pose_sigma_m=0.001)
    assert action.sweep_kind is SweepKind.INTERMEDIATE and 2.0 < script.machine._travel.distance_m < 2.1


@pytest.mark.parametrize("unknown", [None, math.nan, math.inf])
def test_sigma_that_nobody_knows_leaves_the_distance(unknown):
    script = Script(max_distance_m=1.0, max_tracked_distance_m=4.0).driving()
    script.until(DriveState.SETTLING, command=FORWARD, follower="following", pose_sigma_m=unknown)
    assert 1.0 < script.machine._travel.distance_m < 1.1


def test_turning_to_and_fro_adds_up_to_a_sweep():
    script = Script(max_yaw_rad=2.0).driving()
    for k in range(200):
        action = script.tick((0.0, 0.8 if (k // 20) % 2 else -0.8), "turning_to_path")
        if action.state is DriveState.SETTLING:
            break
    assert action.sweep_kind is SweepKind.INTERMEDIATE and "rad" in action.reason
    assert abs(script.yaw) < 1.0 and 2.0 < script.machine._travel.yaw_rad < 2.1


@pytest.mark.parametrize(("slope_rad", "sweeps"), [(0.1, True), (0.0, False)])
def test_turn_in_place_on_a_slope_asks_for_a_sweep_before_the_robot_drives_on(slope_rad, sweeps):
    script = Script(max_slope_turn_rad=1.6, slope_rad=0.05).driving()

    def tick(command):
        pose = transform_from_rpy([script.x, 0.0, 0.0], (0.0, 0.0, script.yaw))
        return script.tick(command, "turning_to_path", T_odom_base=transform_from_rpy([0.0, 0.0, 0.0], (slope_rad, 0.0, 0.0)) @ pose)

    for _ in range(44):
        assert tick((0.0, 0.8)).state is DriveState.DRIVING
    action = tick(FORWARD)
    assert (action.state is DriveState.SETTLING) == sweeps
    assert not sweeps or (action.sweep_kind is SweepKind.INTERMEDIATE and "on a slope" in action.reason)


def test_goal_that_is_reached_where_the_way_is_long_enough_counts_as_reached():
    script = Script(max_distance_m=1.01).driving()
    while script.machine._travel.distance_m < 0.99:
        script.tick(FORWARD, "following")
    assert script.tick(FORWARD, "reached").sweep_kind is SweepKind.REACHED


def test_noise_of_standing_odometry_is_no_distance():
    script = Script()
    for k in range(400):
        script.tick(T_odom_base=transform_from_rpy([0.01 * (k % 2), 0.0, 0.0]))
        if script.machine.state is DriveState.MAPPING:
            break
    assert script.machine.distance_m < 0.05


@pytest.mark.parametrize("old", ["reached", "stuck", "blocked"])
def test_end_of_the_last_path_is_not_taken_for_that_of_the_new_one(old):
    script = Script().driving()
    script.until(DriveState.MAPPING, command=(0.0, 0.0), follower=old)
    script.decide("goal")
    for _ in range(5):
        assert script.tick((0.0, 0.0), old).state is DriveState.DRIVING
    assert script.tick(FORWARD, "following").v == 0.5
    assert script.tick(FORWARD, old).state is DriveState.SETTLING


def test_goal_that_is_reached_at_once_is_believed_after_a_moment():
    script = Script().driving()
    script.until(DriveState.MAPPING, command=(0.0, 0.0), follower="reached")
    script.decide("goal")
    decided = script.t
    script.until(DriveState.SETTLING, command=(0.0, 0.0), follower="reached")
    assert script.t - decided == pytest.approx(0.5, abs=TICK + 1e-6)


def test_follower_that_stays_idle_ends_the_drive():
    script = Script().driving()
    action = script.until(DriveState.SETTLING, command=(0.0, 0.0), follower="idle")
    assert action.sweep_kind is SweepKind.IDLE


@pytest.mark.parametrize("kind", [Decision.EXPLORED, Decision.TRAPPED])
def test_end_of_the_exploration_stands(kind):
    script = Script()
    script.until(DriveState.MAPPING)
    answer = script.decide(kind.value, "no frontier is left")
    assert answer.state is DriveState.FINISHED and answer.reason == f"{kind.value}: no frontier is left"
    for follower in ["following"] * 5 + ["reached"] * 20 + ["idle"] * 200 + ["paused"] * 20:  # the old path's end, and none
        action = script.tick(FORWARD, follower)
        assert (action.v, action.w, action.state) == (0.0, 0.0, DriveState.FINISHED)


def test_sweep_that_does_not_begin_is_asked_for_four_times_and_fails_with_a_reason():
    script = Script()
    script.obeys_sweeps = False
    action = script.until(DriveState.FAILED)
    assert action.reason == "the sweep did not begin within 3.0 s, for the 4th time" and script.sweeps_started == 4
    assert script.tick(FORWARD, "following").v == 0.0 and script.machine.sweeps == 0


def test_hiccup_of_the_mount_costs_one_sweep():
    script = Script()
    for _ in range(6):  # each has its own tries
        script.obeys_sweeps = False
        script.until(DriveState.SWEEPING)
        assert "did not begin" in script.until(DriveState.SETTLING).reason
        script.obeys_sweeps = True
        script.until(DriveState.MAPPING)
        script.decide("look")
    assert "failed" not in script.states()


@pytest.mark.parametrize("state", [DriveState.SETTLING, DriveState.SWEEPING])
def test_mount_that_is_silent_for_a_while_is_named_and_waited_for(state):
    script = Script()
    script.until(state)
    for _ in range(round(60.0 / TICK)):
        action = script.tick(tilt_rad=None)
        assert (action.state, action.reason) == (state, "no joint state of the tilting mount")
    script.tilts = one_sweep() if state is DriveState.SWEEPING else []
    script.until(DriveState.MAPPING)


def test_robot_that_has_failed_sweeps_again_when_somebody_asks_and_has_its_tries_anew():
    script = Script()
    script.obeys_sweeps = False
    script.until(DriveState.FAILED)
    for _ in range(5):
        assert script.tick(follower="recalled").state is DriveState.FAILED, "asked for before it failed"
    for _ in range(100):
        assert script.tick(FORWARD, "following").state is DriveState.FAILED
    assert script.tick(follower="recalled", follower_reason="start").reason == "start"
    script.until(DriveState.FAILED)
    assert script.sweeps_started == 8
    script.obeys_sweeps = True
    for _ in range(15):
        script.tick()
    script.tick(follower="recalled")
    script.until(DriveState.MAPPING)
    assert script.decide("goal").state is DriveState.DRIVING


def test_mount_that_speaks_and_is_not_level_fails():
    script = Script()
    script.until(DriveState.SETTLING)
    assert script.until(DriveState.FAILED, tilt_rad=0.5).reason == "the mount was not level within 20 s"


def test_sweep_without_a_cloud_is_made_again_and_says_what_the_mount_did():
    script = Script()
    script.machine.whole_sweep_rad = 3.0
    script.until(DriveState.MAPPING, cloud_s=-math.inf)
    mapped_s = script.t
    action = script.until(DriveState.SETTLING, cloud_s=0.5)
    assert action.reason == "no cloud of the sweep, in which the mount went from -0.60 to 2.85 rad, of 3.00 that are asked for"
    assert script.t - mapped_s == pytest.approx(StopScanAndGoConfig().cloud_limit_s, abs=2 * TICK)
    script.until(DriveState.MAPPING, cloud_s=0.5)
    script.until(DriveState.FAILED, cloud_s=0.5, limit=2000)
    assert script.sweeps_started == 4 and script.actions[-1].reason.endswith("for the 4th time")


@pytest.mark.parametrize("has_come", [True, None])
def test_decision_is_waited_for_where_the_cloud_has_come_or_nobody_hears_of_clouds(has_come):
    script = Script()
    script.until(DriveState.MAPPING, cloud_s=-math.inf if has_come else None)
    heard_s = script.t - 0.2 if has_come else None
    for _ in range(round(100.0 / TICK)):
        assert script.tick(cloud_s=heard_s).state is DriveState.MAPPING


def test_sweep_that_does_not_end_fails_with_a_reason():
    script = Script(sweep_limit_s=10.0)
    script.until(DriveState.SWEEPING)
    assert script.until(DriveState.FAILED, tilt_rad=1.0).reason == "the sweep did not end within 10.0 s"


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"T_odom_base": None}, "no odometry"),
        ({"T_odom_base": transform_from_rpy([0.0, 0.0, 0.0]) * math.nan}, "no odometry"),
        ({"command": None}, "no command"),
        ({"command": (math.nan, 0.0)}, "no command"),
    ],
)
def test_what_is_missing_while_driving_stops_the_robot_and_no_more(changes, reason):
    script = Script().driving()
    action = script.tick(**({"command": FORWARD, "follower": "following"} | changes))
    assert (action.v, action.w, action.state) == (0.0, 0.0, DriveState.DRIVING) and reason in action.reason
    assert script.tick(FORWARD, "following").v == 0.5


def test_start_waits_for_odometry_and_laser():
    script = Script()
    for _ in range(60):
        assert script.tick(T_odom_base=None).state is DriveState.STARTING
        assert script.tick(tilt_rad=None).state is DriveState.STARTING
    script.until(DriveState.SETTLING, limit=25)


@pytest.mark.parametrize("now", [2.0, 170.0, 2e9])
def test_time_that_jumps_delays_but_does_not_break_the_round(now: float):
    script = Script()
    script.t = 100.0
    script.until(DriveState.SWEEPING)
    script.t = now
    assert script.until(DriveState.MAPPING, limit=200).sweep_kind is SweepKind.INITIAL
    assert script.decide("goal").state is DriveState.DRIVING


def test_stamp_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="stamp_s"):
        Script().tick(stamp_s=math.nan)


def test_wrong_configuration_lists_every_violation():
    with pytest.raises(ValueError, match=r"max_distance_m.*left_tilt_rad"):
        StopScanAndGo(StopScanAndGoConfig(max_distance_m=0.0, left_tilt_rad=0.1, level_tilt_rad=0.15))


@pytest.mark.parametrize("state", [DriveState.SETTLING, DriveState.SWEEPING, DriveState.MAPPING, DriveState.DRIVING])
def test_machine_that_was_kept_goes_on_and_does_not_begin_anew(state):
    script, other = Script(), Script()
    for s in (script, other):
        s.until(DriveState.MAPPING)
        if state is DriveState.DRIVING:
            s.decide("goal")
        elif state is not DriveState.MAPPING:
            s.decide("goal")
            s.until(state, command=FORWARD, follower="following")
        s.actions.clear()
    other.machine = pickle.loads(pickle.dumps(other.machine))
    assert other.machine.state is script.machine.state is state
    for s in (script, other):
        for _ in range(200):
            s.tick(FORWARD, "following")
            if s.machine.state is DriveState.MAPPING:
                s.decide("goal")
    assert other.actions == script.actions and other.machine.sweeps == script.machine.sweeps


@pytest.mark.parametrize("step_s", [3600.0, -3600.0, -0.7])
def test_time_since_the_beginning_goes_on_where_the_clock_is_set(step_s: float) -> None:
    """A budget of 30 minutes was spent when chrony set the clock an hour on, and never ended when it was set back."""
    script = Script()
    script.driving()
    before_s = script.t - script.machine.began_s
    script.t += step_s
    script.tick(FORWARD, "following")
    assert script.t - script.machine.began_s == pytest.approx(before_s, abs=2 * TICK)


def test_pause_of_the_follower_is_time_of_the_run() -> None:
    script = Script()
    script.tick()
    script.t += 30.0
    script.tick()
    assert script.t - script.machine.began_s == pytest.approx(30.0 + TICK)
