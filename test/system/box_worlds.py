"""Worlds of boxes for single runs, in metres."""

import numpy as np
import trimesh

Span = tuple[float, float]


def box(x: Span, y: Span, z: Span) -> trimesh.Trimesh:
    """Between these limits."""
    return trimesh.creation.box(bounds=np.array([x, y, z]).T)


def walled_floor(x: Span, y: Span) -> trimesh.Trimesh:
    """A floor at height 0 with walls around it."""
    walls = [box((at - 0.1, at + 0.1), (y[0] - 0.1, y[1] + 0.1), (-0.2, 1.8)) for at in x]
    walls += [box(x, (at - 0.1, at + 0.1), (-0.2, 1.8)) for at in y]
    return trimesh.util.concatenate([*walls, box(x, y, (-0.2, 0.0))])
