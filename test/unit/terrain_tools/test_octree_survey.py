"""What is known of a map from its bytes alone: the octree itself is the oracle."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from terrain_maps import FREE, OCCUPIED, UNKNOWN, octree_of, two_storeys

from octomap_server_3dnav.octree.octree import OctreeMap
from terrain_tools.octree_survey import survey


def random_octree(seed, share):
    """A map of blocks, so that some are pruned, anywhere in the tree."""
    rng = np.random.default_rng(seed)
    blocks = rng.choice([UNKNOWN, FREE, OCCUPIED], size=(3, 4, 2), p=[1 - share, share / 2, share / 2])
    states = np.kron(blocks, np.ones((4, 4, 4), dtype=np.uint8))
    states[rng.random(states.shape) < 0.1 * share] = OCCUPIED
    return octree_of(states, origin=rng.integers(-200, 200, 3))


def pieces(octree):
    """Data and format of a map in both formats."""
    return (octree.to_binary(), False), (octree.to_full(), True)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.05, 1.0))
def test_counts_are_those_of_the_octree(seed, share):
    octree = random_octree(seed, share)
    runs = octree.column_runs()
    for data, full in pieces(octree):
        found, read = survey(data, full), (OctreeMap.from_full if full else OctreeMap.from_binary)(data, octree.resolution)
        assert (found.nodes, found.leaves) == (read.node_count, read.leaf_count)
        assert found.columns == (runs.nx, runs.ny)
        assert found.runs >= runs.z_lo.size and found.surfaces >= np.count_nonzero(runs.occupied)


def test_regions_are_blocks_of_64_voxels_that_are_not_all_alike():
    octree = OctreeMap(1.0)
    ends = np.array([[0.5, 0.5, 0.5], [200.5, 0.5, 0.5], [201.5, 0.5, 0.5]], dtype=np.float32)
    octree.insert_sweep(ends, ends)
    assert all(survey(*piece).regions == 2 for piece in pieces(octree))


def test_leaf_of_half_the_tree_covers_all_of_its_columns():
    found = survey(b"\x02\x00")
    assert found.leaves == 1 and found.columns == (32768, 32768) and found.surfaces == 2**30 and found.memory_bytes > 40e9


@pytest.mark.parametrize("data", [b"", b"\x00", b"\x00\x00"])
def test_nothing_is_no_map(data):
    found = survey(data)
    assert (found.leaves, found.columns, found.memory_bytes < 1000) == (0, (0, 0), True)


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=400), st.booleans())
def test_no_bytes_are_too_strange(data, full):
    found = survey(data, full)
    assert found.leaves <= found.nodes <= 8 * len(data) + 1


def test_truncated_data_are_counted_as_far_as_they_go():
    for data, full in pieces(octree_of(two_storeys())):
        assert 0 < survey(data[: len(data) // 2], full).leaves < survey(data, full).leaves
