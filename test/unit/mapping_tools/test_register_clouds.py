"""./register_clouds: what it finds, what it refuses, and what it says of bad input, all without a traceback."""

import json

import numpy as np
import open3d as o3d
import pytest

from mapping_tools.prepared_cloud import met_something
from mapping_tools.register_clouds import main
from rigid_geometry import inverse, rotation_angle, transform_from_rpy, transform_points

T_ROOM_A = transform_from_rpy((-1.2, -0.8, 0.9))
T_ROOM_B = transform_from_rpy((-0.6, 0.1, 0.9), (0.0, 0.0, 0.4))
T_A_B = inverse(T_ROOM_A) @ T_ROOM_B


def room(size=(4.5, 3.5, 2.6)):
    """A closed room of half sizes x, y and height z, with furniture that makes it unlike itself from any other side."""
    x, y, z = size
    boxes = [(-x, -y, -0.1, x, y, 0), (-x, -y, z, x, y, z + 0.1), (-x, y, 0, x, y + 0.1, z), (-x, -y - 0.1, 0, x, -y, z)]
    boxes += [(x, -y, 0, x + 0.1, y, z), (-x - 0.1, -y, 0, -x, y, z), (2, 1, 0, 3, 1.7, 0.8), (-x, 0.5, 0, -x + 0.5, 2, 1.3)]
    boxes += [(0.8, -2.6, 0, 1.2, -2.2, 1.9), (-2.4, -y, 0, -0.6, -y + 0.5, 0.6)]
    scene = o3d.t.geometry.RaycastingScene()
    for box in np.array(boxes, dtype=float):
        mesh = o3d.geometry.TriangleMesh.create_box(*(box[3:] - box[:3])).translate(box[:3])
        scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(mesh))
    return scene


def scan(scene, T_room_sensor, seed=1, count=40_000):
    """(count, 3) points in the sensor's frame, with a centimetre of noise."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rays = np.hstack([np.tile(T_room_sensor[:3, 3], (count, 1)), direction @ T_room_sensor[:3, :3].T]).astype(np.float32)
    ranges = scene.cast_rays(o3d.core.Tensor(rays))["t_hit"].numpy()
    return direction * (ranges + rng.normal(0.0, 0.01, count))[:, None]


def written(path, points):
    cloud = o3d.t.geometry.PointCloud(points.astype(np.float32))
    assert o3d.t.io.write_point_cloud(str(path), cloud)
    return str(path)


@pytest.fixture(scope="module")
def scans(tmp_path_factory):
    folder, scene = tmp_path_factory.mktemp("scans"), room()
    return written(folder / "a.ply", scan(scene, T_ROOM_A)), written(folder / "b.pcd", scan(scene, T_ROOM_B, seed=2))


def outcome(folder, *arguments):
    """Exit code and what was written."""
    out = folder / "T.json"
    code = main([*map(str, arguments), "--out", str(out)])
    return code, json.loads(out.read_text()) if out.exists() else None


def assert_right(found, T_true):
    off = inverse(T_true) @ np.array(found["transform"])
    assert np.linalg.norm(off[:3, 3]) < 0.03 and np.degrees(rotation_angle(off)) < 0.3


def test_reading_is_placed_from_a_guess(tmp_path, scans):
    code, found = outcome(tmp_path, *scans, "--guess", 0.4, 1.1, 0.0, 0.0, 0.0, 0.25, "--guess-sigma", 0.3, 0.1)
    assert code == 0 and found["verdict"] == "accepted"
    assert_right(found, T_A_B)
    assert np.linalg.eigvalsh(found["covariance"]).min() > 0.0
    assert np.linalg.norm(found["quaternion_xyzw"]) == pytest.approx(1.0)


def test_reading_is_placed_without_a_guess(tmp_path, scans):
    code, found = outcome(tmp_path, *scans)
    assert code == 0
    assert_right(found, T_A_B)


def test_what_was_written_is_a_guess_for_the_next_match(tmp_path, scans, capsys):
    outcome(tmp_path, *scans)
    assert main([*scans, "--guess-file", str(tmp_path / "T.json")]) == 0
    assert "accepted" in capsys.readouterr().out


def test_origins_in_fields_are_used(tmp_path, scans):
    points = transform_points(T_A_B, scan(room(), T_ROOM_B, seed=2))
    cloud = o3d.t.geometry.PointCloud(points.astype(np.float32))
    for name, value in zip(("vp_x", "vp_y", "vp_z"), T_A_B[:3, 3], strict=True):
        cloud.point[name] = np.full((len(points), 1), value, np.float32)
    o3d.t.io.write_point_cloud(str(tmp_path / "moved.ply"), cloud)
    code, found = outcome(tmp_path, scans[0], tmp_path / "moved.ply")
    assert code == 0
    assert_right(found, np.eye(4))


def test_clouds_in_coordinates_far_from_their_origin_are_matched(tmp_path, scans):
    far = np.array([2000.0, -300.0, 40.0])
    reference, reading = (written(tmp_path / f"{k}.ply", scan(room(), T, seed=k) + far) for k, T in ((1, T_ROOM_A), (2, T_ROOM_B)))
    code, found = outcome(tmp_path, reference, reading, "--origins", "none")
    assert found["transform"] is None or code == 0
    code, found = outcome(tmp_path, reference, reading, "--set", "verdict=match_ratio", "--origins", "none")
    T_far = transform_from_rpy(far)
    off = inverse(T_A_B) @ inverse(T_far) @ np.array(found["transform"]) @ T_far
    assert code == 0 and np.linalg.norm(off[:3, 3]) < 0.05 and np.degrees(rotation_angle(off)) < 0.3
    sigmas_at_points = np.array(found["covariance"])
    assert np.linalg.eigvalsh(sigmas_at_points).min() > 0.0 and sigmas_at_points[3:, 3:].max() > 0.1  # metres, 2 km from the points


def test_clouds_in_map_coordinates_are_matched_near_them(tmp_path, scans, capsys):
    far = np.array([448262.0, 5412345.0, 412.0])
    shapes = scan(room(), T_ROOM_A), scan(room(), T_ROOM_B, seed=2)
    for name, points in zip("ab", shapes, strict=True):
        np.savetxt(tmp_path / f"{name}.xyz", points + far, fmt="%.4f")
    near = outcome(tmp_path, *scans, "--set", "verdict=match_ratio", "--origins", "none")[1]
    code, found = outcome(tmp_path, tmp_path / "a.xyz", tmp_path / "b.xyz", "--set", "verdict=match_ratio", "--origins", "none")
    T_far = transform_from_rpy(far)
    off = inverse(np.array(near["transform"])) @ inverse(T_far) @ np.array(found["transform"]) @ T_far
    assert code == 0 and np.linalg.norm(off[:3, 3]) < 0.01 and np.degrees(rotation_angle(off)) < 0.1
    code, found = outcome(tmp_path, tmp_path / "a.xyz", scans[1], "--guess", *far, 0.0, 0.0, 0.0)
    assert "does not say where its beams started" in capsys.readouterr().err
    off = inverse(T_A_B) @ inverse(T_far) @ np.array(found["transform"]) if code == 0 else np.eye(4)
    assert np.linalg.norm(off[:3, 3]) < 0.03


def test_far_cloud_whose_digits_are_lost_is_refused(tmp_path, scans, capsys):
    lost = written(tmp_path / "lost.ply", scan(room(), T_ROOM_A) + [448262.0, 5412345.0, 412.0])
    assert main([lost, scans[1]]) == 2
    assert "lost.ply: its points, far from 0 0 0 in float32, are told apart to 0.5 m only" in capsys.readouterr().err


def test_place_for_the_result_is_looked_at_before_the_match(tmp_path, scans, capsys):
    assert main([*scans, "--out", str(tmp_path / "none" / "T.json")]) == 2
    text = capsys.readouterr().err
    assert text.startswith("./register_clouds: --out") and text.count("\n") == 1


@pytest.mark.parametrize("at", [0, 1, 2])
def test_input_is_not_replaced_by_the_result(tmp_path, scans, capsys, at):
    guess = tmp_path / "guess.json"
    guess.write_text(json.dumps(np.eye(4).tolist()))
    out = (*scans, guess)[at]
    assert main([*scans, "--guess-file", str(guess), "--out", str(out)]) == 2
    text = capsys.readouterr().err
    assert text.startswith(f"./register_clouds: --out {out}: is the input") and text.count("\n") == 1


def test_another_room_is_refused_and_leaves_no_transform(tmp_path, scans, capsys):
    other = written(tmp_path / "other.ply", scan(room((3.1, 2.7, 2.2)), transform_from_rpy((0.5, 0.4, 0.9), (0, 0, 2.0))))
    code, found = outcome(tmp_path, scans[0], other)
    assert code == 1 and found["transform"] is None and found["covariance"] is None
    said = capsys.readouterr().out
    assert found["verdict"] in ("refused", "ambiguous") and found["reason"] in said
    assert (found["not_verified"] is not None) == (found["verdict"] == "refused") == ("not verified: x y z" in said)


def test_refusal_prints_the_limit_and_where_the_reading_was_laid(tmp_path, scans, capsys):
    code, found = outcome(tmp_path, *scans, "--set", "max_contradiction=0", "--set", "max_changed=0")
    said = capsys.readouterr().out
    assert code == 1 and found["transform"] is None and "max_contradiction = 0" in found["reason"]
    x, y, z = np.array(found["not_verified"])[:3, 3]
    assert f"not verified: x y z {x:.4f} {y:.4f} {z:.4f} m" in said
    off = inverse(T_A_B) @ np.array(found["not_verified"])
    assert np.linalg.norm(off[:3, 3]) < 0.03


def test_beams_that_met_nothing_are_told_by_the_one_range_they_share(tmp_path, scans, capsys):
    points = scan(room(), T_ROOM_B, seed=2)
    upwards = points[:, 2] > 0.5 * np.linalg.norm(points, axis=1)
    points[upwards] *= 32.77 / np.linalg.norm(points[upwards], axis=1, keepdims=True)
    code, found = outcome(tmp_path, scans[0], written(tmp_path / "open.ply", points))
    assert f"{np.count_nonzero(upwards):,} points, all 32.77 m away and none farther, left out" in capsys.readouterr().err
    assert code == 0
    assert_right(found, T_A_B)


@pytest.mark.parametrize(
    "ranges",
    [np.full(1000, 3.0), np.linspace(1.0, 30.0, 1000), np.linspace(1.0, 30.0, 100), np.zeros(0)],
    ids=["all alike", "a wall far off", "few points", "none"],
)
def test_no_range_that_surfaces_may_have_is_taken_for_the_limit(ranges):
    assert met_something(ranges).all()


@pytest.mark.parametrize(("count", "are_echoes"), [(19, True), (20, False)])
def test_limit_is_told_by_twenty_beams_and_more(count, are_echoes):
    assert met_something(np.append(np.linspace(1.0, 30.0, 100), np.full(count, 32.77)))[100:].all() == are_echoes


def test_scan_of_3dtk_is_read(tmp_path, scans):
    x, y, z = 100.0 * scan(room(), T_ROOM_B, seed=2, count=15_000).T
    np.savetxt(tmp_path / "scan001.3d", np.column_stack([-y, z, x]), fmt="%.4f")
    code, found = outcome(tmp_path, scans[0], tmp_path / "scan001.3d")
    assert code == 0
    assert_right(found, T_A_B)


@pytest.mark.parametrize(
    "points",
    [
        np.array([[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]]),
        np.full((5000, 3), 1.5),
        np.array([[1e3, 0.0, 0.0]]) + np.random.default_rng(0).uniform(-3, 3, (5000, 3)),
        np.random.default_rng(0).uniform(-3, 3, (5000, 3)) * [1, 1, 0],
        np.random.default_rng(0).uniform(-3, 3, (5000, 3)) * [1, 0, 0],
    ],
    ids=["two points", "all equal", "a kilometre off", "planar", "on a line"],
)
def test_cloud_that_tells_nothing_is_not_accepted(tmp_path, scans, points):
    poor = written(tmp_path / "poor.ply", points)
    for pair in ((scans[0], poor), (poor, scans[1])):
        code, found = outcome(tmp_path, *pair)
        assert found["verdict"] != "accepted" and code == (0 if found["verdict"] == "degenerate" else 1)


def test_points_that_are_not_finite_are_left_out(tmp_path, scans, capsys):
    points = scan(room(), T_ROOM_B, seed=2)
    points[::7] = np.nan
    code, found = outcome(tmp_path, scans[0], written(tmp_path / "holes.ply", points))
    assert code == 0 and "not finite" in capsys.readouterr().err
    assert_right(found, T_A_B)


@pytest.mark.parametrize(
    "more, said",
    [
        (["--guess", "0", "0", "nan", "0", "0", "0"], "--guess 0 0 nan 0 0 0: expected 6 finite numbers"),
        (["--min-range", "-1"], "--min-range -1: expected 0 or more"),
        (["--min-range", "nan"], "--min-range"),
        (["--guess", "0", "0"], "--guess"),
        (["--guess-file", "absent.json"], "absent.json"),
        (["--guess-sigma", "0", "1"], "--guess-sigma"),
        (["--origins", "fields"], "vp_x"),
        (["--origins", "anywhere"], "--origins"),
        (["--set", "voxel=1"], "voxel_m"),
        (["--set", "voxel_m"], "PARAMETER=VALUE"),
        (["--set", "voxel_m=-1"], "voxel_m"),
        (["--set", "voxel_m=[1"], "voxel_m"),
        (["--min-range", "1000"], "1000"),
        (["--out", "/nowhere/T.json"], "/nowhere"),
        (["--speed"], "--speed"),
    ],
)
def test_wrong_argument_is_named(scans, capsys, more, said):
    assert main([*scans, *more]) == 2
    text = capsys.readouterr().err
    assert said in text and text.splitlines()[-1].startswith("./register_clouds: ")


@pytest.mark.parametrize(
    "content",
    [
        "",
        "[1, 2, 3]",
        '{"transform": null}',
        '{"pose": 1}',
        json.dumps((2 * np.eye(4)).tolist()),
        "[[1, 2",
        "[[NaN,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]",
    ],
)
def test_guess_file_that_holds_no_transform_is_named(tmp_path, scans, capsys, content):
    (tmp_path / "guess.json").write_text(content)
    assert main([*scans, "--guess-file", str(tmp_path / "guess.json")]) == 2
    text = capsys.readouterr().err
    assert "--guess-file" in text and "transform" in text and "array" not in text


@pytest.mark.parametrize(
    "points", [np.zeros((0, 3)), np.full((50, 3), np.nan), np.full((50, 3), 1e9)], ids=["empty", "NaN", "out of any grid"]
)
def test_cloud_that_holds_nothing_is_named(tmp_path, scans, capsys, points):
    path = tmp_path / "nothing.ply"
    rows = points.astype("<f4")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\nproperty float x\nproperty float y\nproperty float z\n"
    path.write_bytes(header.encode("ascii") + b"end_header\n" + rows.tobytes())
    assert main([scans[0], str(path)]) == 2
    assert "nothing.ply" in capsys.readouterr().err
