"""What the floods of the terrain analysis work on: a window of columns, its surfaces, and the links between them."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.column_runs import ColumnRuns
from octomap_server_3dnav.surface_columns import Columns, Surfaces, crop_columns, tops_of
from octomap_server_3dnav.surface_graph import Links, nearest_neighbours, slopes_of_open_ground, steppable_neighbours
from octomap_server_3dnav.surface_heights import SurfaceHeights
from octomap_server_3dnav.surface_holes import bridge_holes
from octomap_server_3dnav.terrain_config import Limits, TerrainConfig


@dataclass(frozen=True, eq=False)
class Scene:
    """What the flood works on: the window's columns, their surfaces and links, and where the columns lie from the robot in metres."""

    columns: Columns
    key: tuple[int, int]
    surfaces: Surfaces
    links: Links
    x: NDArray[np.float64]
    y: NDArray[np.float64]

    def within(self, radius_m: float | None) -> NDArray[np.bool_]:
        """(C,) whether the middle of each column is within `radius_m` of the robot; all are when it is None."""
        spans, column = _spans_within(self.x, self.y, radius_m), np.arange(self.y.size)
        return np.asarray(((column >= spans[:, :1]) & (column < spans[:, 1:])).ravel())

    def nodes_within(self, radius_m: float) -> NDArray[np.int64]:
        """The surface nodes of those columns, ascending."""
        row = np.arange(self.x.size) * self.y.size
        nodes = self.surfaces.start[row[:, None] + _spans_within(self.x, self.y, radius_m)]
        return np.concatenate([np.arange(first, end) for first, end in nodes if first < end] or [np.empty(0, dtype=np.int64)])


def _spans_within(x: NDArray[np.float64], y: NDArray[np.float64], radius_m: float | None) -> NDArray[np.int64]:
    """(X, 2) first and end of the ascending y with np.hypot(x, y) <= radius_m in every row x; all of them when it is None."""
    if radius_m is None:
        return np.tile([0, y.size], (x.size, 1))
    half = np.sqrt(np.maximum(radius_m**2 - x**2, 0.0))
    padded = np.concatenate([[-np.inf], y, [np.inf]])  # the roots may round across a column: the two at each end are asked
    first = np.minimum(np.searchsorted(y, -half), y.size - 1)
    end = np.maximum(np.searchsorted(y, half, side="right"), 1)
    first = first - (np.hypot(x, padded[first]) <= radius_m) + (np.hypot(x, padded[first + 1]) > radius_m)
    end = end + (np.hypot(x, padded[end + 1]) <= radius_m) - (np.hypot(x, padded[end]) > radius_m)
    return np.stack([first, np.maximum(first, end)], axis=1)


def _window(runs: ColumnRuns, robot: NDArray[np.float64], reach_m: float | None, margin: int) -> tuple[Columns, tuple[int, int]]:
    low = runs.origin_key
    high = (runs.origin_key[0] + runs.nx - 1, runs.origin_key[1] + runs.ny - 1)
    if reach_m is not None:
        x, y = (math.floor(v / runs.resolution) for v in robot[:2])
        span = math.ceil(reach_m / runs.resolution) + margin
        low, high = (x - span, y - span), (x + span, y + span)
    return crop_columns(runs, low, high, margin)


def _linked_spans(x: NDArray[np.float64], y: NDArray[np.float64], radius_m: float | None, margin: int) -> NDArray[np.int64]:
    """The spans within the radius without the columns of the margin."""
    spans = np.clip(_spans_within(x, y, radius_m), margin, y.size - margin)
    spans[:margin], spans[x.size - margin :] = margin, margin
    return spans


def _links(surfaces: Surfaces, ny: int, spans: NDArray[np.int64], limits: Limits) -> Links:
    near = nearest_neighbours(surfaces.start, surfaces.z, ny, spans, limits.step)
    graph = steppable_neighbours(near, surfaces, limits.max_step, limits.max_measured_step)
    slope = slopes_of_open_ground(surfaces.start, surfaces.slope_level, graph, ny, spans, limits.slope_reach, limits.max_fitted_slope)
    return Links(near, graph, slope)


def _surfaces(columns: Columns, key: tuple[int, int], heights: SurfaceHeights | None, config: TerrainConfig, limits: Limits) -> Surfaces:
    surfaces = tops_of(columns, limits.clearance, limits.step)
    if heights is not None:
        ix, iy = np.divmod(surfaces.column, np.int32(columns.ny))
        surfaces = surfaces.at_heights(heights.at(ix + key[0], iy + key[1], surfaces.z))
    return bridge_holes(columns, surfaces, limits.clearance, config.hole_bridge_voxels, limits.step, limits.max_measured_step)


def scene_around(
    runs: ColumnRuns,
    heights: SurfaceHeights | None,
    robot: NDArray[np.float64],
    reach_m: float | None,
    config: TerrainConfig,
    limits: Limits,
) -> Scene:
    """The window within `reach_m` of the robot (3,), or of all that is known when it is None, with margins for what the floods look at."""
    columns, key = _window(runs, robot, reach_m, limits.margin)
    surfaces = _surfaces(columns, key, heights, config, limits)
    x = (np.arange(columns.nx) + key[0] + 0.5) * runs.resolution - robot[0]
    y = (np.arange(columns.ny) + key[1] + 0.5) * runs.resolution - robot[1]
    linked_m = None if reach_m is None else reach_m + (limits.slope_reach + 4) * runs.resolution  # as far as slopes and steps look
    return Scene(columns, key, surfaces, _links(surfaces, columns.ny, _linked_spans(x, y, linked_m, limits.margin), limits), x, y)
