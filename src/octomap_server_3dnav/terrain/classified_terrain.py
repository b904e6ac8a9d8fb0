"""What the terrain analysis finds: classes of surface voxels, and the navigation graph over them (thesis 5.5)."""

import math
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from map_zones import NO_ZONES, Zones
from octomap_server_3dnav.octree.columns import Columns

UNREACHED, TRAVERSABLE, OBSTACLE, CLIFF, INFLATION, FRONTIER, POTENTIAL_CLIFF = 255, 0, 1, 2, 3, 4, 5
"""Labels of nodes, as the kernels take them; those but the first are of `TerrainClass`."""
_REACH_M = 0.3  # height between a point and the surface that it lies on
_SLOPE_RADIUS_M = 0.4


class TerrainClass(IntEnum):
    """Class of a surface voxel (thesis figures 5.16-5.18); a potential cliff is a frontier of its own kind."""

    TRAVERSABLE = TRAVERSABLE
    OBSTACLE = OBSTACLE
    CLIFF = CLIFF
    INFLATION = INFLATION
    FRONTIER = FRONTIER
    POTENTIAL_CLIFF = POTENTIAL_CLIFF


class Barriers(NamedTuple):
    """What is blocked, a drop or too steep beside the ground, (B,) each: the `node` of the ground that it was seen from; `x` and `y` of its
    hits in voxels of the window; `level` of that ground; `column` and `voxel` of what stands there, -1 of what is ground itself; and
    whether it `falls`."""

    node: NDArray[np.int64]
    x: NDArray[np.float64]
    y: NDArray[np.float64]
    level: NDArray[np.int64]
    column: NDArray[np.int64]
    voxel: NDArray[np.int64]
    falls: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Passage:
    """A way to be driven straight, with a turn on the spot at its corners: node at each end, and its line (K, 3) in map in metres."""

    nodes: tuple[int, int]
    line: NDArray[np.float64]

    def turned(self) -> "Passage":
        """The same the other way."""
        return Passage((self.nodes[1], self.nodes[0]), self.line[::-1])


@dataclass(frozen=True, eq=False)
class Terrain:
    """Classified surface voxels and the navigation graph over them.

    Voxel (ix, iy, z) of the octree's index spans [i * resolution, (i + 1) * resolution) on each axis of map. N nodes: first
    `surface_count` surface voxels that the flood reached, sorted by column of the window (`columns`, from `window_key`
    on; `column_start`) and height, then obstacle voxels beside them, then frontier voxels of both kinds.

    Fields: ix, iy (N,) int32; z (N,) int16; label (N,) uint8 of TerrainClass; reached (N,) bool, connected with the departure (frontiers:
    seen from such a node); near_kerb (N,) bool, where wheels should not turn; distance_m (N,) float32, of surface nodes from the nearest
    barrier over the ground, inf where none is near; cost (N,) float32, factor on the length of a path, inf where no path may go;
    neighbours (N, 4) int32 to +x, +y, -x, -y, -1 for none (a frontier's are the nodes it was seen from); seen_from (N,) int32, the surface
    node from which an obstacle voxel or a frontier was seen, -1 of surface nodes; start, the voxel beneath the robot, and departure, where
    paths begin when the start lies in the inflation: node indices, None when there is none; radius_m of the classification, None for the
    whole map; robot_xyz, where base_link was; columns, what was seen in the window's columns; barriers, where the ground ends.
    `navigation.passages` adds the passages, narrow (N,) bool, inflated ground wide enough to drive straight over, and the zones kept to.
    """

    resolution: float
    ix: NDArray[np.int32]
    iy: NDArray[np.int32]
    z: NDArray[np.int16]
    label: NDArray[np.uint8]
    reached: NDArray[np.bool_]
    near_kerb: NDArray[np.bool_]
    distance_m: NDArray[np.float32]
    cost: NDArray[np.float32]
    neighbours: NDArray[np.int32]
    seen_from: NDArray[np.int32]
    start: int | None
    departure: int | None
    radius_m: float | None
    robot_xyz: tuple[float, float, float]
    surface_count: int
    window_key: tuple[int, int]
    column_start: NDArray[np.int64]
    columns: Columns
    barriers: Barriers
    narrow: NDArray[np.bool_]
    passages: tuple[Passage, ...] = ()
    zones: Zones = NO_ZONES

    def centers(self, nodes: NDArray[np.integer] | slice | None = None) -> NDArray[np.float32]:
        """(N, 3) centres in map, in metres, of all nodes or those given by index."""
        which = slice(None) if nodes is None else nodes
        voxels = np.stack([self.ix[which], self.iy[which], self.z[which]], axis=-1)
        return np.asarray((voxels + 0.5) * self.resolution, dtype=np.float32)

    def nodes_of(self, terrain_class: TerrainClass) -> NDArray[np.int64]:
        """Indices of the nodes of one class."""
        return np.flatnonzero(self.label == terrain_class)

    def frontiers(self) -> NDArray[np.int64]:
        """Indices of the nodes of floor that was not seen, of both kinds."""
        return np.flatnonzero((self.label == TerrainClass.FRONTIER) | (self.label == TerrainClass.POTENTIAL_CLIFF))

    def surface_near(self, xyz: NDArray[np.floating] | tuple[float, float, float]) -> int | None:
        """Surface node of the column at a point in map that is nearest in height, within 0.3 m; None when there is none."""
        wx = math.floor(xyz[0] / self.resolution) - self.window_key[0]
        wy = math.floor(xyz[1] / self.resolution) - self.window_key[1]
        if not (0 <= wx < self.columns.nx and 0 <= wy < self.columns.ny):
            return None
        column = wx * self.columns.ny + wy
        nodes = np.arange(self.column_start[column], self.column_start[column + 1])
        if not nodes.size:
            return None
        gaps = np.abs((self.z[nodes] + 0.5) * self.resolution - xyz[2])
        return int(nodes[np.argmin(gaps)]) if gaps.min() <= _REACH_M else None

    def slope_near(self, xyz: NDArray[np.floating] | tuple[float, float, float]) -> float | None:
        """Steepest slope in radians of the plane through the surface around a point in map; None when fewer than six voxels are there."""
        centers = self.centers(slice(0, self.surface_count)) - np.asarray(xyz, dtype=np.float64)
        near = centers[(np.hypot(centers[:, 0], centers[:, 1]) <= _SLOPE_RADIUS_M) & (np.abs(centers[:, 2]) <= _SLOPE_RADIUS_M)]
        if len(near) < 6:
            return None
        gradient = np.linalg.lstsq(np.column_stack([near[:, :2], np.ones(len(near))]), near[:, 2], rcond=None)[0][:2]
        return math.atan(float(np.hypot(*gradient)))

    @property
    def is_inside(self) -> bool:
        """Whether the robot stands where it cannot turn."""
        return self.start is not None and self.label[self.start] != TerrainClass.TRAVERSABLE

    @property
    def is_in_passage(self) -> bool:
        """Whether a passage begins where the robot stands."""
        return any(passage.nodes[0] == self.start for passage in self.passages)

    @property
    def traversable_area_m2(self) -> float:
        """Ground that the robot's centre may reach without leaving what is known, seen from above."""
        return float(np.count_nonzero(self.reached & (self.label == TerrainClass.TRAVERSABLE))) * self.resolution**2

    @property
    def ground_area_m2(self) -> float:
        """Ground found by the first flood, with the inflated strip: an estimate of what was covered so far."""
        ground = (self.label == TerrainClass.TRAVERSABLE) | (self.label == TerrainClass.INFLATION)
        return float(np.count_nonzero(ground)) * self.resolution**2
