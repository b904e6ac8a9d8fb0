"""What the costmap hands on: costs with the place where they lie. Values are those of costmap_2d."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

FREE: Final = 0
INSCRIBED: Final = 253
LETHAL: Final = 254
NO_INFORMATION: Final = 255


@dataclass(frozen=True)
class CostmapView:
    """Costs of one moment: `cost` (ny, nx) uint8, row = y, column = x, `origin_xy` the lower left corner in map, metres."""

    cost: NDArray[np.uint8]
    origin_xy: tuple[float, float]
    resolution: float

    def cost_at(self, points: NDArray[np.floating]) -> NDArray[np.uint8]:
        """(N,) costs under (N, 2) map points; NO_INFORMATION outside the window and for points that are not finite."""
        points = np.asarray(points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 2:
            raise ValueError(f"points are (N, 2) map coordinates, not shape {points.shape}")
        cells = np.floor((points - np.asarray(self.origin_xy)) / self.resolution + 1e-9)
        ny, nx = self.cost.shape
        inside = (cells[:, 0] >= 0) & (cells[:, 0] < nx) & (cells[:, 1] >= 0) & (cells[:, 1] < ny)
        out = np.full(len(points), NO_INFORMATION, dtype=np.uint8)
        column, row = cells[inside].astype(np.int64).T
        out[inside] = self.cost[row, column]
        return out
