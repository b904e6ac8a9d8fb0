"""The world `rooms`: a corridor and two rooms joined by three doorways in a loop, flat, 8 x 10 m; the clutter comes from the seed."""

import numpy as np

from pybullet_simulation.solids import Solid, box, cylinder, walls_around

LOW_XY, HIGH_XY = (-5.0, -4.0), (5.0, 4.0)
WALL_M, WALL_HEIGHT_M = 0.15, 2.0
BURIED_M = 0.05  # solids reach into the ground, so that no two faces coincide
DOORWAYS = ((-3.0, 2.1), (-3.0, -2.1), (3.1, 0.0))  # centres
FREE_GAP_M = 1.6  # between clutter and anything that it does not stand against
AT_DOORWAY_M = 1.9


def rooms_solids(rng: np.random.Generator) -> list[Solid]:
    """Ground, walls with doorways of 1.8 m, and clutter that leaves every passage at least 1.6 m wide."""
    ground = box("ground", (*(v - 1.0 for v in LOW_XY), -0.5), (*(v + 1.0 for v in HIGH_XY), 0.0))
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
    """In each room things against the outer walls and one pillar or crate in the open; nothing in the corridor but at its ends."""
    solids: list[Solid] = []
    for name, side in (("north", 1.0), ("south", -1.0)):
        for i in range(int(rng.integers(2, 4))):
            solids += _placed(rng, solids, lambda r, n=f"{name}_{i}", s=side: _against_wall(r, n, s))
        solids += _placed(rng, solids, lambda r, n=name, s=side: _in_the_open(r, n, s))
    return solids


def _placed(rng: np.random.Generator, others: list[Solid], propose) -> list[Solid]:  # type: ignore[no-untyped-def]
    """The first proposal that is far enough from doorways and other clutter; none after 50 tries."""
    for _ in range(50):
        solid: Solid = propose(rng)
        low, high = solid.vertices[:, :2].min(axis=0), solid.vertices[:, :2].max(axis=0)
        doors = all(np.linalg.norm(np.clip(d, low, high) - d) > AT_DOORWAY_M for d in DOORWAYS)
        if doors and all(_gap(low, high, other) > FREE_GAP_M for other in others):
            return [solid]
    return []


def _gap(low, high, other: Solid) -> float:  # type: ignore[no-untyped-def]
    other_low, other_high = other.vertices[:, :2].min(axis=0), other.vertices[:, :2].max(axis=0)
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(other_low - high, low - other_high))))


def _against_wall(rng: np.random.Generator, name: str, side: float) -> Solid:
    depth, width, height = rng.uniform(0.25, 0.6), rng.uniform(0.4, 1.2), rng.uniform(0.4, 1.6)
    x = rng.uniform(-2.8 + width / 2, 4.99 - width / 2)
    ys = sorted((side * 4.0, side * (4.0 - depth)))
    return box(f"crate_{name}", (x - width / 2, ys[0], -BURIED_M), (x + width / 2, ys[1], height))


def _in_the_open(rng: np.random.Generator, name: str, side: float) -> Solid:
    x, y = rng.uniform(-1.2, 3.2), side * rng.uniform(1.95, 2.15)
    if rng.uniform() < 0.5:
        return cylinder(f"pillar_{name}", x, y, -BURIED_M, WALL_HEIGHT_M, rng.uniform(0.1, 0.2))
    half = rng.uniform(0.12, 0.22)
    return box(f"box_{name}", (x - half, y - half, -BURIED_M), (x + half, y + half, rng.uniform(0.5, 1.2)))
