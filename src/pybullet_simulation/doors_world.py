"""The world `doors`: two rooms and a hall joined in a loop by doors through which the robot fits but in which it cannot turn.

Seen from above (14 x 8 m): the rooms lie in the west, one north of the other; in the hall's north-east corner a ramp of 1 m width, with a
drop on both sides, leads onto a deck, part of which is hidden behind a screen, and behind a parapet to whoever looks up from the hall: it
can only be seen from the deck. Which door is how wide, where it is, and the clutter come from the seed.
"""

import math

import numpy as np

from pybullet_simulation.clutter import Propose, place, plan_bounds
from pybullet_simulation.solids import BURIED_M, Solid, box, cylinder, hull, walls_around

LOW_XY, HIGH_XY = (-6.0, -4.0), (8.0, 4.0)
WALL_M, WALL_HEIGHT_M = 0.15, 2.0
DOOR_WIDTHS_M = (0.9, 0.95, 1.0)
HALL_X, MIDDLE_Y = -1.5, 0.0  # the hall's west wall, and the wall between the rooms
DECK = ((3.0, 1.0), (8.0, 4.0))
DECK_HEIGHT_M, RAMP_M, RAMP_Y, SLOPE_RAD = 0.45, 1.0, 2.5, math.radians(12.0)
SCREEN_X, SCREEN_END_Y = 5.5, 2.2
CLEAR_M = 1.7  # between clutter and anything else


def doors_solids(rng: np.random.Generator) -> list[Solid]:
    """Ground, walls with three doors, deck and ramp, and clutter that leaves the robot room to turn around it."""
    margin = np.array([WALL_M, WALL_M])
    ground = box("ground", (*(LOW_XY - margin), -0.5), (*(HIGH_XY + margin), 0.0))
    walls, doors = _inner_walls(rng)
    deck = _deck()
    return [ground, *walls_around(LOW_XY, HIGH_XY, -BURIED_M, WALL_HEIGHT_M, WALL_M), *walls, *deck, *_clutter(rng, doors, deck)]


def _inner_walls(rng: np.random.Generator) -> tuple[list[Solid], list[tuple[float, float]]]:
    """The three walls, each with its door, and the middles of the doors."""
    south, north, between = (float(w) for w in rng.permutation(DOOR_WIDTHS_M))
    y_south, y_north, x_between = -2.0 + rng.uniform(-0.4, 0.4), 2.0 + rng.uniform(-0.4, 0.4), -3.75 + rng.uniform(-0.5, 0.5)
    h = WALL_M / 2
    walls = [
        *_wall_along_y("south", HALL_X, (LOW_XY[1], MIDDLE_Y - h), y_south, south),
        *_wall_along_y("north", HALL_X, (MIDDLE_Y - h, HIGH_XY[1]), y_north, north),
        _part("between_west", (LOW_XY[0], MIDDLE_Y - h), (x_between - between / 2, MIDDLE_Y + h)),
        _part("between_east", (x_between + between / 2, MIDDLE_Y - h), (HALL_X - h, MIDDLE_Y + h)),
    ]
    return walls, [(HALL_X, y_south), (HALL_X, y_north), (x_between, MIDDLE_Y)]


def _wall_along_y(name: str, x: float, y: tuple[float, float], door_y: float, door_m: float) -> list[Solid]:
    ends = (y[0], door_y - door_m / 2), (door_y + door_m / 2, y[1])
    return [_part(f"{name}_{i}", (x - WALL_M / 2, low), (x + WALL_M / 2, high)) for i, (low, high) in enumerate(ends)]


def _part(name: str, low_xy: tuple[float, float], high_xy: tuple[float, float]) -> Solid:
    return box(name, (*low_xy, -BURIED_M), (*high_xy, WALL_HEIGHT_M))


def _deck() -> list[Solid]:
    (x0, y0), (x1, y1), top = *DECK, DECK_HEIGHT_M
    profile = [(x0 - top / math.tan(SLOPE_RAD), 0.0), (x0 - top / math.tan(SLOPE_RAD), -BURIED_M), (x0 + 0.01, -BURIED_M), (x0 + 0.01, top)]
    ramp = hull("ramp", [(x, side, z) for side in (RAMP_Y - RAMP_M / 2, RAMP_Y + RAMP_M / 2) for x, z in profile])
    screen = box("screen", (SCREEN_X, y0, top - BURIED_M), (SCREEN_X + WALL_M, SCREEN_END_Y, WALL_HEIGHT_M))
    parapet = box("parapet", (SCREEN_X, y0, top - BURIED_M), (x1, y0 + WALL_M, WALL_HEIGHT_M))
    return [box("deck", (x0, y0, -BURIED_M), (x1, y1, top)), ramp, screen, parapet]


def _clutter(rng: np.random.Generator, doors: list[tuple[float, float]], deck: list[Solid]) -> list[Solid]:
    """A pillar or box in each room and two in the hall, away from the doors and the ramp's foot."""
    keep_off = [(np.array([d, d]), CLEAR_M + 0.6) for d in doors] + [(plan_bounds(deck) - [[2.0, 0.0], [0.0, 0.0]], CLEAR_M)]
    solids: list[Solid] = []
    for i, area in enumerate(
        (((-5.0, 1.0), (-2.5, 3.2)), ((-5.0, -3.2), (-2.5, -1.0)), ((0.5, -3.0), (4.5, -1.2)), ((0.5, -3.0), (4.5, -1.2)))
    ):
        solids += place(rng, _thing(f"thing_{i}", *area), [*keep_off, *((plan_bounds([s]), CLEAR_M) for s in solids)])
    return solids


def _thing(name: str, low_xy: tuple[float, float], high_xy: tuple[float, float]) -> Propose:
    def propose(rng: np.random.Generator) -> list[Solid]:
        x, y = rng.uniform(low_xy, high_xy)
        if rng.uniform() < 0.5:
            return [cylinder(name, x, y, -BURIED_M, WALL_HEIGHT_M, rng.uniform(0.1, 0.2))]
        half = rng.uniform(0.12, 0.22)
        return [box(name, (x - half, y - half, -BURIED_M), (x + half, y + half, rng.uniform(0.5, 1.2)))]

    return propose
