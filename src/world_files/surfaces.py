"""What a file holds, in metres: surfaces of triangles, and fields of heights, which become such."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int32]


@dataclass(frozen=True)
class Surface:
    """A surface that is not convex, such as terrain or a loaded mesh: vertices (V, 3) float64, triangles (T, 3) int32."""

    vertices: Array
    triangles: Indices


@dataclass(frozen=True)
class Mesh(Surface):
    """A surface, with the number of the closed solid that each triangle bounds (T,), OPEN where none, and where its origin lies (3,).

    `missing`: names of what its file shows, too, and that could not be read.
    """

    solid: Indices
    origin: Array
    missing: tuple[str, ...] = ()

    @property
    def bounds_xy(self) -> Array:
        """(2, 2) lowest and highest x, y."""
        return np.array([self.vertices[:, :2].min(axis=0), self.vertices[:, :2].max(axis=0)])


@dataclass(frozen=True)
class HeightField:
    """Heights (rows, columns) in m on a regular grid: heights[r, c] lies at (x0 + c * step, y0 + r * step)."""

    heights: Array
    x0: float
    y0: float
    step: float


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
