"""The fast ways of the terrain kernels against the plain definitions that they stand for."""

import itertools
import math

import numpy as np
import pytest
from scipy.spatial import cKDTree
from terrain_worlds import grid_of_heights, runs_of

from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.terrain import kernels as terrain_kernels
from octomap_server_3dnav.terrain import scene as terrain_scene
from octomap_server_3dnav.terrain.config import StepLimits, TerrainConfig
from octomap_server_3dnav.terrain.surface_columns import (
    NO_VOXEL,
    Columns,
    Surfaces,
    crop_columns,
    find_node,
    ground_voxel,
    is_top_seen,
    lowest_occupied,
    tops_of,
)
from octomap_server_3dnav.terrain.surface_graph import (
    UNFITTED,
    nearest_neighbours,
    slope_at,
    slopes_of_open_ground,
    steepness,
)
from octomap_server_3dnav.terrain.surface_holes import _one_per_hole, bridge_holes
from octomap_server_3dnav.terrain.surface_steps import steppable_neighbours

MARGIN, STEP, CLEARANCE = 18, 2, 14


def bumpy_world(seed: int) -> tuple[Columns, Surfaces]:
    """A hilly floor with noise of a voxel, unknown holes, and a deck over part of it: columns with no, one and two surfaces."""
    rng = np.random.default_rng(seed)
    noise = rng.uniform(-0.08, 0.08, (70, 60))
    states = grid_of_heights(lambda x, y: 0.5 + 0.45 * np.sin(1.3 * x + seed) + noise[: x.shape[0], : y.shape[1]], 70, 60)
    states[(rng.random(states.shape[:2]) < 0.05)[:, :, None] & (states == VoxelState.OCCUPIED)] = VoxelState.UNKNOWN
    states[10:60, 5:55, -2] = VoxelState.OCCUPIED
    runs = runs_of(states)
    spans = np.tile([MARGIN, MARGIN + runs.ny], (runs.nx + 2 * MARGIN, 1))
    spans[:MARGIN] = spans[MARGIN + runs.nx :] = MARGIN
    columns = crop_columns(runs, (runs.origin_key[0] - MARGIN, runs.origin_key[1] - MARGIN), runs.ny + 2 * MARGIN, spans)
    return columns, bridge_holes(columns, tops_of(columns, CLEARANCE, STEP), CLEARANCE, 3, STEP, STEP)


def whole(columns: Columns) -> np.ndarray:
    """Spans of all columns but the margin's."""
    spans = np.tile([MARGIN, columns.ny - MARGIN], (columns.nx, 1))
    spans[:MARGIN], spans[columns.nx - MARGIN :] = MARGIN, MARGIN
    return spans


@pytest.mark.parametrize("seed", range(4))
def test_neighbours_are_the_nearest_surfaces_of_the_next_columns(seed):
    columns, surfaces = bumpy_world(seed)
    near = nearest_neighbours(surfaces.start, surfaces.z, columns.ny, whole(columns), STEP)
    strides = (columns.ny, 1, -columns.ny, -1)
    expected = [
        [find_node(surfaces.start, surfaces.z, int(c) + stride, int(z), STEP) for stride in strides]
        for c, z in zip(surfaces.column, surfaces.z, strict=True)
    ]
    assert np.array_equal(near, expected) and (np.diff(surfaces.start) > 1).any()


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("reach", [2, 4, 7])
def test_slopes_of_open_ground_are_those_of_the_fit(seed, reach):
    columns, surfaces = bumpy_world(seed)
    near = nearest_neighbours(surfaces.start, surfaces.z, columns.ny, whole(columns), STEP)
    graph = steppable_neighbours(near, surfaces, StepLimits.of(TerrainConfig(), 0.08))
    fitted = {s: slope_at(graph, surfaces.level, s, reach) for s in range(surfaces.z.size)}
    for limit in (0.1, 0.3, float(np.median(list(fitted.values())))):
        slope = slopes_of_open_ground(
            surfaces.start, surfaces.level, graph, columns.ny, whole(columns), reach, (0.8 * limit, limit, 2 * limit)
        )
        judged = np.flatnonzero(slope != UNFITTED)
        assert [slope[s] for s in judged] == [steepness(fitted[s], (0.8 * limit, limit, 2 * limit)) for s in judged]
    is_upper = surfaces.start[surfaces.column[judged]] < judged
    assert judged.size > (100 if reach < 7 else 0) and (is_upper.any() or reach > 2)


def test_spans_are_the_columns_within_the_distance():
    rng = np.random.default_rng(0)
    for radius in (0.5, 5.0, 13.0):
        for x0, y0 in (*rng.uniform(-15, 0, (20, 2)), (-12.0, -12.0), (1.0, 1.0), (0.0, -60.0), (0.0, 60.0), (60.0, 0.0)):
            x, y = x0 + np.arange(24.0), y0 + np.arange(26.0)  # 3, 4, 5 and 5, 12, 13 lie on the rim
            spans, inside = terrain_scene._spans_within(x, y, radius), np.hypot(x[:, None], y) <= radius
            assert np.array_equal((np.arange(26) >= spans[:, :1]) & (np.arange(26) < spans[:, 1:]), inside)


@pytest.mark.parametrize("shape, off", [("circle", 0.0), ("circle", 0.37), ("square", 0.0)])
def test_inflation_takes_what_is_near_at_the_level_of_the_barrier(shape, off):
    columns, surfaces = bumpy_world(1)
    ny, radius, band = columns.ny, 0.42, 3
    barriers = np.random.default_rng(2).choice(surfaces.z.size, 9)
    label = np.zeros(surfaces.z.size, dtype=np.uint8)
    at, level = surfaces.column[barriers].astype(np.int64), surfaces.z[barriers].astype(np.int64)
    places = np.column_stack([at // ny + 0.5 + off, at % ny + 0.5 - off, level])
    voxels = math.floor(radius / 0.08) if shape == "square" else radius / 0.08
    terrain_kernels.inflate(label, surfaces, places, np.empty((0, 3)), voxels, shape == "square", band, columns.nx, ny)
    dx, dy = surfaces.column[:, None] // ny - at // ny - off, surfaces.column[:, None] % ny - at % ny + off
    near = np.hypot(dx, dy) * 0.08 <= radius if shape == "circle" else np.maximum(abs(dx), abs(dy)) <= voxels
    expected = (near & (abs(surfaces.z[:, None] - level) <= band)).any(axis=1)
    assert np.array_equal(label == terrain_kernels.INFLATION, expected) and expected.any()


def test_inflation_begins_where_a_barrier_ends_on_the_side_of_the_ground():
    columns, surfaces = bumpy_world(1)
    ny, radius, band = columns.ny, 5.25, 3
    rng = np.random.default_rng(3)
    barriers = rng.choice(surfaces.z.size, 9)
    label = np.zeros(surfaces.z.size, dtype=np.uint8)
    at, level = surfaces.column[barriers].astype(np.int64), surfaces.z[barriers].astype(np.int64)
    places = np.column_stack([at // ny + 0.4, at % ny + 0.7, level])
    reach = np.column_stack([rng.uniform(-1.0, 1.0, (9, 2)), rng.uniform(0.0, 0.5, 9)])
    reach[0] = 0.0
    terrain_kernels.inflate(label, surfaces, places, reach, radius, False, band, columns.nx, ny)
    middle = np.stack([surfaces.column // ny + 0.5, surfaces.column % ny + 0.5], axis=-1)
    parts = np.linspace(-1.0, 1.0, 2001)
    lines = places[:, None, :2] + parts[:, None] * reach[:, None, :2]
    away = np.array([cKDTree(line).query(middle)[0] - width for line, width in zip(lines, reach[:, 2], strict=True)])
    expected = ((away <= radius) & (abs(surfaces.z - level[:, None]) <= band)).any(axis=0)
    assert np.array_equal(label == terrain_kernels.INFLATION, expected) and expected.any()


def test_bridged_holes_are_sorted_into_the_surfaces():
    columns, surfaces = bumpy_world(3)
    assert surfaces.bridged.any() and np.array_equal(
        np.repeat(np.arange(surfaces.start.size - 1), np.diff(surfaces.start)), surfaces.column
    )
    same_column = np.diff(surfaces.column) == 0
    assert (np.diff(surfaces.z)[same_column] > 0).all() and (np.diff(surfaces.column) >= 0).all()
    there = [lowest_occupied(columns, int(c), int(z), int(z)) for c, z in zip(surfaces.column, surfaces.z, strict=True)]
    assert np.array_equal(surfaces.bridged, np.array(there) == NO_VOXEL)


def test_which_of_two_bridges_over_a_hole_stays_does_not_depend_on_their_order() -> None:
    narrow, wide, low, steep = (
        np.array([7.0, z, gap, a, a + 1, 0.5, rise]) for z, gap, a, rise in ((4, 2, 0, 0.1), (5, 3, 2, 0.0), (3, 2, 4, 0.0), (4, 2, 6, 0.6))
    )
    elsewhere = np.array([7.0, 40.0, 3.0, 8.0, 9.0, 0.5, 0.0])
    for bridges in itertools.permutations([narrow, wide, low, steep, elsewhere]):
        np.testing.assert_array_equal(_one_per_hole(np.array(bridges), step=2), [narrow, elsewhere])


@pytest.mark.parametrize(
    "strips, tops",
    [([(7, 8)], [8]), ([(0, 5), (7, 8)], []), ([(0, 3), (5, 5), (7, 8)], []), ([(0, 5), (8, 8)], []), ([(0, 4), (8, 8)], [8])],
    ids=["floor", "wall", "three strips", "two voxels between", "too far apart"],
)
def test_wall_that_was_hit_in_strips_has_no_top_where_none_was_seen(strips, tops) -> None:
    z_lo, z_hi = np.array([*strips, (11, 40)], dtype=np.int16).T.copy()  # free above, but not right above
    occupied = np.arange(len(z_lo)) < len(strips)
    found = tops_of(Columns(1, 1, np.array([0, len(z_lo)], dtype=np.int32), z_lo, z_hi, occupied), CLEARANCE, STEP)
    assert found.z.tolist() == tops


@pytest.mark.parametrize(
    ("beside", "own", "hangs"),
    [
        ([(1, 3, False), (4, 5, True)], [(1, 3), (6, 20)], 4),
        ([(-9, 5, True)], [(1, 3), (6, 20)], NO_VOXEL),
        ([(1, 6, False), (7, 7, True)], [(1, 3), (6, 20)], NO_VOXEL),
        ([(1, 3, False), (4, 5, True)], [(1, 20)], NO_VOXEL),
        ([(1, 3, False), (4, 5, True)], [(1, 3)], NO_VOXEL),
        ([(1, 3, False), (4, 15, True)], [(1, 3), (16, 20)], NO_VOXEL),
        ([(0, 0, False), (1, 2, True)], [(0, 0), (3, 20)], NO_VOXEL),
    ],
    ids=["end of a bar", "gap beside a wall", "gap at another height", "seen free", "unknown up to the sky", "too high", "below a step"],
)
def test_bar_may_hang_over_ground_where_nothing_was_seen_between_free_space(beside, own, hangs):
    """Beside it, at the robot's height, hangs what was seen; the columns are those in the middle of three by three, and at its side."""
    runs, start = [*((lo, hi, False) for lo, hi in own), *beside], np.zeros(10, dtype=np.int32)
    start[5:], start[6:] = len(own), len(runs)
    z_lo, z_hi, occupied = (np.array(numbers) for numbers in zip(*runs, strict=True))
    columns = Columns(3, 3, start, z_lo.astype(np.int16), z_hi.astype(np.int16), occupied)
    assert terrain_kernels._may_hang_over(columns, 4, STEP + 1, CLEARANCE) == hangs


@pytest.mark.parametrize(
    ("runs", "is_seen"),
    [
        ([(0, 2, True), (3, 9, False)], True),
        ([(0, 2, True), (4, 9, False)], False),
        ([(0, 2, True), (3, 9, True)], False),
        ([(0, 2, True)], False),
        ([(-1, 9, False)], True),
    ],
    ids=["free above", "free farther above", "goes on", "unknown above", "floor assumed amid free space"],
)
def test_top_is_seen_where_the_voxel_above_it_was_free(runs, is_seen):
    z_lo, z_hi, occupied = (np.array(numbers) for numbers in zip(*runs, strict=True))
    columns = Columns(1, 1, np.array([0, len(runs)], np.int32), z_lo.astype(np.int16), z_hi.astype(np.int16), occupied)
    assert is_top_seen(columns, 0, 2) == is_seen


def test_ground_lies_below_the_voxel_in_which_a_beam_gone_astray_ended():
    """Floor that was hit in its own voxel, and twice floor below a stray beam; where no height is measured the voxel stands."""
    level, ground = np.array([4.4, 4.2, 4.5], np.float32), np.array([4.1, 3.1, 3.0], np.float32)
    none, z = np.zeros(3, bool), np.full(3, 4, np.int16)
    surfaces = Surfaces(
        np.arange(4, dtype=np.int32), np.arange(3, dtype=np.int32), z, none, none, level, ground, np.zeros((3, 2), np.float32), ~none
    )
    alone = np.full((3, 4), -1)
    assert [ground_voxel(n, alone, surfaces) for n in range(3)] == [4, 3, 3]
    assert [ground_voxel(n, alone, surfaces._replace(measured=none)) for n in range(3)] == [4, 4, 4]


def test_ground_lies_where_it_does_all_around_if_a_beam_alone_ended_higher():
    level, z, known = np.array([5.1, 3.2, 3.3, 3.1, 3.4], np.float32), np.array([5, 3, 3, 3, 3], np.int16), np.ones(5, bool)
    near = np.full((5, 4), -1)
    near[0] = 1, 2, 3, 4
    surfaces = Surfaces(np.arange(6, dtype=np.int32), np.arange(5, dtype=np.int32), z, ~known, known, level, level, np.zeros((5, 2)), known)
    assert [ground_voxel(n, near, surfaces) for n in range(5)] == [3, 3, 3, 3, 3]
    near[0, 3] = -1  # its end, where it may be the edge of what is as high as it
    assert [ground_voxel(n, near, surfaces) for n in range(5)] == [5, 3, 3, 3, 3]


def test_ground_of_a_thin_deck_does_not_lie_at_its_underside():
    level, z, known = np.array([2.3, 3.2, 3.3, 3.1, 3.4], np.float32), np.array([2, 3, 3, 3, 3], np.int16), np.ones(5, bool)
    with_underside, near = np.array([1.4, *level[1:]], np.float32), np.full((5, 4), -1)
    near[0] = 1, 2, 3, 4
    surfaces = Surfaces(
        np.arange(6, dtype=np.int32), np.arange(5, dtype=np.int32), z, ~known, known, level, with_underside, np.zeros((5, 2)), known
    )
    assert [ground_voxel(n, near, surfaces) for n in range(5)] == [2, 3, 3, 3, 3]
    near[0, 3] = -1
    assert [ground_voxel(n, near, surfaces) for n in range(5)] == [1, 3, 3, 3, 3]
