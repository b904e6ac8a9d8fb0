"""The rolling window: which cells of the map frame the costmap holds now, and how layers move with it.

Cell (row, column) = (y, x); cell indices count from the origin of the map frame, so the window's corner is always a whole
multiple of the resolution and a cell keeps its ground when the window moves.
"""

import math
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

S = TypeVar("S", bound=np.generic)


@dataclass(frozen=True)
class Window:
    """`cells` x `cells` square cells of `resolution` m whose lower left one has the map index (`ix`, `iy`)."""

    ix: int
    iy: int
    cells: int
    resolution: float

    @classmethod
    def centred(cls, x: float, y: float, cells: int, resolution: float) -> "Window":
        """The window whose middle cell contains (x, y) m; ValueError when the position is not finite."""
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ValueError(f"the window's centre is a finite position in map, not ({x}, {y})")
        return cls(math.floor(x / resolution) - cells // 2, math.floor(y / resolution) - cells // 2, cells, resolution)

    @property
    def origin_xy(self) -> tuple[float, float]:
        """Lower left corner in map, metres."""
        return self.ix * self.resolution, self.iy * self.resolution

    def centres(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Map coordinates of the cells' centres: x of the columns (n,), y of the rows (n,)."""
        steps: NDArray[np.float64] = np.arange(self.cells, dtype=np.float64) + 0.5
        return (self.ix + steps) * self.resolution, (self.iy + steps) * self.resolution

    def cell_of(self, points: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Rows, columns and "is inside" of (N, 2) map points; row and column are valid where inside."""
        # A hair's breadth keeps points that lie on a border, but for rounding, in the cell above it.
        column = np.floor(points[:, 0] / self.resolution + 1e-9).astype(np.int64) - self.ix
        row = np.floor(points[:, 1] / self.resolution + 1e-9).astype(np.int64) - self.iy
        inside = (row >= 0) & (row < self.cells) & (column >= 0) & (column < self.cells)
        return row, column, inside


def shifted(values: NDArray[S], old: Window, new: Window, fill: float) -> NDArray[S]:
    """(.., n, n) `values` of the window `old` as the window `new` sees them, `fill` where `new` uncovers ground."""
    out = np.full_like(values, fill)
    dx, dy, n = new.ix - old.ix, new.iy - old.iy, old.cells
    if abs(dx) < n and abs(dy) < n:
        (rows, from_rows), (columns, from_columns) = (
            (slice(max(0, -d), n - max(0, d)), slice(max(0, d), n - max(0, -d))) for d in (dy, dx)
        )
        out[..., rows, columns] = values[..., from_rows, from_columns]
    return out
