"""Pictures: what the renderer puts where, and that a folder yields them whole or says why not."""

import math

import numpy as np
import pytest
from PIL import Image
from run_folder_on_disk import write_run

from exploration_evaluation.picture_content import driven_path
from exploration_evaluation.pictures import draw_pictures
from exploration_evaluation.voxel_renderer import Canvas, View, render_cubes

RED, BLUE, WHITE = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0)


def render(centres, colours, view, sizes=None, bias=None, scale=10.0):
    centres = np.array(centres, dtype=float)
    sizes = np.ones(len(centres)) if sizes is None else np.array(sizes, dtype=float)
    bias = np.zeros(len(centres)) if bias is None else np.array(bias)
    canvas = Canvas(np.array([-2.0, -2.0]), scale, int(4 * scale), int(4 * scale))
    return *render_cubes(centres, sizes, np.array(colours, dtype=np.float32), bias, view, canvas, WHITE), canvas


def test_cube_from_above_fills_its_square_and_nothing_else():
    image, depth, _ = render([[0.5, 0.5, 0.0]], [RED], View.from_above())
    expected = np.zeros((40, 40), dtype=bool)
    expected[10:20, 20:30] = True  # y points up, rows down
    np.testing.assert_array_equal(np.isfinite(depth), expected)
    np.testing.assert_allclose(depth[expected], 0.5)
    assert (image[~expected] == 1.0).all()
    assert (image[expected][:, 1:] == 0.0).all()


def test_nearer_cube_hides_the_farther_whichever_is_drawn_first():
    for order in ([0, 1], [1, 0]):
        centres, colours = np.array([[0, 0, 0], [0, 0, 1.5]]), np.array([RED, BLUE])
        image, _, _ = render(centres[order], colours[order], View.from_above())
        assert image[20, 20, 2] > 0.5
        assert image[20, 20, 0] == 0.0


def test_bias_decides_between_cubes_with_a_common_face():
    image, _, _ = render([[0, 0, 0], [0, 0, 0]], [RED, BLUE], View.from_above(), bias=[0.0, 0.01])
    assert image[20, 20, 2] > 0.5


def test_cube_at_an_angle_covers_its_silhouette():
    elevation = math.radians(30)
    _, depth, canvas = render([[0, 0, 0]], [RED], View.at_angle(math.radians(45), elevation), scale=50.0)
    # Top: the square's diagonal sqrt(2) wide, foreshortened by sin; sides: as wide, 1 m high, foreshortened by cos.
    area = 1.0 * math.sin(elevation) + math.sqrt(2) * math.cos(elevation)
    assert np.isfinite(depth).sum() / canvas.pixels_per_m**2 == pytest.approx(area, rel=0.02)


def test_axes_of_a_view_are_a_right_handed_frame():
    axes = View.at_angle(0.3, 0.7).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_run_folder_yields_two_pictures_that_show_all_classes(tmp_path):
    written = draw_pictures(write_run(tmp_path), {"world": "rooms", "seed": 1, "coverage": 1.0})
    assert [path.name for path in written] == ["map_top.png", "map_angle.png"]
    for path in written:
        pixels = np.asarray(Image.open(path).convert("RGB")).reshape(-1, 3)
        assert len(np.unique(pixels // 16, axis=0)) > 20
    assert not list(tmp_path.glob(".map*"))


def test_map_without_classes_or_path_is_drawn_all_the_same(tmp_path):
    write_run(tmp_path)
    for name in ("terrain.npz", "trajectory.txt", "trajectory_truth.txt"):
        (tmp_path / name).unlink()
    assert all(path.is_file() for path in draw_pictures(tmp_path))


def test_folder_without_any_voxel_says_so(tmp_path):
    with pytest.raises(ValueError, match="nothing to draw.*occupied"):
        draw_pictures(tmp_path)


def test_way_of_a_robot_whose_clock_was_set_back_is_drawn(tmp_path):
    (tmp_path / "trajectory.txt").write_text("".join(f"{stamp} {x} 0 0 0 0 0 1\n" for stamp, x in ((10, 0), (20, 1), (18, 2))))
    path = driven_path(tmp_path)
    assert path.sweeps[:, 0].tolist() == [0.0, 1.0, 2.0] and path.line[-1, 0] == 2.0
