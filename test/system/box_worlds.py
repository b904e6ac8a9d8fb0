"""Worlds of boxes for single runs, in metres."""

import numpy as np
import trimesh

Span = tuple[float, float]


def box(x: Span, y: Span, z: Span) -> trimesh.Trimesh:
    """Between these limits."""
    return trimesh.creation.box(bounds=np.array([x, y, z]).T)


def two_rooms() -> trimesh.Trimesh:
    """6.4 x 4 m: a wall with an opening of 1.6 m, and something that stands in each room."""
    wall = box((-0.1, 0.1), (-0.4, 2.0), (-0.2, 1.8))
    things = (
        box((-2.9, -2.3), (1.2, 2.0), (-0.2, 0.9)),
        box((2.6, 3.2), (-2.0, -1.1), (-0.2, 1.3)),
        box((1.2, 1.9), (1.6, 2.0), (-0.2, 0.6)),
    )
    return trimesh.util.concatenate([walled_floor((-3.2, 3.2), (-2.0, 2.0)), wall, *things])


def walled_floor(x: Span, y: Span) -> trimesh.Trimesh:
    """A floor at height 0 with walls around it."""
    walls = [box((at - 0.1, at + 0.1), (y[0] - 0.1, y[1] + 0.1), (-0.2, 1.8)) for at in x]
    walls += [box(x, (at - 0.1, at + 0.1), (-0.2, 1.8)) for at in y]
    return trimesh.util.concatenate([*walls, box(x, y, (-0.2, 0.0))])
