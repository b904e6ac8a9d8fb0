"""What the flood of the terrain analysis works on: a window of columns, its surfaces, and the links between them."""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.columns import Columns, crop_columns
from octomap_server_3dnav.octree.lean_kernels import Index
from octomap_server_3dnav.octree.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.fill import fill_gaps
from octomap_server_3dnav.terrain.graph import ROWS, Links, centred_heights, nearest_neighbours, steppable_neighbours
from octomap_server_3dnav.terrain.planes import BASE
from octomap_server_3dnav.terrain.surfaces import Surfaces, surfaces_of


@dataclass(frozen=True, eq=False)
class Scene:
    """The window's columns from index `key` on, their surfaces and links, and where the columns lie from the robot in metres."""

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
        return np.flatnonzero(self.within(radius_m)[self.surfaces.column])


@njit(cache=True)
def _columns_of(spans: NDArray[np.int64], ny: Index) -> NDArray[np.bool_]:
    """(C,) bool: the columns of the spans."""
    out = np.zeros(spans.shape[0] * ny, np.bool_)
    for ix in range(spans.shape[0]):
        out[ix * ny + spans[ix, 0] : ix * ny + spans[ix, 1]] = True
    return out


def _spans_within(x: NDArray[np.float64], y: NDArray[np.float64], radius_m: float | None) -> NDArray[np.int64]:
    """(X, 2) first and end of the ascending y with hypot(x, y) <= radius_m in every row x; all of them when it is None."""
    if radius_m is None:
        return np.tile([0, y.size], (x.size, 1))
    half = np.sqrt(np.maximum(radius_m**2 - x**2, 0.0))
    spans = np.stack([np.searchsorted(y, -half), np.searchsorted(y, half, side="right")], axis=1)
    spans[np.abs(x) > radius_m] = 0
    return spans


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


def scene_around(
    runs: ColumnRuns, heights: SurfaceHeights | None, robot: NDArray[np.float64], reach_m: float | None, limits: Limits
) -> Scene:
    """The window within `reach_m` of the robot (3,), or of all that is known when it is None, with margins for what the flood looks at."""
    columns, key, x, y = _window(runs, robot, reach_m, limits.margin)
    surfaces = fill_gaps(columns, surfaces_of(columns, key, heights, limits), limits)
    linked_m = None if reach_m is None else reach_m + (BASE + ROWS + 2) * runs.resolution  # as far as slopes and steps look
    spans = _spans_inside(x, y, linked_m, limits.margin)
    near = nearest_neighbours(surfaces.start, surfaces.z, columns.ny, spans, limits.step)
    surfaces = surfaces._replace(height=centred_heights(near, surfaces))
    return Scene(columns, key, surfaces, Links(near, steppable_neighbours(near, surfaces, limits)), x, y)
