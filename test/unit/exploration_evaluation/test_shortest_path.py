"""Shortest ways over hand-made worlds against lengths found on paper (cells of 0.1 m, the centre 0.6 m from things)."""

import math

import numpy as np
import pytest
from hand_made_worlds import join, plate, ramp, room, wall

from exploration_evaluation import reachable_ground
from exploration_evaluation.shortest_path import path_ratio, shortest_legs

BIAS = 0.005  # of a graph with 40 directions
BASE_M = 0.132


@pytest.fixture(scope="module")
def hall():
    return reachable_ground(*room(10, 10), (5, 5, 0.1))


def shortest_length(ground, places):
    return float(shortest_legs(ground, places).sum())


def ways_in_all_directions(ground):
    """Lengths of ways of 2 m from the middle of a room of 6 x 6 m."""
    middle = np.array([3.03, 2.98, BASE_M])
    angles = np.radians(np.arange(0, 360, 2.5))
    ends = middle + 2.0 * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    return np.array([shortest_length(ground, [middle, end]) for end in ends])


def test_straight_ways_are_as_long_as_the_line():
    lengths = ways_in_all_directions(reachable_ground(*room(6, 6), (3, 3, 0.1)))
    np.testing.assert_allclose(lengths, 2.0, rtol=1e-6)


def test_places_are_visited_in_their_order_and_standing_costs_nothing(hall):
    a, b, c = (2.0, 5.0, BASE_M), (8.0, 5.0, BASE_M), (5.0, 5.0, BASE_M)
    assert shortest_length(hall, [a, b, c]) == pytest.approx(9.0, rel=BIAS)
    assert shortest_length(hall, [a, c, b]) == pytest.approx(6.0, rel=BIAS)
    assert shortest_length(hall, [c, c]) == pytest.approx(0.0, abs=1e-6)
    assert shortest_length(hall, [c, (5.07, 5.0, BASE_M), c]) == pytest.approx(0.14, abs=1e-6)


def around_the_end_of_a_wall(keeps_m):
    """From (2, 2) to (8, 2) around (5, 6): two tangents and an arc."""
    away = math.hypot(3, 4)
    arc = 2 * keeps_m * (math.pi - math.atan2(3, 4) - math.acos(keeps_m / away))
    return 2 * math.sqrt(away**2 - keeps_m**2) + arc


def test_way_around_the_end_of_a_wall_is_no_longer_than_the_body_s_side_allows():
    ground = reachable_ground(*join(room(10, 10), wall(5, 0, 5, 6)), (2, 2, 0.1))
    length = shortest_length(ground, [(2, 2, BASE_M), (8, 2, BASE_M)])
    assert around_the_end_of_a_wall(0.1) <= length <= around_the_end_of_a_wall(0.335)


def test_way_is_never_longer_than_one_that_can_be_driven():
    # Around two walls, as near to their ends as a body of 0.67 m may pass, in steps of a few centimetres.
    ground = reachable_ground(*join(room(10, 10), wall(4, 0, 4, 6), wall(6, 4, 6, 10)), (2, 2, 0.1))
    angle = np.linspace(0, math.pi, 30)
    first = np.column_stack([4 - 0.34 * np.cos(angle), 6 + 0.34 * np.sin(angle)])
    second = np.column_stack([6 - 0.34 * np.cos(angle), 4 - 0.34 * np.sin(angle)])
    way = np.vstack([(2.0, 2.0), first, second, (8.0, 8.0)])
    driven = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
    assert 0.93 * driven < shortest_length(ground, [(2, 2, BASE_M), (8, 8, BASE_M)]) <= driven


def test_long_way_between_the_directions_of_the_graph_is_no_longer_either():
    ground = reachable_ground(*join(room(24, 4), wall(12, 0, 12, 1.5)), (2, 2, 0.1))
    way = np.array([(2.0, 1.0), (11.9, 1.84), (12.1, 1.84), (22.0, 1.0)])
    driven = np.linalg.norm(np.diff(way, axis=0), axis=1).sum()
    assert 20.0 < shortest_length(ground, [(2, 1, BASE_M), (22, 1, BASE_M)]) <= driven


def test_ramp_is_as_long_as_its_slope():
    top = 4 * math.tan(math.radians(15))
    ground = reachable_ground(*join(plate(0, 0, 4, 4), ramp(4, 0, 8, 4, 0, top), plate(8, 0, 12, 4, top)), (2, 2, 0.1))
    length = shortest_length(ground, [(2, 2, BASE_M), (10, 2, top + BASE_M)])
    assert length == pytest.approx(2 + 4 / math.cos(math.radians(15)) + 2, rel=0.01)


def test_floor_under_a_bridge_is_not_the_bridge():
    world = join(room(12, 8), ramp(2, 2.5, 6, 5.5, 0, 1.6), plate(6, 2.5, 12, 5.5, 1.6))
    ground = reachable_ground(*world, (1, 1, 0.132))
    deck, below = (9.0, 4.0, 1.6 + BASE_M), (9.0, 4.0, BASE_M)
    assert shortest_length(ground, [deck, below]) > 14.0  # along the ramp, down, and back beneath it
    assert shortest_length(ground, [below, (9.0, 1.0, BASE_M)]) == pytest.approx(3.0, rel=BIAS)


def test_place_over_no_ground_is_joined_by_the_straight_line(hall):
    for place in ((9.65, 5, BASE_M), (9.9, 5, BASE_M), (12.0, 5, BASE_M)):
        assert shortest_length(hall, [(5, 5, BASE_M), place]) == pytest.approx(place[0] - 5.0)


@pytest.mark.parametrize(("height_m", "is_on"), [(0.25, True), (-0.25, True), (0.45, False)])
def test_place_is_on_the_ground_that_is_near_its_height(height_m, is_on):
    ground = reachable_ground(*join(room(10, 10), wall(5, 0, 5, 6)), (2, 2, 0.1))
    place, behind_the_wall = (2.0, 2.0, height_m), (8.0, 2.0, 0.0)
    assert (shortest_length(ground, [place, behind_the_wall]) > 8.0) is is_on


def test_way_through_a_door_without_room_to_turn_is_not_longer_than_straight():
    world = join(room(10, 10), wall(5, 0, 5, 4.5), wall(5, 5.5, 5, 10))  # a door of 1 m
    ground = reachable_ground(*world, (2, 5, 0.1))
    assert shortest_length(ground, [(2.0, 5.0, BASE_M), (3.0, 5.0, BASE_M), (5.0, 5.0, BASE_M), (3.0, 5.0, BASE_M)]) == pytest.approx(5.0)
    assert shortest_length(ground, [(2.0, 5.0, BASE_M), (8.0, 5.0, BASE_M)]) == pytest.approx(6.0)
    assert shortest_length(ground, [(4.0, 1.0, BASE_M), (6.0, 1.0, BASE_M)]) > 7.5  # and not through the wall


@pytest.mark.parametrize("bad", [np.zeros((1, 3)), np.zeros((2, 2)), np.full((2, 3), np.nan)])
def test_what_is_no_way_is_refused(hall, bad):
    with pytest.raises(ValueError, match="two finite places or more"):
        shortest_length(hall, bad)


def test_ratio_is_driven_to_shortest_and_unknown_for_a_robot_that_stayed_where_it_was():
    assert path_ratio(12.0, 10.0) == pytest.approx(1.2)
    with pytest.raises(ValueError, match="0.02 m"):
        path_ratio(3.0, 0.02)
