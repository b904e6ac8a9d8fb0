"""Single lines come out in odom, in order, as soon as they are complete; what belongs to no pose or tilt is left out and counted."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lidar_in_a_room import LIDAR, ROOM_HIGH, ROOM_LOW, TILT, revolution
from lidar_in_a_room import room_ranges as ranges_along

from rigid_geometry import transform_from_rpy
from sweep_assembly import LaserScans, LidarRevolutions, Line, LineSource, Scan, ScanGeometry, SweepAssemblyConfig

GEOMETRY = ScanGeometry(math.radians(-135.0), math.radians(3.0), 0.025 / 120, 91)
Messages = dict[str, list[tuple[float, object]]]


def tilt_at(t: float) -> float:
    """A mount that nods once in two seconds."""
    return 0.5 + 0.8 * math.sin(math.pi * t)


def pose(t: float) -> np.ndarray:
    return transform_from_rpy((0.5 * t, 0.1 * t, 0.0), (0.0, 0.0, 0.6 * t))


def scan(stamp: float) -> Scan:
    T = np.stack([pose(t) @ TILT.base_from_laser(tilt_at(t))[0] for t in stamp + GEOMETRY.beam_times])
    return Scan(GEOMETRY, ranges_along(T, GEOMETRY.directions).astype(np.float32))


def messages(begin: float = 0.0, end: float = 0.5) -> Messages:
    stamps = [float(t) for t in begin + np.arange(round((end - begin) / 0.025)) * 0.025]
    fine = [float(t) for t in begin + np.arange(round((end - begin) / 0.005)) * 0.005]
    return {
        "joint": [(t, tilt_at(t)) for t in fine],
        "odometry": [(t, pose(t)) for t in stamps],
        "reading": [(t + 0.003, scan(t + 0.003)) for t in stamps],
    }


def laser() -> LineSource[Scan]:
    return LineSource(SweepAssemblyConfig(), TILT, LaserScans())


def fed(source: LineSource, given: Messages, order: list[str] | None = None) -> list[Line]:
    """Lines given out when the topics' messages come in turns, each in its own order."""
    left, out = {topic: list(values) for topic, values in given.items()}, []
    for topic in order or [t for t, values in given.items() for _ in values]:
        if left[topic]:
            getattr(source, f"add_{topic}")(*left[topic].pop(0))
            out += source.poll()
    for topic, values in left.items():
        for value in values:
            getattr(source, f"add_{topic}")(*value)
    return out + list(source.poll())


def off_walls_m(points: np.ndarray) -> np.ndarray:
    return np.abs(np.concatenate([points - ROOM_LOW, points - ROOM_HIGH], axis=1)).min(axis=1)


def test_lines_of_a_robot_that_drives_and_nods_lie_on_the_walls() -> None:
    lines = fed(laser(), messages())
    assert len(lines) == 19 and all(len(one.hits) == 91 for one in lines)
    assert max(off_walls_m(one.hits).max() for one in lines) < 0.01
    middle = pose(0.003 + 0.5 * GEOMETRY.duration_s) @ TILT.base_from_laser(tilt_at(0.003 + 0.5 * GEOMETRY.duration_s))[0]
    np.testing.assert_allclose(lines[0].origin, middle[:3, 3], atol=0.003)


def test_revolutions_of_a_lidar_are_lines_too() -> None:
    given = messages(end=0.6)
    given["reading"] = [(t, revolution(t, pose, tilt_at)) for t in (0.05, 0.15, 0.25)]
    lines = fed(LineSource(SweepAssemblyConfig(), TILT, LidarRevolutions(LIDAR)), given)
    assert len(lines) == 3 and max(off_walls_m(one.hits).max() for one in lines) < 0.02


@settings(max_examples=20, deadline=None)
@given(st.lists(st.sampled_from(["joint", "odometry", "reading"]), max_size=120))
def test_lines_depend_on_stamps_not_on_the_order_of_topics(order: list[str]) -> None:
    given = messages(end=0.2)
    expected, found = fed(laser(), given), fed(laser(), given, order)
    assert [one.stamp_s for one in expected] == [one.stamp_s for one in found]
    assert all(np.array_equal(a.hits, b.hits) for a, b in zip(expected, found, strict=True))


def test_beams_that_met_nothing_end_free_and_those_that_are_not_known_nowhere() -> None:
    source, given = laser(), messages(end=0.1)
    ranges = np.full(91, np.nan, np.float32)
    ranges[:45] = np.inf
    given["reading"] = [(0.003, Scan(GEOMETRY, ranges))]
    (line,) = fed(source, given)
    assert len(line.hits) == 0 and len(line.free_ends) == 15
    assert np.allclose(np.linalg.norm(line.free_ends - line.origin, axis=1), SweepAssemblyConfig().free_range_m, atol=0.02)


@pytest.mark.parametrize("topic, gap_s, reason", [("joint", 0.12, "joints"), ("odometry", 0.22, "odometry")])
def test_lines_in_a_pause_of_joints_or_odometry_are_left_out_and_counted(topic: str, gap_s: float, reason: str) -> None:
    given, source = messages(end=0.8), laser()
    given[topic] = [(t, v) for t, v in given[topic] if not 0.3 < t < 0.3 + gap_s]
    lines = fed(source, given)
    lost = source.dropped[f"scan_without_{reason}"]
    assert lost >= 5 and len(lines) + lost == 31
    assert max(off_walls_m(one.hits).max() for one in lines) < 0.01


def test_line_from_before_the_first_joint_sample_is_left_out() -> None:
    given, source = messages(), laser()
    given["joint"] = [(t, v) for t, v in given["joint"] if t > 0.2]
    lines = fed(source, given)
    assert lines and lines[0].stamp_s > 0.2 and source.dropped["scan_without_joints"] > 0


def test_late_line_is_counted_and_time_that_jumps_back_starts_afresh() -> None:
    source = laser()
    fed(source, messages(begin=5.0, end=5.5))
    source.add_reading(5.2, scan(5.2))
    assert source.dropped["scan_late"] == 1
    assert len(fed(source, messages())) == 19


@pytest.mark.parametrize("tilt", [math.nan, math.inf])
def test_tilt_that_is_not_finite_is_refused(tilt: float) -> None:
    with pytest.raises(ValueError, match="must be finite"):
        laser().add_joint(1.0, tilt)


def test_reading_of_another_sensor_is_refused() -> None:
    with pytest.raises(ValueError, match="is a Scan"):
        laser().add_reading(1.0, revolution(0.05, pose, tilt_at))
