"""Worlds: what their makers promise of passages, slopes, starts and errors."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
import trimesh.exchange.dae
from PIL import Image

from pybullet_simulation import WORLDS, MeshFrame, load_world
from pybullet_simulation.start_pose import StandingTest
from pybullet_simulation.world import nearest_hits, raycasting_scene
from rigid_geometry import read_origin
from robot_body import RobotBody


def columns(world, xy):
    """Heights of the highest surface at each of (N, 2) points."""
    xy = np.asarray(xy, float)
    rays = np.column_stack([xy, np.full(len(xy), 50.0), np.tile((0.0, 0.0, -1.0), (len(xy), 1))]).astype(np.float32)
    return 50.0 - nearest_hits(raycasting_scene(world.vertices, world.triangles), rays)


@pytest.mark.parametrize("name", sorted(WORLDS))
@pytest.mark.parametrize("seed", range(1, 6))
def test_chosen_start_is_flat_and_clear_all_around(name, seed):
    world = load_world(name, seed)
    x, y, _ = world.start_xyyaw
    around = np.linspace(0.0, 2.0 * math.pi, 36, endpoint=False)
    ring = np.column_stack([x + np.cos(around), y + np.sin(around)])
    test = StandingTest(world.vertices, world.triangles, RobotBody())
    lowest = [test.ground_levels(float(a), float(b))[0] for a, b in ring]
    assert np.abs(np.array(lowest) - world.start_z).max() < 0.05
    level = np.column_stack([np.tile((x, y, world.start_z + 0.5), (36, 1)), np.cos(around), np.sin(around), np.zeros(36)])
    assert nearest_hits(raycasting_scene(world.vertices, world.triangles), level.astype(np.float32)).min() > 1.09


@pytest.mark.parametrize("name", sorted(WORLDS))
def test_same_seed_gives_the_same_world_and_another_seed_another(name):
    first, again, other = load_world(name, 3), load_world(name, 3), load_world(name, 4)
    assert np.array_equal(first.vertices, again.vertices) and first.start_xyyaw == again.start_xyyaw
    assert first.vertices.shape != other.vertices.shape or not np.array_equal(first.vertices, other.vertices)


@pytest.mark.parametrize("name", sorted(WORLDS))
def test_triangles_index_vertices_and_all_solids_face_outwards(name):
    world = load_world(name, 1)
    assert world.triangles.dtype == np.int32 and world.vertices.dtype == np.float64
    assert world.triangles.min() >= 0 and world.triangles.max() == len(world.vertices) - 1
    for solid in world.solids:
        mesh = trimesh.Trimesh(solid.vertices, solid.triangles)
        assert mesh.is_watertight and mesh.volume > 0.0, solid.name


def test_plateau_is_reached_by_the_ramp_and_has_headroom_below():
    world = load_world("ramp", 1, start=(5.0, 1.0, 0.0))  # under the plateau
    assert world.start_z == pytest.approx(0.0, abs=1e-5)
    levels = StandingTest(world.vertices, world.triangles, RobotBody()).ground_levels(5.0, 1.0)
    assert levels == pytest.approx([0.0, 2.3], abs=1e-4)
    along = np.column_stack([np.arange(-6.5, 2.5, 0.1), np.full(90, 1.0)])
    steps = np.diff(columns(world, along))
    assert steps.max() == pytest.approx(0.1 * math.tan(math.radians(15.0)), abs=1e-3) and steps.min() > -1e-4


@pytest.mark.parametrize("seed", range(1, 6))
def test_doors_are_wide_enough_to_drive_through_and_too_narrow_to_turn_in(seed):
    solids = {solid.name: solid.vertices for solid in load_world("doors", seed).solids}
    pairs = (("south_0", "south_1", 1), ("north_0", "north_1", 1), ("between_west", "between_east", 0))
    widths = [solids[b][:, axis].min() - solids[a][:, axis].max() for a, b, axis in pairs]
    assert sorted(widths) == pytest.approx([0.9, 0.95, 1.0])
    assert np.ptp(solids["ramp"][:, 1]) == pytest.approx(1.0)


def test_moon_is_mostly_gentle_with_a_few_steep_craters():
    for seed in range(1, 6):
        field = load_world("moon", seed).heightfield
        by_y, by_x = np.gradient(field.heights, field.step)
        slope = np.degrees(np.arctan(np.hypot(by_x, by_y)))
        assert (slope < 20.0).mean() > 0.9 and slope.max() > 35.0


def test_start_that_was_asked_for_is_kept():
    world = load_world("rooms", 1, start=(-4.0, 0.5, 1.0))
    assert world.start_xyyaw == (-4.0, 0.5, 1.0) and world.start_z == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(
    ("name", "start", "text"),
    [
        ("rooms", (0.0, 0.0, 0.0), "inside a wall"),
        ("rooms", (-4.8, 0.0, 0.0), "wall"),
        ("rooms", (30.0, 0.0, 0.0), "no ground"),
        ("rooms", (math.nan, 0.0, 0.0), "finite"),
        ("ramp", (0.0, 1.0, 0.0), "inside a wall or obstacle"),
        ("moon", (9.9, 0.0, 0.0), "walls"),
    ],
)
def test_start_where_the_robot_cannot_stand_is_refused_with_the_reason(name, start, text):
    with pytest.raises(ValueError, match=text):
        load_world(name, 1, start=start)


def test_unknown_world_error_lists_the_known_ones():
    with pytest.raises(ValueError, match="rooms, doors, ramp, moon"):
        load_world("romms", 1)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl", ".dae", ".png"])
def test_missing_and_unreadable_files_are_value_errors(tmp_path, suffix):
    size = (10.0, 10.0, 1.0) if suffix == ".png" else None
    with pytest.raises(ValueError, match="there is no world file"):
        load_world(str(tmp_path / f"none{suffix}"), 1, size)
    bad = tmp_path / f"bad{suffix}"
    bad.write_bytes(b"\x00\x01 neither mesh nor picture")
    with pytest.raises(ValueError, match="cannot read|is empty"):
        load_world(str(bad), 1, size)


def test_arguments_that_do_not_fit_the_world_are_refused(tmp_path):
    floor = tmp_path / "floor.stl"
    trimesh.creation.box((20.0, 20.0, 0.2)).export(floor)
    picture = tmp_path / "flat.png"
    Image.new("L", (16, 16)).save(picture)
    for arguments in [
        ("rooms", 1, (1.0, 1.0, 1.0)),
        ("rooms", 1, None, (5.0, 5.0)),
        ("rooms", -1),
        (str(floor), 1, (1.0, 1.0, 1.0)),
        (str(floor), 1, None, (1.0, 1.0)),
        (str(picture), 1),
        (str(picture), 1, (10.0, -1.0, 1.0)),
    ]:
        with pytest.raises(ValueError):
            load_world(*arguments)


@pytest.mark.parametrize("suffix", [".obj", ".ply", ".stl"])
def test_mesh_file_is_bounded_to_the_area_with_walls(tmp_path, suffix):
    floor = tmp_path / f"floor{suffix}"
    trimesh.creation.box((60.0, 60.0, 0.2)).export(floor)
    world = load_world(str(floor), 1, area_xy=(8.0, 6.0), start=(3.0, 2.0, 0.5))
    assert world.start_z == pytest.approx(0.1, abs=1e-5)
    assert world.extent[:, :2] == pytest.approx(np.array([[3.0 - 4.2, 2.0 - 3.2], [3.0 + 4.2, 2.0 + 3.2]]), abs=1e-6)
    assert world.extent[1, 2] == pytest.approx(0.1 + 1.5)


def test_mesh_without_ground_to_start_on_is_refused(tmp_path):
    pole = tmp_path / "pole.stl"
    trimesh.creation.box((0.3, 0.3, 5.0)).export(pole)
    with pytest.raises(ValueError, match="no flat ground"):
        load_world(str(pole), 1)


@pytest.mark.parametrize(("mode", "top"), [("L", 255), ("I;16", 65535)])
def test_height_map_spans_its_size_with_the_first_row_at_the_highest_y(tmp_path, mode, top):
    grey = np.zeros((33, 33), np.uint8 if mode == "L" else np.uint16)
    grey[:8, :] = top  # a terrace along the upper border of the picture
    path = tmp_path / "terrace.png"
    Image.fromarray(grey).save(path)
    world = load_world(str(path), 1, (16.0, 16.0, 2.0), start=(0.0, -4.0, 0.0))
    field = world.heightfield
    assert field.heights[-1].min() == pytest.approx(2.0, abs=0.02) and field.heights[0].max() == pytest.approx(0.0, abs=0.02)
    assert world.extent[:, :2] == pytest.approx(np.array([[-8.0, -8.0], [8.0, 8.0]]), abs=field.step)


def test_collada_file_is_read_in_its_own_unit_and_up_axis(tmp_path):
    pytest.importorskip("collada", reason="pycollada reads .dae files and is not installed")
    floor = tmp_path / "floor.dae"
    floor.write_bytes(trimesh.exchange.dae.export_collada(trimesh.creation.box((1000.0, 20.0, 800.0))))
    text = floor.read_text()
    start, end = text.index("<asset>"), text.index("</asset>")
    floor.write_text(text[:start] + '<asset><unit name="cm" meter="0.01"/><up_axis>Y_UP</up_axis>' + text[end:])
    world = load_world(str(floor), 1)
    assert world.extent == pytest.approx(np.array([[-5.0, -4.0, -0.1], [5.0, 4.0, 0.1]]), abs=1e-6)
    assert world.start_z == pytest.approx(0.1, abs=1e-6)


def test_real_height_map_and_garage_load_where_they_are_present():
    data = Path(__file__).resolve().parents[4] / "shared" / "data"
    if not data.is_dir():
        pytest.skip("the shared measurement data are not on this machine")
    pytest.importorskip("collada", reason="pycollada reads .dae files and is not installed")
    moon = load_world(str(data / "apollo15_dtm_257x257.png"), 1, (514.0, 514.0, 49.0), (40.0, 40.0))
    assert (moon.extent[1, :2] - moon.extent[0, :2]) == pytest.approx((40.4, 40.4), abs=0.5)
    garage = load_world(str(data / "parking_garage.dae"), 1, None, (40.0, 40.0))
    assert (garage.extent[1, :2] - garage.extent[0, :2] < 40.5).all() and len(garage.triangles) > 100


def test_robot_too_long_for_a_place_does_not_start_there():
    start = load_world("rooms", 1).start_xyyaw
    beside = next(
        (x, start[1], 0.0) for x in np.arange(start[0], start[0] + 20.0, 0.05) if not stands("rooms", (float(x), start[1], 0.0), 1.6)
    )
    assert stands("rooms", beside, 0.99)


def stands(name: str, start: tuple[float, float, float], length_m: float) -> bool:
    try:
        load_world(name, 1, start=start, robot=replace(RobotBody(), length_m=length_m))
    except ValueError:
        return False
    return True


def hall(path, *, scale=1.0, axes=(0, 1, 2), offset=(0.0, 0.0, 0.0), flip=False):
    """Walls and a cube on a closed base whose top is z = 0 and which is two metres thick; the file of it."""
    boxes = [((0, 0, -1), (10, 10, 2)), ((-5, 0, 1.25), (0.2, 10, 2.5)), ((5, 0, 1.25), (0.2, 10, 2.5)), ((2, 2, 0.5), (1, 1, 1))]
    boxes += [((0, -5, 1.25), (10, 0.2, 2.5)), ((0, 5, 1.25), (10, 0.2, 2.5))]
    mesh = trimesh.util.concatenate([trimesh.creation.box(size, trimesh.transformations.translation_matrix(at)) for at, size in boxes])
    mesh.vertices = (np.asarray(mesh.vertices) * scale + offset)[:, axes]
    if flip:
        mesh.invert()
    mesh.export(path)
    return str(path)


@pytest.mark.parametrize("flip", [False, True])
@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply"])
def test_robot_starts_on_top_of_a_closed_solid_whichever_way_it_faces(tmp_path, suffix, flip):
    path = hall(tmp_path / f"hall{suffix}", flip=flip)
    for arguments in ({}, {"start": (0.0, 0.0, 0.0)}, {"area_xy": (6.0, 6.0)}, {"area_xy": (6.0, 6.0), "start": (0.0, 0.0, 0.0)}):
        assert load_world(path, 1, **arguments).start_z == pytest.approx(0.0, abs=1e-4), arguments
    with pytest.raises(ValueError, match="headroom|inside"):
        load_world(path, 1, start=(2.0, 2.0, 0.0), robot=replace(RobotBody(), length_m=1.5))


def test_open_shell_has_an_inside_to_start_in(tmp_path):
    shell = trimesh.creation.box((10.0, 10.0, 3.0))
    shell.update_faces(shell.face_normals[:, 2] < 0.5)  # a box without its lid
    shell.export(tmp_path / "box.stl")
    assert load_world(str(tmp_path / "box.stl"), 1).start_z == pytest.approx(-1.5, abs=1e-4)


def test_height_of_a_start_tells_storeys_apart(tmp_path):
    floors = [trimesh.creation.box((10.0, 10.0, 0.2), trimesh.transformations.translation_matrix((0, 0, z))) for z in (-0.1, 2.9)]
    trimesh.util.concatenate(floors).export(tmp_path / "house.stl")
    path = str(tmp_path / "house.stl")
    assert load_world(path, 1, start=(0.0, 0.0, 0.3)).start_z == pytest.approx(0.0, abs=1e-4)
    assert load_world(path, 1, start=(0.0, 0.0, 3.2, 0.3)).start_z == pytest.approx(3.0, abs=1e-4)
    assert load_world(path, 1, area_xy=(6, 6), start=(0.0, 0.0, 3.2, 0.3)).start_z == pytest.approx(3.0, abs=1e-4)
    with pytest.raises(ValueError, match=r"at x 0 y 0 z 1.5: the ground with headroom there lies at z 0.00, 3.00"):
        load_world(path, 1, start=(0.0, 0.0, 1.5, 0.3))


def test_mesh_far_away_is_the_same_as_near_with_an_origin(tmp_path):
    near, far = hall(tmp_path / "near.obj"), hall(tmp_path / "far.obj", offset=(448262.0, 5412345.0, 412.0))
    a, b = load_world(near, 1), load_world(far, 1)
    assert a.origin == (0.0, 0.0, 0.0) and b.origin == pytest.approx((448262, 5412345, 412), abs=1.0)
    lift = b.origin[2] - 412.0
    np.testing.assert_allclose(b.vertices + (0, 0, lift), a.vertices, atol=1e-6)
    asked = load_world(far, 1, start=(448260.5, 5412344.0, 412.0, 0.5))
    assert asked.start_xyyaw == pytest.approx((-1.5, -1.0, 0.5)) and asked.start_z + lift == pytest.approx(0.0, abs=1e-4)
    with pytest.raises(ValueError, match="at x 448270 y 5412345: there is no ground"):
        load_world(far, 1, start=(448270.0, 5412345.0, 0.5))
    asked.write_mesh(tmp_path / "world.ply")
    assert read_origin(tmp_path / "world_origin.json").tolist() == list(asked.origin)


def test_far_mesh_whose_digits_are_lost_is_refused(tmp_path):
    with pytest.raises(ValueError, match="far.stl is far from 0 0 0 in float32, told apart to 0.5 m only"):
        load_world(hall(tmp_path / "far.stl", offset=(448262.0, 5412345.0, 412.0)), 1)
    with pytest.raises(ValueError, match="told apart to 0.512 m only"):
        load_world(hall(tmp_path / "mm.stl", scale=1000.0, offset=(448262e3, 5412345e3, 412e3)), 1, frame=MeshFrame(scale=0.001))
    load_world(hall(tmp_path / "km.stl", scale=1000.0, offset=(1e6, 0.0, 0.0)), 1, frame=MeshFrame(scale=0.001))
    assert load_world(hall(tmp_path / "here.stl", offset=(4482.0, -5412.0, 412.0)), 1).origin != (0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("scale", "axes", "options"),
    [(1000.0, (0, 1, 2), "--scale 0.001"), (1000.0, (1, 2, 0), "--scale 0.001 --up y"), (100.0, (0, 1, 2), "--scale 0.01")],
)
def test_mesh_in_which_no_robot_fits_is_asked_about(tmp_path, scale, axes, options):
    path = hall(tmp_path / "hall.stl", scale=scale, axes=axes)
    with pytest.raises(ValueError, match=f"Then say {options}$"):
        load_world(path, 1)
    words = options.split()
    world = load_world(path, 1, frame=MeshFrame(float(words[1]), words[3] if len(words) > 2 else None))
    assert world.start_z == pytest.approx(0.0, abs=1e-4)


def test_mesh_standing_on_its_side_is_asked_about(tmp_path):
    floor = trimesh.creation.box((20.0, 0.2, 20.0))
    floor.export(tmp_path / "floor.stl")
    with pytest.raises(ValueError, match=r"It is 20 x 0.2 x 20 m large. Is it with y up\? Then say --up y"):
        load_world(str(tmp_path / "floor.stl"), 1)
    assert load_world(str(tmp_path / "floor.stl"), 1, frame=MeshFrame(up="y")).start_z == pytest.approx(0.1, abs=1e-4)


def test_scale_and_up_that_make_no_sense_are_refused(tmp_path):
    path = hall(tmp_path / "hall.stl")
    for frame in (MeshFrame(scale=0.0), MeshFrame(scale=math.nan), MeshFrame(up="down")):
        with pytest.raises(ValueError, match="scale|up"):
            load_world(path, 1, frame=frame)
    with pytest.raises(ValueError, match="are for files"):
        load_world("rooms", 1, frame=MeshFrame(up="y"))
