"""Readings that are no surface become NaN; everything else passes unchanged."""

import math
from dataclasses import replace

import numpy as np
import pytest

from rigid_geometry import transform_from_rpy
from robot_body import RobotBody
from sweep_assembly import Scan, ScanChain, ScanFilter, ScanFilterConfig, ScanGeometry, TiltGeometry

GEOMETRY = ScanGeometry(math.radians(-135.0), math.radians(0.25), 0.025 / 1440, 1081)
TILT = TiltGeometry(transform_from_rpy((0.20, 0.0, 0.75)), transform_from_rpy((0.03, 0.0, 0.04)))
ANGLES = GEOMETRY.angle_min + GEOMETRY.angle_increment * np.arange(GEOMETRY.count)
STRAIGHT_DOWN = math.pi / 2
INF, NAN = np.inf, np.nan


HUSKY = RobotBody()


def make_filter(**changes) -> ScanFilter:
    return ScanFilter(ScanFilterConfig(**changes), TILT, HUSKY)


def filtered(ranges, tilts, **changes) -> np.ndarray:
    """What is left of the ranges of a scan without limits of its own."""
    return make_filter(**changes).filter(Scan(GEOMETRY, ranges), tilts)


def scan(fill: float = 5.0) -> np.ndarray:
    return np.full(GEOMETRY.count, fill, dtype=np.float32)


def wall_at_side(distance: float, noise: float = 0.0, seed: int = 1) -> np.ndarray:
    """A long corridor wall on the left, nothing elsewhere."""
    with np.errstate(divide="ignore"):
        ranges = np.where(np.sin(ANGLES) > 1e-3, distance / np.sin(ANGLES), INF)
    ranges += np.random.default_rng(seed).normal(0.0, noise, ranges.shape)
    return np.where(ranges > 25.0, INF, ranges).astype(np.float32)


def test_range_limits_and_special_values_follow_rep_117():
    ranges = scan()
    ranges[100:107] = [0.0, 0.05, -INF, INF, NAN, 31.0, 29.9]
    out = filtered(ranges, 0.0, veiling_max_points=0)
    np.testing.assert_array_equal(out[100:107], np.array([NAN, NAN, NAN, INF, NAN, INF, 29.9], dtype=np.float32))
    assert out.dtype == np.float32
    np.testing.assert_array_equal(out[:100], ranges[:100])


@pytest.mark.parametrize(
    ("reading", "left"), [(7.9, 7.9), (8.0, INF), (8.1, INF), (25.0, INF), (1.5, 1.5), (1.49, NAN), (0.0, NAN), (-1.0, NAN)]
)
def test_limits_of_the_message_count(reading, left):
    """Drivers write range_max, or something beyond it, where nothing is in range."""
    ranges = scan(3.0)
    ranges[500:520] = reading
    out = make_filter().filter(Scan(GEOMETRY, ranges, 1.5, 8.0), 0.0)
    np.testing.assert_array_equal(out[505:515], np.full(10, left, np.float32))
    assert (out[:495] == 3.0).all()


@pytest.mark.parametrize("limits", [(0.1, 0.0), (5.0, 5.0), (0.1, NAN), (NAN, 10.0)])
def test_limits_that_leave_nothing_are_refused(limits):
    with pytest.raises(ValueError, match=r"range_min .* is not below its range_max"):
        Scan(GEOMETRY, scan(), *limits)


def test_level_scan_is_free_no_farther_than_its_sensor_reaches():
    short = make_filter().horizontal(Scan(GEOMETRY, scan(INF), 0.1, 1.5), 0.0)
    assert (short.range_max_m, make_filter().horizontal(Scan(GEOMETRY, scan(INF)), 0.0).range_max_m) == (1.5, 2.5)


def test_scans_of_one_laser_may_differ_from_each_other():
    rng, chain = np.random.default_rng(2), ScanChain(ScanFilterConfig(), TILT, HUSKY)
    done = []
    for k in range(40):
        time_increment, angle = 0.025 / 1440 * (1 + 0.01 * rng.normal()), math.radians(0.25) * (1 + 1e-6 * rng.normal())
        geometry = ScanGeometry(GEOMETRY.angle_min, angle, time_increment, 600 if k == 0 else 1081 + int(rng.integers(-2, 3)))
        chain.add_joint(0.1 * k - 0.01, 0.0)
        chain.add_scan(0.1 * k, Scan(geometry, np.full(geometry.count, 3.0)))
        chain.add_joint(0.1 * k + 0.04, 0.0)
        done += [(geometry, one) for one in chain.poll()]
    assert len(done) == 40 and not chain.dropped
    assert all(one.scan.geometry == geometry and (one.scan.ranges == 3.0).all() for geometry, one in done)


def test_scan_waits_for_the_joint_sample_after_its_last_beam():
    chain = ScanChain(ScanFilterConfig(), TILT, HUSKY)
    chain.add_joint(0.99, 0.0)
    chain.add_scan(1.0, Scan(GEOMETRY, scan(2.0)))
    chain.add_joint(1.01, 0.1)
    assert not list(chain.poll())
    chain.add_joint(1.05, 0.2)
    (one,) = chain.poll()
    assert one.stamp_s == 1.0 and np.isnan(one.level.ranges).all() and (one.scan.ranges[:300] == 2.0).all()


def test_joint_sample_that_is_late_or_doubled_changes_nothing():
    chain = ScanChain(ScanFilterConfig(), TILT, HUSKY)
    for stamp_s, tilt in ((0.95, 0.0), (0.99, 0.0), (0.97, 1.0), (0.99, 1.0), (1.05, 0.0)):
        chain.add_joint(stamp_s, tilt)
    chain.add_scan(0.96, Scan(GEOMETRY, scan(2.0)))
    (one,) = chain.poll()
    assert (one.level.ranges == 2.0).all()


def test_beams_that_met_something_too_far_to_count_are_free_no_farther():
    chain = ScanChain(ScanFilterConfig(max_range_m=3.0), TILT, HUSKY)
    for stamp_s in (0.99, 1.05):
        chain.add_joint(stamp_s, 0.0)
    chain.add_scan(1.0, Scan(GEOMETRY, scan(3.5), 0.1, 30.0))
    (one,) = chain.poll()
    assert np.isposinf(one.scan.ranges).any() and one.scan.range_max_m == 3.0


def test_scan_that_comes_late_is_counted_and_time_that_jumps_back_starts_afresh():
    chain = ScanChain(ScanFilterConfig(), TILT, HUSKY)
    for stamp_s in (10.0, 9.9, 1.0):
        chain.add_scan(stamp_s, Scan(GEOMETRY, scan()))
    assert chain.dropped == {"scan_late": 1, "time_jump": 1}
    for stamp_s in (0.99, 1.05):
        chain.add_joint(stamp_s, 0.0)
    assert [one.stamp_s for one in chain.poll()] == [1.0]


def test_input_is_left_alone():
    ranges = scan(0.01)
    filtered(ranges, 0.0)
    assert (ranges == np.float32(0.01)).all()


@pytest.mark.parametrize(
    ("row", "veiled"),
    [
        ([2, 2, 2, 3.1, 5, 5, 5], [3]),  # one point between edge and background
        ([5, 5, 4, 3, 2, 2, 2], [2, 3]),  # the other edge, two points
        ([2, 2, 2, 5, 5, 5, 5], []),  # a clean edge
        ([5, 5, 5, 2, 5, 5, 5], []),  # a pole one beam wide
        ([2, 2, 2, 3.1, INF, INF, INF], [3]),  # an edge before the sky
        ([2, 2, 2, NAN, 5, 5, 5], []),
        ([2, 2.05, 2.1, 2.15, 2.2, 2.25, 2.3], []),  # steps as small as the noise
    ],
)
def test_points_between_an_edge_and_its_background_are_veiled(row, veiled):
    ranges = scan(row[-1])
    ranges[:500] = row[0]
    ranges[500:507] = row
    expected = ranges.copy()
    expected[[500 + i for i in veiled]] = NAN
    np.testing.assert_array_equal(filtered(ranges, 0.0), expected)


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
def test_wall_seen_at_a_low_angle_survives_the_veiling_filter(noise):
    ranges = wall_at_side(1.0, noise)
    out = filtered(ranges, 0.0)
    measured = np.isfinite(ranges)
    lost = measured & np.isnan(out)
    assert lost.sum() <= 0.03 * measured.sum()


def test_own_body_is_removed_whatever_the_tilt():
    down = filtered(scan(0.5), STRAIGHT_DOWN)
    middle = GEOMETRY.count // 2
    assert np.isnan(down[middle])  # 0.25 m above base_link, in the middle of the deck
    ground = filtered(scan(0.95), math.radians(30.0))
    assert np.isfinite(ground[middle])  # nose down 30 deg, 0.95 m ahead: in front of the bumper


def test_body_box_agrees_with_points_moved_one_by_one():
    rng = np.random.default_rng(3)
    config = ScanFilterConfig(veiling_max_points=0)
    for tilt in (0.0, 0.7, STRAIGHT_DOWN, 2.8, -0.5):
        tilts = tilt + rng.uniform(-0.05, 0.05, GEOMETRY.count)
        ranges = rng.uniform(0.2, 2.0, GEOMETRY.count).astype(np.float32)
        out = ScanFilter(config, TILT, HUSKY).filter(Scan(GEOMETRY, ranges), tilts)
        for beam in range(0, GEOMETRY.count, 7):
            r = float(ranges[beam])
            p = TILT.base_from_laser(tilts[beam])[0] @ [r * math.cos(ANGLES[beam]), r * math.sin(ANGLES[beam]), 0.0, 1.0]
            inside = all(low <= v <= high for low, v, high in zip(HUSKY.body_min_m, p[:3], HUSKY.body_max_m, strict=True))
            assert np.isnan(out[beam]) == inside


def test_unknown_tilt_leaves_only_readings_beyond_the_body():
    ranges = scan(0.4)
    ranges[500:] = 6.0
    out = filtered(ranges, NAN)
    assert np.isnan(out[:500]).all() and (out[500:] == 6.0).all()


def test_horizontal_scan_shows_near_returns_only():
    ranges = scan(4.0)
    ranges[10:13] = [1.5, NAN, INF]
    out = make_filter().horizontal(Scan(GEOMETRY, ranges), 0.005).ranges
    np.testing.assert_array_equal(out[10:13], np.array([1.5, NAN, INF], dtype=np.float32))
    assert np.isinf(out[13:]).all()


@pytest.mark.parametrize("tilt", [0.02, -0.02, NAN])
def test_tilted_scan_says_nothing_about_obstacles(tilt):
    assert np.isnan(make_filter().horizontal(Scan(GEOMETRY, scan(1.0)), tilt).ranges).all()


def test_scan_with_one_tilted_beam_is_not_horizontal():
    tilts = np.zeros(GEOMETRY.count)
    tilts[-1] = 0.02
    assert np.isnan(make_filter().horizontal(Scan(GEOMETRY, scan(1.0)), tilts).ranges).all()


def test_wrong_shapes_are_named():
    with pytest.raises(ValueError, match=r"1081 beams.*\(7,\)"):
        filtered(np.ones(7), 0.0)
    with pytest.raises(ValueError, match="tilt"):
        filtered(scan(), np.zeros(7))


def test_configuration_lists_every_violation():
    config = ScanFilterConfig(min_range_m=2.0, max_range_m=1.0, veiling_angle_rad=-1.0)
    assert len(config.validate()) == 2
    with pytest.raises(ValueError, match="min_range_m"):
        ScanFilter(config, TILT, HUSKY)
    assert ScanFilterConfig().validate() == []


@pytest.mark.parametrize("values", [(0.0, 0.0, 1e-5, 10), (NAN, 0.1, 1e-5, 10), (0.0, 0.1, -1.0, 10), (0.0, 0.1, 1e-5, 1)])
def test_impossible_scan_geometry_is_refused(values):
    with pytest.raises(ValueError):
        ScanGeometry(*values)


def test_larger_robot_takes_more_echoes_for_its_own():
    bumper = math.radians(30.0)  # nose down, so that the beam straight ahead ends 0.75 m before base_link
    middle = GEOMETRY.count // 2
    kept = []
    for length_m in (0.99, 1.5):
        body = ScanFilter(ScanFilterConfig(), TILT, replace(HUSKY, length_m=length_m))
        kept.append(bool(np.isfinite(body.filter(Scan(GEOMETRY, scan(0.6)), bumper)[middle])))
    assert kept == [True, False]
