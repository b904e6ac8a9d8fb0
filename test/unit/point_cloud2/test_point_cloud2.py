"""Clouds of every driver are read by what their message says: layout, byte order, rows, no returns, rings and times."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from driver_clouds import LAYOUTS, STAMP_S, Cloud, Field, cloud, ramp, xyz
from hypothesis import given, settings
from hypothesis import strategies as st

from point_cloud2 import field_table, read_beams, read_points

DOCS = Path(__file__).resolve().parents[3] / "docs"


@pytest.mark.parametrize("big", [False, True])
@pytest.mark.parametrize("driver", LAYOUTS)
def test_points_are_those_that_the_driver_wrote_in_either_byte_order(driver: str, big: bool) -> None:
    found = read_points(cloud(driver, ramp(6) | ({"range": 1} if driver == "ouster" else {}), big=big))
    np.testing.assert_array_equal(found.points, xyz(ramp(6)))
    assert found.origins is None and found.normals is None
    assert found.points.dtype == (np.float64 if driver == "doubles" else np.float32)


@pytest.mark.parametrize("row_step", ["right", "total", "zero", "one point", "too large"])
def test_data_of_just_the_points_size_are_right_whatever_row_step_says(row_step: str) -> None:
    message = cloud("velodyne", ramp(12), rows=3)
    steps = {"right": message.row_step, "total": 12 * 22, "zero": 0, "one point": 22, "too large": 2**31}
    np.testing.assert_array_equal(read_points(replace(message, row_step=steps[row_step])).points, xyz(ramp(12)))


def test_padding_of_rows_is_passed_over_also_where_the_last_row_has_none() -> None:
    message = cloud("velodyne", ramp(12), rows=3, padding=10)
    np.testing.assert_array_equal(read_points(message).points, xyz(ramp(12)))
    np.testing.assert_array_equal(read_points(replace(message, data=message.data[:-10])).points, xyz(ramp(12)))


def test_bytes_behind_the_points_are_passed_over() -> None:
    message = cloud("velodyne", ramp(4))
    np.testing.assert_array_equal(read_points(replace(message, data=message.data + b"rest", row_step=0)).points, xyz(ramp(4)))


@pytest.mark.parametrize("nothing", [(0.0, 0.0, 0.0), (np.nan, np.nan, np.nan), (1.0, np.inf, 0.0)])
def test_beam_without_return_is_no_hit_and_still_a_beam(nothing: tuple[float, float, float]) -> None:
    values = ramp(5) | {"ring": np.arange(5), "time": 0.01 * np.arange(5)}
    for name, value in zip("xyz", nothing, strict=True):
        values[name][2] = value
    assert len(read_points(cloud("velodyne", values)).points) == 4
    beams = read_beams(cloud("velodyne", values), STAMP_S)
    assert np.isnan(beams.points).all(axis=1).tolist() == [False, False, True, False, False]
    assert beams.rings is not None and beams.rings.tolist() == [0, 1, 2, 3, 4]


def test_point_on_an_axis_is_a_hit() -> None:
    values = {"x": np.array([0.0, 0.0, 2.0]), "y": np.array([0.0, 3.0, 0.0]), "z": np.array([-1.0, 0.0, 0.0])}
    assert len(read_points(cloud("velodyne", values)).points) == 3


def test_ouster_s_rows_times_and_zeros() -> None:
    n = np.arange(8)
    values = ramp(8) | {"t": 12_500_000 * (n % 4), "ring": n // 4, "range": np.where(n == 5, 0, 1000 * (n + 1))}
    beams = read_beams(cloud("ouster", values, rows=2), STAMP_S)
    assert beams.times_s is not None and beams.rings is not None
    np.testing.assert_allclose(beams.times_s, 0.0125 * (n % 4))
    assert beams.rings.tolist() == [0, 0, 0, 0, 1, 1, 1, 1]
    assert np.flatnonzero(np.isnan(beams.points[:, 0])).tolist() == [5]


@pytest.mark.parametrize(("driver", "unit_s"), [("hesai", 1.0), ("livox", 1e-6), ("livox", 1e-9)])
def test_times_of_day_become_times_after_the_stamp(driver: str, unit_s: float) -> None:
    after = np.linspace(-0.08, 0.02, 5)
    values = ramp(5) | {"timestamp": (STAMP_S + after) / unit_s, ("ring" if driver == "hesai" else "line"): np.arange(5)}
    beams = read_beams(cloud(driver, values), STAMP_S)
    np.testing.assert_allclose(beams.times_s, after, atol=1e-6)
    assert beams.rings is not None and beams.rings.tolist() == [0, 1, 2, 3, 4]


def test_times_of_another_clock_are_refused_and_their_points_are_read() -> None:
    message = cloud("hesai", ramp(3) | {"timestamp": STAMP_S - 37.0})
    assert len(read_points(message).points) == 3
    with pytest.raises(ValueError, match="timestamp says .* one clock"):
        read_beams(message, STAMP_S)


def test_beams_without_a_time_are_left_out() -> None:
    values = ramp(4) | {"timestamp": np.array([STAMP_S, 0.0, np.nan, STAMP_S + 0.01]), "ring": np.arange(4)}
    beams = read_beams(cloud("hesai", values), STAMP_S)
    assert beams.rings is not None and beams.rings.tolist() == [0, 3]


def test_livox_offsets_are_nanoseconds_and_what_its_tag_calls_noise_is_left_out() -> None:
    values = ramp(4) | {"offset_time": [0, 10_000, 20_000, 30_000], "tag": [0x00, 0x10, 0x20, 0x30], "line": [0, 1, 2, 3]}
    beams = read_beams(cloud("livox offset", values), STAMP_S)
    np.testing.assert_allclose(beams.times_s, [0.0, 1e-5])
    assert len(read_points(cloud("livox offset", values)).points) == 2


def test_row_is_the_ring_where_no_field_tells_it() -> None:
    message = cloud("velodyne", ramp(6), rows=3)
    message.fields = [field for field in message.fields if field.name != "ring"]
    rings = read_beams(message, STAMP_S).rings
    assert rings is not None and rings.tolist() == [0, 0, 1, 1, 2, 2]
    assert read_beams(replace(message, height=1, width=6), STAMP_S).rings is None


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"data": b"\0" * 50}, "3 x 4 points of 22 bytes, row_step 88, cannot be read of 50 bytes"),
        ({"point_step": 8}, "points of 8 bytes, whose field z ends at 12"),
        ({"point_step": 0}, "points of 0 bytes"),
        ({"width": 2**31}, "cannot be read"),
        ({"fields": []}, "without float fields x, y, z; it has none"),
        ({"fields": [Field("x", 0, 7), Field("y", 4, 7)]}, r"without float fields x, y, z; it has x \(f4\), y \(f4\)"),
        ({"fields": [Field("x", 0, 5), Field("y", 4, 5), Field("z", 8, 5)]}, r"without float fields x, y, z; it has x \(i4\)"),
        ({"fields": [Field("x", 0, 99), Field("y", 4, 7), Field("z", 8, 7)]}, r"without float fields x, y, z; it has x \(99\)"),
        ({"fields": [Field("x", 0, 7), Field("x", 4, 7), Field("y", 4, 7), Field("z", 8, 7)]}, "2 fields x"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line(change: dict[str, object], reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        read_points(replace(cloud("velodyne", ramp(12), rows=3), **change))


numbers = st.integers(0, 2**32 - 1) | st.integers(0, 64)
fields = st.builds(Field, st.sampled_from(["x", "y", "z", "ring", "time", "timestamp", "tag", "range"]), numbers, st.integers(0, 10))
clouds = st.builds(Cloud, st.lists(fields, max_size=8), numbers, numbers, numbers, numbers, st.binary(max_size=200), st.booleans())


@settings(max_examples=400, deadline=None)
@given(clouds)
def test_any_message_is_read_or_refused(message: Cloud) -> None:
    for read in (read_points, lambda cloud: read_beams(cloud, STAMP_S)):
        try:
            assert read(message).points.shape[1:] == (3,)
        except ValueError as error:
            assert "cloud" in str(error) and "\n" not in str(error)


def test_table_of_the_docs_is_that_of_the_code() -> None:
    assert field_table() in (DOCS / "sensors.md").read_text(encoding="utf-8")
