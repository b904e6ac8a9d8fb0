"""Height maps from pictures (.png): grey is height, laid over a size in metres, sampled finely enough to drive on."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from scipy.ndimage import gaussian_filter, map_coordinates, spline_filter

from world_files.surfaces import HeightField

Array = NDArray[np.float64]

FINEST_M, COARSEST_M = 0.1, 0.25  # step of the terrain, unless that makes too many points
MOST_POINTS = 120_000
_BITS8 = ("1", "L", "LA", "P", "PA", "RGB", "RGBA")  # the modes of a picture that its mode L holds
_WHITE16 = 65535.0
VISIBLE_STEP_M = 0.02  # grey levels farther apart than this would make terraces, and are smoothed


@dataclass(frozen=True)
class HeightMap:
    """Heights (rows, columns) in m, the first row at the highest y, over a size (x, y) in m around the origin."""

    heights: Array
    size_xy: tuple[float, float]

    @property
    def pixel_m(self) -> tuple[float, float]:
        """Distance of neighbouring pixels in x and in y."""
        rows, columns = self.heights.shape
        return self.size_xy[0] / (columns - 1), self.size_xy[1] / (rows - 1)

    def slopes(self) -> Array:
        """(rows, columns) slope in rad at each pixel."""
        dx, dy = self.pixel_m
        by_y, by_x = np.gradient(self.heights, dy, dx)
        return np.asarray(np.arctan(np.hypot(by_x, by_y)))

    def pixel_xy(self, row: int, column: int) -> tuple[float, float]:
        """World x, y of a pixel."""
        dx, dy = self.pixel_m
        return column * dx - self.size_xy[0] / 2, self.size_xy[1] / 2 - row * dy


def read_height_map(path: Path, size_xyz: tuple[float, float, float]) -> HeightMap:
    """An 8- or 16-bit picture as heights from 0 to the size's z. ValueError when it cannot be read or the size makes no sense."""
    if not all(math.isfinite(v) and v > 0 for v in size_xyz):
        raise ValueError(f"size {size_xyz!r} is not three lengths above 0 in metres")
    try:
        with Image.open(path) as picture:
            mode = picture.mode
            bits16 = mode == "I" or mode.startswith("I;16")
            grey = np.asarray(picture.convert("L") if mode in _BITS8 else picture, np.float64)
    except Exception as error:  # the readers raise whatever they stumble over
        raise ValueError(f"cannot read the height map {path}: {type(error).__name__}: {error}") from error
    if not (bits16 or mode in _BITS8) or not 0.0 <= grey.min() <= grey.max() <= _WHITE16:
        values = f"{grey.min():g} to {grey.max():g}"
        raise ValueError(f"the height map {path} is of mode {mode} with values from {values}: expected 8 or 16 bits, grey or colour")
    if min(grey.shape) < 2:
        raise ValueError(f"the height map {path} is {grey.shape[1]} x {grey.shape[0]} pixels; it needs 2 x 2 or more")
    levels = _WHITE16 if bits16 else 255.0
    heights = grey / levels * size_xyz[2]
    if size_xyz[2] / levels > VISIBLE_STEP_M:
        heights = gaussian_filter(heights, 1.0)
    return HeightMap(heights, (size_xyz[0], size_xyz[1]))


def terrain_between(height_map: HeightMap, low_xy: Array, high_xy: Array) -> HeightField:
    """The map between two corners, cut to its own size, on a fine even grid by cubic splines. ValueError when nothing is left."""
    half = np.array(height_map.size_xy) / 2
    low, high = np.maximum(low_xy, -half), np.minimum(high_xy, half)
    if (high - low < 2.0).any():
        raise ValueError(f"less than 2 m of the height map, {height_map.size_xy} m, lies between {low_xy.tolist()} and {high_xy.tolist()}")
    step = min(max(min(height_map.pixel_m), FINEST_M), COARSEST_M)
    step = max(step, math.sqrt(float(np.prod(high - low)) / MOST_POINTS))
    columns, rows = (int(n) for n in np.floor((high - low) / step + 1e-9) + 1)
    x, y = low[0] + np.arange(columns) * step, low[1] + np.arange(rows) * step
    dx, dy = height_map.pixel_m
    at = np.meshgrid((half[1] - y) / dy, (x + half[0]) / dx, indexing="ij")
    heights = map_coordinates(spline_filter(height_map.heights, 3), at, order=3, prefilter=False, mode="nearest")
    return HeightField(heights, float(low[0]), float(low[1]), step)
