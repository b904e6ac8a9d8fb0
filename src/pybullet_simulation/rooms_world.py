"""The world `rooms`: a corridor and two rooms joined by three doorways in a loop, flat, 8 x 10 m; the clutter comes from the seed."""

import numpy as np

from pybullet_simulation.clutter import Propose, place, plan_bounds
from pybullet_simulation.solids import BURIED_M, Solid, box, cylinder, walls_around

LOW_XY, HIGH_XY = (-5.0, -4.0), (5.0, 4.0)
WALL_M, WALL_HEIGHT_M = 0.15, 2.0
DOORWAYS = ((-3.0, 2.1), (-3.0, -2.1), (3.1, 0.0))  # centres
FREE_GAP_M = 1.6  # between clutter and anything that it does not stand against
AT_DOORWAY_M = 1.9


def rooms_solids(rng: np.random.Generator) -> list[Solid]:
    """Ground, walls with doorways of 1.8 m, and clutter that leaves every passage at least 1.6 m wide."""
    margin = np.array([WALL_M, WALL_M])
    ground = box("ground", (*(LOW_XY - margin), -0.5), (*(HIGH_XY + margin), 0.0))
    return [ground, *walls_around(LOW_XY, HIGH_XY, -BURIED_M, WALL_HEIGHT_M, WALL_M), *_inner_walls(), *_clutter(rng)]


def _wall(name: str, x0: float, y0: float, x1: float, y1: float) -> Solid:
    h = WALL_M / 2
    return box(name, (x0 - h, y0 - h, -BURIED_M), (x1 + h, y1 + h, WALL_HEIGHT_M))


def _inner_walls() -> list[Solid]:
    return [
        _wall("corridor_north", -3.0, 3.075, -3.0, 3.925),
        _wall("corridor_middle", -3.0, -1.125, -3.0, 1.125),
        _wall("corridor_south", -3.0, -3.925, -3.0, -3.075),
        _wall("between_west", -2.925, 0.0, 2.125, 0.0),
        _wall("between_east", 4.075, 0.0, 4.925, 0.0),
    ]


def _clutter(rng: np.random.Generator) -> list[Solid]:
    """In each room things against the outer wall and a pillar or box in the open; the corridor stays empty."""
    keep_off = [(np.array([d, d]), AT_DOORWAY_M) for d in DOORWAYS]
    solids: list[Solid] = []
    for name, side in (("north", 1.0), ("south", -1.0)):
        crates = [_against_wall(f"crate_{name}_{i}", side) for i in range(int(rng.integers(2, 4)))]
        for propose in (*crates, _in_the_open(name, side)):
            solids += place(rng, propose, [*keep_off, *((plan_bounds([s]), FREE_GAP_M) for s in solids)])
    return solids


def _against_wall(name: str, side: float) -> Propose:
    def propose(rng: np.random.Generator) -> list[Solid]:
        depth, width, height = rng.uniform(0.25, 0.6), rng.uniform(0.4, 1.2), rng.uniform(0.4, 1.6)
        x = rng.uniform(-2.8 + width / 2, 4.99 - width / 2)
        low_y, high_y = sorted((side * 4.0, side * (4.0 - depth)))
        return [box(name, (x - width / 2, low_y, -BURIED_M), (x + width / 2, high_y, height))]

    return propose


def _in_the_open(name: str, side: float) -> Propose:
    def propose(rng: np.random.Generator) -> list[Solid]:
        x, y = rng.uniform(-1.2, 3.2), side * rng.uniform(1.95, 2.15)
        if rng.uniform() < 0.5:
            return [cylinder(f"pillar_{name}", x, y, -BURIED_M, WALL_HEIGHT_M, rng.uniform(0.1, 0.2))]
        half = rng.uniform(0.12, 0.22)
        return [box(f"box_{name}", (x - half, y - half, -BURIED_M), (x + half, y + half, rng.uniform(0.5, 1.2)))]

    return propose
