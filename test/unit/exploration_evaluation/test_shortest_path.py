"""Shortest ways over hand-made worlds against lengths found on paper (cells of 0.1 m, the centre 0.6 m from things)."""

import math

import numpy as np
import pytest
from hand_made_worlds import join, plate, ramp, room, wall

from exploration_evaluation import reachable_ground
from exploration_evaluation.shortest_path import path_ratio, shortest_length

BIAS = 0.014  # of a graph with 32 directions, and of cells at the ends
BASE_M = 0.132


@pytest.fixture(scope="module")
def hall():
    return reachable_ground(*room(10, 10), (5, 5, 0.1))


def ways_in_all_directions(ground):
    """Lengths of ways of 2 m from the middle of a room of 6 x 6 m."""
    middle = np.array([3.03, 2.98, BASE_M])
    angles = np.radians(np.arange(0, 360, 2.5))
    ends = middle + 2.0 * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(len(angles))])
    return np.array([shortest_length(ground, [middle, end]) for end in ends])


def test_straight_ways_are_too_long_by_at_most_the_bias_and_half_a_percent_in_the_mean():
    lengths = ways_in_all_directions(reachable_ground(*room(6, 6), (3, 3, 0.1)))
    assert lengths.min() >= 2.0 - 1e-6
    assert lengths.max() <= 2.0 * (1 + BIAS)
    assert lengths.mean() == pytest.approx(2.0 * 1.005, rel=0.002)


def test_places_are_visited_in_their_order_and_standing_costs_nothing(hall):
    a, b, c = (2.0, 5.0, BASE_M), (8.0, 5.0, BASE_M), (5.0, 5.0, BASE_M)
    assert shortest_length(hall, [a, b, c]) == pytest.approx(9.0, rel=BIAS)
    assert shortest_length(hall, [a, c, b]) == pytest.approx(6.0, rel=BIAS)
    assert shortest_length(hall, [c, c]) == pytest.approx(0.0, abs=1e-6)
    assert shortest_length(hall, [c, (5.07, 5.0, BASE_M), c]) == pytest.approx(0.14, abs=1e-6)


def test_way_around_the_end_of_a_wall_is_two_tangents_and_an_arc():
    ground = reachable_ground(*join(room(10, 10), wall(5, 0, 5, 6)), (2, 2, 0.1))
    away, radius = math.hypot(3, 4), 0.6  # from (2, 2) to the wall's end at (5, 6), from which the centre keeps its radius
    # Angles at the wall's end: from straight down to the start, and from the start to where the tangent touches the circle.
    arc = 2 * radius * (math.pi - math.atan2(3, 4) - math.acos(radius / away))
    expected = 2 * math.sqrt(away**2 - radius**2) + arc
    length = shortest_length(ground, [(2, 2, BASE_M), (8, 2, BASE_M)])
    assert expected <= length <= (expected + 0.1) * (1 + BIAS)


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


def test_place_nearer_to_a_wall_than_the_robot_turns_is_joined_and_one_beyond_the_wall_is_refused(hall):
    assert shortest_length(hall, [(5, 5, BASE_M), (9.65, 5, BASE_M)]) == pytest.approx(4.65, rel=BIAS)
    for place in ((9.9, 5, BASE_M), (12.0, 5, BASE_M), (5, 5, 3.0)):
        with pytest.raises(ValueError, match="place 1 of the way, .* is not on reachable ground"):
            shortest_length(hall, [(5, 5, BASE_M), place])


def test_way_to_a_place_without_room_to_turn_is_straight_and_no_longer_than_between_two_sweeps():
    world = join(room(10, 10), wall(5, 0, 5, 4.5), wall(5, 5.5, 5, 10))  # a door of 1 m
    ground = reachable_ground(*world, (2, 5, 0.1))
    before, inside = (3.0, 5.0, BASE_M), (5.0, 5.0, BASE_M)
    assert shortest_length(ground, [(2.0, 5.0, BASE_M), before, inside, before]) == pytest.approx(5.0, abs=0.1)
    with pytest.raises(ValueError, match="place 1 of the way, .* is not on reachable ground"):
        shortest_length(ground, [(2.0, 5.0, BASE_M), inside])


@pytest.mark.parametrize("bad", [np.zeros((1, 3)), np.zeros((2, 2)), np.full((2, 3), np.nan)])
def test_what_is_no_way_is_refused(hall, bad):
    with pytest.raises(ValueError, match="two finite places or more"):
        shortest_length(hall, bad)


def test_ratio_is_driven_to_shortest_and_unknown_for_a_robot_that_stayed_where_it_was():
    assert path_ratio(12.0, 10.0) == pytest.approx(1.2)
    with pytest.raises(ValueError, match="0.02 m"):
        path_ratio(3.0, 0.02)
