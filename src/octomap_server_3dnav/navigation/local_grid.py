"""The robot's storey as a flat grid, for the terrain layer of the costmap (thesis 5.5.2, 6.2.1).

After `terrain.classify` of the robot's surroundings, before move_base's costmap. A bridge above or a tunnel below does not show.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.storey import robot_storey
from octomap_server_3dnav.terrain.classified_terrain import Terrain
from stage_config import check_ranges, parameter

LETHAL, FREE, UNKNOWN = 100, 0, -1


@dataclass(frozen=True, eq=False)
class TerrainGrid:
    """A grid along the axes of map, a cell a column of voxels; cell [0, 0] starts at origin_xy in map.

    cost (ny, nx) int8: 100 obstacle or cliff, 0 ground, -1 not known. height (ny, nx) float32: the ground's surface in map, NaN where there
    is none. distance (ny, nx) float32: metres over the ground from the cell's middle to what is lethal, at its exact place; inf where that
    is far, NaN where there is no ground.
    """

    cost: NDArray[np.int8]
    height: NDArray[np.float32]
    distance: NDArray[np.float32]
    origin_xy: tuple[float, float]
    resolution: float

    def middle(self, size_m: float) -> "TerrainGrid":
        """Its middle square of `size_m`, or as much of that as there is. ValueError for a size that is not positive."""
        if not size_m > 0:
            raise ValueError(f"size_m must be positive metres, not {size_m!r}")
        half = max(1, round(size_m / 2 / self.resolution))
        rows, columns = (slice(max(0, n // 2 - half), n // 2 + half) for n in self.cost.shape)
        x, y = (o + part.start * self.resolution for o, part in zip(self.origin_xy, (columns, rows), strict=True))
        block = rows, columns
        return TerrainGrid(self.cost[block], self.height[block], self.distance[block], (x, y), self.resolution)


@dataclass(frozen=True)
class LocalGridConfig:
    """What the local node keeps of the classified surroundings for the costmap."""

    size_m: float = parameter(
        8.0, "m", "side of the grid; a little more than the costmap's, which moves on until the next sweep", low=1.0, high=40.0
    )

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)


def project(terrain: Terrain, centre_xy: tuple[float, float], size_m: float) -> TerrainGrid:
    """The robot's storey in a square of `size_m` around a place in map.

    An obstacle or a cliff wins over ground of the same storey. What zones close is lethal, known or not. Inflated ground is free here,
    the costmap inflates by itself; so is floor assumed over a hole. ValueError when the size is not positive.
    """
    if not size_m > 0:
        raise ValueError(f"size_m must be positive metres, not {size_m!r}")
    half = max(1, round(size_m / 2 / terrain.resolution))
    first = [round(v / terrain.resolution) - half for v in centre_xy]
    ground, lethal = (_inside(terrain, nodes, first, 2 * half) for nodes in robot_storey(terrain))
    cost = np.full((2 * half, 2 * half), UNKNOWN, dtype=np.int8)
    height, distance = (np.full(cost.shape, np.nan, dtype=np.float32) for _ in range(2))
    for nodes, value in ((ground, FREE), (lethal, LETHAL)):
        cost[_cells(terrain, nodes, first)] = value
    height[_cells(terrain, ground, first)] = (terrain.z[ground] + 1) * terrain.resolution
    distance[_cells(terrain, ground, first)] = terrain.distance_m[ground]
    distance[_cells(terrain, lethal, first)] = 0.0
    if terrain.zones.are_set:
        cost[_closed(terrain, height, first)] = LETHAL
    return TerrainGrid(cost, height, distance, (first[0] * terrain.resolution, first[1] * terrain.resolution), terrain.resolution)


def _closed(terrain: Terrain, height: NDArray[np.float32], first: list[int]) -> NDArray[np.bool_]:
    """(ny, nx) what zones close, at the height of the ground, and where that is not known at that beneath the robot."""
    row, column = np.indices(height.shape)
    here = terrain.z[terrain.start] if terrain.start is not None else math.floor(terrain.robot_xyz[2] / terrain.resolution)
    z = np.where(np.isnan(height), (here + 1) * terrain.resolution, height)
    x, y = (column + first[0] + 0.5) * terrain.resolution, (row + first[1] + 0.5) * terrain.resolution
    xyz = np.stack([x, y, z], axis=-1, dtype=np.float64).reshape(-1, 3)
    return terrain.zones.closed(xyz, terrain.resolution).reshape(height.shape)


def _inside(terrain: Terrain, nodes: NDArray[np.int64], first: list[int], count: int) -> NDArray[np.int64]:
    """Those of some nodes that lie in a square of `count` columns."""
    y, x = _cells(terrain, nodes, first)
    return nodes[(x >= 0) & (y >= 0) & (x < count) & (y < count)]


def _cells(terrain: Terrain, nodes: NDArray[np.int64], first: list[int]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Rows and columns of the nodes in a grid that starts at column `first` of the octree."""
    return terrain.iy[nodes] - first[1], terrain.ix[nodes] - first[0]
