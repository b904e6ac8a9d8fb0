"""A sweep is found, completed, de-skewed and given out once, whatever the order in which messages come."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from node_life import Journal, Life
from node_life.life import MEMORY
from rigid_geometry import inverse, transform_from_rpy, transform_points
from sweep_assembly import LaserScans, Scan, ScanGeometry, SweepAssembler, SweepAssemblyConfig, TiltGeometry

GEOMETRY = ScanGeometry(math.radians(-135.0), math.radians(3.0), 0.025 / 120, 91)
TILT = TiltGeometry(transform_from_rpy((0.20, 0.0, 0.75)), transform_from_rpy((0.03, 0.0, 0.04)))
ROOM_LOW, ROOM_HIGH = np.array([-3.0, -2.0, -0.132]), np.array([5.0, 4.0, 3.0])
SWEEP_START, SWEEP_END = 2.0, 4.0


def tilt_at(t: float) -> float:
    """0, over the nose to behind, slowly back through the horizon to above, and back to 0."""
    return float(np.interp(t, [2.0, 2.5, 3.8, 4.0], [0.0, 2.88, -0.61, 0.0]))


def still(t: float) -> np.ndarray:
    return transform_from_rpy((1.0, 0.5, 0.0), (0.0, 0.0, 0.3))


def moving(t: float) -> np.ndarray:
    """Constant body twist between the samples, so that interpolation is exact: straight in odom, turning evenly."""
    return transform_from_rpy((0.3 * (t - 3.0), 0.1 * t, 0.0), (0.0, 0.0, 0.6 * (t - 3.0)))


def room_ranges(T_odom_laser: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(n,) distances to the walls of a room without anything in it; T is (n, 4, 4), a beam each."""
    heading = np.einsum("nij,nj->ni", T_odom_laser[:, :3, :3], directions)
    origin = T_odom_laser[:, :3, 3]
    heading[heading == 0.0] = 1e-12
    to_walls = np.where(heading > 0, (ROOM_HIGH - origin) / heading, (ROOM_LOW - origin) / heading)
    return to_walls.min(axis=1)


def messages(pose=still, begin=1.5, end=4.3) -> dict[str, list[tuple[float, object]]]:
    ticks = np.arange(round(begin / 0.025), round(end / 0.025) + 1) * 0.025
    scans = []
    for stamp in ticks:
        times = stamp + GEOMETRY.beam_times
        T = np.stack([pose(t) @ TILT.base_from_laser(tilt_at(t))[0] for t in times])
        scans.append((float(stamp), Scan(GEOMETRY, room_ranges(T, GEOMETRY.directions))))
    return {
        "joint": [(float(t), tilt_at(t)) for t in ticks],
        "odometry": [(float(t), pose(t)) for t in ticks[::2]],
        "scan": scans,
    }


def make(**changes) -> SweepAssembler:
    """For a laser of few beams, whose points lie far apart: none of them is taken for stray."""
    return SweepAssembler(SweepAssemblyConfig(**{"stray_neighbours": 0, **changes}), LaserScans(), TILT)


def feed(assembler: SweepAssembler, topic: str, stamp: float, value: object) -> None:
    {"joint": assembler.add_joint, "odometry": assembler.add_odometry, "scan": assembler.add_scan}[topic](stamp, value)


def run(assembler: SweepAssembler, inputs: dict, keep=lambda topic, stamp: True) -> list:
    merged = sorted((stamp, topic, i) for topic, rows in inputs.items() for i, (stamp, _) in enumerate(rows) if keep(topic, stamp))
    sweeps = []
    for stamp, topic, i in merged:
        feed(assembler, topic, stamp, inputs[topic][i][1])
        sweeps.append(assembler.poll())
    return [s for s in sweeps if s is not None]


STILL, MOVING = messages(still), messages(moving)


def wall_error(sweep, pose) -> np.ndarray:
    points = transform_points(pose(sweep.stamp_s), sweep.points.astype(float))
    return np.minimum(np.abs(points - ROOM_LOW), np.abs(points - ROOM_HIGH)).min(axis=1)


def test_sweep_begins_where_tilt_leaves_and_ends_where_it_rests_at_the_horizontal():
    (sweep,) = run(make(), STILL)
    assert sweep.start_stamp_s == pytest.approx(SWEEP_START)
    assert sweep.stamp_s == pytest.approx(SWEEP_END)
    assert sweep.points.shape == sweep.origins.shape == (80 * GEOMETRY.count + 1, 3)  # of the last scan its first beam
    assert sweep.points.dtype == sweep.origins.dtype == np.float32


@pytest.mark.parametrize(("pose", "inputs"), [(still, STILL), (moving, MOVING)])
def test_points_lie_on_the_walls_also_when_base_and_mount_move(pose, inputs):
    (sweep,) = run(make(), inputs)
    assert wall_error(sweep, pose).max() < 1e-3


def test_origins_are_where_the_beam_started():
    (sweep,) = run(make(), MOVING)
    time = 3.0 + GEOMETRY.beam_times[5]
    T = inverse(moving(sweep.stamp_s)) @ moving(time) @ TILT.base_from_laser(tilt_at(time))[0]
    index = 40 * GEOMETRY.count + 5
    np.testing.assert_allclose(sweep.origins[index], T[:3, 3], atol=1e-5)
    ranges = np.linalg.norm(sweep.points - sweep.origins, axis=1)[40 * GEOMETRY.count : 41 * GEOMETRY.count]
    np.testing.assert_allclose(ranges, dict(MOVING["scan"])[3.0].ranges, rtol=1e-4)


def test_tilt_with_roll_in_its_mount_is_carried_through():
    crooked = TiltGeometry(transform_from_rpy((0.2, 0.0, 0.75), (0.05, -0.02, 0.1)), transform_from_rpy((0.03, 0.01, 0.04), (0.02, 0, 0)))
    T = crooked.base_from_laser(np.array([0.7]))[0]
    expected = crooked.T_base_mount @ transform_from_rpy((0, 0, 0), (0.0, 0.7, 0.0)) @ crooked.T_tilt_laser
    np.testing.assert_allclose(T, expected, atol=1e-12)


def test_nothing_is_given_out_before_scans_and_odometry_reach_the_end():
    for silent in ("scan", "odometry"):
        assembler = make()
        assert run(assembler, STILL, keep=lambda topic, stamp, silent=silent: topic != silent or stamp < SWEEP_END - 1e-4) == []
        rest = {silent: [row for row in STILL[silent] if row[0] >= SWEEP_END - 1e-4]}
        assert len(run(assembler, rest)) == 1
        assert assembler.poll() is None


@settings(max_examples=25, deadline=None, derandomize=True)
@given(st.randoms(use_true_random=False))
def test_order_between_topics_does_not_matter(random):
    (expected,) = run(make(), MOVING)
    assembler = make()
    queues = {topic: list(rows) for topic, rows in MOVING.items()}
    sweeps = []
    while any(queues.values()):
        topic = random.choice([t for t, rows in queues.items() if rows])
        for _ in range(random.choice([1, 3, 200])):
            if queues[topic]:
                feed(assembler, topic, *queues[topic].pop(0))
        sweeps.append(assembler.poll())
    (sweep,) = [s for s in sweeps if s is not None]
    assert (sweep.stamp_s, sweep.start_stamp_s) == (expected.stamp_s, expected.start_stamp_s)
    np.testing.assert_array_equal(sweep.points, expected.points)
    np.testing.assert_array_equal(sweep.origins, expected.origins)


def with_period(rows, period_s):
    return [(stamp, Scan(scan.geometry, scan.ranges, period_s=period_s)) for stamp, scan in rows]


@pytest.mark.parametrize(
    ("kept", "missing"),
    [
        (lambda i, t: True, 0.0),
        (lambda i, t: i % 2 == 0, 0.5),
        (lambda i, t: t < 3.0, 0.5),
        (lambda i, t: not 2.5 < t < 2.8, 0.14),
    ],
    ids=["none", "every second one", "from its middle on", "a piece"],
)
def test_sweep_tells_which_share_of_its_scans_is_missing_and_has_the_others(kept, missing):
    inputs = dict(MOVING)
    inputs["scan"] = [row for i, row in enumerate(with_period(MOVING["scan"], 0.025)) if kept(i, row[0]) or row[0] >= SWEEP_END]
    (sweep,) = run(make(), inputs)
    assert sweep.missing == pytest.approx(missing, abs=0.015)
    assert wall_error(sweep, moving).max() < 1e-3 and len(sweep.points) > 35 * GEOMETRY.count


def test_share_that_is_missing_is_not_known_where_scans_do_not_tell_their_period():
    (sweep,) = run(make(), STILL)
    assert math.isnan(sweep.missing)


def test_scans_without_joints_are_missing_too():
    inputs = {**STILL, "scan": with_period(STILL["scan"], 0.025)}
    inputs["joint"] = [row for row in STILL["joint"] if not 2.6 <= row[0] <= 3.4]
    (sweep,) = run(make(), inputs)
    assert sweep.missing == pytest.approx(0.42, abs=0.03)


def test_invalid_readings_and_empty_directions_give_no_points():
    inputs = dict(STILL)
    blank = np.where(np.arange(GEOMETRY.count) % 2, np.nan, np.inf)
    inputs["scan"] = [(stamp, Scan(GEOMETRY, blank) if 2.5 <= stamp < 3.0 else scan) for stamp, scan in STILL["scan"]]
    (sweep,) = run(make(), inputs)
    assert np.isfinite(sweep.points).all()
    assert sweep.points.shape[0] == 60 * GEOMETRY.count + 1


@pytest.mark.parametrize(("topic", "reason"), [("joint", "scan_without_joints"), ("odometry", "scan_without_odometry")])
def test_scans_within_a_pause_of_the_other_inputs_are_dropped_and_counted(topic, reason):
    assembler = make()
    (sweep,) = run(assembler, STILL, keep=lambda t, stamp: t != topic or not 2.99 < stamp < 3.31)
    assert 13 <= assembler.dropped[reason] <= 17
    assert len(sweep.points) == (80 - assembler.dropped[reason]) * GEOMETRY.count + 1
    assert wall_error(sweep, still).max() < 1e-3


def test_odometry_that_starts_in_the_sweep_costs_the_scans_before_it():
    assembler = make()
    (sweep,) = run(assembler, STILL, keep=lambda t, stamp: t != "odometry" or stamp > 2.9)
    assert assembler.dropped["scan_without_odometry"] > 30
    assert wall_error(sweep, still).max() < 1e-3


@pytest.mark.parametrize(("at", "torn"), [(1.0, 0), (2.5, 1), (9.0, 0)], ids=["before", "within", "after"])
@pytest.mark.parametrize("late", [False, True], ids=["told in time", "told when it has ended"])
def test_sweep_of_a_robot_that_was_moved_by_hands_meanwhile_is_given_up(at, torn, late):
    assembler = make()
    if not late:
        assembler.break_at(at)
    inputs = messages()
    for topic in ("odometry", "joint"):
        for stamp, value in inputs[topic]:
            feed(assembler, topic, stamp, value)
    if late:
        assembler.break_at(at)
    for stamp, value in inputs["scan"]:
        feed(assembler, "scan", stamp, value)
    assert (assembler.poll() is None) == bool(torn) and assembler.dropped.get("sweep_torn", 0) == torn


def test_sweep_without_any_usable_scan_is_counted():
    assembler = make()
    assert run(assembler, STILL, keep=lambda t, stamp: t != "scan" or stamp > 4.1) == []
    assert assembler.dropped == {"sweep_empty": 1}


def test_node_that_joins_in_the_middle_waits_for_the_next_sweep():
    assembler = make()
    assert run(assembler, STILL, keep=lambda t, stamp: stamp > 2.6) == []
    assert assembler.dropped == {"sweep_without_start": 1}


def test_sweep_that_never_returns_is_dropped():
    assembler = make(max_duration_s=1.0)
    assert run(assembler, STILL) == []
    assert assembler.dropped == {"sweep_too_long": 1}
    later = {topic: [(stamp + 5.0, value) for stamp, value in rows] for topic, rows in STILL.items()}
    assert run(assembler, later) == []
    assert assembler.dropped["sweep_too_long"] == 2


def test_time_that_jumps_back_starts_afresh():
    assembler = make()
    run(assembler, STILL, keep=lambda t, stamp: stamp < 3.5)
    (sweep,) = run(assembler, STILL)
    assert assembler.dropped["time_jump"] >= 1
    (expected,) = run(make(), STILL)
    np.testing.assert_array_equal(sweep.points, expected.points)


def test_repeated_and_unreadable_messages_are_dropped_and_counted():
    assembler = make()
    assembler.add_joint(1.0, 0.0)
    assembler.add_joint(1.0, 0.0)
    assembler.add_joint(1.1, math.nan)
    assembler.add_odometry(1.0, np.full((4, 4), np.nan))
    assembler.add_odometry(math.nan, np.eye(4))
    assembler.add_scan(math.inf, Scan(GEOMETRY, np.ones(GEOMETRY.count)))
    reasons = ("joint_late", "joint_not_finite", "odometry_not_rigid", "odometry_not_finite", "scan_not_finite")
    assert assembler.dropped == dict.fromkeys(reasons, 1)
    with pytest.raises(ValueError, match="is a Scan, not ndarray"):
        assembler.add_scan(1.0, np.ones(3))


def test_memory_stays_bounded_while_driving_and_when_a_topic_is_silent():
    driving, silent = make(), make(buffer_s=31.0)
    scan = Scan(GEOMETRY, np.ones(GEOMETRY.count))
    for i in range(4000):
        driving.add_joint(i * 0.025, 0.0)
        for assembler in (driving, silent):
            assembler.add_scan(i * 0.025, scan)
            assembler.add_odometry(i * 0.025, np.eye(4))
    driven, kept = (len(a._joints) + len(a._odometry) + len(a._scans) for a in (driving, silent))
    assert driven < 12 and kept <= 2 * 1242
    assert silent.dropped["scan_overflow"] > 0


def test_two_sweeps_in_a_row_are_given_out_in_order():
    later = {topic: [(stamp + 3.0, value) for stamp, value in rows if stamp > 1.6] for topic, rows in STILL.items()}
    assembler = make()
    for inputs in (STILL, later):
        for topic, rows in inputs.items():
            for stamp, value in rows:
                feed(assembler, topic, stamp, value)
    first, second = assembler.poll(), assembler.poll()
    assert first is not None and second is not None and assembler.poll() is None
    np.testing.assert_allclose(first.points, second.points, atol=1e-5)
    assert second.stamp_s == pytest.approx(first.stamp_s + 3.0)


def test_configuration_is_checked():
    assert SweepAssemblyConfig().validate() == []
    assert len(SweepAssemblyConfig(buffer_s=5.0, still_rate_rad_s=0.0).validate()) == 2
    with pytest.raises(ValueError, match="buffer_s"):
        make(buffer_s=5.0)


def test_beam_that_ended_in_mid_air_is_left_out():
    """One reading of 1 m where all around it see walls; the sweep is otherwise the same."""
    laser = ScanGeometry(math.radians(-30.0), math.radians(0.5), 0.025 / 120, 121)
    scans = [(float(stamp), Scan(laser, np.full(laser.count, 3.0))) for stamp, _ in STILL["scan"]]
    scans[80][1].ranges[60] = 1.0
    found = [run(SweepAssembler(SweepAssemblyConfig(stray_neighbours=k), LaserScans(), TILT), {**STILL, "scan": scans})[0] for k in (0, 2)]
    ranges = [np.linalg.norm(sweep.points - sweep.origins, axis=1) for sweep in found]
    assert [np.count_nonzero(r < 2.0) for r in ranges] == [1, 0] and len(ranges[0]) == len(ranges[1]) + 1


def test_scans_of_varying_layout_give_the_same_walls():
    rng, scans = np.random.default_rng(5), []
    for k, (stamp, _) in enumerate(MOVING["scan"]):
        count = 40 if k == 0 else 91 + int(rng.integers(-2, 3))
        layout = ScanGeometry(
            GEOMETRY.angle_min, GEOMETRY.angle_increment * (1 + 1e-6 * rng.normal()), 0.025 / 120 * rng.uniform(0.99, 1.01), count
        )
        T = np.stack([moving(t) @ TILT.base_from_laser(tilt_at(t))[0] for t in stamp + layout.beam_times])
        scans.append((stamp, Scan(layout, room_ranges(T, layout.directions))))
    (sweep,) = run(make(), {**MOVING, "scan": scans})
    assert len(sweep.points) > 80 * 88 and wall_error(sweep, moving).max() < 1e-3


def test_beams_that_met_nothing_are_free_no_farther_than_their_scan_reaches():
    blank = np.full(GEOMETRY.count, np.inf)
    scans = [(stamp, Scan(GEOMETRY, blank, 0.1, 4.0) if 2.5 <= stamp < 3.0 else scan) for stamp, scan in STILL["scan"]]
    (sweep,) = run(make(), {**STILL, "scan": scans})
    np.testing.assert_allclose(np.linalg.norm(sweep.free_ends - sweep.free_origins, axis=1), 4.0, rtol=1e-5)


@pytest.mark.parametrize("killed_s", [2.3, 3.0, 3.99])
def test_sweep_in_which_the_process_was_killed_is_whole_to_the_bit(killed_s, tmp_path):
    (expected,) = run(make(), MOVING)
    life = Life({MEMORY: str(tmp_path)})
    first = Journal(life, "assembler", most=100)
    assembler = make()
    for stamp, topic, i in sorted((s, topic, i) for topic, rows in MOVING.items() for i, (s, _) in enumerate(rows) if s <= killed_s):
        value = MOVING[topic][i][1]
        feed(assembler, topic, stamp, value)
        if first.note((topic, stamp, value)):
            first.keep(assembler)
    second, notes = Journal(Life({MEMORY: str(tmp_path)}), "assembler").taken_up(make())
    for note in notes:
        feed(second, *note)
    (sweep,) = run(second, MOVING, keep=lambda topic, stamp: stamp > killed_s)
    np.testing.assert_array_equal(sweep.points, expected.points)
    assert (sweep.start_stamp_s, sweep.stamp_s) == (expected.start_stamp_s, expected.stamp_s)


def test_what_the_kept_assembler_knows_already_is_taken_for_repeated():
    (expected,) = run(make(), MOVING)
    assembler = make()
    run(assembler, MOVING, keep=lambda topic, stamp: stamp <= 3.0)
    run(assembler, MOVING, keep=lambda topic, stamp: 2.5 < stamp <= 3.0)
    (sweep,) = run(assembler, MOVING, keep=lambda topic, stamp: stamp > 3.0)
    np.testing.assert_array_equal(sweep.points, expected.points)
