"""What the floods of the terrain analysis work on: a window of columns, its surfaces, and the links between them."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain.config import Limits, TerrainConfig
from octomap_server_3dnav.terrain.surface_columns import Columns, Surfaces, crop_columns, indices_of, tops_of
from octomap_server_3dnav.terrain.surface_graph import Links, centred_levels, nearest_neighbours, slopes_of_open_ground
from octomap_server_3dnav.terrain.surface_holes import bridge_holes, cover_pits
from octomap_server_3dnav.terrain.surface_steps import STEP_REACH, restore_on_planes, steppable_neighbours


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
        return np.asarray(_columns_of(_spans_within(self.x, self.y, radius_m), self.y.size))

    def nodes_within(self, radius_m: float) -> NDArray[np.int64]:
        """The surface nodes of those columns, ascending."""
        return np.asarray(_nodes_of(_spans_within(self.x, self.y, radius_m), self.y.size, self.surfaces.start))


@njit(cache=True)
def _columns_of(spans: Any, ny: Any) -> Any:
    """(C,) bool: the columns of the spans."""
    out = np.zeros(spans.shape[0] * ny, np.bool_)
    for ix in range(spans.shape[0]):
        out[ix * ny + spans[ix, 0] : ix * ny + spans[ix, 1]] = True
    return out


@njit(cache=True)
def _nodes_of(spans: Any, ny: Any, start: Any) -> Any:
    """The nodes of the columns of the spans."""
    first, end = np.empty(len(spans), np.int64), np.empty(len(spans), np.int64)
    for ix in range(len(spans)):
        first[ix], end[ix] = start[ix * ny + spans[ix, 0]], start[ix * ny + spans[ix, 1]]
    out, n = np.empty((end - first).sum(), np.int64), 0
    for ix in range(len(spans)):
        for s in range(first[ix], end[ix]):
            out[n] = s
            n += 1
    return out


def _spans_within(x: NDArray[np.float64], y: NDArray[np.float64], radius_m: float | None) -> NDArray[np.int64]:
    """(X, 2) first and end of the ascending y with hypot(x, y) <= radius_m in every row x; all of them when it is None."""
    return np.tile([0, y.size], (x.size, 1)) if radius_m is None else np.asarray(_disc_spans(x, y, radius_m))


@njit(cache=True)
def _disc_spans(x: Any, y: Any, radius: Any) -> Any:
    """The spans of a disc: both ends walk on from those of the row before."""
    out = np.zeros((x.size, 2), np.int64)
    middle = np.argmin(np.abs(y)) if y.size else 0
    first, end = middle, middle + 1
    for ix in range(x.size if y.size else 0):
        if np.hypot(x[ix], y[middle]) > radius:
            continue
        while first > 0 and np.hypot(x[ix], y[first - 1]) <= radius:
            first -= 1
        while np.hypot(x[ix], y[first]) > radius:
            first += 1
        while end < y.size and np.hypot(x[ix], y[end]) <= radius:
            end += 1
        while np.hypot(x[ix], y[end - 1]) > radius:
            end -= 1
        out[ix] = first, end
    return out


def _spans_inside(x: NDArray[np.float64], y: NDArray[np.float64], radius_m: float | None, margin: int) -> NDArray[np.int64]:
    """The spans within the radius without the columns of the margin."""
    spans = np.clip(_spans_within(x, y, radius_m), margin, y.size - margin)
    spans[:margin], spans[x.size - margin :] = margin, margin
    return spans


def _window(
    runs: ColumnRuns, robot: NDArray[np.float64], reach_m: float | None, margin: int
) -> tuple[Columns, tuple[int, int], NDArray[np.float64], NDArray[np.float64]]:
    """The columns within `reach_m` and a margin, the index of the first one, and where they lie from the robot (3,) in metres."""
    low = np.array(runs.origin_key)
    high = low + (runs.nx, runs.ny)
    if reach_m is not None:
        at, span = np.floor(robot[:2] / runs.resolution).astype(np.int64), math.ceil(reach_m / runs.resolution) + margin
        low, high = np.clip(at - span, low, high), np.clip(at + span + 1, low, high)
    key = (int(low[0]) - margin, int(low[1]) - margin)
    x, y = ((np.arange(high[a] - low[a] + 2 * margin) + key[a] + 0.5) * runs.resolution - robot[a] for a in (0, 1))
    spans = _spans_inside(x, y, None if reach_m is None else reach_m + margin * runs.resolution, margin)
    return crop_columns(runs, key, y.size, spans), key, x, y


def _links(surfaces: Surfaces, ny: int, spans: NDArray[np.int64], limits: Limits) -> tuple[Surfaces, Links]:
    """The surfaces, on slopes at the heights of the middles of their columns, and the links between them."""
    near = nearest_neighbours(surfaces.start, surfaces.z, ny, spans, limits.step)
    graph = steppable_neighbours(near, surfaces, limits.steps)
    surfaces = surfaces._replace(slope_level=centred_levels(graph, surfaces))
    restore_on_planes(near, graph, surfaces, ny, limits)
    slope = slopes_of_open_ground(surfaces.start, surfaces.slope_level, graph, ny, spans, limits.slope_reach, limits.steepest)
    return surfaces, Links(near, graph, slope)


def _surfaces(columns: Columns, key: tuple[int, int], heights: SurfaceHeights | None, config: TerrainConfig, limits: Limits) -> Surfaces:
    surfaces = tops_of(columns, limits.clearance, limits.step)
    if heights is not None:
        ix, iy = indices_of(surfaces.column, columns.ny, key)
        surfaces = surfaces.at_heights(heights.at(ix, iy, surfaces.z))
    if config.hole_bridge_voxels == 0:
        return surfaces
    surfaces = bridge_holes(columns, surfaces, limits.clearance, config.hole_bridge_voxels, limits.step, limits.steps.measured)
    return cover_pits(columns, surfaces, limits.step, limits.steps.voxels)


def scene_around(
    runs: ColumnRuns,
    heights: SurfaceHeights | None,
    robot: NDArray[np.float64],
    reach_m: float | None,
    config: TerrainConfig,
    limits: Limits,
) -> Scene:
    """The window within `reach_m` of the robot (3,), or of all that is known when it is None, with margins for what the floods look at."""
    columns, key, x, y = _window(runs, robot, reach_m, limits.margin)
    surfaces = _surfaces(columns, key, heights, config, limits)
    linked_m = None if reach_m is None else reach_m + (limits.slope_reach + STEP_REACH) * runs.resolution  # as far as slopes and steps look
    return Scene(columns, key, *_links(surfaces, columns.ny, _spans_inside(x, y, linked_m, limits.margin), limits), x, y)
