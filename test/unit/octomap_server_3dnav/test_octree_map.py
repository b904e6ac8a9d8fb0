"""What is asked of the octree and what it writes: dense grids and Debian's octomap tools are the oracles."""

import os
import re
import shutil
import stat
import struct
import subprocess
import threading
from pathlib import Path

import numpy as np
import pytest
from octree_planes import clear_box, insert_plane

from octomap_server_3dnav.octree.column_runs import ColumnRuns, VoxelState
from octomap_server_3dnav.octree.octree import OctreeMap, SensorModel

RES = 0.1
FREE, OCCUPIED, UNKNOWN = VoxelState.FREE, VoxelState.OCCUPIED, VoxelState.UNKNOWN
GRID = np.stack(np.meshgrid(*[np.arange(-24, 24)] * 3, indexing="ij"), -1).reshape(-1, 3)
# The real storey, where the reference data lie beside the repository or where OCTREE_TEST_DATA says.
DATA = Path(os.environ.get("OCTREE_TEST_DATA", Path(__file__).parents[4] / "shared" / "data"))


def part_of(octree: OctreeMap, lo, hi) -> OctreeMap:
    """A map of what lies in a box."""
    return OctreeMap.from_binary(octree.to_binary(lo, hi), octree.resolution)


def room_map(sweeps: int = 3, resolution: float = RES) -> OctreeMap:
    """A box room of 4 x 4 x 2 m scanned from a few places: surfaces, pruned free space, and voxels that were revised."""
    rng = np.random.default_rng(7)
    octree = OctreeMap(resolution)
    for _ in range(sweeps):
        origin = rng.uniform(-0.8, 0.8, 3) * [1, 1, 0.5]
        direction = rng.normal(size=(4000, 3))
        reach = np.where(direction > 0, np.array([2, 2, 1]) - origin, np.array([-2, -2, -1]) - origin) / direction
        points = origin + direction * reach.min(axis=1, keepdims=True)
        octree.insert_sweep(points.astype(np.float32), np.broadcast_to(origin, points.shape).astype(np.float32))
    return octree


def grid_states(octree: OctreeMap) -> np.ndarray:
    return octree.states_at((GRID + 0.5) * octree.resolution)


# -- column runs


@pytest.mark.parametrize(("lo", "hi"), [(None, None), ([-0.5, -1.2, -0.4], [1.3, 0.2, 0.7]), ([-np.inf, 0, 0], [np.inf, 0.1, np.inf])])
def test_column_runs_hold_exactly_the_states_of_the_voxels(lo, hi):
    octree = room_map()
    runs = octree.column_runs(lo, hi)
    x, y, z = (np.arange(n) for n in (runs.nx, runs.ny, runs.z_range[1] - runs.z_range[0] + 1))
    indices = np.stack(np.meshgrid(x + runs.origin_key[0], y + runs.origin_key[1], z + runs.z_range[0], indexing="ij"), -1)
    states = octree.states_at((indices.reshape(-1, 3) + 0.5) * RES).reshape(indices.shape[:3])
    drawn = ColumnRuns.from_dense(states, indices[0, 0, 0])
    assert all(np.array_equal(getattr(runs, name), getattr(drawn, name)) for name in ("start", "z_lo", "z_hi", "occupied"))


def test_column_runs_of_a_box_are_those_of_a_map_of_it_and_leave_nothing_known_out():
    octree, lo, hi = room_map(), np.array([-0.5, -1.2, -0.4]), np.array([1.3, 0.2, 0.7])
    runs, alone = octree.column_runs(lo, hi), part_of(octree, lo, hi).column_runs()
    assert (runs.origin_key, runs.nx, runs.ny) == (alone.origin_key, alone.nx, alone.ny)
    for name in ("start", "z_lo", "z_hi", "occupied"):
        assert np.array_equal(getattr(runs, name), getattr(alone, name)), name
    inside = ((GRID >= np.round(lo / RES)) & (GRID < np.round(hi / RES))).all(axis=1)
    assert (runs.z_hi - runs.z_lo + 1).sum() == (grid_states(octree)[inside] != UNKNOWN).sum()


def test_loaded_tree_and_live_tree_have_the_same_runs(tmp_path):
    octree = room_map()
    octree.write_bt(tmp_path / "map.bt")
    live, loaded = octree.column_runs(), OctreeMap.read(tmp_path / "map.bt").column_runs()
    assert all(np.array_equal(getattr(live, name), getattr(loaded, name)) for name in ("start", "z_lo", "z_hi", "occupied"))


def test_voxel_below_zero_has_a_negative_index():
    octree = OctreeMap(RES)
    insert_plane(octree, [-0.05, 0.05, -0.05], 0.01)
    runs = octree.column_runs()
    assert (runs.origin_key, runs.nx, runs.ny, runs.z_range) == ((-1, 0), 1, 1, (-1, -1))


def test_empty_map_has_no_columns():
    runs = OctreeMap(RES).column_runs()
    assert (runs.nx, runs.ny, runs.z_lo.size) == (0, 0, 0)


def test_map_of_too_many_columns_is_refused_with_their_number():
    octree = OctreeMap(RES)
    for place in (-3000.0, 3000.0):
        insert_plane(octree, [place, place, 0.0], 0.1)
    with pytest.raises(ValueError, match="ask for a smaller box"):
        octree.column_runs()
    assert octree.column_runs([2990, 2990, -1], [3010, 3010, 1]).nx > 0


# -- plane, boxes, queries


def test_plane_fills_only_what_is_unknown():
    octree = OctreeMap(RES, SensorModel(grazing_m=0.0))
    octree.insert_sweep(np.array([[0.45, 0.05, 0.05]], np.float32), np.array([[0.05, 0.05, 0.05]], np.float32))
    assert insert_plane(octree, [0.0, 0.0, 0.05], 0.3) == 36 - 3
    places = [[[0.1 * x + 0.05, 0.1 * y + 0.05, 0.05] for x in range(-3, 5)] for y in range(-3, 3)]
    rows = ["".join(".1#"[s] for s in octree.states_at(row)) for row in places]
    assert rows == ["######..", "######..", "######..", "###1111#", "######..", "######.."]


@pytest.mark.parametrize("up", [(0.0, 0.0, 1.0), (-0.3, 0.1, 0.9), (0.0, 0.42, 0.9), (1.0, 1.0, 0.8)])
def test_plane_lies_as_its_normal_says(up):
    octree, center = OctreeMap(RES), np.array([0.33, -0.21, 0.45])
    assert insert_plane(octree, center, 0.6, up) == 13 * 13
    centers, _ = octree.occupied_voxels()
    off = (centers - center) @ (np.array(up) / up[2])
    assert len(centers) == 13 * 13 and np.abs(off).max() <= RES / 2 + 1e-6
    assert len(np.unique(np.round(centers[:, :2] / RES, 1), axis=0)) == 13 * 13  # one voxel a column


@pytest.mark.parametrize("up", [(0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (np.nan, 0.0, 1.0), (0.0, 1.0)])
def test_plane_whose_normal_does_not_point_upwards_is_refused(up):
    with pytest.raises(ValueError, match="up"):
        insert_plane(OctreeMap(RES), [0.0, 0.0, 0.0], 0.5, up)


def test_plane_is_overruled_by_what_beams_see_later():
    octree = OctreeMap(RES)
    insert_plane(octree, [0.0, 0.0, 0.05], 0.2)
    down = np.array([[0.05 + x / 10, 0.05 + y / 10, -1.05] for x in range(-2, 3) for y in range(-2, 3)], np.float32)
    for _ in range(3):
        octree.insert_sweep(down, down + np.array([0.0, 0.0, 2.1], np.float32))
    assert octree.states_at([[0.05, 0.05, 0.05], [-0.05, 0.05, 0.05]]).tolist() == [FREE, OCCUPIED]


def test_cleared_box_is_free_where_it_was_known_and_the_rest_is_untouched():
    octree = room_map()
    before = grid_states(octree)
    clear_box(octree, [0.5, 0.5, -1.2], [3.0, 3.0, 0.0])
    inside = ((GRID >= [5, 5, -12]) & (GRID < [30, 30, 0])).all(axis=1)
    assert np.array_equal(grid_states(octree), np.where(inside & (before == OCCUPIED), FREE, before))


def test_binary_of_a_box_holds_what_lies_in_it_and_nothing_else():
    octree = room_map()
    inside = ((GRID >= [-3, -25, -2]) & (GRID < [21, 4, 9])).all(axis=1)
    part = part_of(octree, [-0.3, -2.5, -0.2], [2.1, 0.4, 0.9])
    assert np.array_equal(grid_states(part), np.where(inside, grid_states(octree), UNKNOWN))
    assert octree.to_binary([-9, -9, -9], [9, 9, 9]) == octree.to_binary()
    assert part_of(octree, [50, 50, 50], [51, 51, 51]).node_count == 0


def test_binary_of_a_box_is_that_of_a_map_of_it_alone():
    part = part_of(room_map(), [-0.3, -2.5, -0.2], [2.1, 0.4, 0.9])
    assert part.to_binary() == room_map().to_binary([-0.3, -2.5, -0.2], [2.1, 0.4, 0.9])


def test_occupied_voxels_are_those_of_the_grid_with_pruned_ones_whole():
    octree = OctreeMap(RES)
    for z in (0.05, 0.15):
        insert_plane(octree, [0.2, 0.1, z], 0.2 - 1e-3)
    centers, sizes = octree.occupied_voxels()
    assert centers.dtype == sizes.dtype == np.float32
    assert np.isclose((sizes.astype(float) ** 3).sum(), 4 * 4 * 2 * RES**3)
    assert sorted(np.round(sizes / RES).astype(int).tolist()) == [1] * 16 + [2, 2]
    assert (octree.states_at(centers) == OCCUPIED).all()


def test_occupied_voxels_of_a_live_tree_are_merged_whatever_their_probabilities(tmp_path):
    octree = room_map()
    octree.write_bt(tmp_path / "map.bt")
    live, loaded = octree.occupied_voxels(), OctreeMap.read(tmp_path / "map.bt").occupied_voxels()
    assert np.array_equal(live[0], loaded[0]) and np.array_equal(live[1], loaded[1])


def test_states_are_unknown_where_nothing_can_be_known():
    octree = room_map()
    states = octree.states_at([[np.nan, 0, 0], [1e9, 0, 0], [0, -np.inf, 0], [50, 50, 50], [0, 0, 0]])
    assert states.dtype == np.uint8 and states.tolist() == [UNKNOWN] * 4 + [FREE]
    assert octree.states_at(np.zeros((0, 3))).shape == (0,)
    with pytest.raises(ValueError, match=r"\(N, 3\)"):
        octree.states_at([0.0, 0.0, 0.0])


def test_new_map_holds_nothing():
    octree = OctreeMap(RES)
    assert (octree.node_count, octree.leaf_count, octree.to_full()) == (0, 0, b"")
    insert_plane(octree, [0, 0, 0.05], 0.1)
    assert octree.node_count > 0 and octree.memory_bytes > 0


def test_threads_that_share_a_map_do_not_disturb_each_other():
    octree, failures = OctreeMap(RES), []
    rng = np.random.default_rng(3)
    sweeps = [rng.uniform(-2, 2, (2000, 3)).astype(np.float32) for _ in range(4)]

    def read() -> None:
        try:
            for _ in range(40):
                octree.column_runs()
                OctreeMap.from_full(octree.to_full(), RES)
        except ValueError as error:  # runs that overlap, data that end early
            failures.append(error)

    threads = [threading.Thread(target=octree.insert_sweep, args=(s, np.zeros_like(s))) for s in sweeps] + [threading.Thread(target=read)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not failures and octree.node_count > 0


# -- bytes and files


def test_full_data_survive_the_round_trip_bit_by_bit():
    octree = room_map()
    again = OctreeMap.from_full(octree.to_full(), RES)
    assert again.to_full() == octree.to_full() and again.node_count == octree.node_count


def test_binary_data_keep_every_state():
    octree = room_map()
    again = OctreeMap.from_binary(octree.to_binary(), RES)
    assert np.array_equal(grid_states(again), grid_states(octree))
    assert again.to_binary() == octree.to_binary()
    assert again.node_count <= octree.node_count  # pruned where only probabilities differed


def test_empty_map_survives_both_round_trips(tmp_path):
    octree = OctreeMap(RES)
    for name, write in (("map.bt", octree.write_bt), ("map.ot", octree.write_ot)):
        write(tmp_path / name)
        assert OctreeMap.read(tmp_path / name).node_count == 0


def test_files_keep_resolution_and_states(tmp_path):
    octree = room_map(resolution=0.08)
    octree.write_bt(tmp_path / "map.bt")
    octree.write_ot(tmp_path / "map.ot")
    for name in ("map.bt", "map.ot"):
        again = OctreeMap.read(tmp_path / name)
        assert again.resolution == 0.08 and np.array_equal(grid_states(again), grid_states(octree))
    assert OctreeMap.read(tmp_path / "map.ot").to_full() == octree.to_full()


def run_tool(*command: str | Path) -> str:
    if shutil.which(str(command[0])) is None:
        pytest.skip(f"{command[0]} of Debian's octomap-tools is not installed")
    return subprocess.run([str(c) for c in command], capture_output=True, text=True, timeout=30, check=True).stdout


def test_octomaps_tools_read_the_files_and_find_the_trees_equal(tmp_path):
    octree = room_map()
    octree.write_bt(tmp_path / "map.bt")
    octree.write_ot(tmp_path / "map.ot")
    run_tool("convert_octree", tmp_path / "map.bt", tmp_path / "converted.ot")
    states_equal = OctreeMap.read(tmp_path / "converted.ot")
    assert np.array_equal(grid_states(states_equal), grid_states(octree))
    run_tool("convert_octree", tmp_path / "map.ot", tmp_path / "again.ot")
    text = run_tool("compare_octrees", tmp_path / "map.ot", tmp_path / "again.ot")
    divergence = re.search(r"KLD: (\S+)", text)
    assert divergence and float(divergence[1]) == 0.0, text


def test_octomaps_own_files_are_read(tmp_path):
    octree = room_map()
    octree.write_ot(tmp_path / "map.ot")
    run_tool("convert_octree", tmp_path / "map.ot", tmp_path / "theirs.bt")
    theirs = OctreeMap.read(tmp_path / "theirs.bt")
    assert np.array_equal(grid_states(theirs), grid_states(octree))
    assert theirs.to_binary() == octree.to_binary()  # the same maximum likelihood tree, the same bytes


def bt(data: bytes, nodes: int, kind: str = "OcTree") -> bytes:
    return f"# Octomap OcTree binary file\nid {kind}\nsize {nodes}\nres 0.1\ndata\n".encode() + data


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "no octomap file"),
        (b"\x89PNG\r\n\x1a\n" + bytes(100), "no octomap file"),
        (b"# Octomap OcTree binary file\nid OcTree\nsize 3", "without a line 'data'"),
        (b"# Octomap OcTree binary file\nid OcTree\nres 0.1\ndata\n", "'size VALUE'"),
        (bt(b"", 0, "CountingOcTree"), "type 'CountingOcTree', expected one of OcTree, OcTreeStamped, ColorOcTree"),
        (bt(b"", 0).replace(b"size 0", b"size -1"), "'size' is no such number: -1"),
        (bt(b"", 0).replace(b"size 0", b"size 1e3"), "'size' is no such number: 1e3"),
        (bt(b"", 0).replace(b"0.1", b"0,1"), "'res' is no such number: 0,1"),
        (bt(b"", 0).replace(b"0.1", b"nan"), "'res' is no such number: nan"),
        (bt(b"", 0).replace(b"0.1", b"1e999"), "resolution"),
        (
            b"# Octomap OcTree file\nid ColorOcTree\nsize 2\nres 0.1\ndata\n" + bytes(12),
            "2 nodes of 5 or 8 bytes .ColorOcTree., its data are 12",
        ),
        (b"# Octomap OcTree file\nid OcTree\nsize 2\nres 0.1\ndata\n" + bytes(16), "2 nodes of 5 bytes .OcTree., its data are 16"),
        (bt(b"\x01\x00", 7), "header says 7 nodes, its data holds 2"),
        (bt(b"\x03\x00", 3), "ends early"),
        (bt(b"\x03\x00" * 17, 18), "deeper than 16"),
        (bt(b"\x01\x00junk", 2), "goes on after its end"),
        (bt(b"\x03\x00\x00\x00", 2), "without children"),
        (bt(b"", 0).replace(b"0.1", b"-1"), "resolution"),
        (b"# Octomap OcTree file\nid OcTree\nsize 1\nres 0.1\ndata\n" + struct.pack("<fB", np.nan, 0), "not finite"),
    ],
)
def test_foreign_and_broken_files_are_refused_by_name(tmp_path, content, words):
    path = tmp_path / "broken.bt"
    path.write_bytes(content)
    with pytest.raises(ValueError, match=words) as error:
        OctreeMap.read(path)
    assert "broken.bt" in str(error.value)


@pytest.mark.parametrize(("tree", "extra"), [("ColorOcTree", 3), ("ColorOcTree", 0), ("OcTreeStamped", 0), ("OcTreeStamped", 4)])
def test_trees_of_other_kinds_are_read_without_their_colours_and_stamps(tmp_path, tree, extra):
    octree = room_map()
    octree.write_ot(tmp_path / "map.ot")
    head, data = (tmp_path / "map.ot").read_bytes().split(b"\ndata\n", 1)
    nodes = np.frombuffer(data, dtype=np.uint8).reshape(-1, 5)
    colours = np.random.default_rng(1).integers(0, 256, (len(nodes), extra), dtype=np.uint8)
    theirs = np.hstack([nodes[:, :4], colours, nodes[:, 4:]]).tobytes()
    (tmp_path / "theirs.ot").write_bytes(head.replace(b"id OcTree", b"id " + tree.encode()) + b"\ndata\n" + theirs)
    assert OctreeMap.read(tmp_path / "theirs.ot").to_full() == octree.to_full()


def test_binary_files_of_all_kinds_of_trees_are_alike(tmp_path):
    octree = room_map()
    octree.write_bt(tmp_path / "map.bt")
    content = (tmp_path / "map.bt").read_bytes()
    (tmp_path / "theirs.bt").write_bytes(content.replace(b"id OcTree", b"id ColorOcTree"))
    assert OctreeMap.read(tmp_path / "theirs.bt").to_binary() == octree.to_binary()


@pytest.mark.parametrize("name", ["map.bt", "map.ot"])
def test_file_cut_off_anywhere_is_refused(tmp_path, name):
    octree = room_map(sweeps=1)
    octree.write_bt(tmp_path / "map.bt")
    octree.write_ot(tmp_path / "map.ot")
    content = (tmp_path / name).read_bytes()
    for length in np.linspace(1, len(content) - 1, 23).astype(int):
        (tmp_path / name).write_bytes(content[:length])
        with pytest.raises(ValueError, match=name):
            OctreeMap.read(tmp_path / name)


@pytest.mark.parametrize("seed", range(5))
def test_random_bytes_never_do_worse_than_a_refusal(seed):
    rng = np.random.default_rng(seed)
    for length in rng.integers(1, 400, 40):
        data = rng.bytes(int(length))
        for read in (OctreeMap.from_binary, OctreeMap.from_full):
            with pytest.raises(ValueError, match="octree data"):
                read(data, RES)


def test_failed_write_keeps_the_old_file_and_leaves_nothing_behind(tmp_path, monkeypatch):
    path = tmp_path / "map.bt"
    room_map(sweeps=1).write_bt(path)
    old = path.read_bytes()

    def no_space(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", no_space)
    with pytest.raises(OSError, match="is full"):
        OctreeMap(RES).write_bt(path)
    assert path.read_bytes() == old and os.listdir(tmp_path) == ["map.bt"]


def test_written_file_is_readable_by_others(tmp_path):
    room_map(sweeps=1).write_bt(tmp_path / "map.bt")
    assert stat.S_IMODE((tmp_path / "map.bt").stat().st_mode) == 0o644


def test_real_storey_has_its_published_leaves_and_survives_the_round_trip(tmp_path):
    path = DATA / "geb079.bt"
    if not path.exists():
        pytest.skip(f"the real storey {path.name} is not beside the repository")
    octree = OctreeMap.read(path)
    _, sizes = octree.occupied_voxels()
    assert (len(sizes), octree.leaf_count - len(sizes), octree.resolution) == (143_729, 284_415, 0.08)
    runs = octree.column_runs()
    length = runs.z_hi.astype(int) - runs.z_lo + 1
    assert length[runs.occupied].sum() == np.round((sizes.astype(float) / 0.08) ** 3).sum()
    octree.write_bt(tmp_path / "again.bt")
    again = OctreeMap.read(tmp_path / "again.bt").column_runs()
    assert np.array_equal(again.z_lo, runs.z_lo) and np.array_equal(again.occupied, runs.occupied)
