"""A tour of views that show all there is to see, in little time: large neighbourhood search (Shaw 1998) on a table of who sees what.

Between `clairvoyant`, which knows what a view is, and `visiting_order`. A round takes a few neighbouring views out of the tour, puts
others in by what they show for the seconds that they cost, leaves out those that have become needless, and orders the rest.
"""

import numpy as np
from numpy.typing import NDArray

from exploration_evaluation.visiting_order import best_order, order_cost

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MOST_TAKEN_OUT = 5
_MOOD = 0.5  # by how much a view's worth varies between rounds
_LEAST_S = 0.1  # a view in passing costs something, or one would take all


def covering_tour(sees: Mask, times_s: Floats, start: int, stop_s: float, rounds: int, rng: np.random.Generator) -> list[int]:
    """Views in the order of the tour, the start first, that see all that any view sees.

    sees (P, T): whether view p shows target t. times_s (P, P): from view to view. stop_s: seconds that a view takes, the first one, too.
    No shortest tour: the best of so many rounds, and the same one for the same generator.
    """
    search = _Search(sees, times_s, stop_s, rng)
    tour = search.completed([start])
    cost = search.cost(tour)
    for _ in range(rounds):
        changed = search.completed(search.thinned_out(tour))
        if (changed_cost := search.cost(changed)) <= cost:
            tour, cost = changed, changed_cost
    return tour


class _Search:
    def __init__(self, sees: Mask, times_s: Floats, stop_s: float, rng: np.random.Generator) -> None:
        # Targets that the same views show are one target of more weight.
        columns, count = np.unique(sees[:, sees.any(axis=0)], axis=1, return_counts=True)
        self._sees, self._weighed = columns, (columns * count).astype(np.float32)
        self._times, self._stop_s, self._rng = times_s, stop_s, rng

    def cost(self, tour: list[int]) -> float:
        return order_cost(self._times, tour) + self._stop_s * len(tour)

    def thinned_out(self, tour: list[int]) -> list[int]:
        """Without some view and a few of those nearest to it."""
        if len(tour) < 2:
            return tour
        centre = tour[self._rng.integers(1, len(tour))]
        nearest = sorted(tour[1:], key=lambda view: self._times[centre, view])
        gone = set(nearest[: self._rng.integers(1, _MOST_TAKEN_OUT + 1)])
        return [view for view in tour if view not in gone]

    def completed(self, tour: list[int]) -> list[int]:
        """With views put in until all is seen, and no needless one."""
        tour = list(tour)
        left = ~self._sees[tour].any(axis=0)
        while left.any():
            detours, places = self._detours(tour)
            mood = 1.0 + _MOOD * self._rng.random(len(self._sees), dtype=np.float32)
            view = int(np.argmax(mood * (self._weighed @ left.astype(np.float32)) / (detours + self._stop_s + _LEAST_S)))
            tour.insert(int(places[view]), view)
            left &= ~self._sees[view]
        return best_order(self._times, self._without_needless(tour))

    def _detours(self, tour: list[int]) -> tuple[Floats, NDArray[np.int64]]:
        """(P,) seconds that each view adds where it fits best, and (P,) its place in the tour."""
        legs = self._times[tour[:-1], tour[1:]][:, None]
        between = self._times[tour[:-1]] + self._times[:, tour[1:]].T - legs
        added = np.vstack([between, self._times[tour[-1]]])
        return added.min(axis=0), added.argmin(axis=0) + 1

    def _without_needless(self, tour: list[int]) -> list[int]:
        shown = self._sees[tour].sum(axis=0)
        for view in self._rng.permutation(tour[1:]).tolist():
            if (shown[self._sees[view]] > 1).all():
                tour.remove(view)
                shown -= self._sees[view]
        return tour
