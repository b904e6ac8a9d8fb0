"""Small meshes whose reachable area one finds with paper and pencil."""

import numpy as np
from numpy.typing import NDArray

Mesh = tuple[NDArray[np.float64], NDArray[np.int64]]

_CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
_FACES = [
    (0, 1, 3),
    (0, 3, 2),
    (4, 6, 7),
    (4, 7, 5),
    (0, 4, 5),
    (0, 5, 1),
    (2, 3, 7),
    (2, 7, 6),
    (0, 2, 6),
    (0, 6, 4),
    (1, 5, 7),
    (1, 7, 3),
]


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    """An axis-aligned solid."""
    return np.array(low) + _CORNERS * (np.array(high) - np.array(low)), np.array(_FACES)


def plate(x0: float, y0: float, x1: float, y1: float, z: float = 0.0) -> Mesh:
    """One horizontal rectangle without thickness."""
    return np.array([[x0, y0, z], [x1, y0, z], [x1, y1, z], [x0, y1, z]], dtype=float), np.array([[0, 1, 2], [0, 2, 3]])


def ramp(x0: float, y0: float, x1: float, y1: float, z0: float, z1: float) -> Mesh:
    """A rectangle that climbs along x from z0 to z1."""
    return np.array([[x0, y0, z0], [x1, y0, z1], [x1, y1, z1], [x0, y1, z0]], dtype=float), np.array([[0, 1, 2], [0, 2, 3]])


def wall(xa: float, ya: float, xb: float, yb: float, height: float = 2.0, base: float = 0.0) -> Mesh:
    """A vertical sheet without thickness over the line a-b."""
    corners = [[xa, ya, base], [xb, yb, base], [xb, yb, base + height], [xa, ya, base + height]]
    return np.array(corners, dtype=float), np.array([[0, 1, 2], [0, 2, 3]])


def join(*parts: Mesh) -> Mesh:
    """One mesh of several."""
    vertices, triangles, count = [], [], 0
    for v, t in parts:
        vertices.append(v)
        triangles.append(t + count)
        count += len(v)
    return np.vstack(vertices), np.vstack(triangles)


def room(width: float = 4.0, depth: float = 4.0) -> Mesh:
    """A flat floor from the origin to (width, depth) between four sheets of wall."""
    return join(
        plate(0, 0, width, depth), wall(0, 0, width, 0), wall(width, 0, width, depth), wall(width, depth, 0, depth), wall(0, depth, 0, 0)
    )
