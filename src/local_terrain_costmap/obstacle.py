"""Obstacle layer: what the short horizontal scans see between two sweeps (thesis 6.2.1).

A beam clears the cells that it passes and marks the one that it hits. A free beam says nothing about the ground below it, so
this layer holds marks only: it never turns unknown terrain into free terrain.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from local_terrain_costmap.config import CostmapConfig
from local_terrain_costmap.window import Window, shifted
from robot_body import RobotBody


class ObstacleLayer:
    """`marked` (n, n) bool of a window, and the map height of every mark (NaN where it was not told)."""

    def __init__(self, config: CostmapConfig, robot: RobotBody, window: Window) -> None:
        self._config, self._overhead_m = config, robot.height_m + config.overhead_margin_m
        self._window = window
        self.clear()

    def configure(self, config: CostmapConfig) -> None:
        """From the next scan on."""
        self._config = config

    def clear(self) -> None:
        """Forget every mark."""
        n = self._window.cells
        self.marked: NDArray[np.bool_] = np.zeros((n, n), dtype=np.bool_)
        self._mark_z: NDArray[np.float32] = np.full((n, n), np.nan, dtype=np.float32)

    def move(self, window: Window) -> None:
        """Keep the marks that lie in `window`, at their place."""
        self.marked = shifted(self.marked, self._window, window, 0)
        self._mark_z = shifted(self._mark_z, self._window, window, math.nan)
        self._window = window

    def add_scan(
        self,
        hits: NDArray[np.float64],
        free_ends: NDArray[np.float64],
        origin_xy: tuple[float, float],
        hits_z: NDArray[np.float64] | None,
        ground: NDArray[np.float32],
    ) -> bool:
        """Clear along all beams, then mark the hits that count; True when a mark appeared or went."""
        before = self.marked.copy()
        ends = np.concatenate([hits, free_ends])
        sensor = np.asarray(origin_xy, dtype=np.float64)
        window = self._window
        _clear_rays(self.marked, ends, sensor, np.asarray(window.origin_xy), window.resolution, self._config.clearing_range_m)
        z = np.full(len(hits), np.nan) if hits_z is None else hits_z
        near = np.hypot(hits[:, 0] - sensor[0], hits[:, 1] - sensor[1]) <= self._config.obstacle_range_m
        row, column, inside = window.cell_of(hits)
        counted = near & inside
        row, column, z = row[counted], column[counted], z[counted]
        solid = ~self._is_explained(z, ground[row, column])
        self.marked[row[solid], column[solid]] = True
        self._mark_z[row[solid], column[solid]] = z[solid]
        return not np.array_equal(before, self.marked)

    def drop_explained(self, ground: NDArray[np.float32]) -> None:
        """Take back the marks that newer terrain shows to be ground, or to be passed under."""
        self.marked &= ~self._is_explained(self._mark_z, ground)

    def _is_explained(self, z: NDArray[np.floating], ground: NDArray[np.float32]) -> NDArray[np.bool_]:
        # Comparisons with NaN are False: a hit without height, or over ground that is not known, stays an obstacle.
        above = z - ground
        is_explained: NDArray[np.bool_] = (np.abs(above) <= self._config.ground_tolerance_m) | (above >= self._overhead_m)
        return is_explained


@njit(cache=True)
def _clear_rays(
    marked: NDArray[np.bool_],
    ends: NDArray[np.float64],
    sensor: NDArray[np.float64],
    corner: NDArray[np.float64],
    resolution: float,
    max_range: float,
) -> None:
    """Clear the cells from the sensor towards each end, but the end's own cell, walking from cell border to cell border."""
    ny, nx = marked.shape
    x0 = (sensor[0] - corner[0]) / resolution
    y0 = (sensor[1] - corner[1]) / resolution
    limit = max_range / resolution
    for i in range(ends.shape[0]):
        dx = (ends[i, 0] - corner[0]) / resolution - x0
        dy = (ends[i, 1] - corner[1]) / resolution - y0
        length = math.sqrt(dx * dx + dy * dy)
        if length == 0.0:
            continue
        end_column, end_row = math.floor(x0 + dx), math.floor(y0 + dy)
        column, row = math.floor(x0), math.floor(y0)
        step_x, step_y = (1 if dx > 0 else -1), (1 if dy > 0 else -1)
        per_x = length / abs(dx) if dx != 0.0 else math.inf
        per_y = length / abs(dy) if dy != 0.0 else math.inf
        next_x = ((column + 1 - x0) if dx > 0 else (x0 - column)) * per_x if dx != 0.0 else math.inf
        next_y = ((row + 1 - y0) if dy > 0 else (y0 - row)) * per_y if dy != 0.0 else math.inf
        stop = min(length, limit)
        while not (column == end_column and row == end_row):
            if 0 <= row < ny and 0 <= column < nx:
                marked[row, column] = False
            if min(next_x, next_y) >= stop:
                break
            if next_x <= next_y:
                column += step_x
                next_x += per_x
            else:
                row += step_y
                next_y += per_y


def compile_kernels() -> None:
    """Compiles the kernel for the types that a scan passes."""
    _clear_rays(np.zeros((1, 1), dtype=bool), np.zeros((1, 2)), np.zeros(2), np.zeros(2), 1.0, 1.0)
