"""Classes of small worlds: what is floor, obstacle, cliff, inflation and frontier (thesis 5.5, figures 5.10-5.13)."""

import math
from dataclasses import replace

import numpy as np
import pytest
from terrain_worlds import (
    BELOW,
    FREE,
    OCCUPIED,
    RESOLUTION,
    UNKNOWN,
    drawn,
    grid_of_heights,
    label_at,
    label_set,
    pose,
    runs_of,
    terrain_of,
)

from octomap_server_3dnav.terrain.classify import TerrainClass, TerrainConfig, classify
from robot_body import RobotBody

TRAVERSABLE, OBSTACLE, CLIFF, INFLATION, FRONTIER, POTENTIAL_CLIFF = TerrainClass


def flat(nx=60, ny=60):
    return grid_of_heights(lambda x, y: 0.04 + 0 * x * y, nx, ny)


def ramp(degrees, rise=1.2, start=2.0):
    slope = math.tan(math.radians(degrees))
    return lambda x, y: np.clip((x - start) * slope, 0.0, rise) + 0.04 + 0 * y


def assumed(terrain, states):
    """(N,) whether a node is floor in whose voxel nothing was hit."""
    is_surface = np.arange(terrain.label.size) < terrain.surface_count
    at = np.where(is_surface, [terrain.ix, terrain.iy, terrain.z + BELOW], 0)
    return is_surface & (states[tuple(at)] != OCCUPIED)


def test_flat_floor_is_traversable_and_ends_in_frontiers():
    terrain = terrain_of(flat(), pose(2.4, 2.4))
    assert (terrain.label == TRAVERSABLE).sum() == 60 * 60
    assert (terrain.label == FRONTIER).sum() == 4 * 60
    assert terrain.traversable_area_m2 == pytest.approx((60 * RESOLUTION) ** 2)


def test_wall_is_an_obstacle_and_inflates_the_floor_by_the_circumscribed_radius():
    states = flat()
    states[40, :, BELOW:] = OCCUPIED
    terrain = terrain_of(states, pose(1.6, 2.4))
    assert drawn(terrain, 30, 20, 44) == "." * 13 + "o" * 7 + "#" + "    "


def test_square_inflation_reaches_into_the_corners_and_the_circle_does_not():
    states = flat()
    states[40, 40, BELOW:] = OCCUPIED
    circle, square = (terrain_of(states, pose(1.6, 2.4), inflation_shape=shape) for shape in ("circle", "square"))
    corner = ((40 - 7 + 0.5) * RESOLUTION, (40 - 7 + 0.5) * RESOLUTION, 0.04)
    assert label_at(circle, *corner) == TRAVERSABLE
    assert label_at(square, *corner) == INFLATION


def test_drop_that_was_seen_is_a_cliff():
    states = grid_of_heights(lambda x, y: np.where(x < 3.2, 0.04, -0.5) + 0 * y, 60, 60)
    terrain = terrain_of(states, pose(1.6, 2.4))
    assert drawn(terrain, 30, 28, 44) == "." * 4 + "o" * 7 + "v" + " " * 5


def test_drop_of_which_only_the_air_was_seen_is_a_cliff():
    states = flat()
    states[40:, :, : BELOW + 1] = FREE
    states[40:, :, :2] = UNKNOWN
    assert label_at(terrain_of(states, pose(1.6, 2.4)), 3.16, 2.4, 0.04) == CLIFF


def test_drop_that_was_not_seen_is_a_frontier():
    states = flat()
    states[40:, :, : BELOW + 1] = UNKNOWN
    terrain = terrain_of(states, pose(1.6, 2.4))
    assert drawn(terrain, 30, 36, 42) == "....?  "
    assert not (terrain.label == CLIFF).any()


def drivable_crest():
    """A floor that ends at x = 3.2, and a beam over its edge that falls 20 degrees."""
    states = flat()
    for column in range(40, 60):
        seen = BELOW + 1 - int((column - 39) * math.tan(math.radians(20.0)))
        states[column, :, :] = UNKNOWN
        states[column, :, seen:] = FREE
    return states


def test_view_over_a_drivable_crest_is_a_potential_cliff_and_no_cliff():
    terrain = terrain_of(drivable_crest(), pose(1.6, 2.4))
    assert label_at(terrain, 3.24, 2.4, 0.04) == POTENTIAL_CLIFF
    assert not (terrain.label == CLIFF).any()


def test_view_over_a_drivable_crest_is_a_cliff_where_unseen_drops_are_assumed():
    terrain = terrain_of(drivable_crest(), pose(1.6, 2.4), cliff_evidence="assumed")
    assert label_at(terrain, 3.16, 2.4, 0.04) == CLIFF
    assert label_at(terrain, 3.24, 2.4, 0.04) != FRONTIER


def test_tunnel_seen_from_below_does_not_make_the_unseen_floor_above_it_a_cliff():
    states = grid_of_heights(lambda x, y: np.where(x < 3.2, 1.64, np.nan) + 0 * y, 60, 60, top_m=5.0)
    states[:, :, BELOW] = OCCUPIED
    states[:, :, BELOW + 1 : BELOW + 18] = FREE  # the hall below
    states[40:, :, BELOW + 18] = OCCUPIED  # its ceiling, the floor above it unknown
    states[40:, :, BELOW + 19 :] = UNKNOWN
    states[40:, :, BELOW + 22 :] = FREE
    states[40:, :, BELOW + 18] = UNKNOWN
    terrain = terrain_of(states, pose(1.6, 2.4, ground=1.6))
    assert label_at(terrain, 3.24, 2.4, 1.64) == FRONTIER
    assert not (terrain.label == CLIFF).any()


@pytest.mark.parametrize("degrees", [10, 15, 20])
def test_ramp_is_traversable_up_to_the_plateau(degrees):
    length = 1.2 / math.tan(math.radians(degrees))
    nx = int((2.0 + length + 2.0) / RESOLUTION)
    terrain = terrain_of(grid_of_heights(ramp(degrees), nx, 40), pose(1.0, 1.6))
    assert label_at(terrain, 2.0 + length + 1.0, 1.6, 1.24) == TRAVERSABLE
    assert (terrain.label == OBSTACLE).sum() == 0


@pytest.mark.parametrize("degrees", [32, 35, 40, 50])
def test_ramp_that_is_too_steep_is_an_obstacle(degrees):
    length = 1.2 / math.tan(math.radians(degrees))
    nx = int((2.0 + length + 2.0) / RESOLUTION)
    terrain = terrain_of(grid_of_heights(ramp(degrees), nx, 40), pose(1.0, 1.6))
    assert label_at(terrain, 2.0 + length + 1.0, 1.6, 1.24) is None
    assert (terrain.label == OBSTACLE).any()


@pytest.mark.parametrize("offset", np.arange(0.0, 0.08, 0.016))
@pytest.mark.parametrize("degrees", [20, 35])
def test_slope_is_judged_alike_wherever_the_voxel_layers_lie(degrees, offset):
    rise = ramp(degrees)
    terrain = terrain_of(grid_of_heights(lambda x, y: rise(x, y) + offset, 110, 30), pose(1.0, 1.2, ground=offset))
    top = label_at(terrain, 7.0, 1.2, 1.24 + offset)
    assert top == (TRAVERSABLE if degrees == 20 else None)


@pytest.mark.parametrize("height, drivable", [(0.08, True), (0.18, False), (0.30, False)])
def test_kerb_is_an_obstacle_from_below_and_a_cliff_from_above(height, drivable):
    states = grid_of_heights(lambda x, y: np.where(x < 3.2, 0.04, 0.04 + height) + 0 * y, 80, 60)
    below, above = terrain_of(states, pose(1.6, 2.4)), terrain_of(states, pose(5.0, 2.4, ground=height))
    assert (label_at(below, 5.0, 2.4, 0.04 + height) == TRAVERSABLE) == drivable
    assert (label_at(above, 1.6, 2.4, 0.04) == TRAVERSABLE) == drivable
    assert (below.label == OBSTACLE).any() != drivable
    assert (above.label == CLIFF).any() != drivable


def test_low_ceiling_is_an_obstacle_and_a_high_one_is_not():
    for height, expected in ((0.9, OBSTACLE), (1.6, TRAVERSABLE)):
        states = flat(90)
        states[40:, :, BELOW + int(height / RESOLUTION)] = OCCUPIED
        terrain = terrain_of(states, pose(1.6, 2.4))
        assert label_at(terrain, 3.24, 2.4, 0.04) == expected


def test_bridge_is_driven_over_and_under():
    states = flat(90, 90)
    deck = BELOW + 20
    states[30:60, :, deck] = OCCUPIED
    states[30:60, :, deck + 1 :] = FREE
    under = terrain_of(states, pose(1.0, 3.6))
    over = terrain_of(states, pose(3.6, 3.6, ground=20 * RESOLUTION))
    assert label_at(under, 3.6, 3.6, 0.04) == TRAVERSABLE
    assert label_at(under, 3.6, 3.6, 1.64) is None
    assert label_at(over, 3.6, 3.6, 1.64) == TRAVERSABLE
    assert label_at(over, 3.6, 3.6, 0.04) is None
    assert label_at(over, 30.5 * RESOLUTION, 3.6, 1.64) == CLIFF


@pytest.mark.parametrize("gap", [1, 2, 3])
def test_lines_that_were_not_seen_are_bridged(gap):
    states = flat()
    for first in (34, 42):
        states[first : first + gap, :, : BELOW + 1] = UNKNOWN
    terrain = terrain_of(states, pose(1.6, 2.4))
    assert label_at(terrain, 4.4, 2.4, 0.04) == TRAVERSABLE
    assert assumed(terrain, states).sum() == 2 * gap * 60
    assert not (terrain.label == CLIFF).any()


@pytest.mark.parametrize("turns", range(4))
def test_floor_bridged_over_the_top_of_a_wall_below_it_is_no_obstacle(turns):
    """The head of a ramp: its voxel over the deck's front wall was not hit, the wall three voxels below it was (ramp, seed 4)."""
    states = flat()
    states[30:, :, BELOW], states[30:, :, BELOW + 1] = UNKNOWN, OCCUPIED
    states[30, 30, : BELOW - 1], states[30, 30, BELOW - 1 : BELOW + 1], states[30, 30, BELOW + 1 :] = OCCUPIED, UNKNOWN, FREE
    states = np.rot90(states, turns)
    terrain = terrain_of(states, pose(2.4, 2.4))
    assert not np.isin(terrain.label, (OBSTACLE, CLIFF, INFLATION)).any()
    assert np.count_nonzero(assumed(terrain, states) & (terrain.label == TRAVERSABLE)) == 1


@pytest.mark.parametrize("size", [(1, 1), (2, 1), (3, 2)])
def test_pit_that_was_seen_and_is_too_deep_for_a_step_is_a_cliff_all_around(size):
    states, (nx, ny) = flat(), size
    states[40 : 40 + nx, 30 : 30 + ny, BELOW - 1 : BELOW + 1] = FREE
    states[40 : 40 + nx, 30 : 30 + ny, BELOW - 2] = OCCUPIED
    terrain = terrain_of(states, pose(1.6, 2.4))
    cliffs = {(x, y) for x, y, _, label in label_set(terrain) if label == CLIFF}
    along_x, along_y = range(40, 40 + nx), range(30, 30 + ny)
    assert cliffs == {(x, y) for x in along_x for y in (29, 30 + ny)} | {(x, y) for x in (39, 40 + nx) for y in along_y}


def test_missing_plate_of_a_metre_is_not_bridged():
    states = flat()
    states[34:47, 20:33, : BELOW + 1] = UNKNOWN
    terrain = terrain_of(states, pose(1.6, 2.4))
    assert not assumed(terrain, states).any()
    assert label_at(terrain, 40.5 * RESOLUTION, 26.5 * RESOLUTION, 0.04) is None
    assert label_at(terrain, 34.5 * RESOLUTION, 26.5 * RESOLUTION, 0.04) == FRONTIER


def test_hole_below_space_that_was_not_seen_is_not_bridged():
    states = flat()
    states[34:36, 26:28, : BELOW + 1] = UNKNOWN
    states[42:44, 26:28] = UNKNOWN
    terrain = terrain_of(states, pose(1.6, 2.4))
    assert set(terrain.ix[assumed(terrain, states)].tolist()) == {34, 35}


def test_ditch_that_was_seen_is_not_bridged():
    states = flat()
    states[40:42, :, 1 : BELOW + 1] = FREE
    states[40:42, :, 0] = OCCUPIED
    terrain = terrain_of(states, pose(1.6, 2.4))
    assert not assumed(terrain, states).any()
    assert label_at(terrain, 39.5 * RESOLUTION, 2.4, 0.04) == CLIFF


def test_floor_that_alternates_between_layers_stays_traversable():
    random = np.random.default_rng(5)
    states = grid_of_heights(lambda x, y: 0.079 + 0.012 * random.standard_normal((x.size, y.size)), 60, 60)
    terrain = terrain_of(states, pose(2.4, 2.4))
    assert (terrain.label == TRAVERSABLE).sum() == 60 * 60


def test_ramp_too_narrow_to_turn_on_is_inflated_away_and_a_wide_one_is_not():
    for half_width, expected in ((0.5, INFLATION), (1.2, TRAVERSABLE)):
        rise = ramp(20)
        states = grid_of_heights(lambda x, y, w=half_width, r=rise: np.where(abs(y - 2.4) < w, r(x, y), 0.04), 70, 60)
        terrain = terrain_of(states, pose(1.0, 2.4))
        assert label_at(terrain, 4.0, 2.4, 0.04 + 2.0 * math.tan(math.radians(20))) == expected


def wall_behind(strip):
    states = flat()
    states[strip, :, : BELOW + 8] = UNKNOWN
    states[40, :, BELOW:] = OCCUPIED
    return terrain_of(states, pose(1.6, 2.4))


def test_wall_behind_a_strip_that_was_not_seen_still_inflates():
    terrain = wall_behind(np.s_[36:40])
    assert drawn(terrain, 30, 30, 40) == "...ooo?   #"


def test_strip_that_was_not_seen_right_before_a_wall_is_a_side_of_it():
    terrain = wall_behind(np.s_[38:40])
    assert drawn(terrain, 30, 30, 40) == ".ooooooo# #"
    assert label_at(terrain, 38.5 * RESOLUTION, 2.4, 0.04) == TerrainClass.OBSTACLE


def test_floor_above_which_nothing_was_seen_anywhere_is_floor():
    states = flat()
    states[40, :, BELOW:] = OCCUPIED
    states[states == FREE] = UNKNOWN  # as in the map of a cloud
    assert drawn(terrain_of(states, pose(1.6, 2.4)), 30, 30, 40) == "...ooooooo#"


def test_local_classification_equals_the_whole_inside_its_radius():
    states = flat(120, 120)
    states[70, 20:100, BELOW:] = OCCUPIED
    states[20:40, 90, : BELOW + 1] = FREE
    here = pose(4.0, 4.0)
    local, whole = terrain_of(states, here, 3.0), terrain_of(states, here)

    def inside(terrain):
        distance = np.hypot(*(terrain.centers()[:, :2] - np.array([4.0, 4.0])).T)
        return {n for n, d in zip(zip(*label_arrays(terrain), strict=True), distance, strict=True) if d <= 2.9}

    def label_arrays(terrain):
        return terrain.ix.tolist(), terrain.iy.tolist(), terrain.z.tolist(), terrain.label.tolist()

    assert inside(local) == inside(whole)


def test_edge_of_the_radius_is_no_frontier():
    terrain = terrain_of(flat(120, 120), pose(4.8, 4.8), 2.0)
    assert not (terrain.label == FRONTIER).any()
    assert not (terrain.label == CLIFF).any()


def test_start_in_the_inflation_departs_from_the_nearest_open_ground():
    states = flat()
    states[40, :, BELOW:] = OCCUPIED
    terrain = terrain_of(states, pose(37.5 * RESOLUTION, 2.4))
    assert terrain.label[terrain.start] == INFLATION
    assert terrain.label[terrain.departure] == TRAVERSABLE
    assert terrain.ix[terrain.departure] == 32


def test_start_skips_a_candidate_with_too_little_ground():
    states = flat()
    states[28:33, 28:33, BELOW + 3] = OCCUPIED  # a crate of 0.24 m beneath the robot, lower than the tolerance
    terrain = terrain_of(states, pose(30.5 * RESOLUTION, 30.5 * RESOLUTION))
    assert terrain.start is not None and terrain.z[terrain.start] == 0


def test_no_ground_beneath_the_robot_gives_no_start():
    terrain = terrain_of(flat(), pose(2.4, 2.4, ground=1.0))
    assert terrain.start is None and terrain.departure is None and terrain.label.size == 0


def test_robot_outside_the_map_and_empty_map_give_no_start():
    assert terrain_of(flat(), pose(50.0, -20.0), 6.0).start is None
    assert terrain_of(np.zeros((0, 0, 3), np.uint8), pose(0.0, 0.0)).start is None


@pytest.mark.parametrize("radius", [0.0, -1.0, math.nan])
def test_radius_that_is_not_positive_is_refused(radius):
    with pytest.raises(ValueError, match="radius_m"):
        classify(runs_of(flat()), pose(1, 1), TerrainConfig(), RobotBody(), radius)


def test_pose_that_is_not_rigid_is_refused():
    with pytest.raises(ValueError, match="rigid"):
        classify(runs_of(flat()), np.ones((4, 4)), TerrainConfig(), RobotBody(), None)


def _rough(seed):
    random = np.random.default_rng(seed)
    states = grid_of_heights(lambda x, y: 0.2 * np.sin(x) * np.cos(1.3 * y) + 0.09, 72, 72)
    for _ in range(6):
        ix, iy = random.integers(5, 66, 2)
        states[ix : ix + 3, iy : iy + 2, BELOW : BELOW + 12] = OCCUPIED
    for _ in range(40):
        ix, iy = random.integers(0, 72, 2)
        states[ix : ix + random.integers(1, 5), iy : iy + random.integers(1, 5), : BELOW + 3] = UNKNOWN
    states[:12, 40:50, : BELOW + 6] = FREE
    states[30:40, 30:40] = flat()[:10, :10]
    return states


@pytest.mark.parametrize("seed", range(4))
def test_labels_turn_and_mirror_with_the_world(seed):
    states, n = _rough(seed), 72
    middle = n * RESOLUTION / 2 + 0.001
    reference = {(x, y, z, c) for x, y, z, c in label_set(terrain_of(states, pose(middle, middle), min_ground_voxels=1))}
    assert len({c for *_, c in reference}) == 5
    quarter = terrain_of(np.rot90(states).copy(), pose(middle, middle), min_ground_voxels=1)
    mirrored = terrain_of(states[::-1].copy(), pose(middle, middle), min_ground_voxels=1)
    assert {(y, n - 1 - x, z, c) for x, y, z, c in label_set(quarter)} == reference
    assert {(n - 1 - x, y, z, c) for x, y, z, c in label_set(mirrored)} == reference


def test_labels_move_with_the_world():
    states = _rough(1)
    from octomap_server_3dnav.octree.column_runs import ColumnRuns

    moved = ColumnRuns.from_dense(states, (-500, 300, -BELOW + 40), RESOLUTION)
    here = pose(2.88, 2.88)
    there = pose(2.88 - 500 * RESOLUTION, 2.88 + 300 * RESOLUTION, ground=40 * RESOLUTION)
    expected = {(x - 500, y + 300, z + 40, c) for x, y, z, c in label_set(terrain_of(states, here))}
    assert label_set(classify(moved, there, TerrainConfig(), RobotBody(), None)) == expected


def test_graph_edges_are_mutual_and_join_neighbouring_columns_within_a_step():
    terrain = terrain_of(_rough(2), pose(2.88, 2.88))
    for direction, (dx, dy) in enumerate(((1, 0), (0, 1), (-1, 0), (0, -1))):
        a = np.flatnonzero((terrain.neighbours[:, direction] >= 0) & (terrain.label != FRONTIER))
        b = terrain.neighbours[a, direction]
        assert (terrain.neighbours[b, (direction + 2) % 4] == a).all()
        assert (terrain.ix[b] - terrain.ix[a] == dx).all() and (terrain.iy[b] - terrain.iy[a] == dy).all()
        assert (abs(terrain.z[b].astype(int) - terrain.z[a]) <= 2).all()


def test_configuration_lists_its_violations():
    assert TerrainConfig().validate() == []
    assert len(TerrainConfig(margin_m=-1.0, inflation_shape="star").validate()) == 2


def test_underside_of_a_deck_is_no_surface_and_its_unseen_top_is_a_frontier():
    states = flat(90)
    deck = BELOW + 20
    states[30:, :, deck] = OCCUPIED
    states[30:60, :, deck + 1 :] = FREE  # seen from above
    states[60:, :, deck] = UNKNOWN
    states[60:, :, deck + 1 :] = UNKNOWN
    states[60:, :, deck - 2] = OCCUPIED  # seen from below, two voxels lower
    states[60:, :, deck - 1] = UNKNOWN
    terrain = terrain_of(states, pose(3.6, 2.4, ground=20 * RESOLUTION))
    assert label_at(terrain, 60.5 * RESOLUTION, 2.4, 1.64) == FRONTIER
    assert label_at(terrain, 59.5 * RESOLUTION, 2.4, 1.64) == TRAVERSABLE


def test_gap_before_ground_that_nothing_else_leads_to_is_a_frontier():
    states = flat()
    states[40:44, :, : BELOW + 1] = UNKNOWN
    terrain = terrain_of(states, pose(1.6, 2.4))
    assert drawn(terrain, 30, 38, 45) == "..?     "


def thin_deck(top_rows, thickness=2, nx=90, ny=60):
    """A hall and a deck over its half x >= 30, its underside seen from below everywhere, its top only in the columns of `top_rows`."""
    states = flat(nx, ny)
    top = BELOW + 20
    states[:30, :, top], states[:30, :, top + 1 :], states[:30, :, :top] = OCCUPIED, FREE, UNKNOWN
    states[30:, :, top - thickness] = OCCUPIED
    states[30:, :, top - thickness + 1 : top + 1] = UNKNOWN
    states[30:, :, top + 1 :] = FREE
    if thickness > 2:
        states[30:, 3::7, top - thickness + 1] = OCCUPIED  # the noise of the beams from below
        states[30:, 3::7, top] = FREE  # flat beams on their way to the next line
    states[list(top_rows), :, top] = OCCUPIED
    return states


def on_deck(states):
    return terrain_of(states, pose(1.6, 2.4, ground=20 * RESOLUTION))


@pytest.mark.parametrize("thickness", [1, 2, 3])
def test_grazing_lines_on_a_thin_deck_are_bridged_over_the_undersides_between_them(thickness):
    terrain = on_deck(thin_deck(range(31, 90, 3), thickness))
    assert drawn(terrain, 30, 28, 92) == "." * 61 + "?   "
    assert not ((terrain.label == OBSTACLE) | (terrain.label == CLIFF) | (terrain.label == INFLATION)).any()


@pytest.mark.parametrize("height", [1, 2, 18])
def test_wall_below_a_deck_whose_top_was_not_seen_is_a_frontier_and_no_cliff(height):
    states, top = flat(60), BELOW + 20
    states[:30, :, :top], states[:30, :, top] = UNKNOWN, OCCUPIED
    states[30:, :, : top + 1] = UNKNOWN
    states[30:33, :, top - 1 - height : top - 1] = OCCUPIED  # seen from below, its upper two layers not at all
    terrain = on_deck(states)
    assert drawn(terrain, 30, 26, 33) == "....?   "
    assert not ((terrain.label == OBSTACLE) | (terrain.label == CLIFF)).any()


def test_step_down_whose_foot_was_seen_from_above_stays_a_cliff():
    states, top = flat(60), BELOW + 20
    states[:30, :, :top], states[:30, :, top] = UNKNOWN, OCCUPIED
    states[30:, :, top - 2], states[30:, :, top - 1 :] = OCCUPIED, FREE
    assert label_at(on_deck(states), 29.5 * RESOLUTION, 2.4, 1.64) == CLIFF


@pytest.mark.parametrize("thickness", [1, 2, 3])
def test_grazing_lines_too_far_apart_on_a_thin_deck_end_in_a_frontier(thickness):
    terrain = on_deck(thin_deck([*range(31, 50, 3), *range(58, 90, 8)], thickness))
    assert drawn(terrain, 30, 46, 60) == "." * 4 + "?" + " " * 10
    assert not ((terrain.label == OBSTACLE) | (terrain.label == CLIFF) | (terrain.label == INFLATION)).any()


def test_box_on_a_deck_seen_in_grazing_lines_is_an_obstacle():
    states = thin_deck(range(31, 90, 3))
    states[60:64, 28:34, BELOW + 20 : BELOW + 24] = OCCUPIED
    assert label_at(on_deck(states), 60.5 * RESOLUTION, 30.5 * RESOLUTION, 1.64, reach=0.4) == OBSTACLE


def test_edge_of_a_deck_seen_in_grazing_lines_is_a_cliff():
    states = thin_deck(range(31, 70, 3))
    states[68:, :, BELOW + 1 :] = FREE
    terrain = on_deck(states)
    assert label_at(terrain, 67.5 * RESOLUTION, 2.4, 1.64) == CLIFF
    assert not (terrain.label == FRONTIER).any() or terrain.ix[terrain.label == FRONTIER].max() < 68


def test_floor_that_flat_beams_left_one_unknown_voxel_above_is_a_surface():
    states = flat()
    states[20:40:2, :, BELOW + 1] = UNKNOWN
    assert (terrain_of(states, pose(0.8, 2.4)).label == TRAVERSABLE).sum() == 60 * 60


@pytest.mark.parametrize("degrees", [0, 8, 15, 25])
def test_slope_near_a_point_is_that_of_the_ground(degrees):
    terrain = terrain_of(grid_of_heights(ramp(degrees), 60, 40), pose(1.0, 1.6), robot=replace(RobotBody(), max_slope_rad=0.6))
    height = (3.5 - 2.0) * math.tan(math.radians(degrees))
    assert terrain.slope_near((3.5, 1.6, min(height, 1.2))) == pytest.approx(math.radians(degrees), abs=math.radians(2.0))
    assert terrain.slope_near((3.5, 1.6, 5.0)) is None
