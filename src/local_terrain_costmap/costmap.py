"""The costmap: three layers over one rolling window, put together when somebody asks."""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from local_terrain_costmap.config import CostmapConfig
from local_terrain_costmap.inflation import inflated
from local_terrain_costmap.obstacle import ObstacleLayer
from local_terrain_costmap.terrain import TerrainLayer
from local_terrain_costmap.view import LETHAL, CostmapView
from local_terrain_costmap.window import Window
from robot_body import RobotBody


class LocalCostmap:
    """Rolling costmap in the map frame: terrain, obstacles and inflation (thesis 6.2.1, figure 6.3)."""

    def __init__(self, config: CostmapConfig, robot: RobotBody) -> None:
        """A window around the map's origin in which nothing is known; ValueError lists what is wrong with `config`."""
        problems = config.validate() + config.contradictions(robot)
        if problems:
            raise ValueError("; ".join(problems))
        self._config, self._contact_m = config, robot.half_width_m
        self._cells = round(config.size_m / config.resolution_m)
        self._window = Window.centred(0.0, 0.0, self._cells, config.resolution_m)
        self._terrain = TerrainLayer(self._window)
        self._obstacles = ObstacleLayer(config, robot, self._window)
        self._view: CostmapView | None = None

    def recenter(self, x: float, y: float) -> None:
        """Move the window so that its middle cell contains (x, y) m in map; every layer's cells keep their ground."""
        window = Window.centred(x, y, self._cells, self._config.resolution_m)
        if window == self._window:
            return
        self._window = window
        self._terrain.move(window)
        self._obstacles.move(window)
        self._view = None

    def set_terrain(self, cost: ArrayLike, origin_xy: tuple[float, float], resolution: float, height: ArrayLike | None = None) -> None:
        """Replace the terrain by the classification of a new sweep.

        `cost` (ny, nx): 100 obstacle or cliff, 0 traversable, -1 unknown; row = y, column = x; `origin_xy` the lower left corner in
        map and `resolution`, metres. `height` (ny, nx) in map, metres, NaN unknown: marks that lie on this ground are taken back.
        ValueError when shapes or values are others.
        """
        self._terrain.set_terrain(cost, origin_xy, resolution, height)
        self._obstacles.drop_explained(self._terrain.height)
        self._view = None

    def add_scan(
        self, hits_map: ArrayLike, free_ends_map: ArrayLike, origin_xy: tuple[float, float], hits_z: ArrayLike | None = None
    ) -> None:
        """Clear along the beams of one horizontal scan and mark what it hit.

        `hits_map` (N, 2) and `free_ends_map` (M, 2), where the beams without a hit end, and the sensor's `origin_xy`, all in map,
        metres; beams that measured nothing belong in neither. `hits_z` (N,) heights of the hits in map: those near known
        traversable ground, or high over it, mark nothing. ValueError when shapes do not fit; rows that are not finite are ignored.
        """
        hits, free_ends = _points(hits_map, "hits_map"), _points(free_ends_map, "free_ends_map")
        if not all(math.isfinite(v) for v in origin_xy):
            raise ValueError(f"origin_xy is the sensor's finite position in map, not {origin_xy!r}")
        z = None if hits_z is None else np.asarray(hits_z, dtype=np.float64)
        if z is not None and z.shape != (len(hits),):
            raise ValueError(f"hits_z has one height for each of the {len(hits)} hits, not shape {z.shape}")
        finite = np.isfinite(hits).all(axis=1)
        hits, z = hits[finite], None if z is None else z[finite]
        free_ends = free_ends[np.isfinite(free_ends).all(axis=1)]
        if self._obstacles.add_scan(hits, free_ends, origin_xy, z, self._terrain.height):
            self._view = None

    def clear_obstacles(self) -> None:
        """Forget what the horizontal scans marked, as after a correction of the map."""
        self._obstacles.clear()
        self._view = None

    def master(self) -> CostmapView:
        """The costs of all layers together; the same object until something changes."""
        if self._view is None:
            cost = np.where(self._obstacles.marked, np.uint8(LETHAL), self._terrain.cost)
            cost = inflated(cost, self._contact_m, self._config)
            cost.setflags(write=False)
            self._view = CostmapView(cost, self._window.origin_xy, self._config.resolution_m)
        return self._view


def _points(values: ArrayLike, name: str) -> NDArray[np.float64]:
    points = np.asarray(values, dtype=np.float64)
    if points.size == 0:
        return np.empty((0, 2))
    if points.ndim != 2 or points.shape[1] != 2:
        raise ValueError(f"{name} are (N, 2) map coordinates, not shape {points.shape}")
    return points
