"""Column runs come from bits kept beside the tree's nodes; the nodes themselves, asked voxel by voxel, are the oracle."""

import itertools

import numpy as np
import pytest
from octree_planes import clear_box, insert_plane

from octomap_server_3dnav.octree.column_runs import ColumnRuns, VoxelState
from octomap_server_3dnav.octree.octree import OctreeMap, SensorModel

RES = 0.1
NOTHING, FREE_LEAF, OCCUPIED_LEAF, INNER = range(4)  # octomap's two bits a child


def runs_of_nodes(octree: OctreeMap, lo: np.ndarray, hi: np.ndarray) -> ColumnRuns:
    """What the nodes say of the voxels lo..hi (inclusive), as the smallest block of columns that holds what is known."""
    axes = [np.arange(a, b + 1) for a, b in zip(lo, hi, strict=True)]
    indices = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    states = octree.states_at((indices.reshape(-1, 3) + 0.5) * octree.resolution).reshape(indices.shape[:3])
    x, y = (np.flatnonzero((states != VoxelState.UNKNOWN).any(axis=axis)) for axis in ((1, 2), (0, 2)))
    if not x.size:
        return ColumnRuns.from_dense(states[:0, :0], (0, 0, 0), octree.resolution)
    part = states[x[0] : x[-1] + 1, y[0] : y[-1] + 1]
    return ColumnRuns.from_dense(part, (lo[0] + x[0], lo[1] + y[0], lo[2]), octree.resolution)


def assert_nodes_agree(octree: OctreeMap, lo, hi) -> None:
    """The runs of voxels lo..hi (inclusive) are those of the nodes, array by array."""
    lo, hi = np.asarray(lo), np.asarray(hi)
    runs, expected = octree.column_runs(lo * octree.resolution, (hi + 1) * octree.resolution), runs_of_nodes(octree, lo, hi)
    assert (runs.origin_key, runs.nx, runs.ny) == (expected.origin_key, expected.nx, expected.ny)
    for name in ("start", "z_lo", "z_hi", "occupied"):
        array, wanted = getattr(runs, name), getattr(expected, name)
        assert array.dtype == wanted.dtype and np.array_equal(array, wanted), name


def random_sweep(rng: np.random.Generator, center: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Beams between places within 9 x 9 x 60 voxels, some of them pressed onto planes so that nodes fill up and are pruned."""
    ends = center + rng.uniform(-1, 1, (2, count, 3)) * [4.5, 4.5, 30.0]
    ends[0, ::2, 2] = np.floor(ends[0, ::2, 2] / 8) * 8 + 0.5
    return tuple((ends * RES).astype(np.float32))


def change(octree: OctreeMap, rng: np.random.Generator, center: np.ndarray) -> OctreeMap:
    """One random operation on the voxels near `center`."""
    kind = rng.integers(7)
    box = np.sort(center + rng.uniform(-1, 1, (2, 3)) * [9, 9, 40], axis=0) * RES
    if kind <= 2:
        octree.insert_sweep(*random_sweep(rng, center, int(rng.integers(1, 400))), bounds=tuple(box) if kind else None)
    elif kind == 3:
        insert_plane(octree, center * RES + rng.uniform(-3, 3, 3), rng.uniform(0.05, 1.0))
    elif kind == 4:
        clear_box(octree, *box)
    elif kind == 5:
        return OctreeMap.from_binary(octree.to_binary(*(box if rng.random() < 0.3 else ())), RES, octree.sensor_model)
    else:
        return OctreeMap.from_full(octree.to_full(), RES, octree.sensor_model)
    return octree


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("center", [(0, 0, 0), (64, -64, 31), (-128, 63, -64)])
def test_runs_follow_every_operation(seed, center):
    rng, center = np.random.default_rng(seed), np.array(center)
    octree = OctreeMap(RES, SensorModel(grazing_m=0.0, max=0.8))
    for step in range(12):
        octree = change(octree, rng, center)
        if step == 8:
            octree = OctreeMap(RES, octree.sensor_model)
        low, high = np.sort(center + rng.integers(-8, 9, (2, 3)) * [1, 1, 8], axis=0)
        assert_nodes_agree(octree, low, high)
        assert_nodes_agree(octree, center - [14, 14, 80], center + [14, 14, 80])


def tree_of_leaves(level: int, codes: dict[int, int]) -> OctreeMap:
    """A tree whose node of that level with its lowest voxel at 0, 0, 0 has these children; they have 65536 >> level + 1 voxels an edge."""
    records = [{7: INNER}] + [{0: INNER}] * (level - 1) + [codes] if level else [codes]
    data = b"".join(sum(code << 2 * child for child, code in record.items()).to_bytes(2, "little") for record in records)
    return OctreeMap.from_binary(data, RES)


@pytest.mark.parametrize("level", [4, 7, 8, 9, 10, 12])
def test_leaves_larger_than_a_region_of_bits_are_seen_whole_and_cut(level):
    octree, edge = tree_of_leaves(level, {0: FREE_LEAF, 1: OCCUPIED_LEAF, 6: OCCUPIED_LEAF}), 65536 >> level + 1
    for x, y, z in itertools.product((0, edge - 1, edge), repeat=3):
        assert_nodes_agree(octree, (x - 4, y - 3, z - 70), (x + 3, y + 3, z + 70))
    insert_plane(octree, [edge * RES, 0.5, (edge + 0.5) * RES], 0.3)
    clear_box(octree, [(edge - 2) * RES, -1, -1], [(edge + 3) * RES, 1, (edge + 1) * RES])
    octree.insert_sweep(np.array([[edge * RES, 0.2, 1.0]], np.float32), np.array([[edge * RES - 1.0, 0.4, 0.1]], np.float32))
    assert_nodes_agree(octree, (edge - 12, -6, -70), (edge + 8, 12, 80))
    assert_nodes_agree(octree, (edge - 5, 0, edge - 70), (edge + 5, 9, edge + 70))


def test_map_that_is_one_leaf_is_known_in_every_layer():
    octree = OctreeMap.from_full(np.float32(-1.0).tobytes() + b"\x00", RES)
    runs = octree.column_runs([0, 0, -np.inf], [0.2, 0.3, np.inf])
    assert (runs.nx, runs.ny, runs.z_range) == (2, 3, (-32768, 32767)) and runs.z_lo.size == 6
    with pytest.raises(ValueError, match="ask for a smaller box"):
        octree.column_runs()


def test_columns_at_the_ends_of_the_index_range_are_whole():
    octree = OctreeMap(RES)
    for z in (-3276.8, 3276.7):
        insert_plane(octree, [0.05, 0.05, z + 0.05], 0.01)
    runs = octree.column_runs()
    assert (runs.nx, runs.ny, runs.z_lo.tolist(), runs.z_hi.tolist()) == (1, 1, [-32768, 32767], [-32768, 32767])


def test_memory_counts_the_bits_beside_the_nodes():
    octree = OctreeMap(RES)
    assert octree.memory_bytes < 65536
    insert_plane(octree, [0.05, 0.05, 0.05], 0.01)
    assert octree.memory_bytes >= 65536
