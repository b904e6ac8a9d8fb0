"""Visible surface and completeness against areas and distances found on paper."""

import math

import numpy as np
import pytest
from hand_made import START as HAND_MADE_START
from hand_made import WORLD, hand_made_map
from hand_made_worlds import Mesh, box, join, plate, room

from exploration_evaluation import ReachableGround, reachable_ground
from exploration_evaluation.visible_surface import VisibilityConfig, VisibleSurface, completeness, visible_surface

START = (1.0, 1.0, 0.132)
ROOM_M2 = 64.0 + 4 * 8.0 * 2.0  # floor and walls of an 8 x 8 m room


def seen(mesh: Mesh, **options: float) -> VisibleSurface:
    return visible_surface(*mesh, reachable_ground(*mesh, START), VisibilityConfig(**options))


def test_all_of_an_empty_room_is_seen() -> None:
    assert seen(room(8, 8)).area_m2 == pytest.approx(ROOM_M2)


def test_low_box_shows_its_top_and_sides_and_hides_the_floor_beneath_it() -> None:
    world = join(room(8, 8), box((3.5, 3.5, 0), (4.5, 4.5, 0.5)))
    assert seen(world).area_m2 == pytest.approx(ROOM_M2 - 1.0 + 4 * 0.5 + 1.0)


def test_top_of_a_box_higher_than_the_sensor_is_never_seen() -> None:
    world = join(room(8, 8), box((3.5, 3.5, 0), (4.5, 4.5, 1.5)))
    assert seen(world).area_m2 == pytest.approx(ROOM_M2 - 1.0 + 4 * 1.5)


def test_what_lies_behind_a_wall_or_out_of_range_is_not_seen() -> None:
    behind = join(room(8, 8), plate(8.5, 0, 12, 8))
    assert seen(behind).area_m2 == pytest.approx(ROOM_M2)
    far = join(plate(0, 0, 4, 4), plate(10, 0, 14, 4))
    assert seen(far, max_range_m=6.0, max_incidence_rad=1.55).area_m2 == pytest.approx(16.0)
    assert seen(far, max_range_m=20.0, max_incidence_rad=1.55).area_m2 == pytest.approx(32.0)


def test_grazed_ground_is_not_seen() -> None:
    # From 0.9 m above, 80 degrees reach 5.1 m; the nearer plate ends 0.6 m before the sensor may go no farther.
    far = join(plate(0, 0, 4, 4), plate(10, 0, 14, 4))
    assert seen(far, max_incidence_rad=math.radians(80)).area_m2 == pytest.approx(16.0)


def test_ceiling_is_seen_only_as_high_as_a_sweep_looks() -> None:
    world = join(room(8, 8), plate(0, 0, 8, 8, 2.0))
    assert seen(world).area_m2 == pytest.approx(ROOM_M2 + 64.0)
    level = seen(world, max_elevation_rad=0.0)
    assert level.points[:, 2].max() < 0.95  # the laser is at 0.92


def test_winding_does_not_matter_and_nothing_is_random() -> None:
    vertices, triangles = join(room(8, 8), box((3.5, 3.5, 0), (4.5, 4.5, 0.5)))
    ground = reachable_ground(vertices, triangles, START)
    once, again = (visible_surface(vertices, triangles, ground) for _ in range(2))
    np.testing.assert_array_equal(once.points, again.points)
    assert visible_surface(vertices, triangles[:, ::-1].copy(), ground).area_m2 == pytest.approx(once.area_m2)


def squares_of_the_hand_made_world() -> VisibleSurface:
    """All of its 6 x 4 m of floor and walls of 2 m, by the centres of squares of 0.1 m."""
    x, y, z = (np.arange(0.05, length, 0.1) for length in (6.0, 4.0, 2.0))
    sides = ((x, y, [0.0]), (x, [0.0], z), (x, [4.0], z), ([0.0], y, z), ([6.0], y, z))
    points = np.vstack([np.stack(np.meshgrid(*side, indexing="ij"), axis=-1).reshape(-1, 3) for side in sides])
    return VisibleSurface(points, np.full(len(points), 0.01))


def test_perfect_map_is_complete() -> None:
    surface = squares_of_the_hand_made_world()
    found = completeness(surface, surface.points)
    assert (found.rms_m, found.p95_m, found.seen_share) == (0.0, 0.0, pytest.approx(1.0))
    assert surface.area_m2 == pytest.approx(64.0)


def test_hand_made_map_s_missing_square_raised_plate_and_shifted_wall_cost_what_paper_says() -> None:
    found = completeness(squares_of_the_hand_made_world(), hand_made_map().voxels)
    # A square metre has rings of 36, 28, 20, 12 and 4 squares, 0.1, 0.2 .. 0.5 m from the floor around it; the plate hangs 0.3 m above.
    missing = 36 * 0.1**2 + 28 * 0.2**2 + 20 * 0.3**2 + 12 * 0.4**2 + 4 * 0.5**2
    raised = 36 * 0.1**2 + 28 * 0.2**2 + 36 * 0.3**2
    shifted = 800 * 0.05**2
    assert found.rms_m == pytest.approx(math.sqrt((missing + raised + shifted) / 6400), rel=1e-9)
    assert found.seen_share == pytest.approx(1.0 - (64 + 64) / 6400)
    assert found.p95_m == pytest.approx(0.05)  # 3 % lie farther than the shifted wall


def test_all_of_the_hand_made_world_can_be_seen() -> None:
    assert visible_surface(*WORLD, reachable_ground(*WORLD, HAND_MADE_START)).area_m2 == pytest.approx(64.0)


def test_missing_square_metre_of_a_room_is_the_share_that_is_not_seen() -> None:
    surface = seen(room(8, 8))
    u, v = (a.ravel() for a in np.meshgrid(np.arange(0.025, 8, 0.05), np.arange(0.025, 8, 0.05)))
    low, none, all_ = v < 2.0, 0.0 * u, 0.0 * u + 8.0
    walls = [np.column_stack(w)[low] for w in ((u, none, v), (u, all_, v), (none, u, v), (all_, u, v))]
    floor = np.column_stack([u, v, none])
    hole = (np.abs(floor[:, :2] - 3.5) < 0.5).all(axis=1)
    found = completeness(surface, np.vstack([floor[~hole], *walls]))
    assert found.seen_share == pytest.approx(1.0 - 1.0 / ROOM_M2)


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.full((4, 3), np.nan), np.zeros((4, 2))])
def test_map_without_points_has_no_completeness(points: np.ndarray) -> None:
    with pytest.raises(ValueError, match="points of a map"):
        completeness(squares_of_the_hand_made_world(), points)


def test_surface_without_area_has_no_completeness() -> None:
    with pytest.raises(ValueError, match="visible surface"):
        completeness(VisibleSurface(np.zeros((0, 3)), np.zeros(0)), np.zeros((1, 3)))


def test_wrong_configuration_and_empty_ground_are_refused() -> None:
    mesh = room(8, 8)
    with pytest.raises(ValueError, match="piece_m"):
        seen(mesh, piece_m=-1.0)
    with pytest.raises(ValueError, match="pieces"):
        seen(mesh, piece_m=0.01)
    ground = reachable_ground(*mesh, START)
    nothing = ReachableGround(**{**vars(ground), "points": np.zeros((0, 3))})
    with pytest.raises(ValueError, match="without points"):
        visible_surface(*mesh, nothing)
