"""Orders against all that there are, and against what one sees at a glance."""

from itertools import permutations

import numpy as np
import pytest

from exploration_evaluation.visiting_order import best_order, order_cost


def times_between(places):
    return np.linalg.norm(places[:, None] - places[None], axis=2)


def brute_force(times):
    return min(order_cost(times, (0, *rest)) for rest in permutations(range(1, len(times))))


@pytest.mark.parametrize("stops", range(8))
def test_up_to_seven_stops_no_order_costs_less(stops):
    for seed in range(3):
        times = np.random.default_rng(seed).random((stops + 1, stops + 1))  # one way is not the other
        order = best_order(times, range(stops + 1))
        assert order[0] == 0
        assert sorted(order) == list(range(stops + 1))
        assert order_cost(times, order) == pytest.approx(brute_force(times))


def test_many_stops_on_a_ring_are_visited_around_it():
    angle = np.random.default_rng(1).permutation(20) * 2 * np.pi / 20
    times = times_between(np.column_stack([np.cos(angle), np.sin(angle)]))
    assert order_cost(times, best_order(times, range(20))) == pytest.approx(19 * 2 * np.sin(np.pi / 20))


def test_order_of_many_stops_is_within_a_few_percent_of_many_tries():
    times = times_between(np.random.default_rng(2).random((12, 2)))
    tries = (best_order(times, (0, *np.random.default_rng(k).permutation(np.arange(1, 12)))) for k in range(30))
    assert order_cost(times, best_order(times, range(12))) < 1.06 * min(order_cost(times, order) for order in tries)


def test_order_that_is_best_stays():
    times = times_between(np.arange(9.0)[:, None])
    assert best_order(times, range(9)) == list(range(9))
    assert best_order(np.zeros((9, 9)), (4, 2, 7)) == [4, 2, 7]


@pytest.mark.parametrize(
    ("times", "order"), [(np.zeros((2, 3)), (0,)), (np.zeros((2, 2)), ()), (np.zeros((2, 2)), (0, 2)), (np.zeros((2, 2)), (0, 0))]
)
def test_what_is_no_order_is_refused(times, order):
    with pytest.raises(ValueError, match="order names a start|times are"):
        best_order(times, order)
