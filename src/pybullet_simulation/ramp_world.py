"""The world `ramp` (thesis 5.2, 7.2): a walled yard with a plateau that one drives onto and under, narrow ramps, hydrants, dumpsters.

Seen from above (20 x 20 m, x to the right): the big ramp rises eastwards onto the plateau, under which an underpass runs from south
to north and is open to the east. South-west a ramp of 1 m width leads onto a block, north-west another one ends in the air.
"""

import math

import numpy as np

from pybullet_simulation.clutter import Propose, place, plan_bounds
from pybullet_simulation.solids import BURIED_M, Solid, box, cylinder, hull, turned_box, walls_around
from rigid_geometry import transform_from_rpy

LOW_XY, HIGH_XY = (-10.0, -10.0), (10.0, 10.0)
WALL_M, WALL_HEIGHT_M = 0.2, 2.5
SLOPE_RAD = math.radians(15.0)
PLATEAU = ((2.0, -2.0), (8.0, 4.0))  # low and high corner
PLATEAU_HEIGHT_M, PLATE_M = 2.3, 0.18
RAMP_Y = (-0.7, 2.7)
NARROW_M = 1.0
BLOCK = ((-7.5, -7.7), (-5.5, -5.7))
BLOCK_HEIGHT_M = 1.2
GAP_M = 1.7  # between clutter and anything else


def ramp_solids(rng: np.random.Generator) -> list[Solid]:
    """All of the yard; hydrants and dumpsters come from the seed."""
    ground = box("ground", (LOW_XY[0] - WALL_M, LOW_XY[1] - WALL_M, -0.5), (HIGH_XY[0] + WALL_M, HIGH_XY[1] + WALL_M, 0.0))
    walls = walls_around(LOW_XY, HIGH_XY, -BURIED_M, WALL_HEIGHT_M, WALL_M)
    structures = [_plateau(), _narrow_ramp_to_block(), _ramp_into_the_air()]
    return [ground, *walls, *(solid for structure in structures for solid in structure), *_clutter(rng, structures)]


def _wedge(name: str, low_x: float, high_x: float, y: tuple[float, float], height: float) -> Solid:
    """A solid ramp with level 0 at `low_x` and `height` at `high_x`; it rises towards `high_x`, on whichever side that lies."""
    profile = [(low_x, 0.0), (low_x, -BURIED_M), (high_x, -BURIED_M), (high_x, height)]
    return hull(name, [(x, side, z) for side in y for x, z in profile])


def _plateau() -> list[Solid]:
    (x0, y0), (x1, y1), top = *PLATEAU, PLATEAU_HEIGHT_M
    under = top - PLATE_M / 2  # supports end inside the plate
    return [
        _wedge("big_ramp", x0 - top / math.tan(SLOPE_RAD), x0, RAMP_Y, top),
        box("plateau", (x0, y0, top - PLATE_M), (x1, y1, top)),
        box("west_wall", (x0, y0 + 0.01, -BURIED_M), (x0 + 0.2, y1 - 0.01, under)),
        box("north_pillar", (x1 - 0.31, y1 - 0.31, -BURIED_M), (x1 - 0.01, y1 - 0.01, under)),
        box("south_pillar", (x1 - 0.31, y0 + 0.01, -BURIED_M), (x1 - 0.01, y0 + 0.31, under)),
    ]


def _narrow_ramp_to_block() -> list[Solid]:
    (x0, y0), (x1, y1), top = *BLOCK, BLOCK_HEIGHT_M
    middle = (y0 + y1) / 2
    ramp = _wedge("narrow_ramp", x1 + top / math.tan(SLOPE_RAD), x1, (middle - NARROW_M / 2, middle + NARROW_M / 2), top)
    return [box("block", (x0, y0, -BURIED_M), (x1, y1, top)), ramp]


def _ramp_into_the_air() -> list[Solid]:
    return [_wedge("ramp_into_the_air", -6.5, -3.5, (6.3, 6.3 + NARROW_M), 3.0 * math.tan(SLOPE_RAD))]


def _clutter(rng: np.random.Generator, structures: list[list[Solid]]) -> list[Solid]:
    feet = [plan_bounds(structure) + np.array([[-1.0, 0.0], [1.0, 0.0]]) for structure in structures]  # room before a ramp's foot
    keep_off = [(bounds, GAP_M) for bounds in feet]
    proposals = [_dumpster(f"dumpster_{i}") for i in range(int(rng.integers(2, 4)))]
    proposals += [_hydrant(f"hydrant_{i}") for i in range(int(rng.integers(3, 6)))]
    solids: list[Solid] = []
    for propose in proposals:
        thing = place(rng, propose, keep_off)
        solids += thing
        keep_off += [(plan_bounds(thing), GAP_M)] if thing else []
    return solids


def _dumpster(name: str) -> Propose:
    """A container with a lid that slopes to the front."""

    def propose(rng: np.random.Generator) -> list[Solid]:
        x, y = rng.uniform(-7.2, 7.2, 2)
        T = transform_from_rpy((x, y, 0.55), (0.0, 0.0, rng.uniform(-math.pi, math.pi)))
        corners = [(sx * 0.95, sy * 0.6, z) for sx in (-1, 1) for sy, z in ((-1, 0.56), (1, 0.56), (-1, 0.65), (1, 0.85))]
        lid = hull(f"{name}_lid", np.array(corners) @ T[:3, :3].T + T[:3, 3])
        return [turned_box(name, T, (1.8, 1.1, 1.2)), lid]

    return propose


def _hydrant(name: str) -> Propose:
    def propose(rng: np.random.Generator) -> list[Solid]:
        x, y = rng.uniform(-8.1, 8.1, 2)
        T = transform_from_rpy((x, y, 0.5), (0.0, 0.0, rng.uniform(-math.pi, math.pi)))
        return [
            cylinder(f"{name}_foot", x, y, -BURIED_M, 0.08, 0.17),
            cylinder(f"{name}_barrel", x, y, -BURIED_M, 0.65, 0.11),
            cylinder(f"{name}_cap", x, y, 0.62, 0.78, 0.13),
            turned_box(f"{name}_nozzles", T, (0.40, 0.12, 0.12)),
        ]

    return propose
