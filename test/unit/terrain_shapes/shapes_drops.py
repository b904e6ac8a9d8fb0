"""Drops: seen ones are cliffs, unseen ones are questions, and what a wheel of 33 cm passes over is neither."""

from shape import Shape, Stand, cliff, frontier, no_cliff, no_frontier, no_path, not_traversable, path, seen, traversable
from shape_parts import block, floor_around, ring, run_of

BROAD = (-6.0, 6.0)


def _terrace(drop: float) -> list:
    """Ground at 0 up to x = 1.2, and `drop` metres lower beyond."""
    return [block((-12.0, 12.0), (-12.0, 12.0), (-drop - 0.5, -drop)), block((-7.0, 1.2), BROAD, (-drop - 0.1, 0.0))]


def _trench(width: float, depth: float) -> Shape:
    """Across x = 0 from end to end of the ground."""
    half = width / 2
    solids = [
        block((-12.0, 12.0), (-12.0, 12.0), (-depth - 0.5, -depth)),
        block((-12.0, -half), (-12.0, 12.0), (-depth - 0.1, 0.0)),
        block((half, 12.0), (-12.0, 12.0), (-depth - 0.1, 0.0)),
    ]
    return seen(
        f"trench of {100 * width:g} cm",
        solids,
        (Stand(-2.6, 0.0), Stand(-1.2, 0.3)),
        not_traversable((-half - 0.2, -1.5, -0.1), (half + 0.2, 1.5, 0.0)),
        cliff((-half - 0.2, -1.2, 0.0), (-half + 0.08, 1.2, 0.0)),
        no_path((1.6, 0.0, 0.0)),
    )


def _hole(size: float, name: str, depth: float | None) -> Shape:
    """A square hole around the origin; without a depth there is nothing below it, as where a plate of a deck is missing."""
    half = size / 2
    solids = floor_around((-half, half), (-half, half), bottom=-0.15 if depth is None else -depth - 0.5)
    below = [block((-half, half), (-half, half), (-depth - 0.5, -depth))] if depth is not None else []
    return seen(
        name,
        [*solids, *below],
        (Stand(-2.6, 0.0), Stand(-1.3, -1.3, yaw_deg=45.0)),
        not_traversable((-half - 0.2, -half - 0.2, -0.2), (half + 0.2, half + 0.2, 0.0)),
        traversable((-2.2, -0.8, 0.0), (-half - 0.8, 0.4, 0.0)),
        path((0.0, -half - 1.0, 0.0)),
    )


GRATING = [block((0.20 * k - 0.08, 0.20 * k + 0.08), BROAD, (-0.05, 0.0)) for k in range(12)]
GENTLE, STEEP = run_of(0.6, 17.0), run_of(0.6, 38.0)
CRATER_M = 2.4  # radius of the rim

SHAPES = (
    seen(
        "plateau edge, seen",
        _terrace(1.5),
        (Stand(-2.4, 0.0), Stand(-0.1, 0.2)),
        cliff((0.95, -1.2, 0.0), (1.28, 1.2, 0.0)),
        not_traversable((0.8, -1.2, 0.0), (1.4, 1.2, 0.0)),
        no_frontier((0.9, -1.0, 0.0), (1.5, 1.0, 0.0)),
        traversable((-0.6, -1.0, 0.0), (0.3, 1.0, 0.0)),
        no_path((2.5, 0.0, -1.5)),
    ),
    seen(
        "plateau edge, not seen",
        _terrace(3.0),
        (Stand(-2.4, 0.0),),
        frontier((0.6, -1.5, -0.1), (1.7, 1.5, 0.1)),
        no_cliff((0.6, -1.2, -0.1), (1.4, 1.2, 0.1)),
        no_path((2.5, 0.0, -3.0)),
    ),
    seen(
        "plateau edge over nothing",
        _terrace(1.5)[1:],
        (Stand(-2.4, 0.0), Stand(-0.1, 0.2)),
        cliff((0.95, -1.2, 0.0), (1.28, 1.2, 0.0)),
        not_traversable((0.8, -1.2, 0.0), (1.4, 1.2, 0.0)),
        no_frontier((0.9, -1.0, 0.0), (1.5, 1.0, 0.0)),
    ),
    _trench(0.4, 0.6),
    _trench(0.8, 1.0),
    _hole(0.5, "hole of 0.5 m", 0.8),
    _hole(1.0, "hole of 1 m", 1.2),
    _hole(1.0, "missing plate", None),
    seen(
        "grating with gaps of 4 cm",
        [
            block((-12.0, -0.12), (-12.0, 12.0), (-0.5, 0.0)),
            *GRATING,
            block((2.32, 12.0), (-12.0, 12.0), (-0.5, 0.0)),
            block((-1.0, 3.0), BROAD, (-1.5, -1.0)),
        ],
        (Stand(-2.6, 0.0), Stand(-0.75, 0.2), Stand(3.0, 0.0, yaw_deg=180.0)),
        traversable((-0.5, -1.2, 0.0), (2.6, 1.2, 0.0)),
        path((-2.0, 0.0, 0.0)),
    ),
    seen(
        "crater with gentle walls",
        [block((-12.0, 12.0), (-12.0, 12.0), (-0.5, 0.0)), *ring((CRATER_M - GENTLE, CRATER_M, CRATER_M + GENTLE), (-0.05, 0.6, -0.05))],
        (Stand(-6.0, 0.0), Stand(-4.6, 0.0), Stand(-1.4, 0.0, 0.3), Stand(0.0, 0.0, 0.0, 180.0)),
        path((-4.9, 0.0, 0.0)),
        traversable((-4.3, -0.6, 0.0), (-1.0, 0.6, 0.6)),
    ),
    seen(
        "crater with steep walls",
        [block((-12.0, 12.0), (-12.0, 12.0), (-0.5, 0.0)), *ring((CRATER_M - STEEP, CRATER_M, CRATER_M + GENTLE), (-0.05, 0.6, -0.05))],
        (Stand(-6.0, 0.0), Stand(-4.6, 0.0), Stand(-3.5, 0.0, 0.24)),
        not_traversable((-CRATER_M + 0.15, -0.5, 0.0), (-CRATER_M + STEEP - 0.1, 0.5, 0.5)),
        no_path((0.0, 0.0, 0.0)),
    ),
)
