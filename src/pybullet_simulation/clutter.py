"""Placing things by chance so that every gap between them stays wide enough to drive and turn in."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.solids import Solid

Array = NDArray[np.float64]
Propose = Callable[[np.random.Generator], list[Solid]]
"""Draws one thing, which may be made of several solids, at a random place."""


def plan_bounds(solids: Sequence[Solid]) -> Array:
    """(2, 2) lowest and highest x, y of some solids."""
    points = np.vstack([solid.vertices[:, :2] for solid in solids])
    return np.array([points.min(axis=0), points.max(axis=0)])


def plan_gap(a: Array, b: Array) -> float:
    """Distance between two upright rectangles given by their (2, 2) bounds; zero when they overlap."""
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(b[0] - a[1], a[0] - b[1]))))


def place(rng: np.random.Generator, propose: Propose, keep_off: Sequence[tuple[Array, float]], tries: int = 60) -> list[Solid]:
    """The first proposal that keeps its distance from every (bounds, distance in m); empty when none of the tries does."""
    for _ in range(tries):
        solids = propose(rng)
        bounds = plan_bounds(solids)
        if all(plan_gap(bounds, other) >= distance for other, distance in keep_off):
            return solids
    return []
