"""What the laser does not see, and what does not stay."""

from shape import Scene, Shape, Stand, no_path, not_traversable, obstacle, path, seen, traversable
from shape_parts import GROUND, block, floor_around, on_ground, pillar, wall_with_door

BEFORE = (Stand(-2.6, 0.0), Stand(-1.1, 0.3))
PUDDLE = ((0.0, 0.9), (-1.2, 1.2))

SHAPES = (
    seen(
        "floor that gives no echo",
        floor_around(*PUDDLE),
        BEFORE,
        not_traversable((0.05, -1.1, 0.0), (0.85, 1.1, 0.0)),
        traversable((-2.0, -1.0, 0.0), (-0.8, 1.0, 0.0)),
        path((0.4, 2.2, 0.0)),
        mute=[block(*PUDDLE, (-0.5, 0.0))],
    ),
    seen(
        "pane of glass in a wall",
        [GROUND, *wall_with_door(2.0, height=2.2)],
        BEFORE,
        not_traversable((0.1, -0.9, 0.0), (1.5, 0.9, 0.0)),
        traversable((-2.0, -0.8, 0.0), (-0.8, 0.8, 0.0)),
        no_path((1.5, 0.0, 0.0)),
        mute=[on_ground((0.05, 0.07), (-1.0, 1.0), 2.2)],
    ),
    Shape(
        "moved box",
        (
            Scene((GROUND, on_ground((0.4, 0.9), (-0.3, 0.3), 0.8)), (Stand(-2.4, 0.0), Stand(-0.9, 0.2))),
            Scene((GROUND, on_ground((0.4, 0.9), (1.8, 2.4), 0.8)), (Stand(-0.9, 0.2), Stand(-1.3, -0.6), Stand(-0.7, -0.3))),
        ),
        (
            traversable((0.2, -0.6, 0.0), (1.2, 0.6, 0.0)),
            path((1.4, 0.0, 0.0)),
            obstacle((0.3, 1.75, 0.0), (0.6, 2.45, 0.8)),
        ),
    ),
    Shape(
        "passer-by",
        tuple(
            Scene((GROUND, pillar(0.8, y, 0.2, 1.7)), (stand,))
            for y, stand in ((-1.4, Stand(-2.2, 0.0)), (0.0, Stand(-1.2, 0.1)), (1.4, Stand(-0.9, -0.3)), (4.0, Stand(-0.8, 0.2)))
        ),
        (
            traversable((0.0, -1.0, 0.0), (1.4, 1.0, 0.0)),
            path((1.6, 0.0, 0.0)),
        ),
    ),
    Shape(
        "gate that opens",
        (
            Scene([GROUND, *wall_with_door(1.6), on_ground((0.05, 0.1), (-0.8, 0.8), 2.0)], (Stand(-2.6, 0.0), Stand(-1.2, 0.2))),
            Scene([GROUND, *wall_with_door(1.6)], (Stand(-1.2, -0.1), Stand(-1.5, 0.1))),
        ),
        (
            path((1.2, 0.0, 0.0)),
            obstacle((-0.1, 0.95, 0.0), (0.25, 2.2, 1.1)),
        ),
    ),
)
