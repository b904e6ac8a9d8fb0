"""Sweeps in the octree against brute force: every voxel of a tiny map, every ray, by slabs in numpy."""

import math

import numpy as np
import pytest

from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.octree.octree import InsertionReport, OctreeMap, SensorModel

RES = 0.1
PLAIN = SensorModel(miss=0.4, grazing_m=0.0)
FREE, OCCUPIED, UNKNOWN = VoxelState.FREE, VoxelState.OCCUPIED, VoxelState.UNKNOWN


def centers(*indices: tuple[int, int, int]) -> np.ndarray:
    """Points in the middle of voxels given by index."""
    return ((np.array(indices, dtype=float) + 0.5) * RES).astype(np.float32)


def one_ray(octree: OctreeMap, start: tuple[int, int, int], end: tuple[int, int, int], **options) -> InsertionReport:
    return octree.insert_sweep(centers(end), centers(start), **options)


def random_sweep(seed: int, n: int = 40) -> tuple[np.ndarray, np.ndarray]:
    """Rays from a few places among points in a cube of 16 voxels around the origin."""
    rng = np.random.default_rng(seed)
    places = rng.uniform(-0.3, 0.3, (4, 3))
    return rng.uniform(-0.8, 0.8, (n, 3)).astype(np.float32), places[rng.integers(0, 4, n)].astype(np.float32)


def crossed_length(start: np.ndarray, end: np.ndarray, lows: np.ndarray) -> np.ndarray:
    """Metres of the segment within each cube of RES at `lows` (N, 3)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (lows - start) / (end - start), (lows + RES - start) / (end - start)
    t0, t1 = np.minimum(a, b).max(axis=1).clip(0, 1), np.maximum(a, b).min(axis=1).clip(0, 1)
    return np.maximum(t1 - t0, 0) * np.linalg.norm(end - start)


class BruteForce:
    """Free and occupied sets of a sweep on a grid of 20 voxels cubed; `near` are voxels that a rounding error may decide."""

    low = -10

    def __init__(self, points: np.ndarray, origins: np.ndarray, max_range: float = math.inf, bounds: np.ndarray | None = None) -> None:
        self.indices = np.stack(np.meshgrid(*[np.arange(20) + self.low] * 3, indexing="ij"), -1).reshape(-1, 3)
        allowed = np.ones(len(self.indices), bool)
        if bounds is not None:
            allowed = ((self.indices >= bounds[0]) & (self.indices <= bounds[1])).all(axis=1)
        self.free, self.near, self.occupied = (np.zeros(len(self.indices), bool) for _ in range(3))
        for point, origin in zip(points.astype(float), origins.astype(float), strict=True):
            self._cast(point, origin, max_range)
        self.occupied &= allowed
        self.free &= allowed & ~self.occupied

    def _cast(self, point: np.ndarray, origin: np.ndarray, max_range: float) -> None:
        length = np.linalg.norm(point - origin)
        end = origin + (point - origin) * min(1.0, max_range / length)
        is_end = (self.indices == np.floor(end / RES)).all(axis=1)
        crossed = crossed_length(origin, end, self.indices * RES)
        self.occupied |= is_end & (length <= max_range)
        self.free |= ~is_end & (crossed > 1e-6)
        self.near |= ~is_end & (crossed > 0) & (crossed <= 1e-6)

    def assert_same(self, octree: OctreeMap) -> None:
        states = octree.states_at((self.indices + 0.5) * RES)
        expected = np.where(self.occupied, OCCUPIED, np.where(self.free, FREE, UNKNOWN))
        wrong = (states != expected) & ~self.near
        assert not wrong.any(), f"{wrong.sum()} voxels, the first {self.indices[wrong][0]}: {states[wrong][0]} for {expected[wrong][0]}"


def unique_ends(points: np.ndarray) -> np.ndarray:
    """Row of the first point in every voxel."""
    return np.sort(np.unique(np.floor(points.astype(float) / RES), axis=0, return_index=True)[1])


@pytest.mark.parametrize("seed", range(4))
def test_sweep_marks_the_voxels_that_brute_force_finds(seed):
    points, origins = random_sweep(seed)
    octree = OctreeMap(RES, PLAIN)
    report = octree.insert_sweep(points, origins)
    first = unique_ends(points)
    oracle = BruteForce(points[first], origins[first])
    oracle.assert_same(octree)
    assert report.occupied == oracle.occupied.sum() and abs(report.free - oracle.free.sum()) <= oracle.near.sum()


@pytest.mark.parametrize("seed", range(4))
def test_bounds_cut_every_ray_to_the_box(seed):
    points, origins = random_sweep(seed)
    bounds = np.array([[-4, -6, -3], [5, 2, 4]])
    octree = OctreeMap(RES, PLAIN)
    octree.insert_sweep(points, origins, bounds=(bounds[0] * RES, (bounds[1] + 1) * RES))
    inside = ((np.floor(points.astype(float) / RES) >= bounds[0]) & (np.floor(points.astype(float) / RES) <= bounds[1])).all(axis=1)
    first = np.concatenate([np.flatnonzero(inside)[unique_ends(points[inside])], np.flatnonzero(~inside)])
    oracle = BruteForce(points[first], origins[first], bounds=bounds)
    states = octree.states_at((oracle.indices + 0.5) * RES)
    assert np.array_equal(states == OCCUPIED, oracle.occupied)
    missing = oracle.free & ~oracle.near & (states != FREE)  # of rays that leave by the same voxel only the first is cast
    assert not ((states == FREE) & ~oracle.free & ~oracle.near).any() and missing.sum() <= 0.05 * oracle.free.sum()


def test_ray_from_outside_the_bounds_frees_only_what_lies_inside():
    octree = OctreeMap(RES, PLAIN)
    report = one_ray(octree, (-5, 0, 0), (9, 0, 0), bounds=([0.0, 0.0, 0.0], [0.3, 0.1, 0.1]))
    assert report == InsertionReport(free=3, occupied=0, dropped=0)
    assert octree.states_at(centers((-1, 0, 0), (0, 0, 0), (2, 0, 0), (3, 0, 0))).tolist() == [UNKNOWN, FREE, FREE, UNKNOWN]


def test_point_beyond_the_range_frees_its_ray_up_to_the_range_and_occupies_nothing():
    octree = OctreeMap(RES, PLAIN)
    report = one_ray(octree, (0, 0, 0), (9, 0, 0), max_range_m=0.5)
    assert report == InsertionReport(free=5, occupied=0, dropped=0)
    assert octree.states_at(centers((4, 0, 0), (5, 0, 0), (9, 0, 0))).tolist() == [FREE, UNKNOWN, UNKNOWN]


@pytest.mark.parametrize("max_range_m, free", [(9.0, 9), (0.5, 5)])
def test_beam_that_met_nothing_frees_its_way_up_to_its_end_or_the_range(max_range_m, free):
    octree, ends = OctreeMap(RES, PLAIN), centers((0, 4, 0), (9, 0, 0))
    octree.insert(octree.trace_sweep(ends, centers((0, 4, 0), (0, 0, 0)), max_range_m, met=1))
    assert octree.states_at(centers((0, 4, 0), (free - 1, 0, 0), (free, 0, 0))).tolist() == [OCCUPIED, FREE, UNKNOWN]


def test_ray_that_ends_by_its_range_where_a_cube_of_voxels_begins_leaves_that_cube_unknown():
    octree = OctreeMap(RES, PLAIN)
    report = one_ray(octree, (0, 0, 0), (20, 0, 0), max_range_m=0.8)
    assert report == InsertionReport(free=8, occupied=0, dropped=0)
    assert octree.states_at(centers((7, 0, 0), (8, 0, 0), (12, 4, 4))).tolist() == [FREE, UNKNOWN, UNKNOWN]


def test_hit_wins_over_rays_through_it_within_a_sweep_in_any_order():
    points, origins = centers((3, 0, 0), (8, 0, 0)), centers((0, 0, 0), (0, 0, 0))
    for order in ([0, 1], [1, 0]):
        octree = OctreeMap(RES, PLAIN)
        assert octree.insert_sweep(points[order], origins[order]) == InsertionReport(free=7, occupied=2, dropped=0)
        assert octree.states_at(centers((3, 0, 0))).tolist() == [OCCUPIED]


@pytest.mark.parametrize(("hits", "misses_until_free"), [(1, 3), (2, 5), (9, 9)])
def test_moved_obstacle_vanishes_after_as_many_sweeps_as_the_log_odds_say(hits, misses_until_free):
    octree = OctreeMap(RES, PLAIN)
    for _ in range(hits):
        one_ray(octree, (0, 0, 0), (5, 0, 0))
    for misses in range(1, misses_until_free + 1):
        one_ray(octree, (0, 0, 0), (9, 0, 0))
        expected = FREE if misses == misses_until_free else OCCUPIED
        assert octree.states_at(centers((5, 0, 0))).tolist() == [expected], misses


def test_many_points_in_one_voxel_count_as_one_hit():
    octree, single = OctreeMap(RES), OctreeMap(RES)
    rng = np.random.default_rng(0)
    cluster = (centers((5, 5, 0)) + rng.uniform(-0.04, 0.04, (100, 3))).astype(np.float32)
    octree.insert_sweep(cluster, np.zeros_like(cluster))
    single.insert_sweep(cluster[:1], np.zeros((1, 3), np.float32))
    assert octree.to_full() == single.to_full()


def test_points_and_origins_that_are_not_finite_are_dropped_and_counted():
    points = np.array([[1, 0, 0], [np.nan, 0, 0], [1, 1, np.inf], [0, 1, 0]], np.float32)
    origins = np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [np.nan, 0, 0]], np.float32)
    octree, clean = OctreeMap(RES), OctreeMap(RES)
    assert octree.insert_sweep(points, origins).dropped == 3
    clean.insert_sweep(points[:1], origins[:1])
    assert octree.to_full() == clean.to_full()


def test_point_at_its_own_origin_is_a_hit_without_a_ray():
    assert one_ray(OctreeMap(RES), (2, 2, 2), (2, 2, 2)) == InsertionReport(free=0, occupied=1, dropped=0)


def test_points_outside_the_trees_reach_free_up_to_its_border():
    octree = OctreeMap(RES)
    report = octree.insert_sweep(np.array([[1e9, 0.05, 0.05]], np.float32), np.array([[3276.05, 0.05, 0.05]], np.float32))
    assert report == InsertionReport(free=8, occupied=0, dropped=0)
    empty = octree.insert_sweep(np.array([[1e9, 5e9, 0]], np.float32), np.array([[1e9, 0, 0]], np.float32))
    assert empty == InsertionReport(0, 0, 0)


def test_empty_sweep_changes_nothing():
    octree = OctreeMap(RES)
    assert octree.insert_sweep(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32)) == InsertionReport(0, 0, 0)
    assert octree.node_count == 0 and octree.to_full() == b"" and octree.to_binary() == b""


@pytest.mark.parametrize("seed", range(3))
def test_same_sweeps_give_the_same_tree_bit_by_bit(seed):
    first, second = OctreeMap(0.05), OctreeMap(0.05)
    for octree in (first, second):
        for sweep in range(3):
            octree.insert_sweep(*random_sweep(10 * seed + sweep, n=500))
    assert first.to_full() == second.to_full()


def amid_seen(indices: np.ndarray, states: np.ndarray) -> np.ndarray:
    """(N,) whether all six voxels beside one were seen; indices (N, 3) of a whole cube, in order."""
    known = np.pad((states != UNKNOWN).reshape(np.ptp(indices, axis=0) + 1), 1)
    beside = [np.roll(known, way, axis)[1:-1, 1:-1, 1:-1] for axis in range(3) for way in (-1, 1)]
    return np.logical_and.reduce(beside).ravel()


@pytest.mark.parametrize(("hits", "sweeps_until_free"), [(1, 1), (2, 2), (9, 4)])
def test_obstacle_vanishes_sooner_where_all_that_is_beside_it_is_seen(hits, sweeps_until_free):
    octree = OctreeMap(RES, PLAIN)
    for _ in range(hits):
        one_ray(octree, (0, 0, 0), (5, 0, 0))
    ends = centers(*((9, y, z) for y in range(-2, 3) for z in range(-2, 3)))
    for sweeps in range(1, sweeps_until_free + 1):
        octree.insert_sweep(ends, ends - np.float32([9 * RES, 0, 0]))
        expected = FREE if sweeps == sweeps_until_free else OCCUPIED
        assert octree.states_at(centers((5, 0, 0))).tolist() == [expected], sweeps


def sweep_beside(octree: OctreeMap, layer: int) -> None:
    """A sweep from the middle of voxel 0 to a wall of voxels at x = 9: free all around voxel 5, or in the rows of one layer only."""
    rows = [0] if layer else range(-5, 6)
    ends = centers(*((9, y, z) for y in range(-5, 6) for z in rows))
    octree.insert_sweep(ends, ends - np.float32([9 * RES, 0, 0]))


@pytest.mark.parametrize(("sweeps", "layer", "hits_until_occupied"), [(0, 0, 1), (1, 0, 2), (2, 0, 3), (3, 0, 4), (9, 0, 4), (9, 1, 1)])
def test_what_steps_into_space_seen_free_all_around_is_hit_again_before_it_is_a_surface(sweeps, layer, hits_until_occupied):
    octree = OctreeMap(RES)
    for _ in range(sweeps):
        sweep_beside(octree, layer)
    for hits in range(1, hits_until_occupied + 1):
        one_ray(octree, (0, 0, 0), (5, 0, 0))
        expected = OCCUPIED if hits == hits_until_occupied else FREE
        assert octree.states_at(centers((5, 0, 0))).tolist() == [expected], hits


@pytest.mark.parametrize("stood", range(1, 8))
def test_box_that_came_and_went_leaves_nothing_that_a_few_sweeps_do_not_clear(stood):
    octree = OctreeMap(RES)
    for _ in range(3):
        sweep_beside(octree, 0)
    for _ in range(stood):
        box = centers(*((5, y, z) for y in range(-1, 2) for z in range(-1, 2)))
        octree.insert_sweep(box, box - np.float32([5 * RES, 0, 0]))
    sweeps = 0
    while (octree.states_at(box) == OCCUPIED).any():
        sweep_beside(octree, 0)
        sweeps += 1
    assert sweeps == max(0, math.ceil((stood * 0.847 - 2.752) / 0.944))


def test_pole_that_every_sweep_meets_stays_although_most_beams_pass_it():
    octree = OctreeMap(RES)
    wall = [(9, y, z) for y in range(-4, 5) for z in range(-3, 4) if y]
    pole = [(5, 0, z) for z in range(-3, 4)]
    for shift in range(12):  # from the side, too: the beams to the wall graze it
        ends = centers(*wall, *pole)
        octree.insert_sweep(ends, np.tile(centers((0, shift % 5 - 2, 0)), (len(ends), 1)))
    assert (octree.states_at(centers(*pole)) == OCCUPIED).all()


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("least", [0.06, 0.25])
def test_bulk_insertion_has_the_log_odds_of_single_updates(seed, least):
    """Values at every voxel after several sweeps, against clamped sums; bulk updates of whole cubes and pruning change none."""
    model = SensorModel(grazing_m=0.0, min=0.06 if least > 0.06 else 0.45, min_through=least)
    logit = {name: math.log(p / (1 - p)) for name, p in vars(model).items() if p}
    octree, total = OctreeMap(RES, model), None
    for sweep in range(6):
        points, origins = random_sweep(seed + 100 * sweep, n=300)
        alone = OctreeMap(RES, model)
        alone.insert_sweep(points, origins)
        octree.insert_sweep(points, origins)
        indices = BruteForce(points[:0], origins[:0]).indices
        states = alone.states_at((indices + 0.5) * RES)
        total = np.full(len(states), np.nan) if total is None else total
        known = np.nan_to_num(total)
        amid = (states == FREE) & amid_seen(indices, states)
        missed = np.maximum(known + logit["miss"], np.minimum(known, logit["min"]))
        through = np.maximum(known + logit["through"], np.minimum(known, logit["min_through"]))
        hit = np.minimum(known + logit["hit"], logit["max"])
        total = np.select([amid, states == FREE, states == OCCUPIED], [through, missed, hit], total)
    expected = np.select([np.isnan(total), total >= 0], [UNKNOWN, OCCUPIED], FREE)
    assert np.array_equal(octree.states_at((indices + 0.5) * RES), expected)


@pytest.mark.parametrize("seed", range(5))
def test_redrawn_map_is_the_one_from_scratch_bit_by_bit(seed):
    rng = np.random.default_rng(seed)
    octree = OctreeMap(RES)
    inserted = [octree.trace_sweep(*random_sweep(100 * seed + i, n=300)) for i in range(8)]
    for voxels in inserted:
        octree.insert(voxels)
    for step in range(6):
        i = int(rng.integers(len(inserted)))
        old, new = inserted[i], octree.trace_sweep(*random_sweep(1000 * seed + step, n=int(rng.choice([1, 300]))))
        inserted[i] = new
        octree.redraw([old, new], inserted)
        scratch = OctreeMap(RES)
        for voxels in inserted:
            scratch.insert(voxels)
        assert octree.to_full() == scratch.to_full() and octree.node_count == scratch.node_count


def test_map_without_any_sweep_left_is_empty():
    octree = OctreeMap(RES)
    voxels = octree.trace_sweep(*random_sweep(0))
    octree.insert(voxels)
    octree.redraw([voxels], [])
    assert octree.node_count == 0 and octree.column_runs().nx == 0 and octree.memory_bytes == OctreeMap(RES).memory_bytes


@pytest.mark.parametrize(
    ("points", "origins", "options", "words"),
    [
        (np.zeros((4, 2)), np.zeros((4, 2)), {}, "points_map must be"),
        (np.zeros((4, 3)), np.zeros((3, 3)), {}, "one row a beam"),
        (np.zeros(3), np.zeros(3), {}, "points_map must be"),
        (np.zeros((1, 3)), np.zeros((1, 3)), {"max_range_m": 0.0}, "max_range_m"),
        (np.zeros((1, 3)), np.zeros((1, 3)), {"max_range_m": math.nan}, "max_range_m"),
        (np.zeros((1, 3)), np.zeros((1, 3)), {"bounds": ([0, 0, 1], [1, 1, 0])}, "lo <= hi"),
        (np.zeros((1, 3)), np.zeros((1, 3)), {"bounds": ([0, 0], [1, 1])}, "three metres"),
    ],
)
def test_sweep_of_wrong_shape_or_range_is_refused(points, origins, options, words):
    with pytest.raises(ValueError, match=words):
        OctreeMap(RES).insert_sweep(points, origins, **options)


@pytest.mark.parametrize("model", [SensorModel(hit=0.4), SensorModel(miss=0.6), SensorModel(grazing_m=-1.0), SensorModel(max=math.nan)])
def test_sensor_model_that_cannot_be_is_refused(model):
    with pytest.raises(ValueError, match="="):
        OctreeMap(RES, model)


@pytest.mark.parametrize("resolution", [0.0, -0.1, math.nan, math.inf])
def test_resolution_that_cannot_be_is_refused(resolution):
    with pytest.raises(ValueError, match="resolution"):
        OctreeMap(resolution)
