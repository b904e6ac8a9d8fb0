"""The fast ways of the terrain kernels against the plain definitions that they stand for."""

import itertools

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree
from terrain_worlds import grid_of_heights, runs_of

from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.octree.columns import NO_VOXEL, Columns, crop_columns, is_free_through, lowest_occupied
from octomap_server_3dnav.terrain import fill, graph, planes, scene, surfaces
from octomap_server_3dnav.terrain.config import Limits, TerrainConfig
from octomap_server_3dnav.terrain.distance import distances
from octomap_server_3dnav.terrain.surfaces import Surfaces, find_node
from robot_body import RobotBody

MARGIN = 18
LIMITS = Limits.of(TerrainConfig(), RobotBody(), 0.08)


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
    key = (runs.origin_key[0] - MARGIN, runs.origin_key[1] - MARGIN)
    columns = crop_columns(runs, key, runs.ny + 2 * MARGIN, spans)
    return columns, fill.fill_gaps(columns, surfaces.surfaces_of(columns, key, None, LIMITS), LIMITS)


def whole(nx: int, ny: int, margin: int) -> NDArray[np.int64]:
    """Spans of all columns but the margin's."""
    spans = np.tile([margin, ny - margin], (nx, 1))
    spans[:margin], spans[nx - margin :] = margin, margin
    return spans


def sheet(height: NDArray[np.float64], sigma: float = 0.05) -> Surfaces:
    """One surface a column of an (nx, ny) grid of heights in voxels."""
    flat = height.ravel().astype(np.float32)
    column = np.arange(flat.size, dtype=np.int32)
    offset = np.zeros((flat.size, 2), np.float32)
    return Surfaces(
        np.arange(flat.size + 1, dtype=np.int32),
        column,
        np.floor(flat).astype(np.int16),
        flat,
        np.full(flat.size, sigma, np.float32),
        offset,
        np.zeros(flat.size, dtype=bool),
    )


def linked(found: Surfaces, nx: int, ny: int, step: int = 30) -> graph.Links:
    """The links of a sheet, however steep it is."""
    near = graph.nearest_neighbours(found.start, found.z, ny, whole(nx, ny, 1), step)
    return graph.Links(near, near)


@pytest.mark.parametrize("seed", range(4))
def test_neighbours_are_the_nearest_surfaces_of_the_next_columns(seed):
    columns, found = bumpy_world(seed)
    near = graph.nearest_neighbours(found.start, found.z, columns.ny, whole(columns.nx, columns.ny, MARGIN), LIMITS.step)
    strides = (columns.ny, 1, -columns.ny, -1)
    expected = [
        [find_node(found.start, found.z, int(c) + stride, int(z), LIMITS.step) for stride in strides]
        for c, z in zip(found.column, found.z, strict=True)
    ]
    assert np.array_equal(near, expected) and (np.diff(found.start) > 1).any()


def test_spans_are_the_columns_within_the_distance():
    rng = np.random.default_rng(0)
    for radius in (0.5, 5.0, 13.0):
        for x0, y0 in (*rng.uniform(-15, 0, (20, 2)), (-12.0, -12.0), (1.0, 1.0), (0.0, -60.0), (0.0, 60.0), (60.0, 0.0)):
            x, y = x0 + np.arange(24.0), y0 + np.arange(26.0)  # 3, 4, 5 and 5, 12, 13 lie on the rim
            spans, inside = scene._spans_within(x, y, radius), np.hypot(x[:, None], y) <= radius
            assert np.array_equal((np.arange(26) >= spans[:, :1]) & (np.arange(26) < spans[:, 1:]), inside)


# -- surfaces and what is filled between them


def test_floor_that_is_filled_in_is_sorted_into_the_surfaces():
    columns, found = bumpy_world(3)
    assert found.filled.any() and np.array_equal(np.repeat(np.arange(found.start.size - 1), np.diff(found.start)), found.column)
    same_column = np.diff(found.column) == 0
    assert (np.diff(found.z)[same_column] > 0).all() and (np.diff(found.column) >= 0).all()
    there = [lowest_occupied(columns, int(c), int(z), int(z)) for c, z in zip(found.column, found.z, strict=True)]
    assert np.array_equal(found.filled, np.array(there) == NO_VOXEL)
    assert found.sigma[found.filled].min() >= 2 * found.sigma[~found.filled].max()


def test_which_of_two_lines_over_a_hole_stays_does_not_depend_on_their_order() -> None:
    narrow, wide, low, elsewhere = (4, 2), (5, 3), (3, 2), (40, 3)  # z and gap
    for lines in itertools.permutations([narrow, wide, low, elsewhere]):
        z, gap = np.array(lines).T
        values = np.zeros(z.size, np.float32)
        floor = fill._Floor(np.full(z.size, 7), z, gap, values, values, np.zeros((z.size, 2), np.float32))
        kept = fill._one_per_hole(floor, step=2)
        assert list(zip(kept.z.tolist(), kept.gap.tolist(), strict=True)) == [narrow, elsewhere]


@pytest.mark.parametrize(
    "strips, tops",
    [([(7, 8)], [8]), ([(0, 5), (7, 8)], []), ([(0, 3), (5, 5), (7, 8)], []), ([(0, 5), (8, 8)], []), ([(0, 4), (8, 8)], [8])],
    ids=["floor", "wall", "three strips", "two voxels between", "too far apart"],
)
def test_wall_that_was_hit_in_strips_has_no_top_where_none_was_seen(strips, tops) -> None:
    z_lo, z_hi = np.array([*strips, (11, 40)], dtype=np.int16).T.copy()  # free above, but not right above
    occupied = np.arange(len(z_lo)) < len(strips)
    columns = Columns(1, 1, np.array([0, len(z_lo)], dtype=np.int32), z_lo, z_hi, occupied)
    assert surfaces._tops(columns, 14, 2, 3)[2].tolist() == tops


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
    assert is_free_through(columns, 0, 3, 3) == is_seen


def test_sigma_of_a_height_falls_with_its_hits_to_that_of_the_pose_and_is_a_voxels_without_any():
    hits = np.array([[4.4, 0.1, -0.2, 1], [4.4, 0.1, -0.2, 100], [np.nan] * 4], np.float32)
    height, sigma, offset = surfaces._estimates(hits, np.array([4, 4, 4], np.int16), 0.12, 0.05)
    assert height.tolist() == pytest.approx([4.4, 4.4, 4.5])
    assert sigma.tolist() == pytest.approx([np.hypot(0.12, 0.05), np.hypot(0.012, 0.05), 12**-0.5])
    assert offset.tolist()[0] == pytest.approx([0.1, -0.2]) and not offset[2].any()


# -- planes


def plane_of(height: NDArray[np.float64], pull: float) -> NDArray[np.float64]:
    """Gradient by lstsq of the finite heights of a square window, with a level plane of weight `pull`."""
    half = len(height) // 2
    x, y = np.meshgrid(*[np.arange(-half, half + 1)] * 2, indexing="ij")
    known = np.isfinite(height)
    a = np.column_stack([x[known], y[known]]).astype(float)
    h = height[known]
    rows = np.vstack([a - a.mean(axis=0), np.sqrt(pull) * np.eye(2)])
    return np.linalg.lstsq(rows, np.append(h - h.mean(), [0.0, 0.0]), rcond=None)[0]


@pytest.mark.parametrize("half", [planes.WHEEL, planes.BASE])
@pytest.mark.parametrize("seed", range(3))
def test_gradient_is_that_of_least_squares_over_the_star_of_straight_lines(half, seed):
    rng, n = np.random.default_rng(seed), 21
    x, y = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    height = 40.0 + 0.3 * x - 0.2 * y + rng.normal(0.0, 0.3, (n, n))
    found = sheet(height)
    window = height[10 - half : 11 + half, 10 - half : 11 + half].copy()
    u, v = np.meshgrid(*[np.arange(-half, half + 1)] * 2, indexing="ij")
    diagonal = (abs(u) == abs(v)) & (abs(u) <= half - half // 2)
    window[~((u == 0) | (v == 0) | diagonal)] = np.nan
    of_base, of_wheel = planes.gradients_at(linked(found, n, n).graph, found, 10 * n + 10)
    gx, gy, sigma = of_base if half == planes.BASE else of_wheel
    assert (gx, gy) == pytest.approx(tuple(plane_of(window, 0.5)), abs=1e-5) and sigma > 0


@pytest.mark.parametrize("half", [planes.WHEEL, planes.BASE, planes.ROBOT])
@pytest.mark.parametrize("shift", [(0, 0), (1, -1)])
def test_plane_is_that_of_least_squares_wherever_its_window_lies(half, shift):
    rng, n = np.random.default_rng(half), 31
    x, y = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    height = 40.0 + 0.3 * x - 0.2 * y + rng.normal(0.0, 0.1, (n, n))
    found, (cx, cy) = sheet(height), (15 + shift[0] * half, 15 + shift[1] * half)
    window = height[cx - half : cx + half + 1, cy - half : cy + half + 1]
    at = (shift[0] * half, shift[1] * half)
    slope, scatter, _, noise, _ = planes._plane_at(found, n, 15 * n + 15, at, half, (0.29, -0.21))
    gradient = plane_of(window, 0.0)
    u, v = np.meshgrid(*[np.arange(-half, half + 1)] * 2, indexing="ij")
    assert slope == pytest.approx(np.hypot(*gradient), abs=1e-5)
    assert scatter == pytest.approx(np.var(window - gradient[0] * u - gradient[1] * v), abs=1e-5)
    assert noise == pytest.approx(0.05**2)


def test_plane_over_too_little_ground_is_none():
    found = sheet(np.full((31, 31), 8.5))
    few = found._replace(z=np.where(found.column % 31 < 14, -99, found.z).astype(np.int16))  # of 11 rows beside the middle only 6
    assert np.isnan(planes._plane_at(few, 31, 15 * 31 + 15, (0, 0), planes.ROBOT, (0.0, 0.0))[0])


@pytest.mark.parametrize("degrees, expected", [(20.0, 0), (24.9, 0), (25.4, 0), (25.7, 2), (30.0, 2)])
@pytest.mark.parametrize("way", [0.0, 0.6, 2.0])
@pytest.mark.parametrize("noise", [0.0, 0.06])
def test_steepness_of_a_plane_is_known_by_its_limit_whatever_its_direction(degrees, expected, way, noise):
    n, slope = 41, np.tan(np.radians(degrees))
    x, y = np.meshgrid(np.arange(n) - 20, np.arange(n) - 20, indexing="ij")
    random = np.random.default_rng(7).normal(0.0, noise, (n, n))
    found = sheet(60.0 + slope * (np.cos(way) * x + np.sin(way) * y) + random, sigma=0.07)
    assert planes.steepness(found, linked(found, n, n), n, 20 * n + 20, LIMITS) == expected


# -- steps


def jump_is_climbed(jump: float, slope: float = 0.0, sigma: float = 0.0, noise: float = 0.0) -> NDArray[np.bool_]:
    """Whether the edges in the middle of a plane that jumps between its columns 9 and 10 can be stepped over, there and back."""
    n = 20
    x = np.arange(n)[:, None] + 0.0 * np.arange(n)
    height = 20.0 + slope * x + np.where(x >= 10, jump, 0.0) + np.random.default_rng(1).normal(0.0, noise, (n, n))
    found = sheet(height, max(sigma, 1e-6))
    near = graph.nearest_neighbours(found.start, found.z, n, whole(n, n, 1), 30)
    steps = graph.steppable_neighbours(near, found, LIMITS).reshape(n, n, 4)
    others = np.delete(steps[6:14, 6:14, 0], 3, axis=0)
    assert (others >= 0).all(), "an edge beside the step was cut"
    assert np.array_equal(steps[9, 6:14, 0] >= 0, steps[10, 6:14, 2] >= 0)
    return steps[9, 6:14, 0] >= 0


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("slope", [0.0, 0.25, -0.25])
def test_step_is_the_jump_between_two_planes_and_not_the_rise_from_column_to_column(slope, sign):
    limit = LIMITS.max_step
    assert jump_is_climbed(sign * (limit - 0.02), slope).all()
    assert not jump_is_climbed(sign * (limit + 0.02), slope).any()


def test_step_counts_with_its_sigmas_but_never_with_more_than_half_a_step():
    limit = LIMITS.max_step
    assert jump_is_climbed(limit - 0.15, sigma=0.1).all()
    assert not jump_is_climbed(limit - 0.02, sigma=0.1).any()
    assert jump_is_climbed(limit / 2 - 0.02, sigma=0.28).all()


def test_ground_that_is_no_rougher_than_hits_stray_is_one_plane_to_a_robot_of_low_steps():
    n, low = 20, LIMITS._replace(max_step=0.4)
    found = sheet(20.0 + np.random.default_rng(1).normal(0.0, 0.06, (n, n)), 0.06)
    near = graph.nearest_neighbours(found.start, found.z, n, whole(n, n, 1), 30)
    assert np.array_equal(graph.steppable_neighbours(near, found, low).reshape(n, n, 4)[5:15, 5:15], near.reshape(n, n, 4)[5:15, 5:15])


@pytest.mark.parametrize("seed", range(3))
def test_height_at_an_edge_is_that_of_reweighted_least_squares(seed):
    rng = np.random.default_rng(seed)
    points = np.array([(i + 0.5, lane, 0.2 * i - 0.1 * lane) for i in range(graph.ROWS) for lane in (-1, 0, 1)])
    points[:, 2] += rng.normal(0.0, 0.02, len(points))
    points[4, 2] += 1.0  # something else
    far, fit = LIMITS.max_step / 10, np.array([points[1, 2], 0.0, 0.0])
    rows = np.vstack([np.column_stack([np.ones(len(points)), points[:, :2]]), np.sqrt(graph._PRIOR) * np.eye(3)[1:]])
    for i in range(graph._ROUNDS):
        off = points[:, 2] - rows[: len(points)] @ fit
        weight = np.where(points[:, 0] < 1.0, 0.01, 1.0) if i == 0 else (1.0 + (off / far) ** 2) ** -2
        root = np.sqrt(np.append(weight, [1.0, 1.0]))
        fit = np.linalg.lstsq(root[:, None] * rows, root * np.append(points[:, 2], [0.0, 0.0]), rcond=None)[0]
    at_edge, variance, _ = graph._height_at_edge(points, len(points), points[1, 2], 0.05, LIMITS)
    assert at_edge == pytest.approx(fit[0], abs=1e-6) and abs(at_edge + 0.1) < 0.1
    precision = (root[:, None] * rows).T @ (root[:, None] * rows)
    square = weight @ off**2 / weight.sum()
    assert variance == pytest.approx(np.linalg.inv(precision)[0, 0] * max(0.05**2, square), rel=1e-6)


# -- distance


def things_on_a_plane(stands: NDArray[np.bool_], rng: np.random.Generator) -> tuple[Surfaces, NDArray[np.int32], NDArray, NDArray, NDArray]:
    """A plane with things that stand on columns (n, n) of it: its surfaces, graph, and the nodes beside things and the places of these."""
    n = len(stands)
    found = sheet(np.full((n, n), 8.5))
    near, is_thing = linked(found, n, n).near, np.append(stands.ravel(), False)
    node, k = np.nonzero(is_thing[near] & (near >= 0) & ~is_thing[:-1, None])
    thing = near[node, k]
    place = np.stack(np.divmod(thing, n), axis=1) + 0.5 + rng.uniform(-0.4, 0.4, (n * n, 2))[thing]
    over = np.where(is_thing[near] | is_thing[:-1, None], -1, near).astype(np.int32)
    return found, over, node, place[:, 0].copy(), place[:, 1].copy()


def distances_and_brute_force(
    stands: NDArray[np.bool_], rng: np.random.Generator, within: float, square: bool
) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
    """Those of the ground amid the plane."""
    n = len(stands)
    found, over, node, x, y = things_on_a_plane(stands, rng)
    far = distances(node, x, y, (found.column, over, n), within, square)
    middle = np.stack([found.column // n + 0.5, found.column % n + 0.5], axis=1)
    expected = cKDTree(np.column_stack([x, y])).query(middle, p=np.inf if square else 2)[0]
    inside = ((middle > 1) & (middle < n - 1)).all(axis=1) & ~stands.ravel()
    assert np.isinf(far[expected > within]).all()
    return far[inside & (expected <= within)], expected[inside & (expected <= within)]


@pytest.mark.parametrize(("square", "most"), [(False, 0.05), (True, 0.1)])
@pytest.mark.parametrize("seed", range(5))
def test_distance_over_an_open_plane_is_that_of_brute_force(seed, square, most):
    rng, stands = np.random.default_rng(seed), np.zeros((50, 50), dtype=bool)
    for x, y in itertools.product(range(6, 50, 12), range(6, 50, 12)):
        stands[x + rng.integers(-3, 4), y + rng.integers(-3, 4)] = True
    far, expected = distances_and_brute_force(stands, rng, 8.0, square)
    assert (far >= expected - 1e-4).all() and (far - expected).max() <= most


@pytest.mark.parametrize("seed", range(5))
def test_distance_amid_many_things_is_never_too_short_and_rarely_too_long(seed):
    """A place is passed on from column to column, and may be forgotten where others are nearer all around."""
    rng, stands = np.random.default_rng(seed), np.zeros((50, 50), dtype=bool)
    for x, y in rng.integers(3, 44, (25, 2)):
        stands[x : x + rng.integers(1, 4), y : y + rng.integers(1, 4)] = True
    far, expected = distances_and_brute_force(stands, rng, 14.0, False)
    assert (far >= expected - 1e-4).all() and (far - expected).max() <= 0.5
    assert np.count_nonzero(far - expected > 0.05) <= 0.01 * far.size


def test_distance_goes_only_where_ground_goes_on():
    """A wall without ends between two halves of a plane, and a barrier in one of them."""
    n = 30
    found = sheet(np.full((n, n), 8.5))
    over = linked(found, n, n).near.copy()
    over[14 * n : 15 * n, 0] = over[15 * n : 16 * n, 2] = -1
    far = distances(np.array([13 * n + 15]), np.array([13.5]), np.array([15.5]), (found.column, over, n), 9.0, False).reshape(n, n)
    assert far[14, 15] == pytest.approx(1.0) and far[13, 15] == 0.0 and np.isinf(far[15:]).all()
