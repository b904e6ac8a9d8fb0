"""The costmap: three layers over one rolling window, put together when somebody asks."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from local_terrain_costmap.config import CostmapConfig
from local_terrain_costmap.inflation import distance_to_lethal, inflated
from local_terrain_costmap.line_layer import LineLayer
from local_terrain_costmap.obstacle import ObstacleLayer
from local_terrain_costmap.terrain import TerrainLayer
from local_terrain_costmap.view import FREE, LETHAL, NO_INFORMATION, CostmapView
from local_terrain_costmap.window import Window
from robot_body import RobotBody


class LocalCostmap:
    """Rolling costmap in the map frame: terrain, obstacles and inflation (thesis 6.2.1, figure 6.3)."""

    def __init__(self, config: CostmapConfig, robot: RobotBody) -> None:
        """A window around the map's origin in which nothing is known; ValueError lists what is wrong with `config`."""
        self._config, self._robot, self._contact_m = _checked(config, robot), robot, robot.half_width_m
        self._cells = round(config.size_m / config.resolution_m)
        self._window = Window.centred(0.0, 0.0, self._cells, config.resolution_m)
        self._terrain = TerrainLayer(self._window)
        self._obstacles = ObstacleLayer(config, robot, self._window)
        self._lines = LineLayer(config, robot, self._window)
        self._view: CostmapView | None = None

    def configure(self, config: CostmapConfig) -> None:
        """From the next scan on; the window stays as it is. ValueError lists what is wrong with `config`."""
        self._config = replace(_checked(config, self._robot), size_m=self._config.size_m, resolution_m=self._config.resolution_m)
        self._obstacles.configure(self._config)
        self._lines.configure(self._config)
        self._view = None

    def recenter(self, x: float, y: float) -> None:
        """Move the window so that its middle cell contains (x, y) m in map; every layer's cells keep their ground."""
        window = Window.centred(x, y, self._cells, self._config.resolution_m)
        if window == self._window:
            return
        self._window = window
        self._terrain.move(window)
        self._obstacles.move(window)
        self._lines.move(window, self._terrain)
        self._view = None

    def set_terrain(
        self,
        cost: ArrayLike,
        origin_xy: tuple[float, float],
        resolution: float,
        height: ArrayLike | None = None,
        distance: ArrayLike | None = None,
    ) -> None:
        """Replace the terrain by the classification of a new sweep.

        `cost` (ny, nx): 100 obstacle or cliff, 0 traversable, -1 unknown; row = y, column = x; `origin_xy` the lower left corner in
        map and `resolution`, metres. `height` (ny, nx) in map, metres, NaN unknown: marks that lie on this ground are taken back.
        `distance` (ny, nx) of ground from what is lethal, at its exact place, metres, inf where that is far; where it is NaN, that from
        the middle of the next lethal cell counts. ValueError when shapes or values are others.
        """
        self._terrain.set_terrain(cost, origin_xy, resolution, height, distance)
        self._obstacles.drop_explained(self._terrain.height)
        self._lines.explain(self._terrain)
        self._view = None

    def add_scan(
        self, hits_map: ArrayLike, free_ends_map: ArrayLike, origin_xy: tuple[float, float], hits_z: ArrayLike | None = None
    ) -> None:
        """Clear along the beams of one horizontal scan and mark what it hit.

        `hits_map` (N, 2) and `free_ends_map` (M, 2), where the beams without a hit end, and the sensor's `origin_xy`, all in map,
        metres; beams that measured nothing belong in neither. `hits_z` (N,) heights of the hits in map: those near known
        traversable ground, or high over it, mark nothing. ValueError when shapes do not fit; rows that are not finite are ignored.
        """
        hits, free_ends = _points(hits_map, "hits_map", 2), _points(free_ends_map, "free_ends_map", 2)
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

    def add_line(self, stamp_s: float, hits_map: ArrayLike, free_ends_map: ArrayLike, origin_map: ArrayLike) -> None:
        """Take in one line of a laser, or a revolution of a lidar, at any tilt: clear what its beams pass through, mark what they met.

        `hits_map` (N, 3) and `free_ends_map` (M, 3), where the beams without a hit end, and the sensor's `origin_map` (3,), all in map,
        metres; beams that measured nothing belong in neither. Lines come in the order of their `stamp_s`; a late one is left out.
        ValueError when shapes do not fit or the origin or stamp is not finite; rows that are not finite are ignored.
        """
        hits, free_ends = _finite(_points(hits_map, "hits_map", 3)), _finite(_points(free_ends_map, "free_ends_map", 3))
        origin = np.ascontiguousarray(origin_map, dtype=np.float64)
        if origin.shape != (3,) or not np.isfinite(origin).all() or not math.isfinite(stamp_s):
            raise ValueError(f"a line has a finite origin (3,) in map and a finite stamp, not {origin_map!r} at {stamp_s!r} s")
        if self._lines.add_line(stamp_s, hits, free_ends, origin):
            self._view = None

    def strangers(self, within_s: float, standing_s: float = 0.0) -> NDArray[np.float64]:
        """(N, 2) in map, metres: the cells in which scans, or lines of the last `within_s`, met what the terrain does not explain.

        Above 0, `standing_s` leaves out what lines have met at its place for longer: it stands there, and is marked all the same.
        """
        rows, columns = np.nonzero(self._lines.met_within(within_s, standing_s) | (self._obstacles.marked & ~self._lines.is_known))
        return np.asarray(np.column_stack([columns, rows]) + 0.5) * self._config.resolution_m + self._window.origin_xy

    def clear_obstacles(self) -> None:
        """Forget what the scans and lines marked, as after a correction of the map."""
        self._obstacles.clear()
        self._lines.clear()
        self._view = None

    def master(self) -> CostmapView:
        """The costs of all layers together; the same object until something changes."""
        if self._view is None:
            marked = self._obstacles.marked | self._lines.marked
            marks = np.where(marked, np.uint8(LETHAL), np.uint8(FREE))
            bare = np.where(marked, marks, self._terrain.cost)
            cost = inflated(bare, self._distance(marks), self._contact_m, self._config)
            cost.setflags(write=False)
            self._view = CostmapView(cost, self._window.origin_xy, self._config.resolution_m, bare == NO_INFORMATION)
        return self._view

    def _distance(self, marks: NDArray[np.uint8]) -> NDArray[np.float64]:
        """Metres from every cell's middle to what is lethal: exact over ground that was classified, else to the middle of a cell."""
        to_mark, to_cell = (distance_to_lethal(cost, self._config.resolution_m) for cost in (marks, self._terrain.cost))
        exact = self._terrain.distance
        return np.minimum(to_mark, np.where(np.isnan(exact), to_cell, exact))


def _checked(config: CostmapConfig, robot: RobotBody) -> CostmapConfig:
    if problems := config.validate() + config.contradictions(robot):
        raise ValueError("; ".join(problems))
    return config


def _points(values: ArrayLike, name: str, axes: int) -> NDArray[np.float64]:
    points = np.asarray(values, dtype=np.float64)
    if points.size == 0:
        return np.empty((0, axes))
    if points.ndim != 2 or points.shape[1] != axes:
        raise ValueError(f"{name} are (N, {axes}) map coordinates, not shape {points.shape}")
    return points


def _finite(points: NDArray[np.float64]) -> NDArray[np.float64]:
    finite: NDArray[np.float64] = points[np.isfinite(points).all(axis=1)]
    return finite
