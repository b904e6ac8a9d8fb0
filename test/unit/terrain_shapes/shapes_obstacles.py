"""What stands on the ground: walls with doors, pillars, fences. The robot is 0.67 m wide and needs 1.2 m to turn.

A door is one to drive through straight when a voxel is left on either side (0.83 m), and none when there is less than half of one.
"""

from shape import Shape, Stand, no_path, not_traversable, obstacle, path, seen, traversable
from shape_parts import GROUND, block, on_ground, pillar, wall_with_door

from pybullet_simulation.solids import Solid

FITS_M, TOO_NARROW_M = 0.83, 0.75
BEFORE = (Stand(-2.6, 0.0), Stand(-1.2, 0.3))


def _door(width: float) -> Shape:
    """A door in a wall from end to end, seen from both sides where the robot fits through."""
    half = width / 2
    jambs = [obstacle((-0.1, side[0], 0.0), (0.25, side[1], 1.1)) for side in ((half + 0.1, half + 1.2), (-half - 1.2, -half - 0.1))]
    solids, before = [GROUND, *wall_with_door(width)], traversable((-2.2, -0.8, 0.0), (-0.8, 0.8, 0.0))
    if width >= FITS_M:
        return seen(f"door of {width:g} m", solids, (Stand(-2.6, 0.0), Stand(-0.9, 0.0), Stand(1.3, 0.0)), *jambs, path((-1.5, 0.0, 0.0)))
    closed = (no_path((1.5, 0.0, 0.0)),) if width < TOO_NARROW_M else ()
    return seen(f"door of {width:g} m", solids, BEFORE, *jambs, before, *closed)


def _forest(gap: float) -> list[Solid]:
    """Rows of pillars of 20 cm from x = 0 to 4, `gap` metres between them, every other row shifted by half of that."""
    step = gap + 0.2
    rows = range(int(4.0 / step) + 1)
    return [pillar(row * step, y * step + (row % 2) * step / 2, 0.1) for row in rows for y in range(-int(9.0 / step), int(9.0 / step) + 1)]


FENCE = [  # wire of 1 cm, a mesh of 15 cm, 1.2 m high
    *(block((0.0, 0.01), (0.15 * k, 0.15 * k + 0.01), (-0.05, 1.2)) for k in range(-80, 81)),
    *(block((0.0, 0.01), (-12.0, 12.0), (0.15 * k, 0.15 * k + 0.01)) for k in range(1, 9)),
]
RAILING = [
    *(block((0.0, 0.04), (y, y + 0.04), (-0.05, 1.0)) for y in range(-12, 13, 2)),
    *(block((0.0, 0.04), (-12.0, 12.04), (z, z + 0.04)) for z in (0.5, 0.96)),
]
CORRIDOR = [on_ground((-2.0, 3.0), y, 2.0) for y in ((-1.0, -0.8), (0.8, 1.0))]

SHAPES = (
    *(_door(width) for width in (0.7, 0.8, 0.9, 1.0, 1.2, 1.5)),
    seen(
        "pillar forest, 1.8 m apart",
        [GROUND, *_forest(1.8)],
        (Stand(-2.0, 0.3), Stand(-1.0, 0.6), Stand(1.0, 0.6)),
        path((-1.8, 0.0, 0.0)),
        path((3.0, 1.0, 0.0)),
        not_traversable((-0.4, -0.3, 0.0), (0.4, 0.3, 0.0)),
        not_traversable((1.6, 0.7, 0.0), (2.4, 1.3, 0.0)),
    ),
    seen(
        "pillar forest, 0.5 m apart",
        [GROUND, *_forest(0.5)],
        BEFORE,
        not_traversable((0.0, -1.5, 0.0), (1.5, 1.5, 0.0)),
        no_path((1.7, 0.0, 0.0)),
    ),
    seen(
        "post of 4 cm",
        (GROUND, pillar(0.0, 0.0, 0.02, 1.2)),
        (Stand(-2.2, 0.3), Stand(-1.0, -1.2, yaw_deg=40.0)),
        not_traversable((-0.33, -0.33, 0.0), (0.33, 0.33, 0.0)),
        path((1.0, 0.8, 0.0)),
    ),
    seen(
        "grid fence",
        [GROUND, *FENCE],
        BEFORE,
        not_traversable((-0.3, -1.5, 0.0), (0.3, 1.5, 0.0)),
        obstacle((-0.15, -1.2, 0.0), (0.2, 1.2, 1.2)),
        no_path((1.5, 0.0, 0.0)),
    ),
    seen(
        "railing of two bars",
        [GROUND, *RAILING],
        BEFORE,
        not_traversable((-0.3, -1.5, 0.0), (0.3, 1.5, 0.0)),
        no_path((1.5, 0.0, 0.0)),
    ),
    seen(
        "box of 20 cm",
        (GROUND, on_ground((0.0, 0.4), (-0.2, 0.2), 0.2)),
        BEFORE,
        not_traversable((-0.3, -0.5, 0.0), (0.7, 0.5, 0.2)),
        path((1.0, 1.2, 0.0)),
    ),
    seen(
        "bollard of 30 cm",
        (GROUND, pillar(0.0, 0.0, 0.08, 0.3)),
        BEFORE,
        not_traversable((-0.35, -0.35, 0.0), (0.35, 0.35, 0.3)),
        path((0.9, -0.9, 0.0)),
    ),
    seen(
        "wall",
        (GROUND, on_ground((0.0, 0.2), (-12.0, 12.0), 2.0)),
        BEFORE,
        obstacle((-0.1, -1.5, 0.0), (0.15, 1.5, 1.2)),
        not_traversable((-0.3, -1.5, 0.0), (0.2, 1.5, 0.0)),
        traversable((-2.0, -1.2, 0.0), (-0.8, 1.2, 0.0)),
        no_path((1.0, 0.0, 0.0)),
    ),
    seen(
        "corridor of 1.6 m",
        [GROUND, *CORRIDOR],
        (Stand(-2.6, 0.0), Stand(-0.4, 0.0), Stand(2.0, 0.0)),
        traversable((-1.6, -0.1, 0.0), (1.2, 0.1, 0.0)),
        path((-2.4, 0.0, 0.0)),
        path((3.4, 0.0, 0.0)),
    ),
)
