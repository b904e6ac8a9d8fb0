"""Clouds of files: what other programs wrote comes back as it was, and what is cut off or damaged never does."""

import numpy as np
import open3d as o3d
import pytest

from mapping_tools.cloud_files import CloudFileError, read_cloud

WAYS = [("binary.ply", {}), ("ascii.ply", {"write_ascii": True}), ("binary.pcd", {}), ("ascii.pcd", {"write_ascii": True})]
WAYS += [("packed.pcd", {"compressed": True})]


def written(path, points, origins=None, **how):
    cloud = o3d.t.geometry.PointCloud(points.astype(np.float32))
    for k, name in enumerate(("vp_x", "vp_y", "vp_z")):
        if origins is not None:
            cloud.point[name] = np.ascontiguousarray(origins[:, k : k + 1].astype(np.float32))
    assert o3d.t.io.write_point_cloud(str(path), cloud, **how)
    return path


@pytest.fixture
def points():
    return np.random.default_rng(1).uniform(-5.0, 5.0, (200, 3))


@pytest.mark.parametrize("name, how", WAYS)
def test_what_open3d_wrote_comes_back(tmp_path, points, name, how):
    found = read_cloud(written(tmp_path / name, points, points + 1.0, **how))
    np.testing.assert_allclose(found.points, points, atol=1e-5)
    np.testing.assert_allclose(found.origins, points + 1.0, atol=1e-5)


@pytest.mark.parametrize("name, how", WAYS)
def test_cloud_without_viewpoint_fields_has_no_origins(tmp_path, points, name, how):
    found = read_cloud(written(tmp_path / name, points, **how))
    assert found.origins is None
    np.testing.assert_array_equal(found.sensor, np.zeros(3))


@pytest.mark.parametrize("name, how", WAYS)
@pytest.mark.parametrize("left", [0.0, 0.02, 0.6, 0.99])
def test_cut_off_file_is_no_cloud(tmp_path, points, name, how, left):
    path = written(tmp_path / name, points, points, **how)
    data = path.read_bytes()
    path.write_bytes(data[: int(left * len(data))])
    with pytest.raises(CloudFileError, match=name):
        read_cloud(path)


def test_other_byte_order_and_other_elements_of_a_ply_are_read(tmp_path, points):
    header = f"ply\nformat binary_big_endian 1.0\ncomment by hand\nelement vertex {len(points)}\nproperty double x\nproperty double y\n"
    header += "property uchar red\nproperty double z\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n"
    rows = np.zeros(len(points), [("x", ">f8"), ("y", ">f8"), ("red", "u1"), ("z", ">f8")])
    rows["x"], rows["y"], rows["z"] = points.T
    path = tmp_path / "hand.ply"
    path.write_bytes(header.encode("ascii") + rows.tobytes())
    np.testing.assert_array_equal(read_cloud(path).points, points)


@pytest.mark.parametrize("form", ["ASCII", "BINARY"])
def test_points_of_a_vtk_are_read(tmp_path, points, form):
    rows = points.round(3).astype(">f4")
    data = rows.tobytes() if form == "BINARY" else "\n".join(" ".join(map(str, nine)) for nine in rows.reshape(-1, 6).tolist()).encode()
    head = f"# vtk DataFile Version 3.0\nby hand\n{form}\nDATASET POLYDATA\nPOINTS {len(rows)} float\n".encode()
    path = tmp_path / "scan.vtk"
    path.write_bytes(head + data + b"\nVERTICES 1 2\n1 0\n")
    np.testing.assert_array_equal(read_cloud(path).points, rows)
    path.write_bytes(head + data[:-40] + b"\nVERTICES 1 2\n1 0\n" * (form == "ASCII"))
    with pytest.raises(CloudFileError, match=r"scan.vtk: is cut off: 19\d of 200 points"):
        read_cloud(path)


def test_points_of_text_are_read(tmp_path, points):
    path = tmp_path / "scan.xyz"
    np.savetxt(path, np.column_stack([points, points]), header="x y z red green blue")
    np.testing.assert_array_equal(read_cloud(path).points, points)


def test_format_that_no_library_reads_names_what_converts_it(tmp_path):
    with pytest.raises(CloudFileError, match="convert it, as by pdal"):
        read_cloud(tmp_path / "scan.las")


def test_viewpoint_of_a_pcd_is_where_all_was_seen_from(tmp_path, points):
    path = written(tmp_path / "seen.pcd", points)
    path.write_bytes(path.read_bytes().replace(b"VIEWPOINT 0 0 0", b"VIEWPOINT 1.5 -2 0.25"))
    np.testing.assert_array_equal(read_cloud(path).sensor, [1.5, -2.0, 0.25])


def test_sweep_of_a_session_has_its_origins(tmp_path, points):
    np.savez(tmp_path / "000000.npz", points=points, origins=points + 1.0, stamp_s=2.0)
    np.testing.assert_array_equal(read_cloud(tmp_path / "000000.npz").origins, points + 1.0)


@pytest.mark.parametrize(
    "name, content",
    [
        ("absent.ply", None),
        (
            "comma.ply",
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n0,1 2 3\n",
        ),
        ("twice.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float x\nend_header\n1 2\n"),
        ("huge.ply", b"ply\nformat ascii 1.0\nelement vertex 999999999999999\nproperty float x\nend_header\n1\n"),
        ("grid.vtk", b"# vtk DataFile Version 3.0\n\nASCII\nDATASET STRUCTURED_GRID\nPOINTS 1 float\n1 2 3\n"),
        ("cloud.txt", b"1 2 3\n"),
        ("prose.ply", b"to whom it may concern"),
        ("prose.pcd", b"to whom it may concern"),
        ("prose.npz", b"to whom it may concern"),
        ("strange.ply", b"ply\nformat ebcdic 1.0\nelement vertex 1\nproperty float x\nend_header\n1 2 3\n"),
        ("bare.ply", b"ply\nformat binary_little_endian 1.0\nelement vertex 3\nend_header\n123"),
        ("faces.ply", b"ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int v\nend_header\n3 0 1 2\n"),
        ("flat.ply", b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n"),
        (
            "words.ply",
            b"ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\na b c\n",
        ),
        ("none.ply", b"ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n"),
        ("bare.ply", b"ply\nformat ascii 1.0\nelement vertex 3\nend_header\n"),
        ("short.ply", b"ply\nformat ascii 1.0\nelement vertex\nproperty float x\nend_header\n"),
        ("plain.pcd", b"FIELDS a b c\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n1 2 3\n"),
    ],
)
def test_file_that_is_no_cloud_is_named(tmp_path, name, content):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(CloudFileError, match=name):
        read_cloud(tmp_path / name)
