"""The picture of what was missed, on a room of which half is mapped, and levels on literal cells."""

import numpy as np
import open3d as o3d
import pytest
from PIL import Image

from evaluation_report import missed_view
from evaluation_report.missed import levels

CELL = 0.1


def write_tum(path, poses):
    path.write_text("".join(f"{t:.3f} {x:.6f} {y:.6f} 0.132 0 0 0 1\n" for t, x, y in poses))


@pytest.fixture
def run(tmp_path):
    """A floor of 6 x 4 m; the map, in the world's frame, has the part with x < 3 m only."""
    floor = o3d.geometry.TriangleMesh.create_box(6.0, 4.0, 0.2).translate((0, 0, -0.2))
    o3d.io.write_triangle_mesh(str(tmp_path / "world.ply"), floor)
    drive = [(1.0 + 0.05 * k, 1.5 + 0.01 * k, 2.0) for k in range(100)]
    write_tum(tmp_path / "trajectory_truth.txt", drive)
    write_tum(tmp_path / "trajectory.txt", drive[::20])
    x, y = np.meshgrid(np.arange(0.04, 3.0, 0.08), np.arange(0.04, 4.0, 0.08))
    centres = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -0.04)])
    np.savez(tmp_path / "occupied.npz", centers=centres.astype(np.float32), sizes=np.full(len(centres), 0.08, np.float32))
    return tmp_path


def share_of(image, colour):
    return float((np.abs(image.astype(int) - colour).max(axis=2) < 24).mean())


def test_missed_half_is_drawn_as_missed(run):
    path = missed_view(run)
    assert path == run / "map_missed.png"
    image = np.asarray(Image.open(path).convert("RGB"))
    right, left = image[:, image.shape[1] * 2 // 3 :], image[:, : image.shape[1] // 3]
    red, green = np.array([0xD0, 0x10, 0x3A]), np.array([0xB9, 0xE2, 0xB4])
    assert share_of(right, red) > 0.25 and share_of(right, green) < 0.02
    assert share_of(left, green) > 0.2 and share_of(left, red) < 0.02
    assert not list(run.glob(".map*"))


@pytest.mark.parametrize("name", ["world.ply", "trajectory_truth.txt", "trajectory.txt", "occupied.npz"])
def test_what_lacks_is_named(run, name):
    (run / name).unlink()
    with pytest.raises(ValueError, match=name):
        missed_view(run)
    assert not (run / "map_missed.png").exists()


def cells(*columns):
    """One column a heights' tuple, side by side along x."""
    return np.array([[CELL * (k + 0.5), 0.05, z] for k, heights in enumerate(columns) for z in heights])


def test_ground_without_floors_above_each_other_is_one_level_however_hilly():
    assert levels(cells((0.0,), (0.9,), (2.5,)), CELL, 1.0).tolist() == [0, 0, 0]


def test_underpass_and_plateau_are_two_levels_with_the_ramp_divided_half_way():
    ground = cells((0.0,), (0.0, 2.0), (2.0,), (1.5,), (0.5,))
    assert levels(ground, CELL, 1.0).tolist() == [0, 0, 1, 1, 1, 0]


def test_three_storeys_are_three_levels():
    assert levels(cells((0.0, 3.0, 6.0)), CELL, 1.0).tolist() == [0, 1, 2]


def test_noise_within_a_floor_is_no_storey():
    assert levels(cells((0.0, 0.05), (0.0,)), CELL, 1.0).tolist() == [0, 0, 0]
