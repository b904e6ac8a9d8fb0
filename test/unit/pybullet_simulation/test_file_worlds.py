"""Worlds from SDF files and descriptions: floors, walls, starts, and what is said of a file."""

import dataclasses
import math
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
import trimesh.exchange.dae

sys.path.append(str(Path(__file__).parents[1] / "world_files"))

from sdf_files import GROUND, box, collision, model, pose, world_file

from pybullet_simulation import WorldDescription, load_world
from pybullet_simulation.world import World, nearest_hits, raycasting_scene
from simulated_movers import MoverSpec

PILLAR = model("pillar", collision(box("1 1 2")), pose=pose("2 3 1 0 0 0"))


def highest(world: World, x: float, y: float) -> float:
    ray = np.array([[x, y, 50.0, 0.0, 0.0, -1.0]], np.float32)
    return 50.0 - float(nearest_hits(raycasting_scene(world.vertices, world.triangles), ray)[0])


def test_ground_plane_is_a_floor_that_ends_at_walls_two_metres_beyond_what_stands_on_it(tmp_path: Path) -> None:
    world = load_world(str(world_file(tmp_path, GROUND, PILLAR)), 1, start=(0.5, 3.0, 0.0))
    assert world.start_z == pytest.approx(0.0, abs=1e-5) and highest(world, 2.0, 3.0) == pytest.approx(2.0, abs=1e-4)
    inner = world.extent[:, :2] + np.array([[0.2], [-0.2]])
    np.testing.assert_allclose(inner, [[-1.5, 0.5], [4.5, 5.5]], atol=1e-6)
    assert highest(world, 4.6, 3.0) > 1.0
    assert len(world.notes) == 1 and "6 x 5 m" in world.notes[0]


def test_floor_reaches_the_start_and_an_area_takes_another_part(tmp_path: Path) -> None:
    path = str(world_file(tmp_path, GROUND, PILLAR))
    assert load_world(path, 1, start=(-9.0, 3.0, 0.0)).extent[0, 0] == pytest.approx(-11.2)
    area = load_world(path, 1, start=(-9.0, 3.0, 0.0), area_xy=(8.0, 6.0))
    np.testing.assert_allclose(area.extent[:, :2], [[-13.2, -0.2], [-4.8, 6.2]], atol=1e-6)
    assert not area.notes


def test_start_far_from_all_that_stands_on_a_floor_is_refused_unless_an_area_is_said(tmp_path: Path) -> None:
    path = str(world_file(tmp_path, GROUND, PILLAR))
    assert load_world(path, 1, start=(-48.0, 3.0, 0.0)).extent[0, 0] == pytest.approx(-50.2)
    with pytest.raises(ValueError, match="^the robot cannot start at x 400 y 3: all that stands in the file is 398 m away; --area X Y"):
        load_world(path, 1, start=(400.0, 3.0, 0.0))
    assert load_world(path, 1, start=(400.0, 3.0, 0.0), area_xy=(8.0, 6.0)).start_xyyaw == (400.0, 3.0, 0.0)


def slab(path: Path, size: tuple[float, float, float]) -> WorldDescription:
    trimesh.creation.box(size).export(path)
    return WorldDescription(str(path), start=(0.0, 0.0, 0.0))


OTHERS = "0.001 for millimetres, 0.01 for centimetres, 0.0254 for inches, 0.3048 for feet"


@pytest.mark.parametrize(
    ("size", "said"), [((201, 9, 0.2), True), ((9, 201, 0.2), True), ((9, 9, 31), True), ((199, 9, 0.2), False), ((9, 9, 29), False)]
)
def test_mesh_that_is_unusually_long_or_high_is_told_with_its_unit(tmp_path: Path, size: tuple[float, float, float], said: bool) -> None:
    about = slab(tmp_path / "hall.obj", size)
    hint = f" m, one unit taken as one metre (--scale tells another: {OTHERS}); the robot starts at "
    assert (hint in load_world(about, 1).about()) == said
    assert "unit" not in load_world(dataclasses.replace(about, scale=1.0), 1).about()


def test_mesh_whose_file_names_its_unit_is_told_so(tmp_path: Path) -> None:
    (tmp_path / "hall.dae").write_bytes(trimesh.exchange.dae.export_collada(trimesh.creation.box((300.0, 0.2, 9.0))))
    assert " m, with the unit that the file names (--scale tells another: " in load_world(str(tmp_path / "hall.dae"), 1).about()


def test_unit_of_an_sdf_file_needs_no_word(tmp_path: Path) -> None:
    world = load_world(str(world_file(tmp_path, GROUND, PILLAR, model("wall", collision(box("300 1 1")), pose=pose("0 9 0.5 0 0 0")))), 1)
    assert "unit" not in world.about()


def test_plane_only_asks_for_an_area(tmp_path: Path) -> None:
    path = str(world_file(tmp_path, GROUND))
    with pytest.raises(ValueError, match="a plane only; --area X Y"):
        load_world(path, 1)
    assert np.ptp(load_world(path, 1, area_xy=(8.0, 6.0)).extent[:, :2], axis=0) == pytest.approx((8.4, 6.4))


def test_what_was_left_out_is_told(tmp_path: Path) -> None:
    world = load_world(str(world_file(tmp_path, GROUND, PILLAR, "<include><uri>model://lamp</uri></include>")), 1)
    assert "model://lamp" in world.notes[0]


@pytest.mark.parametrize("seed", range(1, 13))
def test_robot_starts_neither_on_a_roof_nor_on_a_crate(tmp_path: Path, seed: int) -> None:
    crate = model("crate", collision(box("20 20 3")), pose=pose("20 0 1.5 0 0 0"))
    roof = model("roof", collision(box("12 12 0.2")), pose=pose("0 0 3 0 0 0"))
    posts = [
        model(f"p{x}{y}", collision(box("0.2 0.2 3")), pose=pose(f"{x} {y} 1.5 0 0 0")) for x in range(-6, 7, 2) for y in range(-6, 7, 2)
    ]
    path = str(world_file(tmp_path, GROUND, crate, roof, *posts))
    assert load_world(path, seed).start_z == pytest.approx(0.0, abs=1e-4)
    assert load_world(path, seed, start=(0.0, 0.0, 3.1, 0.0)).start_z == pytest.approx(3.1, abs=1e-4)


def test_house_without_room_inside_has_a_start_on_its_roof_only_when_asked(tmp_path: Path) -> None:
    slabs = [model(f"s{z}", collision(box("8 8 0.2")), pose=pose(f"0 0 {z} 0 0 0")) for z in (-0.1, 3.1)]
    posts = [model(f"p{x}{y}", collision(box("0.2 0.2 3")), pose=pose(f"{x} {y} 1.5 0 0 0")) for x in range(-4, 5) for y in range(-4, 5)]
    path = str(world_file(tmp_path, *slabs, *posts))
    with pytest.raises(ValueError, match="no flat ground"):
        load_world(path, 1)
    assert load_world(path, 1, start=(0.0, 0.0, 3.2, 0.0)).start_z == pytest.approx(3.2, abs=1e-4)


def open_walls(path: Path) -> str:
    """Walls of a hall of 10 x 10 m, without a floor, from z = 1."""
    walls = [trimesh.creation.box(bounds=[(x, -5, 1), (x + 0.2, 5, 3.5)]) for x in (-5, 5)]
    walls += [trimesh.creation.box(bounds=[(-5, y, 1), (5, y + 0.2, 3.5)]) for y in (-5, 5)]
    trimesh.util.concatenate(walls).export(path)
    return str(path)


def test_mesh_without_a_floor_says_how_to_add_one(tmp_path: Path) -> None:
    path = open_walls(tmp_path / "walls.stl")
    with pytest.raises(ValueError, match="no flat ground.*--ground 1 adds a floor where it has none"):
        load_world(path, 1)
    world = load_world(WorldDescription(path, ground=1.0, start=(0.0, 0.0, 0.0)), 1)
    assert world.start_z == pytest.approx(1.0, abs=1e-5)
    (tmp_path / "hall.yaml").write_text("world: walls.stl\nground: 1.0\nstart: [1, 0, 0.5]\nmovers: [{kind: person}]\n")
    told = load_world(str(tmp_path / "hall.yaml"), 1)
    assert told.start_xyyaw == (1.0, 0.0, 0.5) and told.name == path and told.movers == (MoverSpec(name="person_1"),)
    (tmp_path / "hall.yaml").write_text("world: walls.stl\nground: 1.0\nstart: [1, 0, 0.5]\nmovers: [{kind: horse}]\n")
    with pytest.raises(ValueError, match="^mover 1: kind = 'horse' is none of"):
        load_world(str(tmp_path / "hall.yaml"), 1)


def test_sdf_file_without_a_floor_says_how_to_add_one(tmp_path: Path) -> None:
    path = str(world_file(tmp_path, PILLAR))
    with pytest.raises(ValueError, match="no flat ground.*; --ground 0 adds a floor where it has none$"):
        load_world(path, 1)
    assert load_world(WorldDescription(path, ground=0.0), 1).start_z == pytest.approx(0.0, abs=1e-5)


def test_ground_that_is_no_height_and_models_of_a_mesh_are_refused_by_their_names(tmp_path: Path) -> None:
    path = open_walls(tmp_path / "walls.stl")
    with pytest.raises(ValueError, match="^ground nan is no height in metres$"):
        load_world(WorldDescription(path, ground=math.nan), 1)
    with pytest.raises(ValueError, match=r"^models are for SDF files \(.sdf, .world\); .*walls.stl includes none$"):
        load_world(WorldDescription(path, ground=1.0, models=(tmp_path,)), 1)


def test_description_of_a_built_in_world_has_only_a_start(tmp_path: Path) -> None:
    assert load_world(WorldDescription("rooms", start=(-4.0, 0.5, 1.0)), 1).start_xyyaw == (-4.0, 0.5, 1.0)
    with pytest.raises(ValueError, match="are for files"):
        load_world(WorldDescription("rooms", ground=0.0), 1)


def test_mesh_of_an_sdf_file_in_millimetres_is_asked_about(tmp_path: Path) -> None:
    trimesh.creation.box((12e3, 8e3, 100.0)).export(tmp_path / "slab.stl")
    path = str(world_file(tmp_path, model("hall", collision("<mesh><uri>slab.stl</uri></mesh>"))))
    with pytest.raises(ValueError, match=r"test.world:3: mesh slab.stl is 12,000 x 8,000 x 100 m large. Is it in millimetres\?.*0.001$"):
        load_world(path, 1)


def test_large_sdf_world_is_judged_by_its_meshes_and_not_by_where_they_stand(tmp_path: Path) -> None:
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "crate.stl")
    crate = collision("<mesh><uri>crate.stl</uri></mesh>")
    apart = [model(f"c{x}", crate, pose=pose(f"{x} 5 0.5 0 0 0")) for x in (0, 1500)]
    path = str(world_file(tmp_path, GROUND, *apart))
    assert load_world(path, 1, start=(0.0, 0.0, 0.0), area_xy=(20.0, 20.0)).start_z == pytest.approx(0.0, abs=1e-4)
    trimesh.creation.box((2000.0, 50.0, 0.2)).export(tmp_path / "road.stl")
    path = str(world_file(tmp_path, model("road", collision("<mesh><uri>road.stl</uri></mesh>"))))
    assert load_world(path, 1, start=(0.0, 0.0, 0.0), area_xy=(20.0, 20.0)).start_z == pytest.approx(0.1, abs=1e-4)
    with pytest.raises(ValueError, match="mesh road.stl is 2,000 x 50 x 0 m large.*--area X Y explores a part of it"):
        load_world(path, 1, start=(0.0, 0.0, 0.0))


def test_scale_and_up_are_refused_for_sdf(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="scale and up are for meshes"):
        load_world(WorldDescription(str(world_file(tmp_path, GROUND, PILLAR)), scale=0.001), 1)


def test_what_cannot_be_read_of_a_mesh_is_noted(tmp_path: Path) -> None:
    text = trimesh.exchange.dae.export_collada([trimesh.creation.box((12.0, 0.2, 8.0)), trimesh.creation.box()]).decode()
    first, last = text.rsplit("<instance_geometry ", 1)
    (tmp_path / "a.dae").write_text(f'{first}<instance_geometry url="#gone"{last[last.index(">") :]}')
    assert load_world(str(tmp_path / "a.dae"), 1).notes == (f"{tmp_path / 'a.dae'}: gone cannot be read: left out",)


def test_gltf_has_its_y_upwards_and_no_texture_is_missed(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    trimesh.creation.box((12.0, 0.2, 8.0)).export(tmp_path / "floor.glb")
    np.testing.assert_allclose(load_world(str(tmp_path / "floor.glb"), 1).extent, [[-6, -4, -0.1], [6, 4, 0.1]], atol=1e-6)
    (tmp_path / "floor.obj").write_text("mtllib gone.mtl\nusemtl x\n" + trimesh.creation.box((12.0, 8.0, 0.2)).export(file_type="obj"))
    load_world(str(tmp_path / "floor.obj"), 1)
    assert capfd.readouterr() == ("", "")


def test_far_sdf_world_is_brought_near_with_its_floor(tmp_path: Path) -> None:
    at = "448262 5412345 412"
    far = model("p", collision(box("1 1 2")), pose=pose(f"{at} 0 0 0"))
    ground = model("g", collision("<plane/>"), pose=pose(f"{at} 0 0 0"))
    world = load_world(str(world_file(tmp_path, ground, far)), 1, start=(448260.5, 5412345.0, 0.0))
    assert world.origin == (448262.0, 5412345.0, 412.0) and world.start_z == pytest.approx(0.0, abs=1e-4)
    assert world.start_xyyaw == pytest.approx((-1.5, 0.0, 0.0))
