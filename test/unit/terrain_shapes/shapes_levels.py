"""Floors above floors, and the ways between them."""

import math

from shape import Stand, cliff, no_path, not_traversable, path, seen, traversable
from shape_parts import GROUND, block, on_ground, run_of, slope

from pybullet_simulation.solids import Solid, hull

UPPER = 2.2
UP = run_of(UPPER, 17.0)
MEZZANINE = 1.5
STAIRWAY = run_of(MEZZANINE, 20.0)
NARROW = run_of(0.9, 15.0)


def _along(begin: float, run: float, height: float, *at: float) -> list[Stand]:
    """Stands on a ramp along x, at these distances from its foot."""
    return [Stand(begin + x, 0.0, height * x / run) for x in at]


def _narrow(width: float) -> tuple[Solid, ...]:
    """A ramp of 0.9 m along x with its foot at x = 0, and a platform of 3 m at its head."""
    half = width / 2
    return (GROUND, slope((0.0, NARROW), (0.0, 0.9), (-half, half)), on_ground((NARROW - 0.01, NARROW + 3.0), (-1.5, 1.5), 0.9))


def _spiral(turns: float, rise: float, inner: float, outer: float, sectors: int = 24) -> list[Solid]:
    """A ramp around the origin, plates of 12 cm; it begins at (inner..outer, 0, 0), counter-clockwise."""
    plates = []
    for k in range(round(turns * sectors)):
        corners = []
        for angle, z in ((2 * math.pi * i / sectors, rise * i / sectors) for i in (k, k + 1)):
            corners += [(r * math.cos(angle), r * math.sin(angle), z - t) for r in (inner, outer) for t in (0.0, 0.12)]
        plates.append(hull("plate", corners))
    return plates


def _on_spiral(turn: float, rise: float, radius: float) -> Stand:
    angle = 2 * math.pi * turn
    return Stand(radius * math.cos(angle), radius * math.sin(angle), rise * turn, math.degrees(angle) + 90.0)


SPIRAL_RISE = 1.9

SHAPES = (
    seen(
        "two storeys",
        (
            GROUND,
            slope((-UP, 0.01), (0.0, UPPER), (-1.6, 1.6)),
            block((0.0, 5.0), (-3.5, 3.5), (UPPER - 0.2, UPPER)),
            *(on_ground((4.7, 4.9), y, UPPER - 0.1) for y in ((-3.4, -3.2), (3.2, 3.4))),
        ),
        (
            Stand(-UP - 1.5, 0.0),
            *_along(-UP, UP, UPPER, 1.4, 3.8, 6.2),
            Stand(1.2, 0.0, UPPER),
            Stand(3.4, 0.8, UPPER),
            Stand(2.4, -4.8, 0.0, 90.0),
            Stand(2.4, -2.4, 0.0, 90.0),
        ),
        path((2.6, 0.8, UPPER)),
        path((2.4, 0.0, 0.0)),
        traversable((1.8, -1.8, 0.0), (3.2, -0.8, 0.0)),
        traversable((1.9, -0.4, UPPER), (2.7, 1.4, UPPER)),
        path((-3.5, 0.0, UPPER * (UP - 3.5) / UP)),
    ),
    seen(
        "mezzanine",
        (
            GROUND,
            slope((-STAIRWAY, 0.01), (0.0, MEZZANINE), (-1.5, 1.5)),
            block((0.0, 4.0), (-1.5, 4.0), (MEZZANINE - 0.2, MEZZANINE)),
            on_ground((3.8, 4.0), (-1.5, 4.0), MEZZANINE - 0.1),
        ),
        (
            Stand(-STAIRWAY - 1.4, 0.0),
            *_along(-STAIRWAY, STAIRWAY, MEZZANINE, 1.2, 3.2),
            Stand(1.0, 0.0, MEZZANINE),
            Stand(2.0, 1.4, MEZZANINE, 90.0),
            Stand(1.6, 2.8, MEZZANINE, 90.0),
        ),
        path((-STAIRWAY - 1.2, 0.0, 0.0)),
        traversable((0.9, 0.8, MEZZANINE), (2.6, 2.0, MEZZANINE)),
        cliff((0.8, 3.75, MEZZANINE), (2.6, 4.08, MEZZANINE)),
        not_traversable((0.8, 3.7, MEZZANINE), (2.6, 4.2, MEZZANINE)),
        path((1.6, 5.2, 0.0)),
    ),
    seen(
        "spiral",
        [GROUND, *_spiral(1.25, SPIRAL_RISE, 1.6, 4.0)],
        (
            Stand(2.8, -1.8, 0.0, 90.0),
            *(_on_spiral(turn, SPIRAL_RISE, 2.8) for turn in (0.04, 0.17, 0.30, 0.43, 0.56, 0.69, 0.82, 0.95, 1.08)),
        ),
        path((0.0, 2.8, SPIRAL_RISE / 4)),
        path((0.0, -2.8, SPIRAL_RISE * 0.75)),
        path((2.8, -1.7, 0.0)),
        no_path((5.2, 0.0, SPIRAL_RISE)),
    ),
    seen(
        "narrow ramp of 1 m to a platform",
        _narrow(1.0),
        (Stand(-2.2, 0.0), Stand(-0.9, 0.0), *_along(0.0, NARROW, 0.9, 1.6), Stand(NARROW + 1.2, 0.0, 0.9)),
        path((-2.0, 0.0, 0.0)),
        path((NARROW + 2.2, 0.0, 0.9)),
        not_traversable((1.4, -0.5, 0.3), (NARROW - 0.4, -0.35, 0.8)),
        not_traversable((1.4, 0.35, 0.3), (NARROW - 0.4, 0.5, 0.8)),
    ),
    seen(
        "narrow ramp of 0.6 m to a platform",
        _narrow(0.6),
        (Stand(-2.2, 0.0), Stand(-0.9, 0.4)),
        not_traversable((1.4, -0.3, 0.3), (NARROW - 0.4, 0.3, 0.8)),
        no_path((NARROW - 1.0, 0.0, 0.64)),
        no_path((NARROW + 1.0, 0.0, 0.9)),
    ),
    seen(
        "narrow ramp of 1 m into the air",
        _narrow(1.0)[:2],
        (Stand(-2.2, 0.0), Stand(-0.9, 0.0), *_along(0.0, NARROW, 0.9, 1.4)),
        not_traversable((2.9, -0.5, 0.75), (NARROW + 0.1, 0.5, 0.95)),
        no_path((NARROW - 0.2, 0.0, 0.86)),
    ),
)
