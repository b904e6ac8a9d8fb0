"""./classify_map: what it finds in small maps, what it says when there is no start or no path, and what it refuses; never a traceback."""

import csv
import json
import os
from pathlib import Path

import numpy as np
import pytest
import yaml
from terrain_maps import AIR, FREE, OCCUPIED, RESOLUTION, UNKNOWN, cloud_file, floor, octree_file, octree_of, two_storeys

from mapping_tools.cloud_files import read_cloud
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.octree import OctreeMap
from octomap_server_3dnav.terrain.classify import TerrainClass, TerrainConfig, classify
from robot_body import RobotBody, robot_mapping
from terrain_tools.classify_map import main
from terrain_tools.ground import pose_on
from terrain_tools.results import FILES

# The real storey, where the reference data lie beside the repository or where OCTREE_TEST_DATA says.
DATA = Path(os.environ.get("OCTREE_TEST_DATA", Path(__file__).parents[4] / "shared" / "data"))
START = ("--start", "2", "2", "0.1")


def run(folder, *arguments):
    """Exit code and numbers, None where there are none."""
    code = main([*map(str, arguments), "--out", str(folder / "out")])
    numbers = folder / "out" / "terrain.json"
    return code, json.loads(numbers.read_text()) if numbers.exists() else None


@pytest.fixture(scope="module")
def storeys(tmp_path_factory):
    return octree_file(tmp_path_factory.mktemp("map") / "storeys.bt", two_storeys())


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    return octree_file(tmp_path_factory.mktemp("map") / "room.bt", floor())


# -- what is found


def test_path_leads_over_the_ramp_to_the_upper_storey(tmp_path, storeys, capsys):
    code, found = run(tmp_path, storeys, "--start", 4, 5, 0, "--goal", 4, 5, 2)
    assert code == 0 and found["problem"] is None and "path of" in capsys.readouterr().out
    with (tmp_path / "out" / "path.csv").open() as file:
        rows = [[float(v) for v in row.values()] for row in csv.DictReader(file)]
    assert rows[0][:3] == pytest.approx([4, 5, 0], abs=0.1) and rows[-1][:3] == pytest.approx([4, 5, 2], abs=0.1)
    assert rows[-1][3] == pytest.approx(found["path"]["length_m"], abs=0.01)
    assert any(y < 3 and 0.5 < z < 1.5 for _, y, z, _ in rows)  # on the ramp
    assert found["path"]["climb_m"] - found["path"]["descent_m"] == pytest.approx(2.0, abs=0.05)


def test_classes_are_those_of_the_node_and_in_their_colours(tmp_path, storeys):
    run(tmp_path, storeys, "--start", 4, 5, 0)
    terrain = classify(OctreeMap.read(storeys).column_runs(), pose_on((4, 5, 0), RobotBody()), TerrainConfig(), RobotBody(), None)
    header, _, body = (tmp_path / "out" / "terrain.ply").read_bytes().partition(b"end_header\n")
    rows = np.frombuffer(body, dtype=[("xyz", "<f4", 3), ("rgb", "u1", 3), ("label", "u1")])
    assert np.array_equal(rows["xyz"], terrain.centers()) and np.array_equal(rows["label"], terrain.label)
    assert f"comment label {int(TerrainClass.CLIFF)} cliff\n".encode() in header
    for terrain_class in (TerrainClass.TRAVERSABLE, TerrainClass.OBSTACLE):
        red, green, _ = rows["rgb"][rows["label"] == terrain_class][0].astype(int)
        assert (red > green) == (terrain_class is TerrainClass.OBSTACLE)
    assert np.allclose(read_cloud(tmp_path / "out" / "terrain.ply").points, terrain.centers())


def test_numbers_and_picture_are_written_without_a_goal(tmp_path, room):
    code, found = run(tmp_path, room, *START)
    assert code == 0 and found["path"] is None and not (tmp_path / "out" / "path.csv").exists()
    assert found["terrain"]["ground_m2"] == pytest.approx(3.8**2, abs=0.01)
    assert found["terrain"]["reachable_m2"] == found["terrain"]["classes"]["traversable"]["area_m2"] == pytest.approx(2.6**2, abs=0.01)
    assert found["terrain"]["start_voxel_m"] == pytest.approx([1.95, 1.95, 0.05], abs=0.11)
    png = (tmp_path / "out" / "terrain.png").read_bytes()
    assert png.startswith(b"\x89PNG") and len(png) < 100_000


@pytest.mark.parametrize("suffix", [".bt", ".ot"])
def test_both_octree_formats_give_the_same(tmp_path, suffix, room):
    code, found = run(tmp_path, octree_file(tmp_path / f"map{suffix}", floor()), *START)
    assert code == 0 and found["terrain"]["classes"] == run(tmp_path, room, *START)[1]["terrain"]["classes"]


def robot_file(tmp_path, **changes):
    path = tmp_path / "small.yaml"
    path.write_text(yaml.safe_dump({**robot_mapping(RobotBody()), **changes}))
    return path


def test_robot_file_changes_what_is_traversable(tmp_path, room):
    small = {"length_m": 0.48, "width_m": 0.36, "track_m": 0.3, "wheel_width_m": 0.06, "wheelbase_m": 0.1}  # turns within 0.3 m
    code, found = run(tmp_path, room, *START, "--robot", robot_file(tmp_path, **small))
    assert code == 0 and found["config"]["robot"]["length_m"] == 0.48
    assert found["terrain"]["reachable_m2"] == pytest.approx(3.2**2, abs=0.01)


def test_wrong_robot_is_refused_with_one_line_a_violation(tmp_path, room, capsys):
    wrong = robot_file(tmp_path, width_m=0.5, max_step_m=-1.0, colour="red")
    assert main([str(room), *map(str, START), "--robot", str(wrong), "--out", str(tmp_path / "out")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 3 and all(line.startswith(f"./classify_map: --robot {wrong}: ") for line in lines), lines


def test_profile_sets_parameters_and_values_of_the_robot(tmp_path, room):
    (tmp_path / "p.yaml").write_text("octomap_server_3dnav_node: {terrain: {clearance_margin_m: 0.2}}\nrobot: {max_step_m: 0.05}\n")
    code, found = run(tmp_path, room, *START, "--profile", tmp_path / "p.yaml")
    assert code == 0 and found["config"]["terrain"]["clearance_margin_m"] == 0.2 and found["config"]["robot"]["max_step_m"] == 0.05


def test_start_may_be_off_the_ground_by_its_tolerance(tmp_path, room):
    assert run(tmp_path, room, "--start", 2, 2, 0.3)[0] == 0
    assert run(tmp_path, room, "--start", 2, 2, 0.5)[0] == 1
    assert run(tmp_path, room, "--start", 2, 2, -0.2)[0] == 0


def floor_points(states, per_voxel=3):
    """Points in every occupied voxel of a grid."""
    voxels = np.argwhere(states == OCCUPIED)
    offsets = np.random.default_rng(1).uniform(0.05, 0.95, (per_voxel, len(voxels), 3))
    return ((voxels + offsets) * RESOLUTION).reshape(-1, 3)


def test_cloud_without_origins_has_no_seen_drops(tmp_path):
    states = floor()
    states[30:] = UNKNOWN
    path = cloud_file(tmp_path / "cloud.ply", floor_points(states))
    code, found = run(tmp_path, path, *START, "--resolution", RESOLUTION)
    assert code == 0 and found["resolution_m"] == RESOLUTION
    classes = found["terrain"]["classes"]
    assert classes["cliff"]["voxels"] == 0 and classes["frontier"]["voxels"] == 38 and found["frontiers"]


def test_origins_of_a_cloud_free_the_space_that_its_beams_crossed(tmp_path):
    points = floor_points(floor())
    sensor = dict(zip(("vp_x", "vp_y", "vp_z"), np.tile([[2.0], [2.0], [1.2]], len(points)), strict=True))
    path = cloud_file(tmp_path / "cloud.ply", points, **sensor)
    states = []
    for origins in ("fields", "none"):
        code, found = run(tmp_path, path, *START, "--resolution", RESOLUTION, "--origins", origins)
        assert code == 0
        states.append(found["leaves"])
    assert states[0] > 1.5 * states[1]


def test_points_that_are_not_finite_or_out_of_reach_are_left_out(tmp_path, capsys):
    points = np.vstack([floor_points(floor()), [[np.nan, 0, 0], [0, np.inf, 0], [1e7, 0, 0]]])
    code, _ = run(tmp_path, cloud_file(tmp_path / "cloud.ply", points), *START, "--resolution", RESOLUTION)
    assert code == 0 and "2 not finite, 1 beyond" in capsys.readouterr().err


def test_cloud_in_map_coordinates_is_classified_near_them(tmp_path, capsys):
    points, far = floor_points(floor()), np.array([448262.0, 5412345.0, 412.0])
    np.savetxt(tmp_path / "near.xyz", points, fmt="%.4f")
    np.savetxt(tmp_path / "far.xyz", points + far, fmt="%.4f")
    start = np.array([2.0, 2.0, 0.1])
    assert main([str(tmp_path / "near.xyz"), "--start", *map(str, start), "--out", str(tmp_path / "near")]) == 0
    assert main([str(tmp_path / "far.xyz"), "--start", *map(str, start + far), "--out", str(tmp_path / "far")]) == 0
    near, found = (json.loads((tmp_path / name / "terrain.json").read_text()) for name in ("near", "far"))
    assert near["origin_m"] == [0.0, 0.0, 0.0] and np.abs(np.array(found["origin_m"]) - far).max() < 10.0
    assert "relative to the origin" in capsys.readouterr().err
    assert found["start_m"] == pytest.approx(start + far - found["origin_m"], abs=1e-6)
    assert found["terrain"]["reachable_m2"] == pytest.approx(near["terrain"]["reachable_m2"], rel=0.1)
    assert main([str(tmp_path / "far.xyz"), "--start", *map(str, start + far), "--out", str(tmp_path / "o"), "--origins", "sensor"]) == 2
    assert "--origins sensor" in capsys.readouterr().err


def test_beams_without_an_echo_are_no_ground(tmp_path, capsys):
    points = floor_points(floor())
    np.savetxt(tmp_path / "near.xyz", np.vstack([points, np.zeros((500, 3))]), fmt="%.4f")
    assert main([str(tmp_path / "near.xyz"), "--start", "2", "2", "0.1", "--out", str(tmp_path / "out")]) == 0
    assert "500 points at 0 0 0" in capsys.readouterr().err


def test_files_of_an_earlier_map_do_not_stay(tmp_path, storeys):
    run(tmp_path, storeys, "--start", 4, 5, 0, "--goal", 4, 5, 2)
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == sorted(FILES)
    run(tmp_path, storeys, "--start", 4, 5, 50)
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["terrain.json"]


# -- no start, no path


@pytest.mark.parametrize(
    "start, said",
    [
        ((2, 2, 0.9), "in the air"),
        ((2.95, 1.0, 0.9), "inside something occupied"),
        ((50, 2, 0), "outside the map, which spans x 0.0 to 4.0"),
    ],
)
def test_start_off_the_ground_is_told_where_the_nearest_is(tmp_path, capsys, start, said):
    path = octree_file(tmp_path / "map.bt", floor(walls=[np.s_[27:33, 5:20]]))
    code, found = run(tmp_path, path, "--start", *start)
    assert code == 1 and said in capsys.readouterr().err and said in found["problem"]["reason"]
    x, y, z = found["nearest_ground_m"]
    assert 0.6 <= x <= 3.4 and 0.6 <= y <= 3.4 and z == pytest.approx(0.05)
    assert found["nearest_ground_distance_m"] == pytest.approx(np.linalg.norm(np.subtract(start, (x, y, z))), abs=0.01)
    assert run(tmp_path, path, "--start", x, y, z)[0] == 0


def test_nearest_ground_is_found_on_the_storey_that_was_meant(tmp_path, storeys):
    code, found = run(tmp_path, storeys, "--start", 4, 5, 2.6)
    assert code == 1 and found["nearest_ground_m"] == pytest.approx([4, 5, 2.05], abs=0.1)


def test_start_on_a_table_is_an_island(tmp_path, capsys):
    states = floor()
    states[18:23, 18:23, :5] = OCCUPIED
    code, found = run(tmp_path, octree_file(tmp_path / "map.bt", states), "--start", 2, 2, 0.5)
    assert code == 1 and "leads to less than 0.5 m2" in capsys.readouterr().err
    assert found["nearest_ground_m"][2] == pytest.approx(0.05)


def test_start_in_a_closet_is_too_near_to_its_walls(tmp_path, capsys):
    states = floor(10)
    code, found = run(tmp_path, octree_file(tmp_path / "map.bt", states), "--start", 0.5, 0.5, 0)
    assert code == 1 and "too near to obstacles" in capsys.readouterr().err
    assert found["nearest_ground_m"] is None


def test_map_without_anything_is_said_to_be_empty(tmp_path, capsys):
    OctreeMap(RESOLUTION).write_bt(tmp_path / "empty.bt")
    code, found = run(tmp_path, tmp_path / "empty.bt", *START)
    assert code == 1 and "the map is empty" in capsys.readouterr().err and found["nearest_ground_m"] is None


@pytest.mark.parametrize("start", [(0.05, 0.05, 0.1), (5, 5, 5)])
def test_map_of_one_voxel_has_no_ground(tmp_path, start):
    path = octree_file(tmp_path / "one.bt", np.full((1, 1, 1), OCCUPIED))
    code, found = run(tmp_path, path, "--start", *start)
    assert code == 1 and found["nearest_ground_m"] is None and found["problem"]["reason"]


@pytest.mark.parametrize(
    "goal, said",
    [
        ((4, 2, 0.1), "the start does not lead to what lies there"),
        ((2.95, 2, 0.1), "obstacle"),
        ((1, 2, 0.9), "in the air"),
        ((1, 90, 0), "outside the map"),
        ((-9e5, 2, 0), "outside the map"),
    ],
)
def test_goal_that_cannot_be_reached_is_told_why_and_where_the_nearest_is(tmp_path, capsys, goal, said):
    states = np.full((60, 40, AIR + 1), FREE)
    states[:, :, 0] = OCCUPIED
    states[28:31] = OCCUPIED
    for wall in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1]):
        states[wall] = OCCUPIED
    code, found = run(tmp_path, octree_file(tmp_path / "map.bt", states), "--start", 1, 2, 0, "--goal", *goal)
    assert code == 1 and said in capsys.readouterr().err and said in found["problem"]["reason"]
    assert found["path"] is None and not (tmp_path / "out" / "path.csv").exists()
    assert (tmp_path / "out" / "terrain.png").exists()
    assert run(tmp_path, tmp_path / "map.bt", "--start", 1, 2, 0, "--goal", *found["nearest_ground_m"])[0] == 0


def test_goal_tolerance_lets_a_path_end_beside_the_goal(tmp_path, room):
    goal = ("--goal", 0.3, 2, 0)
    assert run(tmp_path, room, *START, *goal, "--goal-tolerance", 0.1)[0] == 1
    code, found = run(tmp_path, room, *START, *goal)
    assert code == 0 and found["goal_voxel_m"] == pytest.approx([0.75, 2, 0.05], abs=0.11)


# -- bad input


@pytest.mark.parametrize(
    "content, said",
    [
        (b"", "no octomap file"),
        (b"\x7fELF\x02\x01\x01 and so on", "no octomap file"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize 3\nres 0.1\n", "header"),
        (b"# Octomap OcTree binary file\nid CountingOcTree\nsize 2\nres 0.1\ndata\n\x02\x00", "CountingOcTree"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize 9\nres 0.1\ndata\n\x02\x00", "9 nodes"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize x\nres 0.1\ndata\n\x03\x00", "'size' is no such number: x"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize 0\nres 0\ndata\n", "resolution"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize 0\nres nan\ndata\n", "'res' is no such number: nan"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize 0\nres -0.1\ndata\n", "resolution"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize 0\nres 1000\ndata\n", "resolution = 1000.0 is above 1.0"),
    ],
)
def test_file_that_is_no_usable_octree_is_named(tmp_path, capsys, content, said):
    (tmp_path / "foreign.bt").write_bytes(content)
    assert run(tmp_path, tmp_path / "foreign.bt", *START) == (2, None)
    error = capsys.readouterr().err
    assert "foreign.bt" in error and said in error


@pytest.mark.parametrize("suffix", [".bt", ".ot"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.999])
def test_truncated_octree_is_named(tmp_path, capsys, suffix, share):
    path = Path(octree_file(tmp_path / f"cut{suffix}", floor()))
    path.write_bytes(path.read_bytes()[: int(share * path.stat().st_size)])
    assert run(tmp_path, path, *START) == (2, None)
    assert f"cut{suffix}" in capsys.readouterr().err


def test_small_file_of_a_huge_map_is_refused_before_it_is_read(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(OctreeMap, "read", lambda *_: pytest.fail("was read"))
    (tmp_path / "huge.bt").write_bytes(b"# Octomap OcTree binary file\nid OcTree\nsize 2\nres 0.1\ndata\n\x02\x00")
    assert run(tmp_path, tmp_path / "huge.bt", *START, "--max-memory", 8) == (2, None)
    error = capsys.readouterr().err
    assert "32,768 x 32,768 columns" in error and "more than the 8.0 GB of --max-memory" in error


def test_map_above_the_allowed_memory_is_refused_before_it_is_read(tmp_path, capsys, monkeypatch, storeys):
    monkeypatch.setattr(OctreeMap, "read", lambda *_: pytest.fail("was read"))
    assert run(tmp_path, storeys, *START, "--max-memory", 0.001) == (2, None)
    assert "--max-memory" in capsys.readouterr().err


def test_cloud_above_the_allowed_memory_is_refused(tmp_path, capsys):
    path = cloud_file(tmp_path / "cloud.ply", np.random.default_rng(0).uniform(-2000, 2000, (2000, 3)))
    assert run(tmp_path, path, *START, "--max-memory", 0.05) == (2, None)
    assert "2,000 points take up to" in capsys.readouterr().err


@pytest.mark.parametrize(
    "more, said",
    [
        (["--start", "0", "nan", "0"], "--start"),
        (["--start", "0", "0"], "--start"),
        (["--start", "0", "1e300", "0"], "--start"),
        (["--start", "a", "0", "0"], "--start"),
        (["--goal", "inf", "0", "0"], "--goal"),
        (["--goal-tolerance", "0.5"], "--goal-tolerance: has no effect without --goal"),
        (["--goal-tolerance", "nan"], "--goal-tolerance"),
        (["--goal-tolerance", "-1"], "--goal-tolerance"),
        (["--max-memory", "nan"], "--max-memory"),
        (["--max-memory", "0"], "--max-memory"),
        (["--resolution", "0.1"], "--resolution"),
        (["--origins", "none"], "--origins"),
        (["--robot", "absent.yaml"], "absent.yaml"),
        (["--speed"], "--speed"),
    ],
)
def test_wrong_argument_is_named(tmp_path, room, capsys, more, said):
    assert run(tmp_path, room, *START, *more) == (2, None)
    assert said in capsys.readouterr().err


@pytest.mark.parametrize("resolution", ["0", "-0.1", "nan", "1000", "0.0001"])
def test_resolution_that_is_none_is_named(tmp_path, capsys, resolution):
    path = cloud_file(tmp_path / "cloud.ply", floor_points(floor(10)))
    assert run(tmp_path, path, *START, "--resolution", resolution) == (2, None)
    assert "resolution" in capsys.readouterr().err


@pytest.mark.parametrize(
    "points, said",
    [(np.zeros((0, 3)), "no points"), (np.full((9, 3), np.nan), "9 not finite"), (np.full((9, 3), 1e9), "9 beyond")],
    ids=["empty", "NaN", "out of any grid"],
)
def test_cloud_that_holds_nothing_is_named(tmp_path, capsys, points, said):
    path = cloud_file(tmp_path / "nothing.ply", points)
    assert run(tmp_path, path, *START) == (2, None)
    error = capsys.readouterr().err
    assert "nothing.ply" in error and said in error


@pytest.mark.parametrize("name", ["absent.bt", "absent.ply", "map.txt", "folder.bt"])
def test_file_that_cannot_be_read_is_named(tmp_path, capsys, name):
    (tmp_path / "folder.bt").mkdir()
    assert run(tmp_path, tmp_path / name, *START) == (2, None)
    assert name in capsys.readouterr().err


def test_folder_that_cannot_be_written_is_named(tmp_path, room, capsys):
    (tmp_path / "out").write_text("in the way")
    assert main([str(room), *START, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert (
        said.startswith(f"./classify_map: --out {tmp_path / 'out'}:") and "is a file, expected a folder" in said and said.count("\n") == 1
    )


def test_memory_that_ends_is_said(tmp_path, room, capsys, monkeypatch):
    def ended(*_):
        raise MemoryError

    monkeypatch.setattr("terrain_tools.classify_map.analyse", ended)
    assert run(tmp_path, room, *START) == (2, None)
    assert "memory" in capsys.readouterr().err


def test_help_says_how_far_a_start_may_be_off(capsys):
    with pytest.raises(SystemExit) as ended:
        main(["--help"])
    assert ended.value.code == 0 and "off it by up to 0.33 m" in " ".join(capsys.readouterr().out.split())


# -- a real map


@pytest.mark.skipif(not (DATA / "geb079.bt").is_file(), reason="geb079.bt is not beside the repository")
def test_path_along_the_corridor_of_a_real_storey(tmp_path):
    code, found = run(tmp_path, DATA / "geb079.bt", "--start", 17.7, 0, 0, "--goal", 26, 0, 0)
    assert code == 0 and 8.0 < found["path"]["length_m"] < 10.0


def test_octrees_of_the_tests_are_what_they_are_drawn_as():
    for states in (floor(), two_storeys()):
        found, drawn = octree_of(states).column_runs(), ColumnRuns.from_dense(states)
        assert all(np.array_equal(getattr(found, name), getattr(drawn, name)) for name in ("start", "z_lo", "z_hi", "occupied"))


# -- what is in the folder before


def content_of(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.parametrize(
    "name, more",
    [("absent.bt", []), ("room.bt", ["--resolution", "0.2"]), ("noise.bt", []), ("room.bt", ["--max-memory", "1e-9"])],
)
def test_refused_map_leaves_the_results_of_an_earlier_one(tmp_path, capsys, name, more):
    room = octree_file(tmp_path / "room.bt", floor())
    (tmp_path / "noise.bt").write_bytes(b"no octree")
    run(tmp_path, room, *START, "--goal", 3, 3, 0)
    before = content_of(tmp_path / "out")
    assert len(before) == len(FILES) and run(tmp_path, tmp_path / name, *START, *more)[0] == 2
    assert content_of(tmp_path / "out") == before


def test_result_of_an_earlier_map_is_no_map_for_its_own_folder(tmp_path, room, capsys):
    run(tmp_path, room, *START)
    before = content_of(tmp_path / "out")
    capsys.readouterr()
    assert run(tmp_path, tmp_path / "out" / "terrain.ply", *START)[0] == 2
    assert content_of(tmp_path / "out") == before
    said = capsys.readouterr().err
    assert "--out" in said and "terrain.ply" in said and "only read" in said and said.count("\n") == 1


def test_disk_that_takes_not_all_leaves_the_earlier_results(tmp_path, storeys, files_of_at_most):
    run(tmp_path, storeys, "--start", 4, 5, 0, "--goal", 4, 5, 2)
    before = content_of(tmp_path / "out")
    with files_of_at_most(20_000):
        assert run(tmp_path, storeys, "--start", 4, 5, 0)[0] == 2
        assert main([str(storeys), "--start", "4", "5", "0", "--out", str(tmp_path / "new" / "out")]) == 2
    assert content_of(tmp_path / "out") == before and not (tmp_path / "new").exists()


def test_refused_map_makes_no_folder(tmp_path):
    assert main([str(tmp_path / "absent.bt"), *START, "--out", str(tmp_path / "new")]) == 2
    assert not (tmp_path / "new").exists()
