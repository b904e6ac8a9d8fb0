"""Terrain layer: the classification of the last sweep, kept until the next and shifted with the window (thesis 6.2.1)."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from local_terrain_costmap.view import FREE, LETHAL, NO_INFORMATION
from local_terrain_costmap.window import Window

_TRAVERSABLE, _UNKNOWN, _BARRIER = 0, -1, 100


class TerrainLayer:
    """Costs FREE, LETHAL or NO_INFORMATION of a window, and where it is known to be traversable the ground's height and its distance from
    what is lethal."""

    def __init__(self, window: Window) -> None:
        self._source: _Source | None = None
        self._show(window)

    def set_terrain(
        self,
        cost: ArrayLike,
        origin_xy: tuple[float, float],
        resolution: float,
        height: ArrayLike | None = None,
        distance: ArrayLike | None = None,
    ) -> None:
        """Replace the terrain by a newer one; arguments as in `LocalCostmap.set_terrain`."""
        self._source = _Source.checked(cost, origin_xy, resolution, height, distance)
        self._show(self._window)

    def move(self, window: Window) -> None:
        """Show the part that lies in `window`."""
        self._show(window)

    def _show(self, window: Window) -> None:
        # The whole classified area is kept, so what leaves the window and comes back is not forgotten between two sweeps.
        self._window = window
        n = window.cells
        self.cost: NDArray[np.uint8] = np.full((n, n), NO_INFORMATION, dtype=np.uint8)
        self.height: NDArray[np.float32] = np.full((n, n), np.nan, dtype=np.float32)
        self.distance: NDArray[np.float32] = np.full((n, n), np.nan, dtype=np.float32)
        if self._source is not None:
            self._source.paint(window, self.cost, self.height, self.distance)


class _Source:
    """A classified grid as it was received."""

    def __init__(
        self,
        cost: NDArray[np.int64],
        height: NDArray[np.float32],
        distance: NDArray[np.float32],
        origin_xy: tuple[float, float],
        resolution: float,
    ) -> None:
        self._cost, self._height, self._distance = cost, height, distance
        self._origin_xy, self._resolution = origin_xy, resolution
        rows, columns = np.nonzero(cost == _BARRIER)
        self._barriers = np.column_stack([origin_xy[0] + (columns + 0.5) * resolution, origin_xy[1] + (rows + 0.5) * resolution])

    @classmethod
    def checked(
        cls,
        cost: ArrayLike,
        origin_xy: tuple[float, float],
        resolution: float,
        height: ArrayLike | None,
        distance: ArrayLike | None,
    ) -> "_Source":
        grid = np.asarray(cost)
        if grid.ndim != 2 or not np.isin(grid, (_TRAVERSABLE, _UNKNOWN, _BARRIER)).all():
            raise ValueError(f"terrain is (ny, nx) of 100, 0 or -1, not shape {grid.shape} with values {np.unique(grid)[:8].tolist()}")
        if not (np.isfinite(resolution) and resolution > 0 and len(origin_xy) == 2 and np.isfinite(origin_xy).all()):
            raise ValueError(f"terrain needs a finite origin and a positive resolution, not {origin_xy!r} and {resolution!r}")
        heights, distances = (
            np.full(grid.shape, np.nan, np.float32) if v is None else np.asarray(v, dtype=np.float32) for v in (height, distance)
        )
        if heights.shape != grid.shape or distances.shape != grid.shape:
            raise ValueError(f"heights and distances have the terrain's shape {grid.shape}, not {heights.shape} and {distances.shape}")
        if (distances < 0).any():
            raise ValueError(f"distances are not negative: {distances[distances < 0][:4].tolist()}")
        return cls(grid.astype(np.int64), heights, distances, (float(origin_xy[0]), float(origin_xy[1])), float(resolution))

    def paint(self, window: Window, cost: NDArray[np.uint8], height: NDArray[np.float32], distance: NDArray[np.float32]) -> None:
        x, y = window.centres()
        column, inside_x = self._indices(x, self._origin_xy[0], self._cost.shape[1])
        row, inside_y = self._indices(y, self._origin_xy[1], self._cost.shape[0])
        block, source = np.ix_(inside_y, inside_x), np.ix_(row, column)
        values = self._cost[source]
        cost[block] = np.select([values == _BARRIER, values == _TRAVERSABLE], [LETHAL, FREE], NO_INFORMATION).astype(np.uint8)
        height[block] = np.where(values == _TRAVERSABLE, self._height[source], np.nan)
        off_x, off_y = self._off(x[inside_x], column, 0), self._off(y[inside_y], row, 1)
        nearer = np.maximum(self._distance[source] - np.hypot(off_x[None, :], off_y[:, None]), 0.0)
        distance[block] = np.where(values == _TRAVERSABLE, nearer, np.nan)
        self._keep_barriers(window, cost, height)

    def _off(self, centres: NDArray[np.float64], index: NDArray[np.int64], axis: int) -> NDArray[np.float64]:
        """How far centres of the window lie beside those of the cells that they are taken from: nothing, where the rasters are equal."""
        off = centres - self._origin_xy[axis] - (index + 0.5) * self._resolution
        return np.where(np.abs(off) < 1e-6, 0.0, off)

    def _indices(self, centres: NDArray[np.float64], origin: float, count: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        index = np.floor((centres - origin) / self._resolution + 1e-9).astype(np.int64)
        inside = (index >= 0) & (index < count)
        return index[inside], inside

    def _keep_barriers(self, window: Window, cost: NDArray[np.uint8], height: NDArray[np.float32]) -> None:
        # A window coarser than the terrain could step over a thin barrier: every barrier marks the cell that it lies in.
        row, column, inside = window.cell_of(self._barriers)
        cost[row[inside], column[inside]] = LETHAL
        height[row[inside], column[inside]] = np.nan
