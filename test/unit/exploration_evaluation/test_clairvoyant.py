"""The clairvoyant in worlds whose tour one knows by heart, and its search against all tours that there are."""

from dataclasses import replace
from itertools import chain, combinations

import numpy as np
import pytest
from hand_made_worlds import box, join, plate, room, wall

from exploration_evaluation import reachable_ground
from exploration_evaluation.clairvoyant import SENSOR_VIEWS, SETTLE_S, VIEW_STEP_M, clairvoyant
from exploration_evaluation.covering_tour import covering_tour
from exploration_evaluation.visiting_order import best_order, order_cost

VIEW = SENSOR_VIEWS["tilting"]
STOP_S = VIEW.sweep_s + SETTLE_S
SPEED_MPS = 0.5
MIDDLE = (2.5, 2.5, 0.1)


def found(world, start, view=VIEW, speed_mps=SPEED_MPS):
    return clairvoyant(*world, reachable_ground(*world, start), start, speed_mps, view)


def two_rooms(corridor_m):
    """Two rooms of 5 x 5 m, and in line with their middles a corridor, 2 m wide."""
    near, far, end = 5.0, 5.0 + corridor_m, 10.0 + corridor_m
    parts = [plate(0, 0, end, 5), wall(0, 0, end, 0), wall(0, 5, end, 5), wall(0, 0, 0, 5), wall(end, 0, end, 5)]
    return join(*parts, box((near, -1, -1), (far, 1.5, 2)), box((near, 3.5, -1), (far, 6, 2)))


def test_square_that_one_view_sees_takes_one_sweep_and_no_way():
    seen = found(room(8, 8), (4.05, 4.05, 0.1))
    assert (seen.sweeps, seen.stopping_way_m, seen.driving_way_m) == (1, 0.0, 0.0)
    assert seen.stopping_s == pytest.approx(STOP_S)
    assert seen.driving_s == 0.0
    assert seen.seen_share == 1.0


def test_sensor_that_sees_less_far_needs_more_views():
    assert found(room(8, 8), (4.05, 4.05, 0.1), replace(VIEW, range_m=4.0)).sweeps > 1


@pytest.mark.parametrize("corridor_m", [3.0, 6.0])
def test_two_rooms_take_the_way_into_the_second_one(corridor_m):
    # From the middle of the first room; the near corners of the second are seen from within it, at the earliest from its door.
    seen = found(two_rooms(corridor_m), MIDDLE)
    assert seen.sweeps == 2
    for way_m in (seen.stopping_way_m, seen.driving_way_m):
        assert 2.5 + corridor_m <= way_m <= 2.5 + corridor_m + VIEW_STEP_M
    assert seen.stopping_s == pytest.approx(2 * STOP_S + seen.stopping_way_m / SPEED_MPS)
    assert seen.driving_s == pytest.approx(seen.driving_way_m / SPEED_MPS)


def test_middle_of_a_long_corridor_takes_a_view_that_driving_has_for_nothing():
    seen = found(two_rooms(12.0), MIDDLE)
    assert seen.sweeps == 3
    assert seen.driving_way_m == pytest.approx(seen.stopping_way_m, abs=0.3)


def test_faster_robot_takes_less_time():
    slow, fast = (found(two_rooms(6.0), MIDDLE, speed_mps=v) for v in (0.5, 1.0))
    assert fast.driving_s == pytest.approx(0.5 * slow.driving_s)


def test_ground_behind_a_door_that_is_only_passed_counts():
    world = join(room(10, 6), wall(5, 0, 5, 2.5), wall(5, 3.5, 5, 6))  # a door of 1 m
    seen = found(world, (2.0, 3.0, 0.1))
    assert seen.seen_share == 1.0
    assert 3.0 <= seen.driving_way_m <= 4.5


@pytest.mark.parametrize("seed", range(6))
def test_search_finds_the_best_of_all_tours_of_a_few_views(seed):
    rng = np.random.default_rng(seed)
    places = 10 * rng.random((7, 2))
    times, sees = np.linalg.norm(places[:, None] - places[None], axis=2), rng.random((7, 9)) < 0.4
    all_seen = sees.any(axis=0)
    subsets = chain.from_iterable(combinations(range(1, 7), k) for k in range(7))
    covers = [(0, *some) for some in subsets if (sees[[0, *some]].any(axis=0) == all_seen).all()]
    for stop_s in (0.0, 3.0):
        tour = covering_tour(sees, times, 0, stop_s, 300, np.random.default_rng(0))
        assert tour[0] == 0
        assert (sees[tour].any(axis=0) == all_seen).all()
        best = min(order_cost(times, best_order(times, cover)) + stop_s * len(cover) for cover in covers)
        assert order_cost(times, tour) + stop_s * len(tour) == pytest.approx(best)


@pytest.mark.parametrize(("stop_s", "tour"), [(8.0, [0, 3]), (1.0, [0, 1, 2])])
def test_second_view_is_worth_a_longer_way_only_where_views_take_long(stop_s, tour):
    at, sees = np.array([0.0, 3.0, 6.0, -10.0]), np.zeros((4, 10), dtype=np.bool_)
    sees[1, :6] = sees[2, 4:] = sees[3] = True
    assert covering_tour(sees, np.abs(at[:, None] - at), 0, stop_s, 200, np.random.default_rng(0)) == tour


@pytest.mark.parametrize("seed", range(6))
def test_no_view_of_a_tour_is_needless_however_short_the_search(seed):
    rng = np.random.default_rng(seed)
    places = 10 * rng.random((12, 2))
    times, sees = np.linalg.norm(places[:, None] - places[None], axis=2), rng.random((12, 30)) < 0.35
    tour = covering_tour(sees, times, 0, 1.0, 0, np.random.default_rng(seed))
    for view in tour[1:]:
        assert (sees[[other for other in tour if other != view]].any(axis=0) != sees.any(axis=0)).any()


def test_same_world_has_the_same_clairvoyant():
    assert found(two_rooms(12.0), MIDDLE) == found(two_rooms(12.0), MIDDLE)


def test_what_cannot_be_computed_is_refused():
    with pytest.raises(ValueError, match="45 m2 of reachable ground; at most 40 m2"):
        found(room(8, 6.5), (4, 3, 0.1), replace(VIEW, max_ground_m2=40.0))
    with pytest.raises(ValueError, match="speed"):
        found(room(8, 8), (4, 4, 0.1), speed_mps=0.0)
    with pytest.raises(ValueError, match="range_m"):
        found(room(8, 8), (4, 4, 0.1), replace(VIEW, range_m=0.0))
