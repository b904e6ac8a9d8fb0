"""Revolutions of a spinning lidar on the nodding mount become one cloud, as a laser's scans do."""

import numpy as np
import pytest
from lidar_in_a_room import COLUMNS, LIDAR, ROOM_HIGH, ROOM_LOW, TILT, revolution

from rigid_geometry import transform_from_rpy, transform_points
from sweep_assembly import LidarRevolutions, Revolution, SweepAssembler, SweepAssemblyConfig

SWEEP_START, SWEEP_END = 2.0, 3.5


def tilt_at(t: float) -> float:
    return float(np.interp(t, [2.0, 2.5, 3.3, 3.5], [0.0, 1.6, -0.79, 0.0]))


def moving(t: float) -> np.ndarray:
    return transform_from_rpy((0.3 * (t - 3.0), 0.1 * t, 0.0), (0.0, 0.0, 0.6 * (t - 3.0)))


def messages(end=3.8, first_turn=1.53):
    """Revolutions do not begin where the sweep does."""
    ticks = (np.arange(60, round(end / 0.025) + 1) * 0.025).round(6)
    turns = np.arange(first_turn, end - 0.1, 0.1).round(6)
    return {
        "joint": [(float(t), tilt_at(t)) for t in ticks],
        "odometry": [(float(t), moving(t)) for t in ticks[::2]],
        "scan": [(float(t), revolution(t, moving, tilt_at)) for t in turns],
    }


MESSAGES = messages()


def run(inputs, **changes):
    """Of a lidar of few columns, whose points lie far apart: none of them is taken for stray."""
    assembler, sweeps = SweepAssembler(SweepAssemblyConfig(**{"stray_neighbours": 0, **changes}), LidarRevolutions(LIDAR), TILT), []
    add = {"joint": assembler.add_joint, "odometry": assembler.add_odometry, "scan": assembler.add_scan}
    late = {"joint": 0.0, "odometry": 0.0, "scan": 0.1}
    for _, topic, i in sorted((stamp + late[topic], topic, i) for topic, rows in inputs.items() for i, (stamp, _) in enumerate(rows)):
        add[topic](*inputs[topic][i])
        sweeps.append(assembler.poll())
    return [s for s in sweeps if s is not None], assembler


def test_points_lie_on_the_walls_while_base_mount_and_lidar_move():
    (sweep,), _ = run(MESSAGES)
    points = transform_points(moving(sweep.stamp_s), sweep.points.astype(float))
    assert np.minimum(np.abs(points - ROOM_LOW), np.abs(points - ROOM_HIGH)).min(axis=1).max() < 2e-3


def test_sweep_holds_the_beams_between_level_and_level_and_no_others():
    (sweep,), _ = run(MESSAGES)
    assert (sweep.start_stamp_s, sweep.stamp_s) == pytest.approx((SWEEP_START, SWEEP_END))
    assert len(sweep.points) == pytest.approx(15 * COLUMNS * 16, abs=3 * 16)
    assert sweep.points.dtype == sweep.origins.dtype == np.float32


def test_sweep_is_complete_with_the_revolution_that_reaches_its_end():
    """The clock may stand from then on: it must not wait for the next one."""
    last = max(stamp for stamp, _ in MESSAGES["scan"] if stamp < SWEEP_END)
    until = {topic: [r for r in rows if topic != "scan" or r[0] <= last] for topic, rows in MESSAGES.items()}
    assert len(run(until)[0]) == 1
    before = {topic: [r for r in rows if topic != "scan" or r[0] < last] for topic, rows in MESSAGES.items()}
    assert run(before)[0] == []


def test_beams_that_met_nothing_are_thinned_and_cut():
    inputs = dict(MESSAGES)
    inputs["scan"] = []
    for stamp, one in MESSAGES["scan"]:
        points = one.points.copy()
        points[np.linalg.norm(points, axis=1) > 3.0] = np.nan
        inputs["scan"].append((stamp, Revolution(points, one.rings, one.times_s)))
    (sweep,), _ = run(inputs, free_range_m=9.0, free_beam_stride=3)
    (whole,), _ = run(MESSAGES)
    gone = len(whole.points) - len(sweep.points)
    assert len(sweep.free_ends) == pytest.approx(gone / 3, rel=0.02)
    np.testing.assert_allclose(np.linalg.norm(sweep.free_ends - sweep.free_origins, axis=1), 9.0, rtol=1e-4)
    assert (sweep.free_origins > whole.origins.min(axis=0) - 1e-3).all() and (sweep.free_origins < whole.origins.max(axis=0) + 1e-3).all()


def test_revolutions_in_a_pause_of_the_odometry_are_left_out_and_counted():
    inputs = dict(MESSAGES) | {"odometry": [r for r in MESSAGES["odometry"] if not 2.6 < r[0] < 3.0]}
    (sweep,), assembler = run(inputs)
    assert assembler.dropped["scan_without_odometry"] >= 4 and len(sweep.points) <= 11.2 * COLUMNS * 16


def test_reading_of_another_sensor_is_refused():
    with pytest.raises(ValueError, match="is a Revolution, not ndarray"):
        SweepAssembler(SweepAssemblyConfig(), LidarRevolutions(LIDAR), TILT).add_scan(1.0, np.ones(5))


def test_fixed_lidar_gives_a_sweep_for_each_part_of_the_way():
    level = {**messages(), "scan": [(t, revolution(t, moving, lambda _: 0.0)) for t in np.arange(1.53, 3.7, 0.1).round(6)]}
    level["joint"] = [(t, 0.0) for t, _ in level["odometry"]]
    sweeps, _ = run(level, windows="travelled", travelled_rad=0.29)  # it turns by 0.6 rad a second
    assert [s.stamp_s - s.start_stamp_s for s in sweeps] == pytest.approx([0.5, 0.5, 0.5, 0.5])
    assert [s.stamp_s for s in sweeps[:-1]] == [s.start_stamp_s for s in sweeps[1:]]
    for sweep in sweeps[1:]:
        points = transform_points(moving(sweep.stamp_s), sweep.points.astype(float))
        assert np.minimum(np.abs(points - ROOM_LOW), np.abs(points - ROOM_HIGH)).min(axis=1).max() < 2e-3
        assert len(sweep.points) == pytest.approx(5 * COLUMNS * 16, abs=3 * 16) and sweep.place is None
