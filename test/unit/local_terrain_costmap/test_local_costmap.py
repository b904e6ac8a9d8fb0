"""The rolling window and its three layers, put together: what a follower may rely on."""

import math
from dataclasses import replace

import numpy as np
import pytest
from costs import cost_at
from hypothesis import given, settings
from hypothesis import strategies as st

from local_terrain_costmap import FREE, INSCRIBED, LETHAL, NO_INFORMATION, CostmapConfig, LocalCostmap
from robot_body import RobotBody

PICTURE = """
?....?
..#...
......
"""
POINT = replace(RobotBody(), width_m=0.0)  # whose middle alone can touch
VALUE_OF = {"#": 100, ".": 0, "?": -1}


def grid(picture: str) -> np.ndarray:
    """A picture with y upwards as the (ny, nx) array with row 0 at the bottom."""
    return np.array([[VALUE_OF[c] for c in line] for line in reversed(picture.split())], dtype=np.int8)


def bare(**changes: float) -> CostmapConfig:
    """Ten cells of 0.1 m and no inflation, so that layers show as they are."""
    values = {"size_m": 1.0, "resolution_m": 0.1, "inflation_radius_m": 0.0} | changes
    return CostmapConfig(**values)


def at(costmap: LocalCostmap, *points: tuple[float, float]) -> list[int]:
    return [cost_at(costmap.master(), *point) for point in points]


NOTHING = np.empty((0, 2))


def test_new_costmap_knows_nothing():
    assert (LocalCostmap(CostmapConfig(), RobotBody()).master().cost == NO_INFORMATION).all()


def test_terrain_shows_where_it_lies():
    costmap = LocalCostmap(bare(), POINT)
    costmap.set_terrain(grid(PICTURE), (-0.3, -0.1), 0.1)
    view = costmap.master()
    row, column = round((-0.1 - view.origin_xy[1]) / 0.1), round((-0.3 - view.origin_xy[0]) / 0.1)
    expected = np.select([grid(PICTURE) == 100, grid(PICTURE) == 0], [LETHAL, FREE], NO_INFORMATION)
    np.testing.assert_array_equal(view.cost[row : row + 3, column : column + 6], expected)
    assert (view.cost == NO_INFORMATION).sum() == 100 - 16


def test_terrain_that_left_the_window_is_there_when_the_robot_comes_back():
    costmap = LocalCostmap(bare(), POINT)
    costmap.set_terrain(grid(PICTURE), (-0.3, -0.1), 0.1)
    before = costmap.master().cost.copy()
    costmap.recenter(5.0, 5.0)
    assert (costmap.master().cost == NO_INFORMATION).all()
    costmap.recenter(0.0, 0.0)
    np.testing.assert_array_equal(costmap.master().cost, before)


def test_newer_terrain_replaces_the_older_one():
    costmap = LocalCostmap(bare(), POINT)
    costmap.set_terrain(np.full((10, 10), 100), (-0.5, -0.5), 0.1)
    costmap.set_terrain(np.zeros((2, 2)), (0.0, 0.0), 0.1)
    assert at(costmap, (0.05, 0.05), (-0.25, -0.25)) == [FREE, NO_INFORMATION]


@pytest.mark.parametrize("resolution", [0.04, 0.08, 0.3])
def test_no_barrier_is_lost_when_resolutions_differ(resolution):
    cost = np.zeros((20, 20), dtype=np.int8)
    cost[7, 11] = 100
    costmap = LocalCostmap(bare(size_m=3.0), POINT)
    costmap.set_terrain(cost, (-10 * resolution, -10 * resolution), resolution)
    assert at(costmap, (1.5 * resolution, -2.5 * resolution)) == [LETHAL]


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.floats(-3, 3), st.floats(-3, 3)), min_size=1, max_size=5))
def test_marks_stay_on_their_ground_while_the_window_moves(path):
    costmap = LocalCostmap(bare(size_m=10.0), POINT)
    hit = np.array([[0.55, 0.25]])
    costmap.add_scan(hit, NOTHING, (0.0, 0.0))
    for x, y in path:
        costmap.recenter(x, y)
    view = costmap.master()
    assert cost_at(view, *hit[0]) == LETHAL
    assert (view.cost == LETHAL).sum() == 1


@given(st.floats(-50, 50), st.floats(-50, 50))
def test_window_is_aligned_and_holds_the_robot_in_its_middle(x, y):
    costmap = LocalCostmap(CostmapConfig(), RobotBody())
    costmap.recenter(x, y)
    view = costmap.master()
    for origin, position in zip(view.origin_xy, (x, y), strict=True):
        assert abs(origin / 0.08 - round(origin / 0.08)) < 1e-6
        assert abs(position - origin - 3.0) <= 0.08 + 1e-9


def test_beam_clears_what_it_passes_and_marks_what_it_hits():
    costmap = LocalCostmap(bare(size_m=4.0), POINT)
    costmap.set_terrain(np.zeros((40, 40)), (-2.0, -2.0), 0.1)
    costmap.add_scan([[0.55, 0.05], [1.05, 0.05]], NOTHING, (0.05, 0.05))
    assert at(costmap, (0.55, 0.05), (1.05, 0.05)) == [LETHAL, LETHAL]
    costmap.add_scan([[1.05, 0.05]], NOTHING, (0.05, 0.05))
    assert at(costmap, (0.55, 0.05), (1.05, 0.05)) == [FREE, LETHAL]
    costmap.add_scan(NOTHING, [[1.95, 0.05]], (0.05, 0.05))
    assert at(costmap, (1.05, 0.05)) == [FREE]


def test_beam_without_a_measurement_changes_nothing():
    costmap = LocalCostmap(bare(size_m=4.0), POINT)
    costmap.add_scan([[0.55, 0.05]], NOTHING, (0.05, 0.05))
    before = costmap.master()
    costmap.add_scan([[math.nan, 0.05]], [[math.nan, math.nan]], (0.05, 0.05))
    assert costmap.master() is before


def test_free_beam_does_not_make_unknown_ground_free():
    costmap = LocalCostmap(bare(size_m=4.0), POINT)
    costmap.add_scan(NOTHING, [[1.5, 0.0]], (0.0, 0.0))
    assert at(costmap, (0.5, 0.0)) == [NO_INFORMATION]


def test_free_beam_does_not_clear_a_terrain_obstacle():
    costmap = LocalCostmap(bare(), POINT)
    costmap.set_terrain(grid(PICTURE), (-0.3, -0.1), 0.1)
    costmap.add_scan(NOTHING, [[-0.05, 0.45]], (-0.05, -0.45))
    assert at(costmap, (-0.05, 0.05)) == [LETHAL]


def test_hit_beyond_the_short_range_marks_nothing():
    costmap = LocalCostmap(bare(size_m=8.0), POINT)
    costmap.add_scan([[2.45, 0.05], [0.05, 2.65]], NOTHING, (0.0, 0.0))
    assert at(costmap, (2.45, 0.05), (0.05, 2.65)) == [LETHAL, NO_INFORMATION]


def test_hit_on_known_ramp_is_no_obstacle_but_a_box_on_it_is():
    costmap = LocalCostmap(bare(size_m=4.0), POINT)
    ramp = np.tile(np.linspace(0.0, 1.0, 40, dtype=np.float32), (40, 1))
    costmap.set_terrain(np.zeros((40, 40)), (-2.0, -2.0), 0.1, ramp)
    ground = ramp[0, 35]
    hits = [[1.55, 0.05], [1.55, 0.55], [1.55, -0.55], [1.55, 1.05]]
    costmap.add_scan(hits, NOTHING, (0.0, 0.0), [ground + 0.1, ground + 0.6, ground - 0.6, ground + 1.5])
    assert at(costmap, *map(tuple, hits)) == [FREE, LETHAL, LETHAL, FREE]


def test_ramp_that_was_marked_before_it_was_known_is_taken_back():
    costmap = LocalCostmap(bare(size_m=4.0), POINT)
    costmap.add_scan([[0.55, 0.05], [0.55, 0.95]], NOTHING, (0.0, 0.0), [0.9, 0.9])
    height = np.full((40, 40), 0.85, dtype=np.float32)
    height[25:] = 0.0
    costmap.set_terrain(np.zeros((40, 40)), (-2.0, -2.0), 0.1, height)
    assert at(costmap, (0.55, 0.05), (0.55, 0.95)) == [FREE, LETHAL]


def test_mark_without_height_is_kept_on_known_ground():
    costmap = LocalCostmap(bare(size_m=4.0), POINT)
    costmap.add_scan([[0.55, 0.05]], NOTHING, (0.0, 0.0))
    costmap.set_terrain(np.zeros((40, 40)), (-2.0, -2.0), 0.1, np.zeros((40, 40)))
    assert at(costmap, (0.55, 0.05)) == [LETHAL]


def test_clear_obstacles_leaves_the_terrain():
    costmap = LocalCostmap(bare(), POINT)
    costmap.set_terrain(grid(PICTURE), (-0.3, -0.1), 0.1)
    costmap.add_scan([[0.25, 0.05]], NOTHING, (0.0, 0.0))
    costmap.clear_obstacles()
    assert at(costmap, (0.25, 0.15), (-0.05, 0.05)) == [NO_INFORMATION, LETHAL]


def test_master_is_computed_again_only_after_a_change():
    costmap = LocalCostmap(CostmapConfig(), RobotBody())
    first = costmap.master()
    costmap.recenter(0.01, 0.01)
    costmap.add_scan(NOTHING, [[1.0, 0.0]], (0.0, 0.0))
    assert costmap.master() is first
    costmap.add_scan([[1.0, 0.0]], NOTHING, (0.0, 0.0))
    assert costmap.master() is not first


def test_wall_is_inflated_to_the_inscribed_radius_in_free_and_unknown_ground():
    costmap = LocalCostmap(CostmapConfig(size_m=4.0, resolution_m=0.05), RobotBody())
    terrain = np.zeros((80, 80), dtype=np.int8)
    terrain[:, 60] = 100
    terrain[:, 61:] = -1
    costmap.set_terrain(terrain, (-2.0, -2.0), 0.05)
    row = costmap.master().cost[40]
    assert row[60] == LETHAL
    assert (row[54:60] == INSCRIBED).all() and (row[61:67] == INSCRIBED).all()
    assert (np.diff(row[42:54].astype(int)) >= 0).all() and 0 < row[50] < INSCRIBED
    assert row[41] == FREE and row[67] == NO_INFORMATION


def test_outside_the_window_nothing_is_known():
    costmap = LocalCostmap(bare(), POINT)
    costmap.set_terrain(np.zeros((10, 10)), (-0.5, -0.5), 0.1)
    assert at(costmap, (0.0, 0.0), (0.51, 0.0), (0.0, -7.0), (math.nan, 0.0)) == [FREE, 255, 255, 255]


@pytest.mark.parametrize(
    "call",
    [
        lambda c: c.set_terrain(np.full((3, 3), 7), (0.0, 0.0), 0.1),
        lambda c: c.set_terrain(np.zeros(3), (0.0, 0.0), 0.1),
        lambda c: c.set_terrain(np.zeros((3, 3)), (0.0, math.nan), 0.1),
        lambda c: c.set_terrain(np.zeros((3, 3)), (0.0, 0.0), 0.0),
        lambda c: c.set_terrain(np.zeros((3, 3)), (0.0, 0.0), 0.1, np.zeros((2, 3))),
        lambda c: c.set_terrain(np.zeros((3, 3)), (0.0, 0.0), 0.1, None, np.zeros((2, 3))),
        lambda c: c.set_terrain(np.zeros((3, 3)), (0.0, 0.0), 0.1, None, np.full((3, 3), -0.1)),
        lambda c: c.add_scan(np.zeros((3, 3)), NOTHING, (0.0, 0.0)),
        lambda c: c.add_scan(np.zeros((3, 2)), NOTHING, (0.0, 0.0), np.zeros(2)),
        lambda c: c.add_scan(NOTHING, NOTHING, (math.nan, 0.0)),
        lambda c: c.recenter(math.inf, 0.0),
    ],
)
def test_bad_input_is_refused_with_what_was_expected(call):
    with pytest.raises(ValueError, match=r"not|one of"):
        call(LocalCostmap(bare(), POINT))


def test_wrong_configuration_lists_every_violation():
    with pytest.raises(ValueError, match=r"obstacle_range_m.*inflation_radius_m"):
        LocalCostmap(CostmapConfig(obstacle_range_m=-1.0, inflation_radius_m=0.1), RobotBody())


def test_robot_touches_what_is_within_half_its_width():
    for width_m, within in ((0.4, 2), (0.8, 4)):
        costmap = LocalCostmap(CostmapConfig(size_m=4.0, resolution_m=0.1), replace(RobotBody(), width_m=width_m))
        costmap.set_terrain(np.where(np.eye(41) * (np.arange(41) == 20), 100, 0), (-2.05, -2.05), 0.1)
        row = costmap.master().cost[20]
        assert (row == INSCRIBED).sum() == 2 * within


def test_hit_above_the_robot_is_passed_under_by_a_lower_one_only():
    marked = []
    for height_m in (0.5, 1.0):
        costmap = LocalCostmap(bare(size_m=4.0), replace(POINT, height_m=height_m))
        costmap.set_terrain(np.zeros((40, 40)), (-2.0, -2.0), 0.1, np.zeros((40, 40)))
        costmap.add_scan([[1.05, 0.05]], NOTHING, (0.0, 0.0), [0.9])
        marked += at(costmap, (1.05, 0.05))
    assert marked == [FREE, LETHAL]


def test_robot_wider_than_the_inflation_is_refused():
    with pytest.raises(ValueError, match="inflation_radius_m = 0.3 is below half of the robot's width_m = 0.67"):
        LocalCostmap(CostmapConfig(inflation_radius_m=0.3), RobotBody())


def street_of_distances(resolution: float, offset: float) -> tuple[np.ndarray, np.ndarray]:
    """Ground before a wall in the last column that stands `offset` m before the middle of that, and the exact distances from it."""
    cost = np.zeros((20, 20), dtype=np.int8)
    cost[:, 19] = 100
    distance = np.tile((19 - np.arange(20)) * resolution - offset, (20, 1)).astype(np.float32)
    distance[:, 19] = 0.0
    return cost, distance


@pytest.mark.parametrize("offset, nearest_free", [(-0.04, 15), (0.0, 14), (0.04, 14)])
def test_ground_is_inscribed_by_its_exact_distance_not_by_the_middle_of_the_wall_s_cell(offset, nearest_free):
    cost, distance = street_of_distances(0.08, offset)
    costmap = LocalCostmap(CostmapConfig(size_m=3.2, resolution_m=0.08), RobotBody())
    costmap.set_terrain(cost, (-0.8, -0.8), 0.08, None, distance)
    row = costmap.master().cost[20, 10:30]
    assert row[19] == LETHAL and (row[nearest_free + 1 : 19] == INSCRIBED).all() and row[nearest_free] < INSCRIBED


def test_mark_inflates_ground_whose_terrain_is_far_from_anything():
    costmap = LocalCostmap(CostmapConfig(size_m=4.0, resolution_m=0.08), RobotBody())
    costmap.set_terrain(np.zeros((50, 50)), (-2.0, -2.0), 0.08, None, np.full((50, 50), np.inf))
    assert (costmap.master().cost == FREE).all()
    costmap.add_scan([[1.0, 0.04]], NOTHING, (0.04, 0.04))
    assert at(costmap, (1.0, 0.04), (1.0, 0.3), (1.0, 0.6), (-0.5, 0.04))[:2] == [LETHAL, INSCRIBED]
    assert 0 < at(costmap, (1.0, 0.6))[0] < INSCRIBED


def test_lethal_things_of_another_storey_beside_the_ground_do_not_inflate_it():
    cost = np.zeros((20, 20), dtype=np.int8)
    cost[:, 10] = 100
    costmap = LocalCostmap(CostmapConfig(size_m=3.2, resolution_m=0.08), RobotBody())
    costmap.set_terrain(cost, (-0.8, -0.8), 0.08, None, np.where(cost == 0, np.inf, 0.0))
    row = costmap.master().cost[20, 10:30]
    assert row[10] == LETHAL and row[9] == FREE and row[11] == FREE


@pytest.mark.parametrize("resolution", [0.05, 0.2])
def test_distance_on_another_raster_is_never_too_large(resolution):
    cost, distance = street_of_distances(0.08, 0.0)
    costmap = LocalCostmap(CostmapConfig(size_m=4.0, resolution_m=resolution, inflation_radius_m=0.3), replace(RobotBody(), width_m=0.6))
    costmap.set_terrain(cost, (-0.8, -0.8), 0.08, None, distance)
    wall_x = -0.8 + 19.5 * 0.08
    for x in np.arange(wall_x - 0.29, wall_x - 0.06, 0.02):
        column = math.floor((x + 2.0) / resolution)
        if wall_x - (-2.0 + (column + 0.5) * resolution) <= 0.3:
            assert at(costmap, (x, 0.01))[0] >= INSCRIBED


def test_what_nobody_saw_stays_unknown_beside_what_is_lethal():
    costmap = LocalCostmap(bare(inflation_radius_m=0.3), replace(POINT, width_m=0.2))
    costmap.set_terrain(grid("..#?.."), (-0.3, -0.1), 0.1)
    view = costmap.master()
    assert at(costmap, (0.05, -0.05)) == [INSCRIBED] and view.unknown is not None
    row = round((-0.1 - view.origin_xy[1]) / 0.1)
    assert view.unknown[row, 2:8].tolist() == [False, False, False, True, False, False]
