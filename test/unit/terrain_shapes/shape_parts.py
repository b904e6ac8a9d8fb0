"""Parts that shapes are built from."""

import math
from collections.abc import Sequence

import numpy as np

from pybullet_simulation.solids import Solid, box, hull
from pybullet_simulation.solids import cylinder as upright_cylinder

GROUND = box("ground", (-12, -12, -0.5), (12, 12, 0))
BURIED_M = 0.05  # what stands on the ground begins below it

Pair = tuple[float, float]


def block(x: Pair, y: Pair, z: Pair) -> Solid:
    """An upright box by its extent along each axis."""
    low, high = zip(x, y, z, strict=True)
    return box("block", low, high)


def on_ground(x: Pair, y: Pair, top: float) -> Solid:
    """The same from below the ground up."""
    return block(x, y, (-BURIED_M, top))


def pillar(x: float, y: float, radius: float, top: float = 1.6) -> Solid:
    """An upright cylinder on the ground."""
    return upright_cylinder("pillar", x, y, -BURIED_M, top, radius)


def prism(profile: Sequence[Pair], y: Pair) -> Solid:
    """The convex outline (x, z) drawn out along y."""
    return hull("prism", [(x, side, z) for side in y for x, z in profile])


def slope(x: Pair, z: Pair, y: Pair, bottom: float = -BURIED_M) -> Solid:
    """Solid ground that goes from height z[0] at x[0] to z[1] at x[1]."""
    return prism([(x[0], z[0]), (x[1], z[1]), (x[0], bottom), (x[1], bottom)], y)


def tilted_plate(x: Pair, z: Pair, y: Pair, thickness: float) -> Solid:
    """The same as a plate with room below."""
    return prism([(x[0], z[0]), (x[1], z[1]), (x[0], z[0] - thickness), (x[1], z[1] - thickness)], y)


def run_of(height: float, angle_deg: float) -> float:
    """How far a slope goes for a height."""
    return height / math.tan(math.radians(angle_deg))


def floor_around(x: Pair, y: Pair, top: float = 0.0, bottom: float = -0.5, reach: float = 12.0) -> list[Solid]:
    """Ground with a rectangular hole in it."""
    return [
        block((-reach, reach), (-reach, y[0]), (bottom, top)),
        block((-reach, reach), (y[1], reach), (bottom, top)),
        block((-reach, x[0]), y, (bottom, top)),
        block((x[1], reach), y, (bottom, top)),
    ]


def wall_with_door(width: float, height: float = 2.0, x: Pair = (0.0, 0.15), reach: float = 12.0) -> list[Solid]:
    """A wall across x with a door around y = 0."""
    half = width / 2
    return [
        on_ground(x, (-reach, -half), 2.4),
        on_ground(x, (half, reach), 2.4),
        block(x, (-half, half), (height, 2.4)),
    ]


def ring(radii: Sequence[float], heights: Sequence[float], sectors: int = 32) -> list[Solid]:
    """A round dam around the origin: the convex outline (radius, height) of each sector."""
    angles = np.linspace(0.0, 2.0 * math.pi, sectors + 1)
    return [
        hull("sector", [(r * math.cos(a), r * math.sin(a), z) for a in pair for r, z in zip(radii, heights, strict=True)])
        for pair in zip(angles[:-1], angles[1:], strict=True)
    ]
