"""Height fields as triangles, for the moon and for height maps from files."""

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.world import HeightField, Surface

Array = NDArray[np.float64]


def surface_from_heights(field: HeightField) -> Surface:
    """The field as triangles that face upwards; diagonals alternate, so that no direction is preferred."""
    rows, columns = field.heights.shape
    x, y = np.meshgrid(field.x0 + np.arange(columns) * field.step, field.y0 + np.arange(rows) * field.step)
    index = np.arange(rows * columns, dtype=np.int32).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    even = ((np.arange(rows - 1)[:, None] + np.arange(columns - 1)) % 2 == 0).ravel()[:, None]
    first = np.where(even, np.column_stack([a, b, c]), np.column_stack([a, b, d]))
    second = np.where(even, np.column_stack([a, c, d]), np.column_stack([b, c, d]))
    vertices = np.column_stack([x.ravel(), y.ravel(), field.heights.ravel()])
    return Surface(vertices, np.vstack([first, second]).astype(np.int32))
