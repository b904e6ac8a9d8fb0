"""Line layer: what the laser's single lines meet between two terrains, at any tilt of the mount (thesis 6.2.1 has level lines only).

A line leaves evidence in voxels of the map: where its beams ended, and when. A later beam that passes through a voxel takes it back.
What the evidence means is asked when somebody wants to know: a column stands in the robot's way where something was met that is
neither its ground nor high enough to be passed under. So a newer terrain explains old evidence, and old evidence a newer terrain.
"""

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy import ndimage

from local_terrain_costmap.config import CostmapConfig
from local_terrain_costmap.terrain import TerrainLayer
from local_terrain_costmap.view import LETHAL
from local_terrain_costmap.window import Window, shifted
from rigid_geometry import JUMP_BACK_S
from robot_body import RobotBody

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
_SETTLING_S = 1.0  # what was met is not taken back before: the next lines pass just over it, or beside it
_MET_AGAIN_S = 0.3  # beams just over a box go through the voxel of its top, and one of the next lines meets it there: it has not moved
_GROUND_REACH_M = 0.32  # of the known ground by which hits are judged where none is known; farther off, they are not judged


class LineLayer:
    """Evidence in the voxels of a window, (layers, n, n), and which of its columns it marks.

    Layers repeat upwards: one holds all heights that are a whole number of stacks apart. A stack is twice as high as what stops the
    robot, and every voxel knows the exact height of its evidence. `is_known` are the columns on or beside what the terrain knows.
    """

    def __init__(self, config: CostmapConfig, robot: RobotBody, window: Window) -> None:
        self._config, self._window = config, window
        self._overhead_m = robot.height_m + config.overhead_margin_m
        # The terrain gives the top of the ground's voxel: the ground is half a cell below it, give or take as much.
        self._half_cell_m = config.resolution_m / 2
        self._tolerance_m, self._steepest = robot.max_step_m + self._half_cell_m, math.tan(robot.max_slope_rad)
        self._layers = 2 * math.ceil(self._overhead_m / config.resolution_m)
        self._know(TerrainLayer(window))
        self.clear()

    def configure(self, config: CostmapConfig) -> None:
        """From the next line on."""
        self._config = config

    def clear(self) -> None:
        """Forget all evidence."""
        shape = self._layers, self._window.cells, self._window.cells
        self._met_s: Floats = np.full(shape, -math.inf)
        self._z: Singles = np.full(shape, np.nan, dtype=np.float32)
        self._newest_s = -math.inf
        self.marked: NDArray[np.bool_] = np.zeros(shape[1:], dtype=np.bool_)
        self._since_s: Floats = np.full(shape[1:], math.inf)  # when it came that is marked there
        self._missed_s: Floats = np.full(shape[1:], -math.inf)  # and since when nothing is; inf while something is

    def move(self, window: Window, terrain: TerrainLayer) -> None:
        """Keep the evidence that lies in `window`, at its place; `terrain` has moved there already."""
        self._met_s = shifted(self._met_s, self._window, window, -math.inf)
        self._z = shifted(self._z, self._window, window, math.nan)
        self._since_s = shifted(self._since_s, self._window, window, math.inf)
        self._missed_s = shifted(self._missed_s, self._window, window, -math.inf)
        self._window = window
        self.explain(terrain)

    def explain(self, terrain: TerrainLayer) -> None:
        """Judge the evidence by a newer terrain of the same window."""
        self._know(terrain)
        self._mark()

    def add_line(self, stamp_s: float, hits: Floats, free_ends: Floats, origin: Floats) -> bool:
        """Take back what the beams passed through, and keep where they ended; True when a mark appeared or went.

        A line that is not newer than the last one is left out; a much older one means that time jumped: start afresh.
        """
        if stamp_s < self._newest_s - JUMP_BACK_S:
            self.clear()
        if stamp_s <= self._newest_s:
            return False
        self._newest_s = stamp_s
        ends = np.concatenate([hits, free_ends])
        corner = np.array([*self._window.origin_xy, 0.0])
        settled_s = stamp_s - _SETTLING_S
        _pass(self._met_s, ends, origin, corner, self._window.resolution, (self._config.clearing_range_m, settled_s))
        self._keep(stamp_s, hits[np.hypot(*(hits - origin)[:, :2].T) <= self._config.obstacle_range_m])
        before = self.marked
        self._mark()
        return not np.array_equal(before, self.marked)

    def _mark(self) -> None:
        self.marked = self._judged()
        self._since_s[self._missed_s < self._newest_s - _MET_AGAIN_S] = math.inf
        self._since_s = np.where(self.marked, np.minimum(self._since_s, self._newest_s), self._since_s)
        self._missed_s = np.where(self.marked, math.inf, np.minimum(self._missed_s, self._newest_s))

    def _keep(self, stamp_s: float, hits: Floats) -> None:
        """Evidence where at least `least_hits` of them lie in a voxel, at their mean height: a point without company is none."""
        row, column, inside = self._window.cell_of(hits)
        layer = np.floor(hits[:, 2] / self._window.resolution).astype(np.int64) % self._layers
        voxels = np.ravel_multi_index((layer[inside], row[inside], column[inside]), self._met_s.shape)
        found, inverse, count = np.unique(voxels, return_inverse=True, return_counts=True)
        mean = np.bincount(inverse, hits[inside, 2], len(found)) / count
        enough = count >= self._config.least_hits
        self._met_s.flat[found[enough]] = stamp_s
        self._z.flat[found[enough]] = mean[enough]

    def _know(self, terrain: TerrainLayer) -> None:
        """The ground of a column without its own is the nearest known, as much less exact as the steepest slope takes it up or down.

        What the terrain knows to be lethal it knows more exactly than a line, which errs by a cell: nothing is marked beside it.
        """
        ground = terrain.height
        self.is_known = ndimage.binary_dilation(terrain.cost == LETHAL, np.ones((3, 3)))
        distance, (row, column) = ndimage.distance_transform_edt(np.isnan(ground), self._window.resolution, return_indices=True)
        near = distance <= _GROUND_REACH_M
        self._ground = np.where(near, ground[row, column] - self._half_cell_m, np.nan).astype(np.float32)
        self._allowed_m = (self._tolerance_m + distance * self._steepest).astype(np.float32)

    def met_within(self, seconds: float, standing_s: float = 0.0) -> NDArray[np.bool_]:
        """(n, n) the columns that are marked by what lines met in the last `seconds` before the newest.

        Above 0, `standing_s` leaves out what has stood at its place, or in a column beside it, for longer.
        """
        met = self._judged(seconds) if self.marked.any() else self.marked
        if not standing_s:
            return met
        stands = ndimage.binary_dilation(self._newest_s - self._since_s > standing_s, np.ones((3, 3)))
        return np.asarray(met & ~stands)

    def _judged(self, within_s: float = math.inf) -> NDArray[np.bool_]:
        oldest_s = self._newest_s - min(within_s, self._config.keep_s)
        above = np.where(self._met_s >= oldest_s, self._z, np.nan) - self._ground
        # Comparisons with NaN are False: evidence over ground that is not known marks nothing.
        in_the_way = (above > self._allowed_m) & (above < self._overhead_m + self._half_cell_m)
        return np.asarray((in_the_way | (above < -self._allowed_m)).any(axis=0) & ~self.is_known)


@njit(cache=True)
def _pass(met_s: Floats, ends: Floats, origin: Floats, corner: Floats, resolution: float, limits: tuple[float, float]) -> None:
    """Take back the evidence in the voxels from the origin towards each end, but the end's own, walking from border to border.

    `limits`: how far beams count, in metres, and up to which time evidence is old enough to be taken back.
    """
    layers, rows, columns = met_s.shape
    counts = (columns, rows, layers)
    at, last, step = np.zeros(3, np.int64), np.zeros(3, np.int64), np.zeros(3, np.int64)
    per, following = np.zeros(3), np.zeros(3)
    for i in range(ends.shape[0]):
        length = 0.0
        for axis in range(3):
            start, end = (origin[axis] - corner[axis]) / resolution, (ends[i, axis] - corner[axis]) / resolution
            at[axis], last[axis] = math.floor(start), math.floor(end)
            way = end - start
            step[axis] = 1 if way > 0.0 else -1
            per[axis] = abs(way)
            following[axis] = at[axis] + 1 - start if way > 0.0 else start - at[axis]
            length += way * way
        length = math.sqrt(length)
        if length == 0.0:
            continue
        for axis in range(3):
            per[axis] = length / per[axis] if per[axis] > 0.0 else math.inf
            following[axis] = following[axis] * per[axis] if per[axis] < math.inf else math.inf
        stop = min(length, limits[0] / resolution)
        while not (at[0] == last[0] and at[1] == last[1] and at[2] == last[2]):
            if 0 <= at[0] < counts[0] and 0 <= at[1] < counts[1]:
                layer = at[2] % layers
                if met_s[layer, at[1], at[0]] <= limits[1]:
                    met_s[layer, at[1], at[0]] = -math.inf
            nearest = 0
            for axis in range(1, 3):
                if following[axis] < following[nearest]:
                    nearest = axis
            if following[nearest] >= stop:
                break
            at[nearest] += step[nearest]
            following[nearest] += per[nearest]


def compile_kernels() -> None:
    """Compiles the kernel for the types that a line passes."""
    _pass(np.zeros((1, 1, 1)), np.zeros((1, 3)), np.zeros(3), np.zeros(3), 1.0, (1.0, 0.0))
