"""Reachable ground of hand-made worlds against areas found on paper (robot: 0.598 m to turn, 0.335 m body, 0.1 m cells)."""

import math

import numpy as np
import pytest
from hand_made_worlds import Mesh, box, join, plate, ramp, room, wall

from exploration_evaluation import RobotShape, reachable_ground

START = (2.0, 2.0, 0.132)
TURN_M = RobotShape().circumscribed_radius_m
SIDE_M = 4 - 2 * TURN_M  # of the places in a room of 4 x 4 m
BORDER_M2 = 0.02  # where nothing stands the end of the ground is found to half a centimetre, over 2.8 m


def test_flat_room_leaves_the_floor_without_a_margin_of_the_turning_radius():
    ground = reachable_ground(*room(4, 4), START)
    assert ground.area_m2 == pytest.approx(SIDE_M**2, abs=BORDER_M2)
    assert ground.cell_area_m2 == pytest.approx(0.01)
    # The body's circle reaches 0.335 m farther, round the corners.
    assert ground.covered_area_m2 == pytest.approx(SIDE_M**2 + 4 * SIDE_M * 0.335 + math.pi * 0.335**2, rel=0.005)


def test_covered_ground_includes_every_place_of_the_centre():
    ground = reachable_ground(*room(4, 4), START)
    covered = {tuple(p) for p in ground.covered_points.round(4)}
    assert len(ground.points) and all(tuple(p) in covered for p in ground.points.round(4))


@pytest.mark.parametrize("divider", [box((4.0, 0, 0), (4.2, 4, 2)), box((4.0, 0, -0.5), (4.2, 4, 2)), wall(4.0, 0, 4.0, 4)])
def test_wall_across_the_room_leaves_the_start_s_half(divider):
    assert reachable_ground(*join(room(8, 4), divider), START).area_m2 == pytest.approx(SIDE_M**2, abs=BORDER_M2)


def test_wall_with_a_wide_door_opens_the_other_half():
    wide = join(room(8, 4), wall(4, 0, 4, 1.2), wall(4, 2.8, 4, 4))
    both_halves_and_passage = 2 * SIDE_M**2 + 2 * TURN_M * 0.4
    assert reachable_ground(*wide, START).area_m2 == pytest.approx(both_halves_and_passage, abs=0.35)  # round door posts


def two_rooms(door_m: float, turned_rad: float = 0.0) -> Mesh:
    """Two rooms of 4 x 4 m beside each other with a door in the middle of the wall between them, turned about their first corner."""
    vertices, triangles = join(room(8, 4), wall(4, 0, 4, 2 - door_m / 2), wall(4, 2 + door_m / 2, 4, 4))
    c, s = math.cos(turned_rad), math.sin(turned_rad)
    return vertices @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]), triangles


@pytest.mark.parametrize("turned_rad", [0.0, 0.06, 0.3, math.pi / 4])
def test_room_behind_a_door_that_is_wider_than_the_robot_is_reached_straight(turned_rad):
    start = (2 * math.cos(turned_rad) - 2 * math.sin(turned_rad), 2 * math.sin(turned_rad) + 2 * math.cos(turned_rad), 0.132)
    ground = reachable_ground(*two_rooms(0.9, turned_rad), start)
    assert ground.area_m2 == pytest.approx(2 * SIDE_M**2, rel=0.03)
    assert ground.covered_area_m2 < ground.straight_area_m2


def test_room_behind_a_door_that_is_narrower_than_the_robot_is_not_reached():
    ground = reachable_ground(*two_rooms(0.64), START)
    assert ground.area_m2 == pytest.approx(SIDE_M**2, abs=0.25)
    assert ground.straight_points[:, 0].max() < 4.3  # a corner of the outline fits into it


def test_rooms_in_a_row_behind_narrow_doors_are_all_reached():
    doors = [wall(x, y0, x, y1) for x in (4, 8, 12) for y0, y1 in ((0, 1.55), (2.45, 4))]
    assert reachable_ground(*join(room(16, 4), *doors), START).area_m2 == pytest.approx(4 * SIDE_M**2, rel=0.03)


def test_platform_at_the_end_of_a_narrow_ramp_is_reached_and_the_ramp_counts_as_straight_ground():
    top = 4 * math.tan(math.radians(15))
    world = join(plate(0, 0, 4, 4), ramp(4, 1.5, 8, 2.5, 0, top), plate(8, 0, 12, 4, top))
    ground = reachable_ground(*world, START)
    assert ground.area_m2 == pytest.approx(2 * SIDE_M**2, rel=0.03)
    amid = (ground.straight_points[:, 0] > 5) & (ground.straight_points[:, 0] < 7)
    assert 2 * 0.85 < amid.sum() * 0.01 <= 2 * 1.0 + 1e-6  # lines lie a third of a cell apart, so that its rims may be left out
    assert not ((ground.covered_points[:, 0] > 5) & (ground.covered_points[:, 0] < 7)).any()


def test_dead_end_is_driven_into_straight_and_its_bend_is_not():
    # A corridor of 1 m along x from the room's middle, then along y.
    walls = join(wall(4, 1.5, 7, 1.5), wall(7, 1.5, 7, 6), wall(4, 2.5, 6, 2.5), wall(6, 2.5, 6, 6), wall(6, 6, 7, 6))
    open_room = join(plate(0, 0, 4, 4), wall(0, 0, 4, 0), wall(0, 4, 4, 4), wall(0, 0, 0, 4), wall(4, 0, 4, 1.5), wall(4, 2.5, 4, 4))
    ground = reachable_ground(*join(open_room, plate(4, 1.5, 7, 2.5), plate(6, 2.5, 7, 6), walls), START)
    assert ground.area_m2 == pytest.approx(SIDE_M**2, abs=0.25)
    assert ground.straight_points[:, 0].max() > 6.8
    assert ground.straight_points[:, 1].max() < 4.0


def test_wall_across_the_room_leaves_nothing_straight_behind_it():
    world = join(room(8, 4), wall(4.0, 0, 4.0, 4))
    assert reachable_ground(*world, START).straight_points[:, 0].max() < 4.0


def test_ramp_of_15_degrees_is_climbed_onto_the_upper_plate():
    top = 4 * math.tan(math.radians(15))
    ground = reachable_ground(*join(plate(0, 0, 4, 4), ramp(4, 0, 8, 4, 0, top), plate(8, 0, 12, 4, top)), START)
    assert ground.area_m2 == pytest.approx((12 - 2 * TURN_M) * SIDE_M, abs=BORDER_M2)
    assert ground.points[:, 2].max() == pytest.approx(top, abs=BORDER_M2)


LOW_STEPS = RobotShape(max_step_m=0.02)


@pytest.mark.parametrize("cell_m", [0.08, 0.10, 0.12])
@pytest.mark.parametrize("degrees", [15, -15, 24])
def test_robot_of_low_steps_drives_a_slope_that_rises_more_than_a_step_from_cell_to_cell(degrees, cell_m):
    top = 4 * math.tan(math.radians(degrees))
    ground = reachable_ground(*join(plate(0, 0, 4, 4), ramp(4, 0, 8, 4, 0, top), plate(8, 0, 12, 4, top)), START, LOW_STEPS, cell_m)
    assert ground.area_m2 == pytest.approx((12 - 2 * TURN_M) * SIDE_M, rel=0.02)


@pytest.mark.parametrize(("height", "reached"), [(0.02, True), (0.025, False), (0.04, False)])
def test_robot_of_low_steps_stops_at_a_step_between_floors_that_a_slope_would_climb(height, reached):
    ground = reachable_ground(*join(room(8, 4), box((4, 0, 0), (8, 4, height))), START, LOW_STEPS)
    assert ground.area_m2 == pytest.approx((8 - 2 * TURN_M) * SIDE_M if reached else SIDE_M**2, abs=BORDER_M2)


def test_narrow_ramp_is_driven_straight_by_a_robot_of_low_steps():
    top = 4 * math.tan(math.radians(20))
    world = join(plate(0, 0, 4, 4), ramp(4, 1.5, 8, 2.5, 0, top), plate(8, 0, 12, 4, top))
    assert reachable_ground(*world, START, LOW_STEPS).points[:, 0].max() > 9.0


def test_ramp_of_35_degrees_is_a_barrier():
    top = 4 * math.tan(math.radians(35))
    ground = reachable_ground(*join(plate(0, 0, 4, 4), ramp(4, 0, 8, 4, 0, top), plate(8, 0, 12, 4, top)), START)
    assert ground.area_m2 == pytest.approx(SIDE_M**2, abs=BORDER_M2)


@pytest.mark.parametrize(("height", "reached"), [(0.08, True), (0.14, False), (1.5, False)])
def test_plateau_is_reached_only_over_a_low_step(height, reached):
    ground = reachable_ground(*join(room(8, 4), box((4, 0, 0), (8, 4, height))), START)
    assert ground.area_m2 == pytest.approx((8 - 2 * TURN_M) * SIDE_M if reached else SIDE_M**2, abs=BORDER_M2)


def test_cliff_edges_keep_the_turning_radius_without_walls():
    assert reachable_ground(*plate(0, 0, 4, 4), START).area_m2 == pytest.approx(SIDE_M**2, abs=BORDER_M2)


def bridge_world(clearance=2.0):
    """A floor of 12 x 8 m crossed by a bridge 3 m wide at y 2.5..5.5, with a ramp up to it from x 2 to x 6."""
    return join(room(12, 8), ramp(2, 2.5, 6, 5.5, 0, 1.6), plate(6, 2.5, 12, 5.5, 1.6), plate(9, 6, 12, 8, clearance))


def test_bridge_counts_over_and_under():
    ground = reachable_ground(*bridge_world(), (1.0, 1.0, 0.132))
    x, y, z = ground.points.T
    deck = (x > 7) & (x < 11) & (abs(y - 4) < 1.5)
    assert (z[deck] > 1.5).sum() == pytest.approx(40 * 18)  # 3 m wide, 0.6 m from either edge
    assert (z[deck] < 0.1).sum() == pytest.approx(40 * 30)  # the floor beneath it, all of it
    assert not ((x > 2.7) & (x < 4) & (abs(y - 4) < 1.4) & (z < 0.1)).any()  # too low under the ramp's foot


def test_low_ceiling_takes_the_ground_beneath_it():
    high = reachable_ground(*join(room(4, 4), plate(0, 0, 4, 4, 1.2)), START)
    assert high.area_m2 == pytest.approx(SIDE_M**2, abs=BORDER_M2)
    with pytest.raises(ValueError, match="no ground"):
        reachable_ground(*join(room(4, 4), plate(0, 0, 4, 4, 1.0)), START)


def test_post_thinner_than_the_grid_is_seen():
    # Nothing of it lies on a line through cell centres.
    post = box((2.985, 2.985, 0), (3.015, 3.015, 1.5))
    ground = reachable_ground(*join(room(6, 6), post), (1, 1, 0.132))
    away = np.linalg.norm(ground.points[:, :2] - 3.0, axis=1)
    assert away.min() >= 0.6 - 0.03
    assert ground.area_m2 == pytest.approx(4.8 * 4.8 - math.pi * 0.615**2, abs=0.1)


def test_pebble_lower_than_a_step_is_driven_over():
    pebble = (
        np.array([[2, 2, 0], [2.1, 2, 0], [2, 2.1, 0], [1.9, 2, 0], [2, 1.9, 0], [2, 2, 0.06]]) + [0.55, 0.45, 0],
        np.array([[1, 2, 5], [2, 3, 5], [3, 4, 5], [4, 1, 5]]),
    )
    assert reachable_ground(*join(room(4, 4), pebble), START).area_m2 == pytest.approx(SIDE_M**2, abs=BORDER_M2)


def test_flank_that_hangs_over_ends_the_floor_where_it_begins():
    # The flank's first cells, at 3.45 m, lie higher above the floor than a step, and level with each other.
    flank = ramp(3.44, 0, 3.79, 4, 0.09, 1.09)
    ground = reachable_ground(*join(room(8, 4), flank), START, RobotShape(circumscribed_radius_m=0.57))
    assert ground.points[:, 0].max() == pytest.approx(2.85, abs=0.001)  # 0.59 m before the flank


def test_winding_does_not_matter():
    vertices, triangles = bridge_world()
    there = reachable_ground(vertices, triangles, (1, 1, 0.132))
    back = reachable_ground(vertices, triangles[:, ::-1].copy(), (1, 1, 0.132))
    np.testing.assert_allclose(there.points, back.points, atol=1e-5)


def test_world_moved_by_whole_cells_moves_the_ground():
    vertices, triangles = bridge_world()
    here = reachable_ground(vertices, triangles, (1, 1, 0.132))
    moved = reachable_ground(vertices + [-7.0, 3.0, 0.5], triangles, (-6, 4, 0.632))
    assert len(here.points) == len(moved.points)
    np.testing.assert_allclose(moved.points - [-7.0, 3.0, 0.5], here.points, atol=1e-4)


def test_world_turned_by_an_odd_angle_keeps_its_area_within_the_grid_s_error():
    vertices, triangles = room(6, 6)
    c, s = math.cos(0.4), math.sin(0.4)
    turned = vertices @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T
    start = np.array([3 * c - 3 * s, 3 * s + 3 * c, 0.132])
    assert reachable_ground(turned, triangles, start).area_m2 == pytest.approx(4.8 * 4.8, rel=0.02)


def test_larger_robot_reaches_less():
    small = reachable_ground(*bridge_world(), (1, 1, 0.132), RobotShape(circumscribed_radius_m=0.5))
    large = reachable_ground(*bridge_world(), (1, 1, 0.132), RobotShape(circumscribed_radius_m=0.9))
    assert large.area_m2 < small.area_m2


def test_start_near_a_wall_finds_room_beside_it_but_not_behind_it():
    world = join(room(8, 4), wall(4, 0, 4, 4))
    assert reachable_ground(*world, (3.8, 2, 0.132)).points[:, 0].max() < 4
    assert reachable_ground(*world, (4.2, 2, 0.132)).points[:, 0].min() > 4


def test_robot_whose_base_is_high_stands_on_its_ground():
    high = RobotShape(base_height_m=0.7, height_m=1.0, headroom_m=1.1)
    assert reachable_ground(*room(4, 4), (2, 2, 0.7), high).area_m2 == pytest.approx(SIDE_M**2, abs=BORDER_M2)
    with pytest.raises(ValueError, match="no ground"):
        reachable_ground(*room(4, 4), (2, 2, 0.7))


@pytest.mark.parametrize("start", [(20, 2, 0.1), (2, 2, 3.0), (2, 2, -1.0)])
def test_start_without_ground_is_refused(start):
    with pytest.raises(ValueError, match="no ground"):
        reachable_ground(*room(4, 4), start)


def test_start_in_a_cell_too_small_to_turn_is_refused():
    with pytest.raises(ValueError, match="no room"):
        reachable_ground(*room(1, 1), (0.5, 0.5, 0.132))


@pytest.mark.parametrize(
    ("vertices", "triangles", "text"),
    [
        (np.zeros((0, 3)), np.zeros((1, 3), int), "vertices"),
        (np.full((3, 3), np.nan), np.array([[0, 1, 2]]), "vertices"),
        (np.eye(3), np.zeros((0, 3), int), "triangles"),
        (np.eye(3), np.array([[0, 1, 3]]), "index"),
        (np.eye(3), np.array([[0.0, 1.0, 2.0]]), "triangles"),
        (np.eye(3) * 1e6, np.array([[0, 1, 2]]), "columns"),
    ],
)
def test_mesh_that_is_none_is_refused(vertices, triangles, text):
    with pytest.raises(ValueError, match=text):
        reachable_ground(vertices, triangles, START)


def tiles(gap_m: float, turned_rad: float = 0.0, depth_m: float = 1.3) -> Mesh:
    """A floor of 6 x 6 m of tiles of 1 m on a lower floor, with seams between them, turned about its middle."""
    half = 0.5 * gap_m
    parts = [box((x + half, y + half, -depth_m), (x + 1 - half, y + 1 - half, 0.0)) for x in range(6) for y in range(6)]
    vertices, triangles = join(*parts, plate(-2, -2, 8, 8, -depth_m))
    c, s = math.cos(turned_rad), math.sin(turned_rad)
    return (vertices - [3, 3, 0]) @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + [3, 3, 0], triangles


@pytest.mark.parametrize("cell_m", [0.08, 0.09, 0.10, 0.11, 0.12])
@pytest.mark.parametrize(("gap_m", "turned_rad"), [(0.036, 0.0), (0.045, 0.0), (0.036, 0.3)])
def test_seams_narrower_than_a_wheel_are_floor_at_every_size_of_cell(gap_m, turned_rad, cell_m):
    ground = reachable_ground(*tiles(gap_m, turned_rad), (3, 3, 0.132), cell_m=cell_m)
    assert ground.area_m2 == pytest.approx((6 - gap_m - 2 * TURN_M) ** 2, rel=0.02)
    assert np.abs(ground.points[:, 2]).max() < 0.01


@pytest.mark.parametrize("cell_m", [0.08, 0.10, 0.12])
def test_bottom_of_a_seam_is_no_ground_with_walls(cell_m):
    assert reachable_ground(*tiles(0.036, 0.0, 0.3), (3, 3, 0.132), cell_m=cell_m).area_m2 == pytest.approx(4.764**2, rel=0.02)


def test_trench_wider_than_a_wheel_is_an_end_of_the_ground():
    both_sides = join(plate(0, 0, 4, 4), plate(4.13, 0, 8, 4), plate(-2, -2, 10, 6, -1.3))
    assert reachable_ground(*both_sides, START).area_m2 == pytest.approx(SIDE_M**2, abs=BORDER_M2)


def test_thin_sheet_across_the_floor_is_no_seam():
    # Its top, 2 cm wide, lies under the rays of a row of columns.
    sheet = box((4.04, 0, -0.5), (4.06, 4, 0.4))
    assert reachable_ground(*join(room(8, 4), sheet), START).points[:, 0].max() < 4.0


@pytest.mark.parametrize("shift_m", [(0.0, 0.0), (0.025, 0.05), (0.05, 0.075)])
@pytest.mark.parametrize("cell_m", [0.08, 0.10, 0.12])
def test_areas_hardly_depend_on_size_and_place_of_the_grid(cell_m, shift_m):
    vertices, triangles = join(room(6, 4), box((3, 1, 0), (3.4, 1.5, 1)))
    offset = np.array([*shift_m, 0.0])
    ground = reachable_ground(vertices + offset, triangles, np.array(START) + offset, cell_m=cell_m)
    beside_the_box = 0.4 * 1.1 + 1.2 * 0.9 + (math.pi / 2) * 0.6**2  # between it and the wall at y = 0 there is no room to turn
    assert ground.area_m2 == pytest.approx(4.8 * 2.8 - beside_the_box, rel=0.02)


LOW_M = (0.15, 0.3, 0.45)


@pytest.mark.parametrize("height_m", LOW_M)
def test_low_sheet_between_the_rays_ends_the_ground(height_m):
    assert reachable_ground(*join(room(8, 4), wall(4.0, 0, 4.0, 4, height_m)), START).straight_points[:, 0].max() < 4.0


@pytest.mark.parametrize("height_m", LOW_M)
def test_low_post_thinner_than_the_grid_is_kept_away_from(height_m):
    ground = reachable_ground(*join(room(6, 6), box((2.985, 2.985, 0), (3.015, 3.015, height_m))), (1, 1, 0.132))
    assert np.linalg.norm(ground.points[:, :2] - 3.0, axis=1).min() >= 0.6 - 0.03


@pytest.mark.parametrize("underside_m", LOW_M)
def test_low_bar_across_the_room_ends_the_ground(underside_m):
    bar = box((3.96, -1, underside_m), (3.98, 5, underside_m + 0.02))  # between the rays, and its corners outside
    assert reachable_ground(*join(room(8, 4), bar), START).straight_points[:, 0].max() < 4.0
