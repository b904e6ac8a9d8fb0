"""./export_map: what it writes is what others read of it: octomap's tree, clouds, map_server's images and a GeoTIFF's heights."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image
from terrain_maps import RESOLUTION, floor, octree_of, two_storeys

from mapping_tools.cloud_files import read_cloud
from mapping_tools.map_bag import MADE_OF_SWEEPS
from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.octree.octree import OctreeMap
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass, TerrainConfig, classify
from pose_graph_mapping.graph.pose_graph import PoseGraph
from pose_graph_mapping.session.session_files import pcd_bytes
from pose_graph_mapping.session.session_record import Measured
from pose_graph_mapping.session.session_store import SessionStore
from rigid_geometry import origin_bytes, quat_xyzw_from_transform, transform_from_rpy, transform_points
from robot_body import DEFAULT_ROBOT_FILE, RobotBody
from terrain_tools.criteria import Criteria
from terrain_tools.export_map import CLASSES, OCTREES, main
from terrain_tools.ground import pose_on
from terrain_tools.storey_maps import FREE, OCCUPIED, UNKNOWN, ClassifiedVoxels, storey_maps

CLOUD = np.array([[0.5, 1.0, 0.15], [2.0, -1.0, 0.5]])


def run_folder(path: Path, states: np.ndarray, start: tuple[float, float, float]) -> Terrain:
    """What a run leaves of a map: octree, classes and merged cloud."""
    path.mkdir()
    tree = octree_of(states)
    tree.write_ot(path / "map.ot")
    terrain = classify(tree.column_runs(), pose_on(start, RobotBody()), TerrainConfig(), RobotBody(), None)
    x, y, z = terrain.centers().T
    np.savez(path / "terrain.npz", x=x, y=y, z=z, label=terrain.label)
    (path / "cloud.pcd").write_bytes(pcd_bytes(CLOUD))
    return terrain


def image(path: Path) -> np.ndarray:
    """(ny, nx) as map_server takes it: the first row is that of the least y."""
    return np.asarray(Image.open(path))[::-1]


def value_at(folder: Path, name: str, x: float, y: float) -> int:
    """What map_server would serve there."""
    said = yaml.safe_load((folder / f"{name}.yaml").read_text())
    grid, (x0, y0, _), size = image(folder / said["image"]), said["origin"], said["resolution"]
    return int(grid[int((y - y0) / size), int((x - x0) / size)])


def test_one_floor_is_one_map_with_ground_where_the_robot_can_drive(tmp_path: Path) -> None:
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "lab.pgm")]) == 0
    assert value_at(tmp_path, "lab", 2.0, 2.0) == FREE
    said = yaml.safe_load((tmp_path / "lab.yaml").read_text())
    assert (said["negate"], said["mode"], said["resolution"]) == (0, "trinary", RESOLUTION)
    occupied = {grey: (255 - grey) / 255 > said["occupied_thresh"] for grey in (OCCUPIED, FREE, UNKNOWN)}
    free = {grey: (255 - grey) / 255 < said["free_thresh"] for grey in (OCCUPIED, FREE, UNKNOWN)}
    assert occupied == {OCCUPIED: True, FREE: False, UNKNOWN: False} and free == {OCCUPIED: False, FREE: True, UNKNOWN: False}


@pytest.mark.parametrize("name", ["lab", "hall #2", "site: A", "'quoted' \"twice\"", "back\\slash", "Flügel 3 – 東", "- x", "*all"])
def test_image_is_found_by_its_name_whatever_that_is(tmp_path: Path, name: str) -> None:
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / f"{name}.pgm")]) == 0
    assert value_at(tmp_path, name, 2.0, 2.0) == FREE
    assert yaml.safe_load((tmp_path / f"{name}.yaml").read_text(encoding="utf-8"))["image"] == f"{name}.pgm"


def test_two_floors_are_two_maps_of_the_same_cells_with_heights(tmp_path: Path) -> None:
    terrain = run_folder(tmp_path / "run", two_storeys(), (4, 5, 0))
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "h.pgm"), str(tmp_path / "h.tif")]) == 0
    assert not (tmp_path / "h.pgm").exists()
    assert image(tmp_path / "h-1.pgm").shape == image(tmp_path / "h-2.pgm").shape
    low, high = (np.asarray(Image.open(tmp_path / f"h-{n}.tif"))[::-1] for n in (1, 2))
    both = np.isfinite(low) & np.isfinite(high)
    assert both.sum() > 100 and (high[both] - low[both]).min() > RobotBody().height_m
    tops = (terrain.z[np.isin(terrain.label, (TerrainClass.TRAVERSABLE, TerrainClass.INFLATION))] + 1) * RESOLUTION
    assert np.nanmin(low) == pytest.approx(tops.min()) and np.nanmax(high) == pytest.approx(tops.max())


def test_what_is_lethal_wins_over_ground_of_its_height_and_not_of_another() -> None:
    labels = [TerrainClass.TRAVERSABLE] * 3 + [TerrainClass.OBSTACLE, TerrainClass.CLIFF, TerrainClass.OBSTACLE]
    ix, z = np.array([0, 1, 2, 1, 2, 3], np.int32), np.array([0, 0, 0, 2, 9, 1], np.int32)
    voxels = ClassifiedVoxels(ix, np.zeros(6, np.int32), z, np.array(labels, np.uint8), 0.1)
    (storey,) = storey_maps(voxels)
    assert storey.grey[0].tolist() == [FREE, OCCUPIED, FREE, OCCUPIED]


def heights_at(path: Path, xy: np.ndarray) -> np.ndarray:
    """What a GeoTIFF says of (N, 2) places, by its ModelTransformation, or its scale and its corner of the upper left."""
    picture = Image.open(path)
    tags = picture.tag_v2
    assert tags[42113] == "nan" and (34264 in tags) != (33550 in tags and 33922 in tags)
    if 34264 in tags:
        T = np.array(tags[34264]).reshape(4, 4)
    else:
        (across, down, _), (_, _, _, left, top, _) = tags[33550], tags[33922]
        T = np.array([[across, 0, 0, left], [0, -down, 0, top], [0, 0, 0, 0], [0, 0, 0, 1]])
    columns, rows = np.floor(np.linalg.solve(T[:2, :2], (xy - T[:2, 3]).T)).astype(int)
    return np.asarray(np.asarray(picture)[rows, columns])


def write_poses(path: Path, poses: np.ndarray) -> None:
    """One a second, as a TUM file."""
    lines = [(second, *T[:3, 3], *quat_xyzw_from_transform(T)) for second, T in enumerate(poses)]
    path.write_text("".join(" ".join(f"{number:.9g}" for number in line) + "\n" for line in lines))


def test_height_map_lies_in_the_world_wherever_the_robot_started(tmp_path: Path) -> None:
    terrain = run_folder(tmp_path / "run", two_storeys(), (4, 5, 0))
    (tmp_path / "run" / "world_origin.json").write_bytes(origin_bytes((500000.0, 5400000.0, 300.0)))
    poses = np.array([transform_from_rpy((x, 5.0, 0.1)) for x in (4.0, 5.0, 6.0)])
    T_world_map = transform_from_rpy((12.0, 5.0, 7.0), (0.001, -0.002, 1.57))
    write_poses(tmp_path / "run" / "trajectory.txt", poses)
    write_poses(tmp_path / "run" / "trajectory_truth.txt", T_world_map @ poses)
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "a.tif")]) == 0
    ground = terrain.centers()[np.isin(terrain.label, (TerrainClass.TRAVERSABLE, TerrainClass.INFLATION))].astype(np.float64)
    for number in (1, 2):
        of_storey = ground[(ground[:, 2] > 1.8) == (number == 2)]
        tops = transform_points(T_world_map, of_storey + [0.0, 0.0, RESOLUTION / 2]) + [500000.0, 5400000.0, 300.0]
        assert len(tops) > 100
        assert heights_at(tmp_path / f"a-{number}.tif", tops[:, :2]) == pytest.approx(tops[:, 2], abs=1e-3)


@pytest.mark.parametrize(("name", "added"), [("world_origin.json", 0.0), ("map_origin.json", 300.0)])
def test_height_map_without_true_poses_has_the_session_s_own_coordinates(tmp_path: Path, name: str, added: float) -> None:
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    (tmp_path / "run" / name).write_bytes(origin_bytes((300.0, 300.0, 300.0)))
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "a.tif")]) == 0
    found = heights_at(tmp_path / "a.tif", np.array([[2.05, 2.05]]) + added)
    assert found == pytest.approx([added + RESOLUTION], abs=1e-3)
    assert 33550 in Image.open(tmp_path / "a.tif").tag_v2


def test_octrees_and_clouds_are_those_of_the_run(tmp_path: Path) -> None:
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    names = ["a.ot", "a.bt", "a.pcd", "a.ply"]
    assert main([str(tmp_path / "run"), "--out", *(str(tmp_path / name) for name in names)]) == 0
    tree = OctreeMap.read(tmp_path / "run" / "map.ot")
    assert OctreeMap.read(tmp_path / "a.ot").to_full() == tree.to_full()
    assert OctreeMap.read(tmp_path / "a.bt").to_binary() == tree.to_binary()
    assert all(read_cloud(tmp_path / name).points == pytest.approx(CLOUD) for name in names[2:])


def test_a_cloud_is_without_what_lies_in_free_space(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A person who was seen once, and through whose place later beams went."""
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    voxels = np.array([[2.0, 2.0, k * RESOLUTION] for k in (0, 1, 5)]) + RESOLUTION / 2
    tree, unseen = OctreeMap.read(tmp_path / "run" / "map.ot"), [2.0, 2.0, -3.0]
    assert tree.states_at([*voxels, unseen]).tolist() == [VoxelState.OCCUPIED, VoxelState.FREE, VoxelState.FREE, VoxelState.UNKNOWN]
    (tmp_path / "run" / "cloud.pcd").write_bytes(pcd_bytes(np.array([*voxels, unseen])))
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "a.ply")]) == 0
    assert read_cloud(tmp_path / "a.ply").points == pytest.approx(np.array([*voxels[:2], unseen]))
    assert "3 points; 1 in free space are left out" in capsys.readouterr().out


def session_of_a_room(folder: Path) -> None:
    """One sweep of a square room's floor and walls, as ./map_bag leaves it: without octree and classes."""
    line = np.arange(-3.0, 3.0, 0.05)
    x, y = (a.ravel() for a in np.meshgrid(line, line))
    along, up = (a.ravel() for a in np.meshgrid(line, np.arange(-0.13, 1.8, 0.05)))
    walls = [
        np.column_stack(c) for side in (-3.0, 3.0) for edge in [np.full(along.size, side)] for c in ((edge, along, up), (along, edge, up))
    ]
    points = np.concatenate([np.column_stack([x, y, np.full(x.size, -0.132)]), *walls]).astype(np.float32)
    store, graph, T = SessionStore(folder), PoseGraph(), transform_from_rpy((10.0, 5.0, 0.132))
    graph.add_vertex(T)
    origins = np.tile(np.float32([0.2, 0.0, 0.75]), (len(points), 1))
    store.add_sweep(0, 1.0, points, origins, graph, Measured(T, (0.0, 0.0, 1.0), 0.01))
    store.save(graph)


def test_octree_and_ground_of_a_session_are_made_of_its_sweeps(tmp_path: Path) -> None:
    session_of_a_room(tmp_path / "session")
    names = [str(tmp_path / name) for name in ("a.bt", "a.pgm", "a.ply")]
    assert main([str(tmp_path / "session"), "--out", *names]) == 0
    assert OctreeMap.read(tmp_path / "a.bt").resolution == Criteria().octree.resolution
    assert [value_at(tmp_path, "a", x, 5.5) for x in (11.0, 13.0)] == [FREE, OCCUPIED]
    (tmp_path / "fine.yaml").write_text("resolution: 0.05\n")
    assert main([str(tmp_path / "session"), "--profile", str(tmp_path / "fine.yaml"), "--out", str(tmp_path / "b.bt")]) == 0
    assert OctreeMap.read(tmp_path / "b.bt").resolution == 0.05


def test_octree_and_ground_are_what_map_bag_removes_when_it_adds_sweeps() -> None:
    assert {*OCTREES, CLASSES} == {*MADE_OF_SWEEPS}


def test_octree_s_file_and_voxels_give_the_centres(tmp_path: Path) -> None:
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    file = tmp_path / "run" / "map.ot"
    assert main([str(file), "--out", str(tmp_path / "a.pcd")]) == 0
    assert main([str(tmp_path / "run"), "--voxels", "--out", str(tmp_path / "b.pcd")]) == 0
    centers = OctreeMap.read(file).occupied_voxels()[0]
    assert all(len(read_cloud(tmp_path / name).points) == len(centers) for name in ("a.pcd", "b.pcd"))


@pytest.mark.parametrize(
    ("lacking", "out", "reason"),
    [
        ("terrain.npz", ["a.bt", "a.pgm"], "terrain.npz is missing"),
        ("map.ot", ["a.pcd", "a.bt"], "neither sweeps/index.json nor map.ot"),
        ("cloud.pcd", ["a.bt", "a.ply"], "cloud.pcd is missing"),
        ("", ["a.bt", "a.dxf"], "ends in .ot, .bt, .pcd"),
        ("", ["a.bt", "nowhere/a.bt"], "no such folder"),
    ],
)
def test_what_is_not_there_is_named_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], lacking: str, out: list[str], reason: str
) -> None:
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    if lacking:
        (tmp_path / "run" / lacking).unlink()
    assert main([str(tmp_path / "run"), "--out", *(str(tmp_path / name) for name in out)]) == 2
    said = capsys.readouterr()
    assert reason in said.err and len(said.err.splitlines()) == 1 and said.out == ""
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04noise", np.random.default_rng(1).bytes(3000)])
def test_damaged_classes_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str], content: bytes) -> None:
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    (tmp_path / "run" / "terrain.npz").write_bytes(content)
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "a.pgm")]) == 2
    assert "terrain.npz" in capsys.readouterr().err


def test_octree_alone_is_not_classified(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    assert main([str(tmp_path / "run" / "map.ot"), "--out", str(tmp_path / "a.pgm")]) == 2
    assert "give a run's folder" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["cloud.ply", "robot.pgm", "link/cloud.ply"])
def test_files_of_the_run_itself_are_not_replaced(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    run = tmp_path / "run"
    run_folder(run, floor(), (2, 2, 0))
    (run / "cloud.ply").write_text("of the run")
    (run / "robot.yaml").write_bytes(DEFAULT_ROBOT_FILE.read_bytes())
    (run / "link").symlink_to(run)
    before = {path: path.read_bytes() for path in run.iterdir() if path.is_file()}
    assert main([str(run), "--voxels", "--out", str(run / "a.ply"), str(run / name)]) == 2
    said = capsys.readouterr()
    assert "only read" in said.err and said.err.count("\n") == 1 and said.out == ""
    assert {path: path.read_bytes() for path in run.iterdir() if path.is_file()} == before


def test_second_output_that_is_a_folder_is_told_before_the_first_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    (tmp_path / "d.ply").mkdir()
    assert main([str(tmp_path / "run"), "--out", str(tmp_path / "z.bt"), str(tmp_path / "d.ply")]) == 2
    assert "is a folder, expected a file" in capsys.readouterr().err and not (tmp_path / "z.bt").exists()


def test_octree_is_not_replaced_by_its_own_copy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    octree_of(floor()).write_ot(tmp_path / "map.ot")
    assert main([str(tmp_path / "map.ot"), "--out", str(tmp_path / "map.ot")]) == 2
    assert "is the input" in capsys.readouterr().err


def test_disk_that_takes_not_all_leaves_nothing(tmp_path: Path, files_of_at_most: Callable[[int], AbstractContextManager[None]]) -> None:
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    with files_of_at_most(1000):
        assert main([str(tmp_path / "run"), "--out", str(tmp_path / "a.pcd"), str(tmp_path / "a.ot")]) == 2
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_folder_without_a_run_is_said_to_be_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "empty").mkdir()
    assert main([str(tmp_path / "empty"), "--out", str(tmp_path / "a.ply")]) == 2
    assert "empty: no run or session there" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "out"),
    [(("--robot", "small"), "a.pgm"), (("--profile", "thesis"), "a.pgm"), (("--profile", "thesis"), "a.ply"), (("--voxels",), "a.bt")],
)
def test_option_without_effect_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], more: tuple[str, ...], out: str) -> None:
    run_folder(tmp_path / "run", floor(), (2, 2, 0))
    assert main([str(tmp_path / "run"), *more, "--out", str(tmp_path / out)]) == 2
    said = capsys.readouterr().err
    assert f"{more[0]}: has no effect" in said and said.count("\n") == 1 and not (tmp_path / out).exists()
