"""The four principles of docs/terrain.md, each on the smallest map that shows it."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from terrain_worlds import BELOW, FREE, OCCUPIED, RESOLUTION, UNKNOWN, drawn, grid_of_heights, label_at, pose, runs_of, terrain_of

from octomap_server_3dnav.navigation.planner import PlannerConfig, plan_path
from octomap_server_3dnav.octree.surface_heights import HitHeights, SurfaceHeights
from octomap_server_3dnav.terrain import graph, surfaces
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass, TerrainConfig, classify
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.flood import flood
from octomap_server_3dnav.terrain.scene import Scene, scene_around
from robot_body import RobotBody

TRAVERSABLE, OBSTACLE, CLIFF, INFLATION, FRONTIER, POTENTIAL_CLIFF = TerrainClass
LIMITS = Limits.of(TerrainConfig(), RobotBody(), RESOLUTION)


def flat(nx: int = 60, ny: int = 60) -> NDArray[np.uint8]:
    return grid_of_heights(lambda x, y: 0.04 + 0 * x * y, nx, ny)


def met(height, nx: int = 60, ny: int = 60, noise_m: float = 0.0, seed: int = 0) -> tuple[NDArray[np.uint8], SurfaceHeights]:
    """States and heights of a ground that beams met every 2 cm, with noise in their heights."""
    x, y = (np.arange(0.01, n * RESOLUTION, 0.02) for n in (nx, ny))
    z = height(x[:, None], y[None, :]) + 0 * x[:, None] * y + noise_m * np.random.default_rng(seed).standard_normal((x.size, y.size))
    beams = np.stack([*np.meshgrid(x, y, indexing="ij"), z], axis=-1).reshape(-1, 3)
    beams = beams[np.isfinite(z.ravel())]
    heights, states = SurfaceHeights(RESOLUTION), grid_of_heights(lambda x, y: np.nan + 0 * x * y, nx, ny)
    heights.add(HitHeights.of(beams, RESOLUTION))
    ix, iy, iz = np.floor(beams / RESOLUTION).astype(int).T
    top = np.full((nx, ny), -BELOW)
    np.maximum.at(top, (ix, iy), iz)
    states[np.arange(states.shape[2]) - BELOW > top[:, :, None]] = FREE
    states[ix, iy, iz + BELOW] = OCCUPIED
    return states, heights


def measured(height, at: NDArray[np.float64], noise_m: float = 0.0, seed: int = 0, robot: RobotBody | None = None) -> Terrain:
    states, heights = met(height, noise_m=noise_m, seed=seed)
    return classify(runs_of(states), at, TerrainConfig(), robot or RobotBody(), None, heights)


# -- 1 and 2: a step is the jump between what was measured on both sides


@pytest.mark.parametrize("floor", [0.0, 0.02, 0.041, 0.07])
@pytest.mark.parametrize(
    ("rise", "is_climbed", "noise_m"),
    [(0.10, True, 0.0), (0.10, True, 0.005), (0.10, True, 0.01), (0.11, False, 0.0), (0.11, False, 0.005), (0.12, False, 0.01)],
)
def test_kerb_as_high_as_the_robot_climbs_is_driven_over_both_ways_and_one_of_a_centimetre_more_is_not(rise, is_climbed, floor, noise_m):
    def kerb(x, y):
        return np.where(x < 30 * RESOLUTION, floor, floor + rise) + 0 * y

    below, above = measured(kerb, pose(1.2, 2.4, floor), noise_m), measured(kerb, pose(3.6, 2.4, floor + rise), noise_m)
    assert (label_at(below, 3.6, 2.4, floor + rise) == TRAVERSABLE) == is_climbed
    assert (label_at(above, 1.2, 2.4, floor) == TRAVERSABLE) == is_climbed
    assert (label_at(below, 30.5 * RESOLUTION, 2.4, floor + rise) == OBSTACLE) != is_climbed
    assert (label_at(above, 30.5 * RESOLUTION, 2.4, floor + rise) == CLIFF) != is_climbed


@pytest.mark.parametrize(("limit_m", "is_climbed"), [(0.09, False), (0.10, True)])
def test_kerb_is_judged_by_what_this_robot_climbs(limit_m, is_climbed):
    terrain = measured(
        lambda x, y: np.where(x < 30 * RESOLUTION, 0.02, 0.12) + 0 * y, pose(1.2, 2.4, 0.02), robot=replace(RobotBody(), max_step_m=limit_m)
    )
    assert (label_at(terrain, 3.6, 2.4, 0.12) == TRAVERSABLE) == is_climbed


@pytest.mark.parametrize(("rise", "has_way_round", "is_driven_over"), [(0.07, True, True), (0.10, True, False), (0.10, False, True)])
def test_step_that_may_be_too_high_is_driven_over_only_where_no_other_way_is_left(rise, has_way_round, is_driven_over):
    def ridge(x, y):
        return np.where((x > 2.4) & (x < 3.6) & ((y < 7.0) | (not has_way_round)), rise, 0.0)

    states, heights = met(ridge, 80, 120)
    terrain = classify(runs_of(states), pose(1.0, 2.0, 0.0), TerrainConfig(), RobotBody(), None, heights)
    path = plan_path(terrain, terrain.surface_near((5.5, 2.0, 0.0)), PlannerConfig())
    over = (path.points[:, 0] > 2.4) & (path.points[:, 0] < 3.6) & (path.points[:, 1] < 7.0)
    assert over.any() == is_driven_over


@pytest.mark.parametrize("noise_m", [0.0, 0.01, 0.02])
@pytest.mark.parametrize(("degrees", "is_driven"), [(20.0, True), (24.0, True), (25.0, True), (26.0, False), (28.0, False)])
def test_slope_is_driven_up_to_the_limit_whatever_its_noise(degrees, is_driven, noise_m):
    slope = np.tan(np.radians(degrees))
    terrain = measured(lambda x, y: 0.01 + slope * np.clip(x - 1.2, 0.0, 2.4) + 0 * y, pose(0.6, 2.4), noise_m)
    on_it = (terrain.ix > 18) & (terrain.ix < 42) & (terrain.iy > 8) & (terrain.iy < 52)
    assert (terrain.label[on_it] == TRAVERSABLE).all() if is_driven else not (terrain.label[on_it] == TRAVERSABLE).any()
    assert is_driven == (label_at(terrain, 4.2, 2.4, 0.01 + 2.4 * slope) == TRAVERSABLE)


# -- 1: what was not met between two surfaces


@pytest.mark.parametrize(("columns", "expected"), [(1, "..+..."), (2, "..++.."), (3, "..+++."), (4, "..?   ")])
def test_unknown_gap_is_floor_up_to_three_columns(columns, expected):
    states = flat()
    states[30 : 30 + columns, :, : BELOW + 1] = UNKNOWN
    terrain = terrain_of(states, pose(1.2, 2.4))
    assert drawn(terrain, 30, 28, 33) == expected.replace("+", ".")
    assert not np.isin(terrain.label, (OBSTACLE, CLIFF, INFLATION)).any()


@pytest.mark.parametrize(("wheel_radius_m", "max_step_m", "filled"), [(0.165, 0.1, 3), (0.098, 0.05, 2), (0.1, 0.02, 1), (0.05, 0.01, 0)])
def test_gap_that_wheels_do_not_roll_over_is_no_floor(wheel_radius_m, max_step_m, filled):
    robot = replace(RobotBody(), wheel_radius_m=wheel_radius_m, max_step_m=max_step_m)
    limits, found = Limits.of(TerrainConfig(), robot, RESOLUTION), []
    for columns in (1, 2, 3):
        states = flat()
        states[30 : 30 + columns, :, : BELOW + 1] = UNKNOWN
        found.append(scene_around(runs_of(states), None, np.array([1.2, 2.4, 0.1]), None, limits).surfaces.filled.any())
    assert found == [columns <= filled for columns in (1, 2, 3)]


def test_filled_floor_is_less_sure_than_what_it_lies_between():
    states = flat()
    states[30:33, :, : BELOW + 1] = UNKNOWN
    found = scene_around(runs_of(states), None, np.array([1.2, 2.4, 0.1]), None, LIMITS).surfaces
    assert found.filled.sum() == 3 * 60 and found.sigma[found.filled].min() > 2 * found.sigma[~found.filled].max()


@pytest.mark.parametrize("state", [FREE, OCCUPIED])
def test_gap_is_no_floor_where_something_else_was_seen(state):
    states = flat()
    states[30:32, :, : BELOW + 1] = FREE if state == FREE else UNKNOWN
    states[30:32, :, BELOW + 3 : BELOW + 8] = state
    found = scene_around(runs_of(states), None, np.array([1.2, 2.4, 0.1]), None, LIMITS).surfaces
    assert not found.filled.any()


# -- 3: one question beside ground


def cut_floor(columns: int, depth: int, hangs: bool) -> NDArray[np.uint8]:
    """A floor of which `columns` columns show what lies `depth` voxels lower: its underside, with air below, or a trench."""
    states = np.full((60, 60, 60), FREE, dtype=np.uint8)
    top = BELOW + 20
    states[:, :, top], states[:, :, top - depth + 1 : top], states[:, :, top - depth] = OCCUPIED, UNKNOWN, OCCUPIED
    states[30 : 30 + columns, :, top - depth + 1 : top + 1] = FREE
    if not hangs:
        states[:, :, : top - depth] = UNKNOWN
    return states


@pytest.mark.parametrize("depth", [2, 3])
@pytest.mark.parametrize(("columns", "hangs", "is_floor"), [(1, True, True), (3, True, True), (4, True, False), (1, False, False)])
def test_underside_of_a_plate_says_nothing_of_the_floor_above_it_and_a_trench_is_one(columns, depth, hangs, is_floor):
    found = terrain_of(cut_floor(columns, depth, hangs), pose(1.2, 2.4, 20.5 * RESOLUTION))
    assert (label_at(found, 3.6, 2.4, 20.5 * RESOLUTION) == TRAVERSABLE) == is_floor


@pytest.mark.parametrize("height", [3, 4, 6])
@pytest.mark.parametrize(("is_seen_through", "is_floor"), [(False, True), (True, False)])
def test_hole_in_a_plate_is_one_only_where_a_beam_went_through(height, is_seen_through, is_floor):
    """Beams that graze a plate above and below leave columns in which none ended: free, the plate's inside unknown, free, floor."""
    top = BELOW + height
    states = flat()
    states[:, :, BELOW + 1 : top], states[:, :, top] = UNKNOWN, OCCUPIED
    states[30:32, :, BELOW + 1 : top + 1] = FREE
    if not is_seen_through:
        states[30:32, :, top - 1] = UNKNOWN
    found = terrain_of(states, pose(1.2, 2.4, (height + 0.5) * RESOLUTION))
    assert (label_at(found, 3.6, 2.4, (height + 0.5) * RESOLUTION) == TRAVERSABLE) == is_floor


def row(*beyond: tuple[slice, np.uint8, slice]) -> str:
    """Labels of columns 26 to 34 of a floor that ends before column 30; of those from there on a state in some layers by column."""
    states = flat()
    states[30:] = UNKNOWN
    for columns, state, layers in beyond:
        states[columns, :, layers] = state
    return drawn(terrain_of(states, pose(1.0, 2.4)), 30, 26, 34)


BEYOND, AIR, BODY = slice(30, 60), slice(BELOW + 1, None), slice(BELOW, BELOW + 8)


def test_unknown_beside_nothing_is_a_frontier():
    assert row() == "....?    "
    assert row((BEYOND, FREE, AIR)) == "....?    "


@pytest.mark.parametrize(("wheel_radius_m", "max_step_m", "columns"), [(0.1, 0.02, 2), (0.033, 0.01, 1)])
def test_gap_that_wheels_do_not_roll_over_is_a_question(wheel_radius_m: float, max_step_m: float, columns: int) -> None:
    states, robot = flat(), replace(RobotBody(), wheel_radius_m=wheel_radius_m, max_step_m=max_step_m)
    states[30 : 30 + columns, :, : BELOW + 1] = UNKNOWN
    assert drawn(terrain_of(states, pose(1.0, 2.4), robot=robot), 30, 28, 31) == "..? "


def test_drop_that_was_seen_is_a_cliff_and_one_of_which_only_the_air_at_hand_was_seen_is_none():
    assert row((BEYOND, FREE, slice(2, None))) == "ooov     "
    assert row((BEYOND, FREE, slice(BELOW, None)))[:4] == "...."


def test_drop_below_a_rail_beside_the_edge_is_a_cliff_and_a_wall_that_goes_down_is_none():
    """Else wheels would keep as far off the rail as a body must, and not as far off the edge."""
    drop, rail, wall = (BEYOND, FREE, slice(2, None)), (slice(30, 31), slice(BELOW + 6, BELOW + 8)), (slice(30, 31), slice(0, BELOW + 8))
    assert row(drop, (rail[0], OCCUPIED, rail[1]))[:4] == "ooov"
    assert row(drop, (wall[0], OCCUPIED, wall[1]))[:5] == "oooo#"


@pytest.mark.parametrize(("wall_at", "expected"), [(30, "oooo#    "), (31, "oooo##   "), (32, "oooo# #  "), (33, "oooo?  # ")])
def test_unknown_within_two_columns_of_what_stands_is_a_side_of_it(wall_at, expected):
    assert row((slice(wall_at, wall_at + 1), OCCUPIED, BODY)) == expected


def test_what_stands_far_beyond_the_unknown_does_not_block_it():
    assert row((slice(45, 46), OCCUPIED, BODY)) == "....?    "


# -- 4: one distance, over the ground only


def test_distance_never_leads_to_another_storey():
    """A bridge over ground with a wall on it: the ground below is not near the wall, and the bridge not near a post below it."""
    states = flat(60, 60)
    deck = BELOW + 20
    states[20:40, :, deck], states[20:40, :, deck + 1 :] = OCCUPIED, FREE
    states[30, 30, deck + 1 : deck + 10] = OCCUPIED  # on the bridge
    states[30, 15, BELOW + 1 : BELOW + 12] = OCCUPIED  # on the ground, beneath it
    below, above = terrain_of(states, pose(0.8, 2.4)), terrain_of(states, pose(2.4, 0.4, ground=20 * RESOLUTION), inflation_shape="circle")
    beside_post, beside_thing = (30.5 * RESOLUTION, 17.5 * RESOLUTION), (30.5 * RESOLUTION, 32.5 * RESOLUTION)
    assert label_at(below, *beside_post, 0.04) == INFLATION and label_at(below, *beside_thing, 0.04) == TRAVERSABLE
    assert np.isinf(below.distance_m[below.surface_near((*beside_thing, 0.04))])
    assert label_at(above, *beside_post, 1.64) == TRAVERSABLE and label_at(above, *beside_thing, 1.64) == INFLATION


def test_distance_is_from_the_place_of_the_hits_and_kept_with_its_margin():
    states = flat()
    states[40, :, BELOW:] = OCCUPIED
    terrain, config, robot = terrain_of(states, pose(1.6, 2.4)), TerrainConfig(), RobotBody()
    row_of_30 = np.flatnonzero((terrain.iy == 30) & (terrain.label <= INFLATION) & (terrain.ix > 28) & (terrain.ix < 40))
    away = (40 - terrain.ix[row_of_30]) * RESOLUTION
    assert terrain.distance_m[row_of_30] == pytest.approx(away, abs=1e-5)
    kept = robot.turning_radius_m + config.margin_m + config.confidence * config.pose_noise_m
    assert np.array_equal(terrain.label[row_of_30] == INFLATION, away <= kept)


# -- what is no number is no ground


@pytest.mark.parametrize("where", [(0, 3), (2, 3), (1, 1)])
def test_pose_that_holds_no_number_is_refused(where):
    at = pose(1.2, 2.4)
    at[where] = np.nan
    with pytest.raises(ValueError, match="finite|rigid|number"):
        classify(runs_of(flat()), at, TerrainConfig(), RobotBody(), None)


@pytest.mark.parametrize("name", ["range_noise_m", "pose_noise_m", "margin_m", "confidence"])
def test_configuration_that_holds_no_number_is_refused(name):
    with pytest.raises(ValueError, match=name):
        terrain_of(flat(), pose(1.2, 2.4), **{name: float("nan")})


def test_surface_that_no_beam_met_lies_in_the_middle_of_its_voxel():
    states, _ = met(lambda x, y: 0.07 + 0 * x * y)
    found = scene_around(runs_of(states), SurfaceHeights(RESOLUTION), np.array([1.2, 2.4, 0.1]), None, LIMITS).surfaces
    assert np.unique(found.height).tolist() == [0.5] and np.unique(found.sigma).tolist() == [surfaces.VOXEL_SIGMA]


@pytest.mark.parametrize("field", range(4))
def test_hits_that_are_no_numbers_are_none(field):
    """Height, place and number of hits: whichever is none, the voxel is all that is known."""
    hits = np.array([[4.2, 0.1, 0.1, 9.0]] * 2, np.float32)
    hits[1, field] = np.nan
    height, sigma, offset = surfaces._estimates(hits, np.array([4, 4], np.int16), 0.1, 0.05)
    assert height.tolist() == pytest.approx([4.2, 4.5]) and sigma[1] == surfaces.VOXEL_SIGMA and not offset[1].any()


def scene_with(states: NDArray[np.uint8], **changed: tuple[tuple[int, int], float]) -> Scene:
    """A scene in one of whose columns a field of its surface has another value; links are made of that."""
    scene = scene_around(runs_of(states), None, np.array([1.2, 2.4, 0.1]), None, LIMITS)
    found = scene.surfaces
    for name, ((x, y), value) in changed.items():
        values = getattr(found, name).copy()
        values[found.start[(x - scene.key[0]) * scene.columns.ny + y - scene.key[1]]] = value
        found = found._replace(**{name: values})
    return replace(scene, surfaces=found, links=graph.Links(scene.links.near, graph.steppable_neighbours(scene.links.near, found, LIMITS)))


def labels_of(scene: Scene) -> NDArray[np.uint8]:
    """What the flood from column 5, 30 finds."""
    first = int(scene.surfaces.start[(5 - scene.key[0]) * scene.columns.ny + 30 - scene.key[1]])
    inside = np.ones(scene.surfaces.start.size - 1, dtype=bool)
    return flood(scene.columns, scene.surfaces, scene.links, first, inside, LIMITS)[0]


def test_height_that_is_no_number_is_never_traversable():
    scene = scene_with(flat(), height=((30, 30), np.nan))
    label, node = labels_of(scene), np.flatnonzero(np.isnan(scene.surfaces.height))
    assert node.size == 1 and label[node[0]] != TRAVERSABLE and np.count_nonzero(label == TRAVERSABLE) > 3000


def test_sigma_that_is_no_number_makes_no_step_climbable():
    """A kerb of one voxel and a half, which is too high, at whose foot one surface has no sigma."""
    states = grid_of_heights(lambda x, y: np.where(x < 30 * RESOLUTION, 0.04, 0.20) + 0 * y, 60, 60)
    scene = scene_with(states, sigma=((29, 30), np.nan))
    label = labels_of(scene)
    upper = scene.surfaces.column // scene.columns.ny + scene.key[0] >= 30
    assert (label == TRAVERSABLE).any() and not (label[upper] == TRAVERSABLE).any()
