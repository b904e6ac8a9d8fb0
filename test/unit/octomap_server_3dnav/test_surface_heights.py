"""Heights of surfaces within their voxels: means of the hits, by voxel, and what they tell of steps and kerbs."""

import numpy as np
import pytest
from terrain_worlds import BELOW, OCCUPIED, RESOLUTION, grid_of_heights, label_at, pose, runs_of

from octomap_server_3dnav.octree.surface_heights import HitHeights, SurfaceHeights
from octomap_server_3dnav.terrain.classify import TerrainClass, TerrainConfig, classify
from robot_body import RobotBody

TRAVERSABLE, OBSTACLE, CLIFF, INFLATION, FRONTIER, POTENTIAL_CLIFF = TerrainClass


def voxels(*xyz):
    return (np.array(axis) for axis in zip(*xyz, strict=True))


def hits(seed, n=400):
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (n, 3))


def test_height_is_the_mean_of_the_hits_in_the_voxel():
    heights = SurfaceHeights(0.5)
    heights.add(HitHeights.of(np.array([[0.1, 0.1, 0.75], [0.2, 0.3, 0.875], [-0.1, 0.1, -0.25]]), 0.5))
    assert heights.at(*voxels((0, 0, 1), (-1, 0, -1)))[:, 0].tolist() == pytest.approx([1.625, -0.5])


def test_height_of_a_slope_is_the_mean_of_the_hits_in_the_voxel_and_in_the_one_below():
    heights = SurfaceHeights(0.5)
    heights.add(HitHeights.of(np.array([[0.1, 0.1, 0.5625], [0.2, 0.3, 0.4375], [0.4, 0.3, 0.4375], [0.1, 0.1, 1.5]]), 0.5))
    assert heights.at(*voxels((0, 0, 1), (0, 0, 3)))[:, 0].tolist() == pytest.approx([23 / 24, 3.0], abs=2e-3)


def test_face_below_an_edge_is_no_slope():
    face = np.column_stack([np.full(20, 0.1), np.full(20, 0.1), np.linspace(0.02, 0.48, 20)])
    heights = SurfaceHeights(0.5)
    heights.add(HitHeights.of(np.vstack([np.tile([0.1, 0.1, 0.5625], (8, 1)), face]), 0.5))
    assert heights.at(*voxels((0, 0, 1)))[0, [0, 3]].tolist() == pytest.approx([1.125, 8])


def test_what_is_put_down_on_floor_that_was_seen_often_is_as_high_as_its_own_hits() -> None:
    """Else it would be averaged into the floor, and driven over, until it was hit as often."""
    heights = SurfaceHeights(0.5)
    heights.add(HitHeights.of(np.vstack([np.tile([0.1, 0.1, 0.95], (2, 1)), np.tile([0.1, 0.1, 0.0625], (200, 1))]), 0.5))
    assert heights.at(*voxels((0, 0, 1)))[0, [0, 3]].tolist() == pytest.approx([1.9, 2], abs=2e-3)


def test_tail_of_the_noise_of_hits_below_is_no_edge() -> None:
    heights = SurfaceHeights(0.5)
    heights.add(HitHeights.of(np.vstack([[0.1, 0.1, 0.6], np.tile([0.1, 0.1, 0.25], (9, 1))]), 0.5))
    assert heights.at(*voxels((0, 0, 1)))[0, 0] == pytest.approx(0.57, abs=2e-3)


def test_place_of_the_hits_is_told_from_the_middle_of_the_column():
    heights = SurfaceHeights(0.5)
    heights.add(HitHeights.of(np.array([[-0.45, 0.125, 0.3], [-0.4, 0.0, 0.3]]), 0.5))
    assert heights.at(*voxels((-1, 0, 0)))[0, 1:].tolist() == pytest.approx([-0.35, -0.375, 2], abs=2e-3)


def test_voxel_without_a_hit_has_no_height():
    heights = SurfaceHeights(0.5)
    assert np.isnan(heights.at(*voxels((0, 0, 0)))).all()
    heights.add(HitHeights.of(np.array([[0.1, 0.1, 0.75]]), 0.5))
    assert np.isnan(heights.at(*voxels((0, 0, 0), (0, 1, 1), (99, 99, 99)))).all()


def test_spread_is_that_of_all_hits_between_two_voxels_of_a_column():
    rng = np.random.default_rng(4)
    points, resolution = rng.uniform(0.0, 1.0, (200, 3)) * [0.5, 0.5, 3.0], 0.5
    heights = SurfaceHeights(resolution)
    heights.add(HitHeights.of(points[:120], resolution))
    heights.add(HitHeights.of(points[120:], resolution))
    few, none, many = heights.spread(*voxels((0, 0, 2), (0, 1, 0), (0, 0, 1)), np.array([2, 5, 4]))
    for found, low, high in ((few, 2, 3), (many, 1, 5)):
        x, y, _ = (points[(points[:, 2] >= low * resolution) & (points[:, 2] < high * resolution)] / resolution - 0.5).T
        expected = [x.size, x.mean(), y.mean(), x.var(), y.var(), np.cov(x, y, bias=True)[0, 1]]
        assert found == pytest.approx(expected, abs=2e-3)
    assert not none.any()


def test_points_that_are_none_or_out_of_range_are_left_out():
    assert HitHeights.of(np.array([[np.nan, 0.0, 0.0], [1e9, 0.0, 0.0], [0.0, -np.inf, 0.0]]), 0.1).key.size == 0


def test_sweeps_in_any_order_give_the_same_and_leave_no_trace_when_taken_out():
    parts = [HitHeights.of(hits(seed), 0.2) for seed in range(3)]
    forth, back = SurfaceHeights(0.2), SurfaceHeights(0.2)
    for part in parts:
        forth.add(part)
    for part in parts[::-1]:
        back.add(part)
    everywhere = tuple(axis.ravel() for axis in np.meshgrid(*[np.arange(-10, 10)] * 3))
    np.testing.assert_array_equal(forth.at(*everywhere), back.at(*everywhere))
    forth.remove(parts[1])
    alone = SurfaceHeights(0.2)
    alone.add(parts[0])
    alone.add(parts[2])
    assert len(forth) == len(alone)
    np.testing.assert_array_equal(forth.at(*everywhere), alone.at(*everywhere))


def measured(height, T_map_base, nx=80, ny=60, noise_m=0.0, **config):
    """The terrain of a surface that beams have hit every 2 cm, with noise in their heights."""
    x, y = (np.arange(0.01, n * RESOLUTION, 0.02) for n in (nx, ny))
    z = height(x[:, None], y[None, :]) + noise_m * np.random.default_rng(nx).standard_normal((x.size, y.size))
    points = np.stack([*np.meshgrid(x, y, indexing="ij"), z], axis=-1).reshape(-1, 3)
    heights = SurfaceHeights(RESOLUTION)
    heights.add(HitHeights.of(points, RESOLUTION))
    states = grid_of_heights(height, nx, ny)
    if noise_m:
        ix, iy, iz = np.floor(points / RESOLUTION).astype(int).T
        states[ix, iy, iz + BELOW] = OCCUPIED
    return classify(runs_of(states), T_map_base, TerrainConfig(**config), RobotBody(), None, heights)


def kerb(rise, floor=0.0):
    """A kerb across the world at a column's border."""
    return lambda x, y: np.where(x < 40 * RESOLUTION, floor, floor + rise) + 0 * y


@pytest.mark.parametrize("floor", [0.005, 0.03, 0.07])
@pytest.mark.parametrize("rise, drivable", [(0.03, True), (0.05, True), (0.08, True), (0.12, False), (0.15, False)])
def test_kerb_is_what_it_measures_wherever_the_voxel_layers_lie(rise, drivable, floor):
    below = measured(kerb(rise, floor), pose(1.6, 2.4, ground=floor))
    above = measured(kerb(rise, floor), pose(5.0, 2.4, ground=floor + rise))
    assert (label_at(below, 5.0, 2.4, floor + rise) == TRAVERSABLE) == drivable
    assert (label_at(above, 1.6, 2.4, floor) == TRAVERSABLE) == drivable


@pytest.mark.parametrize("floor", [0.0, 0.02, 0.04, 0.055, 0.078])
@pytest.mark.parametrize("rise, drivable", [(0.095, True), (0.1, True), (0.11, False)])
def test_kerb_between_flat_treads_is_known_to_millimetres(rise, drivable, floor):
    below = measured(kerb(rise, floor), pose(1.6, 2.4, ground=floor), noise_m=0.005)
    assert (label_at(below, 5.0, 2.4, floor + rise) == TRAVERSABLE) == drivable
    assert (below.label[(below.iy > 2) & (below.iy < 57)] == OBSTACLE).any() != drivable


@pytest.mark.parametrize("rise, drivable", [(0.1, True), (0.11, False)])
def test_kerb_may_run_obliquely_to_the_grid(rise, drivable):
    oblique = measured(lambda x, y: np.where(x + 0.6 * (y - 2.4) < 3.2, 0.03, 0.03 + rise), pose(1.2, 2.4, ground=0.03), noise_m=0.005)
    assert (label_at(oblique, 5.4, 2.4, 0.03 + rise) == TRAVERSABLE) == drivable


@pytest.mark.parametrize("depth, drivable", [(0.06, True), (0.14, False)])
def test_trench_between_two_treads_is_no_kerb(depth, drivable):
    trench = measured(
        lambda x, y: np.where(abs(x - 3.2) < 2 * RESOLUTION, 0.2 - depth, 0.2) + 0 * y, pose(1.6, 2.4, ground=0.2), noise_m=0.005
    )
    assert (label_at(trench, 5.0, 2.4, 0.2) == TRAVERSABLE) == drivable


@pytest.mark.parametrize("rise, drivable", [(0.06, True), (0.12, False)])
def test_sill_is_a_step_however_narrow(rise, drivable):
    sill = measured(lambda x, y: np.where(abs(x - 40.5 * RESOLUTION) < RESOLUTION / 2, rise, 0.005) + 0 * y, pose(1.6, 2.4))
    assert (label_at(sill, 5.0, 2.4, 0.005) == TRAVERSABLE) == drivable


def test_edge_is_a_cliff_to_the_ground_above_and_a_step_to_that_below():
    """Both within one flood, as a ramp beside it leads up; above the way is kept from where it was hit, below from its rim."""
    terrain = measured(
        lambda x, y: 0.005 + np.where(y > 3.2, np.clip(0.25 * (x - 1.6), 0.0, 0.15), np.where(x < 3.2, 0.0, 0.15)), pose(1.0, 1.2), ny=80
    )
    kept = [label_at(terrain, (column + 0.5) * RESOLUTION, 0.6, 0.005 if column < 40 else 0.155) for column in (31, 32, 40, 47, 49)]
    assert kept == [TRAVERSABLE, INFLATION, OBSTACLE, INFLATION, TRAVERSABLE]


def points(x, z):
    """Beams that ended every 2 cm along y, at some x and z."""
    y = np.arange(0.01, 60 * RESOLUTION, 0.02)
    return np.column_stack([np.repeat(x, y.size), np.tile(y, len(x)), np.repeat(z, y.size)])


def labels_before(height, hits_map, columns):
    """Labels amid the world of columns before something at column 40, whose voxels and hits do not tell the same."""
    heights = SurfaceHeights(RESOLUTION)
    heights.add(HitHeights.of(hits_map, RESOLUTION))
    terrain = classify(runs_of(grid_of_heights(height, 80, 60)), pose(1.2, 2.4), TerrainConfig(), RobotBody(), None, heights)
    return [label_at(terrain, (column + 0.5) * RESOLUTION, 2.4, 0.005) for column in columns]


@pytest.mark.parametrize("part_of_column, first_inflated", [(0.2, 32), (0.5, 32), (1.0, 33)])
def test_cliff_is_where_its_voxel_was_hit(part_of_column, first_inflated):
    edge = (40 + part_of_column) * RESOLUTION
    floor = np.arange(0.005, edge, 0.005)
    found = labels_before(
        lambda x, y: np.where(x < 41 * RESOLUTION, 0.005, -0.4) + 0 * y, points(floor, np.full(floor.size, 0.005)), range(30, 36)
    )
    assert found == [TRAVERSABLE if column < first_inflated else INFLATION for column in range(30, 36)]


def crater(degrees, aside=0.0):
    """The terrain before a crater whose wall begins behind column 40, over which its rim falls already; along that it rises by `aside`."""
    rim, wall = (np.tan(np.radians(angle)) for angle in (degrees, 65.0))

    def height(x, y):
        beyond = np.maximum(0.0, x - 40 * RESOLUTION)
        return 0.63 - rim * np.minimum(beyond, RESOLUTION) - wall * np.clip(beyond - RESOLUTION, 0.0, 0.25) + aside * (y - 2.4)

    return measured(height, pose(1.2, 2.4, ground=0.63))


@pytest.mark.parametrize("degrees", [0, 30])
def test_cliff_is_at_the_mean_place_of_the_hits_in_the_last_column_before_it(degrees):
    found = [label_at(crater(degrees), (column + 0.5) * RESOLUTION, 2.4, 0.63) for column in range(30, 36)]
    assert found == [TRAVERSABLE if column < 33 else INFLATION for column in range(30, 36)]


@pytest.mark.parametrize("aside", [0.0, 0.4])
def test_ground_before_a_drop_that_was_seen_is_a_cliff_however_steep(aside):
    """22 degrees along the rim alone can be driven, with what it falls towards the crater they are too steep."""
    assert label_at(crater(40, aside), 40.5 * RESOLUTION, 2.4, 0.6) == CLIFF


@pytest.mark.parametrize("z", [0.1, 0.2, 0.6])
@pytest.mark.parametrize("nearer, first_inflated", [(0, 33), (12, 33), (14, 32), (20, 32)])
def test_thing_is_at_the_mean_place_of_the_beams_that_met_it_at_any_height_of_the_robot(z, nearer, first_inflated):
    """Twenty beams ended near the far rim of column 40 or near its other one: at 40.90, 40.42, 40.34 and 40.10 on average."""
    beams = points(np.repeat([40.1, 40.9], [nearer, 20 - nearer]) * RESOLUTION, np.full(20, z))
    found = labels_before(lambda x, y: np.where(x < 40 * RESOLUTION, 0.005, 0.6) + 0 * y, beams, range(30, 36))
    assert found == [TRAVERSABLE if column < first_inflated else INFLATION for column in range(30, 36)]


@pytest.mark.parametrize("corner, label", [(40.3, INFLATION), (40.6, TRAVERSABLE)])
def test_corner_is_where_its_sides_meet_not_where_they_were_hit_on_average(corner, label):
    """7.5 and 7.9 voxels from the place, and to be kept off by 7.7."""
    side, z = np.arange(corner, 50.0, 0.05) * RESOLUTION, np.arange(0.18, 1.0, 0.08)
    first, second = np.tile(side, z.size), np.full(side.size * z.size, corner * RESOLUTION)
    heights = SurfaceHeights(RESOLUTION)
    heights.add(
        HitHeights.of(
            np.concatenate([np.stack([a, b, np.repeat(z, side.size)], axis=1) for a, b in ((first, second), (second, first))]), RESOLUTION
        )
    )
    runs = runs_of(grid_of_heights(lambda x, y: np.where((x < 40 * RESOLUTION) | (y < 40 * RESOLUTION), 0.005, 1.0), 80, 80))
    terrain = classify(runs, pose(1.2, 1.2), TerrainConfig(), RobotBody(), None, heights)
    assert label_at(terrain, 35.5 * RESOLUTION, 34.5 * RESOLUTION, 0.005) == label


def test_kerb_is_judged_by_its_voxels_where_the_thesis_does():
    assert label_at(measured(kerb(0.15, 0.005), pose(1.6, 2.4), step_heights="voxels"), 5.0, 2.4, 0.155) == TRAVERSABLE


@pytest.mark.parametrize("rise, turns", [(0.03, True), (0.07, False)])
def test_robot_does_not_turn_beside_a_kerb_that_it_can_drive_over(rise, turns):
    terrain = measured(kerb(rise, 0.01), pose(1.6, 2.4))
    beside, away = (terrain.surface_near((x, 2.4, 0.04)) for x in (3.0, 2.2))
    assert bool(terrain.near_kerb[beside]) != turns and not terrain.near_kerb[away]
    assert (terrain.cost[beside] > terrain.cost[away]) != turns


@pytest.mark.parametrize("degrees, drivable", [(21, True), (28, False)])
def test_slope_that_sparse_lines_hit_beside_the_middle_of_its_columns_is_what_it_measures(degrees, drivable):
    x, y = np.arange(0.005, 80 * RESOLUTION, 0.075), np.arange(0.01, 60 * RESOLUTION, 0.02)
    z = 0.01 + np.tan(np.radians(degrees)) * x
    heights, seen = SurfaceHeights(RESOLUTION), np.full(80, -np.inf)
    heights.add(
        HitHeights.of(np.stack([*np.meshgrid(x, y, indexing="ij"), np.tile(z[:, None], y.size)], axis=-1).reshape(-1, 3), RESOLUTION)
    )
    np.maximum.at(seen, (x / RESOLUTION).astype(int), z)
    runs = runs_of(grid_of_heights(lambda x, y: seen[(x / RESOLUTION).astype(int)] + 0 * y, 80, 60))
    terrain = classify(runs, pose(3.2, 2.4, ground=seen[40]), TerrainConfig(min_ground_voxels=1), RobotBody(), None, heights)
    middle = np.abs((terrain.ix + 0.5) * RESOLUTION - 3.2) < 2.0
    labels = terrain.label[middle & (np.abs((terrain.iy + 0.5) * RESOLUTION - 2.4) < 1.5)]
    assert (labels == TRAVERSABLE).all() if drivable else (labels != TRAVERSABLE).all()


@pytest.mark.parametrize("degrees, drivable", [(24.0, True), (25.0, True), (25.6, False), (27.0, False)])
def test_slope_of_a_plane_as_large_as_the_robot_is_known_to_a_fraction_of_a_degree(degrees, drivable):
    slope = np.tan(np.radians(degrees))
    terrain = measured(lambda x, y: np.clip(x - 1.6, 0.0, 2.4) * slope + 0.01 + 0 * y, pose(0.8, 2.4), noise_m=0.005)
    on_slope = np.abs((terrain.ix + 0.5) * RESOLUTION - 2.8) < 0.8
    inside = on_slope & (np.abs((terrain.iy + 0.5) * RESOLUTION - 2.4) < 1.5)
    assert (terrain.label[inside] == TRAVERSABLE).all() if drivable else not (terrain.label[on_slope] == TRAVERSABLE).any()


def test_hollow_that_is_steep_beside_its_middle_is_no_plane():
    """A bowl whose mean slope is 0 and that is steeper than 25 degrees from 0.6 m on."""
    bowl = measured(
        lambda x, y: np.minimum(0.4 * ((x - 3.2) ** 2 + (y - 2.4) ** 2), 1.5) + 0.01, pose(3.2, 2.4, ground=0.01), noise_m=0.005
    )
    off = np.hypot((bowl.ix + 0.5) * RESOLUTION - 3.2, (bowl.iy + 0.5) * RESOLUTION - 2.4)
    assert (bowl.label == OBSTACLE).any() and not (bowl.label[(off > 0.6) & (off < 1.8)] == TRAVERSABLE).any()


@pytest.mark.parametrize("degrees, length_m, drivable", [(28, 0.24, True), (36, 0.24, False), (22, 0.4, True), (28, 0.4, False)])
def test_patch_within_a_gentler_slope_is_an_obstacle_where_no_plane_as_large_as_the_robot_explains_it(degrees, length_m, drivable):
    gentle, patch = np.tan(np.radians(20.0)), np.tan(np.radians(degrees))
    terrain = measured(
        lambda x, y: 0.01 + gentle * np.clip(x - 1.6, 0.0, 2.4) + (patch - gentle) * np.clip(x - 2.88, 0.0, length_m) + 0 * y,
        pose(0.8, 2.4),
    )
    assert (terrain.label == OBSTACLE).any() != drivable


@pytest.mark.parametrize("limit_at", np.arange(4.0, 4.08, 0.02).tolist())
def test_ground_that_gets_steeper_by_and_by_ends_where_it_is_at_the_limit(limit_at):
    """On a parabola 0.6 m and up to 20 cm more are kept from there, wherever that lies in its column."""
    steepest = np.tan(np.radians(25.0))
    terrain = measured(lambda x, y: 0.01 + steepest * np.clip(x - 2.4, 0.0, None) ** 2 / (2.0 * (limit_at - 2.4)) + 0 * y, pose(0.8, 2.4))
    row = (terrain.label == TRAVERSABLE) & (terrain.iy == 30)
    assert limit_at - 0.80 < (terrain.ix[row].max() + 0.5) * RESOLUTION <= limit_at - 0.6


@pytest.mark.parametrize("degrees", [10, 20])
def test_slope_is_no_kerb(degrees):
    slope = np.tan(np.radians(degrees))
    terrain = measured(lambda x, y: np.clip(x - 1.6, 0.0, 3.0) * slope + 0.01 + 0 * y, pose(0.8, 2.4))
    assert not terrain.near_kerb.any()
    assert not ((terrain.label == OBSTACLE) | (terrain.label == CLIFF)).any()
