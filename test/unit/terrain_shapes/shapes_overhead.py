"""Things overhead: the robot is 1.0 m high and wants 1.1 m."""

from shape import Shape, Stand, no_path, not_traversable, obstacle, path, seen, traversable
from shape_parts import GROUND, block, on_ground, run_of, slope, tilted_plate, wall_with_door

BROAD = (-5.0, 5.0)
BEFORE = (Stand(-2.6, 0.0), Stand(-1.2, 0.3))


def _bridge(underside: float) -> Shape:
    """A deck of 2 m across the way, on walls that leave a passage of 3 m."""
    walls = [on_ground((0.0, 2.0), y, underside) for y in ((-12.0, -1.5), (1.5, 12.0))]
    solids = [GROUND, *walls, block((0.0, 2.0), BROAD, (underside, underside + 0.2))]
    name = f"bridge, {100 * underside:g} cm above the ground"
    if underside < 1.1:
        return seen(
            name, solids, BEFORE, not_traversable((-0.1, -1.2, 0.0), (1.9, 1.2, 0.0)), no_path((1.0, 0.0, 0.0)), no_path((3.0, 0.0, 0.0))
        )
    return seen(
        name,
        solids,
        (*BEFORE, Stand(1.0, 0.0)),
        traversable((-0.8, -0.7, 0.0), (2.4, 0.7, 0.0)),
        path((2.8, 0.0, 0.0)),
        path((-2.0, 0.0, 0.0)),
    )


def _bar(underside: float) -> Shape:
    """A bar of 6 cm between two posts, across a passage of 2.4 m."""
    solids = [
        GROUND,
        on_ground((0.0, 0.1), (-12.0, -1.2), 1.8),
        on_ground((0.0, 0.1), (1.2, 12.0), 1.8),
        block((0.0, 0.06), (-1.2, 1.2), (underside, underside + 0.06)),
    ]
    name = f"bar, {100 * underside:g} cm above the ground"
    if underside < 1.1:
        return seen(name, solids, BEFORE, not_traversable((-0.2, -1.0, 0.0), (0.3, 1.0, 0.0)), no_path((1.5, 0.0, 0.0)))
    return seen(name, solids, BEFORE, traversable((-0.6, -0.4, 0.0), (0.8, 0.4, 0.0)), path((1.5, 0.0, 0.0)))


def _shelf(underside: float) -> Shape:
    """A wall at x = 1 with a shelf of 0.8 m towards the robot."""
    solids = [GROUND, on_ground((1.0, 1.2), BROAD, 2.2), block((0.2, 1.05), (-1.5, 1.5), (underside, underside + 0.15))]
    name = f"shelf, {100 * underside:g} cm above the ground"
    if underside < 1.1:
        return seen(name, solids, BEFORE, not_traversable((0.0, -1.4, 0.0), (0.9, 1.4, 0.0)), obstacle((0.1, -1.3, 0.0), (0.4, 1.3, 1.0)))
    return seen(name, solids, BEFORE, traversable((-0.5, -1.2, 0.0), (0.25, 1.2, 0.0)), obstacle((0.9, -1.3, 0.0), (1.15, 1.3, 1.1)))


RUN = run_of(1.8, 15.0)
PLATE = run_of(2.2, 18.0)
CROSSED = [  # a deck at 1.8 m from y = -1.5 to 1.5 that a ramp along x leads to, and a passage below it along y
    GROUND,
    slope((-RUN - 1.5, -1.5), (0.0, 1.8), (-1.5, 1.5)),
    block((-1.55, 1.55), (-1.5, 1.5), (1.6, 1.8)),
    on_ground((1.5, 4.0), (-1.5, 1.5), 1.8),
]

SHAPES = (
    seen(
        "table",
        (
            GROUND,
            block((0.2, 1.0), (-0.8, 0.8), (0.71, 0.75)),
            *(on_ground(x, y, 0.73) for x in ((0.22, 0.27), (0.93, 0.98)) for y in ((-0.78, -0.73), (0.73, 0.78))),
        ),
        BEFORE,
        not_traversable((0.1, -0.9, 0.0), (1.1, 0.9, 0.0)),
        path((0.6, 1.8, 0.0)),
        no_path((0.6, 0.0, 0.0)),
    ),
    _bridge(0.9),
    _bridge(1.4),
    _bar(0.7),
    _bar(1.35),
    _shelf(0.5),
    _shelf(0.9),
    _shelf(1.4),
    seen(
        "bridge, over and under",
        CROSSED,
        (
            Stand(-8.6, -1.9),
            Stand(-6.5, 0.0, 0.46),
            Stand(-3.6, 0.0, 1.24),
            Stand(0.0, 0.0, 1.8),
            Stand(0.0, -3.0, 0.0, 90.0),
            Stand(0.0, 0.0, 0.0, 90.0),
        ),
        path((0.0, 2.2, 0.0)),
        path((0.0, 0.0, 1.8)),
        traversable((-0.6, -1.8, 0.0), (0.6, 1.2, 0.0)),
        traversable((-1.2, -0.5, 1.8), (-0.7, 0.5, 1.8)),
    ),
    seen(
        "room under a ramp",
        [GROUND, tilted_plate((0.0, PLATE), (0.0, 2.2), (-2.0, 2.0), 0.12), on_ground((PLATE, PLATE + 0.2), (-2.0, 2.0), 2.2)],
        (Stand(4.0, -4.2, 0.0, 90.0), Stand(5.2, -2.9, 0.0, 90.0), Stand(5.3, -0.8, 0.0, 90.0)),
        not_traversable((1.6, -1.7, 0.0), (3.4, 1.7, 0.0)),
        traversable((5.0, -2.4, 0.0), (5.8, 0.8, 0.0)),
        path((4.5, -3.5, 0.0)),
    ),
    seen(
        "tunnel, 2 m wide and 1.35 m high",
        [
            GROUND,
            *(on_ground((0.0, 4.0), y, 1.4) for y in ((-1.4, -1.0), (1.0, 1.4))),
            block((0.0, 4.0), (-1.4, 1.4), (1.35, 1.5)),
            *(on_ground((0.0, 0.2), y, 1.5) for y in ((-12.0, -1.2), (1.2, 12.0))),
        ],
        (Stand(-2.0, 0.0), Stand(0.3, 0.0), Stand(2.6, 0.0)),
        traversable((-0.8, -0.25, 0.0), (3.6, 0.25, 0.0)),
        path((-1.8, 0.0, 0.0)),
    ),
    seen(
        "door of 1.6 m, 0.9 m high",
        [GROUND, *wall_with_door(1.6, height=0.9)],
        BEFORE,
        not_traversable((-0.2, -0.8, 0.0), (0.3, 0.8, 0.0)),
        no_path((1.5, 0.0, 0.0)),
    ),
)
