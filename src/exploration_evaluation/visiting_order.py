"""In which order to visit places, from a start and not back to it, so that the last is reached soonest.

Of a few places every order is tried; of more one is found that no reversed and no moved piece makes cheaper.

These are the moves 2-opt (Croes 1958) and or-opt (Or 1976), each costed anew as a whole: so a leg may take longer one way than the other.
"""

from functools import lru_cache
from itertools import permutations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_ALL_ORDERS = 7  # places of which every order is tried: 5,040
_PIECE = 3  # longest piece that is moved


def order_cost(times_s: ArrayLike, order: ArrayLike) -> float:
    """Seconds until the last place is reached.

    times_s (M, M): from place to place. order (N,): places, the start first. ValueError for another shape.
    """
    times, at = _checked(times_s, order)
    return float(_costs(times, at[None])[0])


def best_order(times_s: ArrayLike, order: ArrayLike) -> list[int]:
    """The same places, the start first, in an order that costs least; of more than seven, least among its neighbours.

    Arguments and errors as of `order_cost`. Where nothing is cheaper the order stays.
    """
    times, at = _checked(times_s, order)
    changes, cost = _changes(len(at) - 1), _costs(times, at[None])[0]
    while len(changes):
        found = at[changes]
        costs = _costs(times, found)
        best = int(np.argmin(costs))
        if not costs[best] < cost - 1e-9:
            break
        at, cost = found[best], costs[best]
    return [int(place) for place in at]


def _costs(times: Floats, orders: Ints) -> Floats:
    """(K,) costs of (K, N) orders."""
    arrivals = np.cumsum(times[orders[:, :-1], orders[:, 1:]], axis=1)
    return arrivals[:, -1] if arrivals.shape[1] else np.zeros(len(orders))


@lru_cache(maxsize=64)
def _changes(places: int) -> Ints:
    """(K, N) changed orders of 0..N-1, the first of which stays in its place."""
    rest = list(range(1, places + 1))
    if places <= _ALL_ORDERS:
        orders = {(0, *order) for order in permutations(rest)} - {(0, *rest)}
    else:
        orders = _reversed_pieces(rest) | _moved_pieces(rest)
    return np.array(sorted(orders), dtype=np.int64).reshape(-1, places + 1)


def _reversed_pieces(rest: list[int]) -> set[tuple[int, ...]]:
    n = len(rest)
    return {(0, *rest[:i], *rest[i:j][::-1], *rest[j:]) for i in range(n) for j in range(i + 2, n + 1)}


def _moved_pieces(rest: list[int]) -> set[tuple[int, ...]]:
    found = set()
    for length in range(1, _PIECE + 1):
        for i in range(len(rest) - length + 1):
            piece, others = rest[i : i + length], rest[:i] + rest[i + length :]
            for k in [k for k in range(len(others) + 1) if k != i]:
                found |= {(0, *others[:k], *way, *others[k:]) for way in (piece, piece[::-1])}
    return found


def _checked(times_s: ArrayLike, order: ArrayLike) -> tuple[Floats, Ints]:
    times, at = np.asarray(times_s, dtype=np.float64), np.asarray(order, dtype=np.int64)
    if times.ndim != 2 or times.shape[0] != times.shape[1]:
        raise ValueError(f"times are (M, M), not {times.shape}")
    if at.ndim != 1 or not len(at) or len(set(at.tolist())) < len(at) or at.min() < 0 or at.max() >= len(times):
        raise ValueError(f"an order names a start and other places among 0..{len(times) - 1}, each once, not {at.tolist()}")
    return times, at
