"""SDF worlds: what stands where, what is left out with a word, and what is refused with file and line."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
import trimesh.exchange.dae
from PIL import Image
from sdf_files import GROUND, box, collision, model, model_folder, pose, world_file

from world_files import OPEN, ModelPaths, SdfWorld, read_sdf


def read(path: Path, *folders: Path) -> SdfWorld:
    return read_sdf(path, ModelPaths(folders))


def extent(world: SdfWorld) -> np.ndarray:
    return np.array([world.vertices.min(axis=0), world.vertices.max(axis=0)])


def centre(world: SdfWorld) -> list[float]:
    return extent(world).mean(axis=0).round(6).tolist()


@pytest.mark.parametrize(
    ("geometry", "size"),
    [
        (box("2 3 4"), (2, 3, 4)),
        ("<cylinder><radius>0.5</radius><length>3</length></cylinder>", (1, 1, 3)),
        ("<sphere><radius>2</radius></sphere>", (4, 4, 4)),
        ("<capsule><radius>0.5</radius><length>2</length></capsule>", (1, 1, 3)),
        ("<cone><radius>1</radius><length>2</length></cone>", (2, 2, 2)),
        ("<ellipsoid><radii>1 2 3</radii></ellipsoid>", (2, 4, 6)),
    ],
)
def test_solid_has_its_size_around_its_origin_and_is_closed(tmp_path: Path, geometry: str, size: tuple[float, ...]) -> None:
    found = read(world_file(tmp_path, model("m", collision(geometry))))
    np.testing.assert_allclose(extent(found), np.array([size, size]) * [[-0.5], [0.5]], atol=0.03)
    assert not found.left_out and not found.floors and set(found.solid) == {0}


def test_boxes_that_share_a_side_stay_two_closed_solids(tmp_path: Path) -> None:
    found = read(world_file(tmp_path, model("a", collision(box())), model("b", collision(box()), pose=pose("1 0 0 0 0 0"))))
    assert sorted(set(found.solid)) == [0, 1]


def test_poses_of_model_link_and_collision_follow_each_other(tmp_path: Path) -> None:
    quarter = f"{math.pi / 2}"
    shape = collision(box(), pose("1 0 0 0 0 0"))
    found = read(world_file(tmp_path, model("m", shape, pose=pose(f"10 0 0 0 0 {quarter}"), link_pose=pose(f"0 2 0 0 0 {quarter}"))))
    assert centre(found) == [7.0, 0.0, 0.0]


@pytest.mark.parametrize(
    "turn",
    [
        pose(f"1 2 3 0 {math.pi / 6} 0"),
        pose("1 2 3 0 30 0", degrees="true"),
        pose(f"1 2 3 0 {math.sin(math.pi / 12)} 0 {math.cos(math.pi / 12)}", rotation_format="quat_xyzw"),
    ],
)
def test_angles_are_radians_degrees_or_a_quaternion(tmp_path: Path, turn: str) -> None:
    found = read(world_file(tmp_path, model("m", collision(box("2 0.001 0.001")), pose=turn)))
    low, high = extent(found)
    assert centre(found) == [1.0, 2.0, 3.0]
    assert (high - low)[[0, 2]] == pytest.approx((2 * math.cos(math.pi / 6), 1.0), abs=2e-3)


FRAMES = "<frame name='f'>" + pose("0 0 5 0 0 0") + "</frame><frame name='g' attached_to='f'>" + pose("0 1 0 0 0 0") + "</frame>"


@pytest.mark.parametrize(
    ("relative", "expected"),
    [
        ("f", [10, 0, 5]),
        ("g", [10, 1, 5]),
        ("other", [13, 0, 0]),
        ("__model__", [10, 0, 0]),
        ("inner::deep", [10, 0, 9]),
        ("world", [0, 0, 0]),
    ],
)
@pytest.mark.parametrize("attribute", ["relative_to", "frame"])
def test_pose_is_relative_to_the_frame_that_it_names(tmp_path: Path, relative: str, expected: list[float], attribute: str) -> None:
    inner = f"<model name='inner'>{pose('0 0 8 0 0 0')}<link name='deep'>{pose('0 0 1 0 0 0')}</link></model>"
    other = f"<link name='other'>{pose('3 0 0 0 0 0')}</link>"
    link = f"<link name='link'>{pose('0 0 0 0 0 0', **{attribute: relative})}{collision(box())}</link>"
    found = read(world_file(tmp_path, f"<model name='m'>{pose('10 0 0 0 0 0')}{FRAMES}{inner}{other}{link}</model>"))
    assert centre(found) == expected


def test_model_lies_relative_to_another_and_is_placed_by_a_frame_of_its_own(tmp_path: Path) -> None:
    placed = f"<model name='b' placement_frame='top'>{pose('0 0 1 0 0 0', relative_to='a')}<frame name='top'>{pose('0 0 4 0 0 0')}</frame>"
    placed += f"<link name='l'>{collision(box())}</link></model>"
    found = read(world_file(tmp_path, f"<model name='a'>{pose('7 0 0 0 0 0')}<link name='l'/></model>", placed))
    assert centre(found) == [7.0, 0.0, -3.0]


def test_nested_model_lies_in_its_parent_and_a_saved_state_says_where_that_was(tmp_path: Path) -> None:
    nested = f"<model name='out'>{pose('1 0 0 0 0 0')}{model('in', collision(box()), pose=pose('0 1 0 0 0 0'))}</model>"
    assert centre(read(world_file(tmp_path, nested))) == [1.0, 1.0, 0.0]
    state = f"<state world_name='w'><model name='out'>{pose('5 0 0 0 0 0')}</model></state>"
    assert centre(read(world_file(tmp_path, nested, state))) == [5.0, 1.0, 0.0]


def test_included_model_is_found_by_name_in_given_folders_and_by_path_beside_the_file(tmp_path: Path) -> None:
    model_folder(tmp_path / "far" / "away", "crate", model("crate", collision(box("2 2 2")), pose=pose("0 0 1 0 0 0")))
    by_name = world_file(tmp_path, "<include><uri>model://crate</uri></include>")
    assert centre(read(by_name, tmp_path / "far" / "away")) == [0.0, 0.0, 1.0]
    by_path = world_file(tmp_path, f"<include><uri>far/away/crate</uri>{pose('4 0 0 0 0 0')}</include>", name="b.world")
    assert centre(read(by_path)) == [4.0, 0.0, 0.0]  # its pose stands for the model's own


def test_models_are_found_in_gazebo_s_own_variables_and_in_folders_beside_the_world(tmp_path: Path) -> None:
    model_folder(tmp_path / "told", "crate", model("crate", collision(box())))
    told = ModelPaths.of([], {"GAZEBO_MODEL_PATH": f"/nowhere:{tmp_path / 'told'}"})
    (tmp_path / "worlds").mkdir()
    path = world_file(tmp_path / "worlds", "<include><uri>model://crate</uri></include>")
    assert len(read_sdf(path, told).triangles) == 12
    with pytest.raises(ValueError, match="nothing to stand on"):
        read(path)
    (tmp_path / "told").rename(tmp_path / "models")
    assert len(read(path).triangles) == 12


def test_model_config_names_the_file_of_the_newest_version(tmp_path: Path) -> None:
    config = "<model><sdf version='1.4'>old.sdf</sdf><sdf version='1.10'>new.sdf</sdf><sdf version='1.9'>model.sdf</sdf></model>"
    folder = model_folder(tmp_path, "m", model("m", collision(box())), config)
    (folder / "new.sdf").write_text(f"<sdf>{model('m', collision(box('4 4 4')))}</sdf>")
    found = read(world_file(tmp_path, "<include><uri>model://m</uri></include>"))
    assert extent(found)[1].tolist() == [2.0, 2.0, 2.0]


def test_model_on_a_server_is_looked_for_by_its_name(tmp_path: Path) -> None:
    model_folder(tmp_path / "models", "oak_tree", model("t", collision(box())))
    uri = "https://server/1.0/someone/models/Oak%20Tree"
    assert len(read(world_file(tmp_path, f"<include><uri>{uri}</uri></include>")).triangles) == 12


@pytest.mark.parametrize("uri", ["Construction%20Cone", "Construction Cone/3", "construction cone/tip"])
def test_model_of_a_server_is_found_in_a_copy_of_gazebo_s_cache(tmp_path: Path, uri: str) -> None:
    model_folder(tmp_path / "models" / "construction cone", "3", model("t", collision(box())))
    found = read(world_file(tmp_path, f"<include><uri>https://server/1.0/someone/models/{uri}</uri></include>"))
    assert not found.left_out and len(found.triangles) == 12


@pytest.mark.parametrize("place", ["construction cone/3", "construction_cone"])
def test_mesh_on_a_server_is_found_below_its_model(tmp_path: Path, place: str) -> None:
    (tmp_path / "models" / place / "meshes").mkdir(parents=True)
    trimesh.creation.box().export(tmp_path / "models" / place / "meshes" / "a b.stl")
    uri = "https://server/1.0/someone/models/Construction%20Cone/3/files/meshes/a%20b.stl"
    assert len(read(world_file(tmp_path, model("m", collision(f"<mesh><uri>{uri}</uri></mesh>")))).triangles) == 12


@pytest.mark.parametrize(
    ("child", "said"),
    [
        ("<plugin name='p' filename='libdoor.so'/>", "plugin libdoor.so in an <include>"),
        ("<experimental:params><collision/></experimental:params>", "experimental:params in an <include>"),
        ("<static>true</static><name>a</name><placement_frame>link</placement_frame>", None),
    ],
)
def test_what_else_stands_in_an_include_is_named(tmp_path: Path, child: str, said: str | None) -> None:
    model_folder(tmp_path, "crate", model("crate", collision(box())))
    left_out = read(world_file(tmp_path, f"<include><uri>model://crate</uri>{child}</include>")).left_out
    assert left_out == (() if said is None else (f"{tmp_path / 'test.world'}:3: {said}: left out",))


def test_merged_model_gives_its_frames_to_its_parent(tmp_path: Path) -> None:
    model_folder(tmp_path, "part", f"<model name='part'><link name='tip'>{pose('0 0 3 0 0 0')}</link></model>")
    link = f"<link name='l'>{pose('1 0 0 0 0 0', relative_to='tip')}{collision(box())}</link>"
    whole = f"<model name='m'><include merge='true'><uri>model://part</uri></include>{link}</model>"
    assert centre(read(world_file(tmp_path, whole))) == [1.0, 0.0, 3.0]


def test_ground_plane_and_sun_are_known_without_their_folders(tmp_path: Path) -> None:
    uris = ("model://ground_plane", "model://sun", "https://server/1.0/someone/models/Ground%20Plane/1", "https://server/a/models/Sun/2")
    known = [f"<include><uri>{uri}</uri></include>" for uri in uris]
    found = read(world_file(tmp_path, *known))
    assert found.floors == (0.0,) and not found.left_out and not len(found.triangles)


def test_plane_is_a_floor_at_its_height(tmp_path: Path) -> None:
    assert read(world_file(tmp_path, model("g", collision("<plane/>"), pose=pose("5 5 0.25 0 0 1")))).floors == (0.25,)
    tilted = read(world_file(tmp_path, GROUND, model("g", collision("<plane><normal>1 0 1</normal></plane>"))))
    assert tilted.floors == (0.0,) and "plane" in tilted.left_out[0]


def test_collision_is_read_before_the_visual_and_that_where_there_is_no_other(tmp_path: Path) -> None:
    visual = f"<visual name='v'><geometry>{box('9 9 9')}</geometry></visual>"
    assert extent(read(world_file(tmp_path, model("m", visual, collision(box())))))[1, 0] == 0.5
    assert extent(read(world_file(tmp_path, model("m", visual))))[1, 0] == 4.5


def test_plane_that_is_only_seen_has_a_size(tmp_path: Path) -> None:
    poster = "<visual name='v'><geometry><plane><normal>1 0 0</normal><size>2 4</size></plane></geometry></visual>"
    found = read(world_file(tmp_path, GROUND, model("m", poster)))
    assert sorted(np.ptp(found.vertices, axis=0).round(6)) == [0.0, 2.0, 4.0] and np.ptp(found.vertices[:, 0]) < 1e-6
    assert set(found.solid) == {OPEN}


def test_mesh_has_its_scale_and_its_file_s_unit_but_not_its_upward_axis(tmp_path: Path) -> None:
    folder = model_folder(tmp_path, "m", model("m", collision("<mesh><uri>model://m/meshes/a.dae</uri><scale>1 2 1</scale></mesh>")))
    (folder / "meshes").mkdir()
    mesh = folder / "meshes" / "a.dae"
    mesh.write_bytes(trimesh.exchange.dae.export_collada(trimesh.creation.box((100.0, 200.0, 300.0))))
    text = mesh.read_text()
    start, end = text.index("<asset>"), text.index("</asset>")
    mesh.write_text(text[:start] + '<asset><unit name="cm" meter="0.01"/><up_axis>Y_UP</up_axis>' + text[end:])
    found = read(world_file(tmp_path, "<include><uri>model://m</uri></include>"))
    assert np.ptp(found.vertices, axis=0) == pytest.approx((1.0, 4.0, 3.0))
    assert found.largest_mesh is not None and found.largest_mesh[1].endswith("mesh a.dae")


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".glb"])
def test_mesh_is_found_beside_the_world_and_through_package(tmp_path: Path, suffix: str) -> None:
    (tmp_path / "robots").mkdir()
    trimesh.creation.box((1.0, 2.0, 3.0)).export(tmp_path / "robots" / f"a{suffix}")
    for uri in (f"robots/a{suffix}", f"package://robots/a{suffix}", f"file://robots/a{suffix}"):
        found = read(world_file(tmp_path, model("m", collision(f"<mesh><uri>{uri}</uri></mesh>"))))
        assert np.ptp(found.vertices, axis=0) == pytest.approx((1.0, 2.0, 3.0)), uri


def test_part_of_a_mesh_is_named_by_its_node(tmp_path: Path) -> None:
    parts = [trimesh.creation.box((1.0, 1.0, 1.0)), trimesh.creation.box((1.0, 1.0, 9.0)).apply_translation((5.0, 0.0, 0.0))]
    text = trimesh.exchange.dae.export_collada(parts).decode()
    (tmp_path / "tree.dae").write_text(text.replace('name="node1"', 'name="Branch"'))
    shape = "<mesh><uri>tree.dae</uri><submesh><name>{}</name>{}</submesh></mesh>"
    found = read(world_file(tmp_path, model("m", collision(shape.format("Branch", "")))))
    assert centre(found) == [5.0, 0.0, 0.0] and np.ptp(found.vertices[:, 2]) == pytest.approx(9.0)
    assert centre(read(world_file(tmp_path, model("m", collision(shape.format("Branch", "<center>true</center>")))))) == [0.0, 0.0, 0.0]
    missing = read(world_file(tmp_path, GROUND, model("m", collision(shape.format("Leaf", "")))))
    assert "'Leaf'" in missing.left_out[0]


def test_mesh_of_a_ros_package_is_found_on_its_path(tmp_path: Path) -> None:
    folder = tmp_path / "ws" / "vendor" / "halls-main"
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text("<package><name>halls</name></package>")
    trimesh.creation.box().export(folder / "a.stl")
    path = world_file(tmp_path, model("m", collision("<mesh><uri>package://halls/a.stl</uri></mesh>")))
    assert len(read_sdf(path, ModelPaths.of([], {"ROS_PACKAGE_PATH": str(tmp_path / "ws")})).triangles) == 12


def test_what_cannot_be_read_of_a_mesh_is_named(tmp_path: Path) -> None:
    text = trimesh.exchange.dae.export_collada([trimesh.creation.box(), trimesh.creation.box()]).decode()
    first, last = text.rsplit('<instance_geometry url="#', 1)
    (tmp_path / "a.dae").write_text(f'{first}<instance_geometry url="#gone_{last}')
    found = read(world_file(tmp_path, model("m", collision("<mesh><uri>a.dae</uri></mesh>"))))
    assert len(found.triangles) == 12 and "of the mesh a.dae, which cannot be read: left out" in found.left_out[0]


SUBMESH = "<mesh><uri>{}</uri><submesh><name>{}</name></submesh></mesh>"


@pytest.mark.parametrize(("part", "high"), [("Cube", 0.5), ("Cube_1", 1.0)])
def test_part_of_an_obj_is_its_object_whatever_its_materials(tmp_path: Path, part: str, high: float) -> None:
    corners = "".join(f"v {x} {y} {z}\n" for z in (0.0, 0.5, 1.0) for x in (0, 1) for y in (0, 1))
    (tmp_path / "a.obj").write_text(
        f"{corners}o Cube\nusemtl red\nf 1 2 5\nusemtl blue\nf 1 3 5\no Cube_1\nusemtl red\nf 5 6 9\nusemtl blue\nf 5 7 9\n"
    )
    found = read(world_file(tmp_path, model("m", collision(SUBMESH.format("a.obj", part)))))
    assert extent(found)[:, 2].tolist() == [high - 0.5, high] and len(found.triangles) == 2


def test_part_that_is_not_there_is_told_with_those_that_are(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\no One\nf 1 2 3\n")
    trimesh.creation.box().export(tmp_path / "a.stl")
    for name, said in (("a.obj", "; it has One"), ("a.stl", ": files of this kind have no parts")):
        (left_out,) = read(world_file(tmp_path, GROUND, model("m", collision(SUBMESH.format(name, "Leaf"))))).left_out
        assert f"{name} has no part 'Leaf'{said}: left out" in left_out


def test_height_map_reaches_its_size_and_lies_at_its_place(tmp_path: Path) -> None:
    Image.fromarray(np.linspace(0, 100, 17 * 17).reshape(17, 17).astype(np.uint8)).save(tmp_path / "hills.png")
    shape = "<heightmap><uri>file://hills.png</uri><size>16 8 3</size><pos>1 2 -1</pos></heightmap>"
    found = read(world_file(tmp_path, model("m", collision(shape))))
    np.testing.assert_allclose(extent(found), [[-7, -2, -1], [9, 6, 2]], atol=0.2)
    first_row = found.vertices[found.vertices[:, 1] > 5.7, 2]
    assert first_row.max() < -0.5  # the picture's first row, which is dark, lies at the highest y


@pytest.mark.parametrize(("pixels", "thinned"), [(129, False), (1025, True)])
def test_large_height_map_that_is_thinned_says_how_far_its_points_are_apart(tmp_path: Path, pixels: int, thinned: bool) -> None:
    Image.fromarray(np.tile(np.linspace(0, 200, pixels), (pixels, 1)).astype(np.uint8)).save(tmp_path / "hills.png")
    shape = "<heightmap><uri>hills.png</uri><size>256 256 9</size></heightmap>"
    left_out = read(world_file(tmp_path, model("m", collision(shape)))).left_out
    said = f"{tmp_path / 'test.world'}:3: heightmap hills.png has a point every 0.74 m, of pixels every 0.25 m"
    assert left_out == ((said,) if thinned else ())


LEFT_OUT = {
    "plugin": "<plugin name='p' filename='libwind.so'/>",
    "actor": "<actor name='walker'/>",
    "model://lamp": "<include><uri>model://lamp</uri></include>",
    "polyline": model("m", collision("<polyline><height>1</height></polyline>")),
    "lamp.dae": model("m", collision("<mesh><uri>model://lamp/lamp.dae</uri></mesh>")),
    "lamp.step": model("m", collision("<mesh><uri>lamp.step</uri></mesh>")),
    "broken.stl": model("m", collision("<mesh><uri>broken.stl</uri></mesh>")),
    "mesh without <uri>": model("m", collision("<mesh/>")),
    "heightmap without <uri>": model("m", collision("<heightmap><size>9 9 1</size></heightmap>")),
    "geometry without a shape": model("m", collision("")),
    "collision without <geometry>": model("m", "<collision name='c'/>"),
    "visual without <geometry>": model("m", "<visual name='v'/>"),
    "hole.png": model("m", collision("<heightmap><uri>hole.png</uri><size>9 9 1</size></heightmap>")),
}


@pytest.mark.parametrize("what", LEFT_OUT)
def test_what_is_not_understood_is_named_with_its_line_and_left_out(tmp_path: Path, what: str) -> None:
    for name in ("lamp.step", "broken.stl", "hole.png"):
        (tmp_path / name).write_bytes(b"no")
    found = read(world_file(tmp_path, GROUND, LEFT_OUT[what], model("b", collision(box()))))
    assert len(found.left_out) == 1 and what in found.left_out[0] and len(found.triangles) == 12
    assert found.left_out[0].startswith(f"{tmp_path / 'test.world'}:4: ") and found.left_out[0].count("\n") == 0


def test_geometry_that_says_it_is_empty_is_nothing_to_speak_of(tmp_path: Path) -> None:
    assert not read(world_file(tmp_path, GROUND, model("m", collision("<empty/>")))).left_out


SEEN_PLANE = "<visual name='v'><geometry><plane><normal>0 0 1</normal></plane></geometry></visual>"
NO_SIZE = [
    ("<box>: it has no <size>", collision("<box/>")),
    ("<sphere>: it has no <radius>", collision("<sphere/>")),
    ("<cylinder>: it has no <radius>", collision("<cylinder><length>1</length></cylinder>")),
    ("<cylinder>: it has no <length>", collision("<cylinder><radius>1</radius></cylinder>")),
    ("<capsule>: it has no <length>", collision("<capsule><radius>1</radius></capsule>")),
    ("<cone>: it has no <radius>", collision("<cone><length>1</length></cone>")),
    ("<ellipsoid>: it has no <radii>", collision("<ellipsoid/>")),
    ("<heightmap>: it has no <size>", collision("<heightmap><uri>hole.png</uri></heightmap>")),
    ("<plane>: it has no <size>", SEEN_PLANE),
]


@pytest.mark.parametrize(("said", "shape"), NO_SIZE, ids=[said for said, _ in NO_SIZE])
def test_shape_without_a_size_ends_the_start_with_file_and_line(tmp_path: Path, said: str, shape: str) -> None:
    path = world_file(tmp_path, GROUND, model("m", shape))
    with pytest.raises(ValueError, match=re.escape(f"{path}:4: {said}")):
        read(path)


def test_the_same_thing_is_named_once(tmp_path: Path) -> None:
    found = read(world_file(tmp_path, GROUND, *3 * ["<include><uri>model://lamp</uri></include>"]))
    assert len(found.left_out) == 1 and "(3 times)" in found.left_out[0]


def test_lights_physics_sensors_and_joints_are_nothing_to_speak_of(tmp_path: Path) -> None:
    quiet = (
        "<light name='sun' type='directional'/><physics type='ode'/><scene/><gui/><spherical_coordinates/><wind/><gravity>0 0 -9</gravity>"
    )
    robot = f"<model name='r'><link name='l'>{collision(box())}<sensor name='s' type='ray'/></link><joint name='j' type='fixed'/></model>"
    assert not read(world_file(tmp_path, quiet, robot)).left_out


def bad(text: str) -> str:
    return model("m", collision(box()), pose=text)


REFUSED = {
    "5 numbers, '1 2 3 4 5', where 6 are wanted": (bad(pose("1 2 3 4 5")), 3),
    "is not finite": (bad(pose("1 2 nan 0 0 0")), 3),
    "'1 2 x 0 0 0' is not 6 numbers": (bad(pose("1 2 x 0 0 0")), 3),
    "7 are wanted": (bad(pose("1 2 3 0 0 0", rotation_format="quat_xyzw")), 3),
    "quaternion is 0": (bad(pose("1 2 3 0 0 0 0", rotation_format="quat_xyzw")), 3),
    "rotation_format 'axis'": (bad(pose("1 2 3 0 0 0", rotation_format="axis")), 3),
    "1 -2 1 is not above 0": (model("m", collision(box("1 -2 1"))), 3),
    "<size>: '1 2 inf' is not finite": (model("m", collision(box("1 2 inf"))), 3),
    "<radius>: 0 is not above 0": (model("m", collision("<sphere><radius>0</radius></sphere>")), 3),
    "there is no frame 'nobody' in 'm'": (model("m", collision(box()), link_pose=pose("0 0 0 0 0 0", relative_to="nobody")), 3),
    "hangs on itself": (model("m", collision(box()), link_pose=pose("0 0 0 0 0 0", relative_to="link")), 3),
    "it has no <uri>": ("<include/>", 3),
    "normal is 0": (model("m", collision("<plane><normal>0 0 0</normal></plane>")), 3),
    "includes itself": ("<include><uri>again</uri></include>", None),
    "mismatched tag": ("<model name='m'>", 4),
}


@pytest.mark.parametrize("said", REFUSED)
def test_what_is_wrong_is_refused_in_one_line_with_file_and_line(tmp_path: Path, said: str) -> None:
    model_folder(tmp_path, "again", "<model name='a'><include><uri>model://again</uri></include></model>")
    element, line = REFUSED[said]
    path = world_file(tmp_path, element)
    with pytest.raises(ValueError, match=re.escape(said)) as refused:
        read(path)
    text = str(refused.value)
    assert "\n" not in text and text.startswith(f"{path}:{line}: " if line else str(tmp_path))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<robot name='r'/>", "1: <robot 'r'>: an SDF file has a <world>"),
        ("<sdf version='1.6'/>", "a <world> or a <model>"),
        ("", "no element found"),
        ("<sdf><world name='w'><plugin filename='libx.so'/></world></sdf>", "nothing to stand on is left of it; .*plugin libx.so"),
        ("<sdf><world name='w'><include><uri>model://x</uri></include></world></sdf>", "nothing to stand on is left of it; .*model://x"),
    ],
)
def test_file_without_a_world_says_so(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "w.sdf").write_text(text)
    with pytest.raises(ValueError, match=said):
        read(tmp_path / "w.sdf")


def test_models_nested_without_end_and_frames_that_hang_on_the_world_are_refused(tmp_path: Path) -> None:
    deep = "<model name='m'>" * 40 + "</model>" * 40
    with pytest.raises(ValueError, match="models in each other"):
        read(world_file(tmp_path, deep))
    turning = (
        f"<model name='m' placement_frame='f'><frame name='f'>{pose('0 0 0 0 0 0', relative_to='world')}</frame><link name='l'/></model>"
    )
    with pytest.raises(ValueError, match="hang on themselves"):
        read(world_file(tmp_path, turning, model("b", collision(box()))))


def test_file_of_one_model_is_a_world_of_it(tmp_path: Path) -> None:
    (tmp_path / "model.sdf").write_text(f"<sdf version='1.6'>{model('m', collision(box()))}</sdf>")
    assert len(read(tmp_path / "model.sdf").triangles) == 12


def test_given_folder_of_models_that_is_none_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no such folder.*nothing"):
        ModelPaths.of([tmp_path / "nothing"], {})
