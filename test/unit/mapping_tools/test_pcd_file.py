"""PCD as people have them: what can be read is read right, what contradicts itself is refused, and no header is believed unseen."""

import numpy as np
import pytest

from mapping_tools.cloud_files import CloudFileError, read_cloud
from mapping_tools.lzf import unpacked

POINTS = np.random.default_rng(7).uniform(-5.0, 5.0, (40, 3)).astype(np.float32)


def header(fields="x y z", size="4 4 4", kind="F F F", count=None, points=40, data="binary", **more):
    """The text of a header; `more` are lines in place of those that it would have, None leaves one out."""
    lines = {"VERSION": "0.7", "FIELDS": fields, "SIZE": size, "TYPE": kind, "COUNT": count or " ".join("1" for _ in fields.split())}
    lines |= {"WIDTH": points, "HEIGHT": 1, "VIEWPOINT": "0 0 0 1 0 0 0", "POINTS": points, "DATA": data} | more
    return "".join(f"{key} {value}\n" for key, value in lines.items() if value is not None).encode()


def read(tmp_path, content):
    (tmp_path / "cloud.pcd").write_bytes(content)
    return read_cloud(tmp_path / "cloud.pcd")


def refusal(tmp_path, content):
    with pytest.raises(CloudFileError) as refused:
        read(tmp_path, content)
    assert str(refused.value).startswith(f"{tmp_path}/cloud.pcd: ") and "\n" not in str(refused.value)
    return str(refused.value)


def literal_lzf(data):
    """LZF of literal runs only."""
    return b"".join(bytes([len(part) - 1]) + part for part in (data[k : k + 32] for k in range(0, len(data), 32)))


def packed(columns, size=None):
    plain = b"".join(np.ascontiguousarray(c).tobytes() for c in columns)
    data = literal_lzf(plain)
    return np.array([len(data), len(plain) if size is None else size], "<u4").tobytes() + data


def test_padding_twice_and_other_fields_do_not_matter(tmp_path):
    layout = np.dtype([("x", "<f4"), ("a", "V4"), ("y", "<f4"), ("i", "<f4"), ("b", "V12"), ("z", "<f4"), ("odd", "V3"), ("n", "<f4")])
    rows = np.zeros(40, layout)
    rows["x"], rows["y"], rows["z"] = POINTS.T
    fields = header("x _ y intensity _ z odd normal_x", "4 1 4 4 1 4 3 4", "F U F F U F Q F", "1 4 1 1 12 1 1 1")
    np.testing.assert_array_equal(read(tmp_path, fields + rows.tobytes()).points, POINTS)


@pytest.mark.parametrize("kind, size, dtype", [("F", 2, "<f2"), ("F", 8, "<f8"), ("I", 2, "<i2"), ("U", 4, "<u4"), ("I", 8, "<i8")])
def test_numbers_of_every_size_are_read(tmp_path, kind, size, dtype):
    values = np.arange(1, 121).reshape(40, 3).astype(dtype)
    text = header(size=f"{size} {size} {size}", kind=f"{kind} {kind} {kind}")
    np.testing.assert_array_equal(read(tmp_path, text + values.tobytes()).points, values)


@pytest.mark.parametrize("kind, size", [("F", 3), ("F", 1), ("Q", 4), ("U", 3)])
def test_point_of_no_number_type_is_refused(tmp_path, kind, size):
    content = header(size=f"{size} 4 4", kind=f"{kind} F F") + bytes(40 * (size + 8))
    assert "field x has TYPE" in refusal(tmp_path, content)


def test_text_with_comments_crlf_and_nan_is_read(tmp_path):
    rows = "".join(f"{x!r} {y!r} {z!r}\r\n" for x, y, z in POINTS.astype(float).tolist())
    content = header(data="ascii", points=41).replace(b"\n", b"\r\n") + b"# by hand\r\n" + rows.encode() + b"\r\nnan nan nan\r\n"
    found = read(tmp_path, content).points
    np.testing.assert_allclose(found[:40], POINTS)
    assert np.isnan(found[40]).all()


def test_old_header_without_points_and_count_is_read(tmp_path):
    content = header(POINTS=None, COUNT=None, VIEWPOINT=None, VERSION=".5", WIDTH=8, HEIGHT=5) + POINTS.tobytes()
    np.testing.assert_array_equal(read(tmp_path, content).points, POINTS)


@pytest.mark.parametrize("padding", [True, False])
def test_compressed_fields_are_read_with_and_without_the_padding_that_pcl_leaves_out(tmp_path, padding):
    columns = [POINTS[:, 0], *([np.zeros(160, np.uint8)] if padding else []), POINTS[:, 1], POINTS[:, 2]]
    text = header("x _ y z", "4 1 4 4", "F U F F", "1 4 1 1", data="binary_compressed")
    np.testing.assert_array_equal(read(tmp_path, text + packed(columns)).points, POINTS)


def test_lzf_repeats_from_far_and_from_itself():
    assert unpacked(bytes([2]) + b"abc" + bytes([0x20 | 0, 2]) + bytes([0xE0, 4, 0]), 3 + 3 + 13) == b"abcabc" + b"c" * 13
    for data in (bytes([0x20, 5]), bytes([5]) + b"ab", bytes([0xE0]), bytes([0]) + b"ab"):
        with pytest.raises(ValueError, match="compressed data"):
            unpacked(data, 3)


@pytest.mark.parametrize(
    "content, said",
    [
        (header() + POINTS.tobytes()[:-1], "cut off: 479 bytes for 40 points of 12 bytes"),
        (header() + POINTS.tobytes() * 2, "its header does not fit its data"),
        (header(points=10**17) + POINTS.tobytes(), "cut off"),
        (header(points=10**30) + POINTS.tobytes(), "expected whole numbers"),
        (header(size="4 4 4000000000000000000") + POINTS.tobytes(), "expected whole numbers"),
        (header("x y z _", "4 4 4 1", "F F F U", "1 1 1 999999999999") + POINTS.tobytes(), "cut off"),
        (header(points=10**12, data="ascii") + b"1 2 3\n", "cut off"),
        (header(points=10**8, data="binary_compressed") + packed(POINTS.T, 12 * 10**8), "cannot stand for 1200000000"),
        (header(data="binary_compressed") + packed(POINTS.T)[:100], "of 495 compressed bytes"),
        (header(data="binary_compressed") + b"\1", "cut off"),
        (header(data="zip") + b"\1", "none of ascii, binary, binary_compressed"),
        (header(WIDTH=20) + POINTS.tobytes(), "WIDTH and HEIGHT make 20 points, its POINTS say 40"),
        (header("x y z z", "4 4 4 4", "F F F F") + bytes(640), "field z is there more than once"),
        (header(kind="F F") + POINTS.tobytes(), "TYPE has 2 entries for 3 FIELDS"),
        (header(size="4 0 4") + POINTS.tobytes(), "from 1 up"),
        (header("x y w") + POINTS.tobytes(), "no z"),
        (header(VIEWPOINT="0 nan 0") + POINTS.tobytes(), "VIEWPOINT"),
        (header(points=-3) + POINTS.tobytes(), "expected whole numbers"),
        (header(FIELDS=None) + POINTS.tobytes(), "no FIELDS"),
        (b"SIZES 4 4 4\n" + header() + POINTS.tobytes(), "line 1: 'SIZES' is none of VERSION"),
        (b"DATA ascii\n1 2 3\n", "no FIELDS"),
        (header(points=2, data="ascii") + b"1 2 3\n0,5 1 2\n", "line 12: '0,5' is no number; decimals are wanted with a point"),
        (header(points=2, data="ascii") + b"1 2 3\n1 2\n", "line 12: 2 numbers where 3 are wanted"),
        (header(points=2, data="ascii") + b"1 2 3\n1 2 1.#QNAN\n", "line 12"),
        (header(points=2, data="ascii") + b"1 2 3\n1 2 1_0\n", "line 12"),
        (header(points=1, data="ascii") + b"1 2 3\n1 2 3\n", "has 2 lines for 1 points"),
    ],
)
def test_header_that_does_not_fit_is_refused(tmp_path, content, said):
    assert said in refusal(tmp_path, content)


def test_points_where_their_beam_starts_are_no_hits(tmp_path):
    rows = np.vstack([POINTS[:3], np.zeros((2, 3)), [[1.5, -2.0, 0.25]], [[np.nan] * 3]]).astype("<f4")
    found = read(tmp_path, header(points=7, VIEWPOINT="1.5 -2 0.25 1 0 0 0") + rows.tobytes())
    assert (len(found.points), found.no_returns) == (4, 3)
    with pytest.raises(CloudFileError, match="all 40 are beams without an echo"):
        read(tmp_path, header() + bytes(480))
