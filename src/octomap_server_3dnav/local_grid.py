"""The local terrain as a flat grid, for the terrain layer of the costmap (thesis 5.5.2, 6.2.1).

After the local `terrain.classify` of the robot's surroundings, before move_base's costmap. Only what the flood reached or ran into is projected: what lies on
another level, a bridge above or a tunnel below, does not show.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from rigid_geometry import as_transform
from rigid_geometry.transforms import Transform

from octomap_server_3dnav.terrain import Terrain, TerrainClass

LETHAL, FREE, UNKNOWN = 100, 0, -1


@dataclass(frozen=True, eq=False)
class TerrainGrid:
    """cost (ny, nx) int8 of a map-aligned grid: 100 obstacle or cliff, 0 ground, -1 not reached; cell [0, 0] starts at origin_xy in map."""

    cost: NDArray[np.int8]
    origin_xy: tuple[float, float]
    resolution: float


def project(terrain: Terrain, T_map_base: Transform, size_m: float, resolution: float) -> TerrainGrid:
    """A square grid of `size_m` around the robot; in every cell an obstacle or a cliff wins over ground.

    Inflated ground is free here, the costmap inflates by itself; so is floor assumed over a hole. Cells are whole multiples of `resolution` in
    map, so that grids of successive poses lie on one raster. ValueError when a size is not positive.
    """
    if not (size_m > 0 and resolution > 0):
        raise ValueError(f"size_m and resolution must be positive metres, not {size_m!r} and {resolution!r}")
    T_map_base = as_transform(T_map_base)
    cells = math.ceil(size_m / resolution - 1e-9)
    first = [math.floor((T_map_base[axis, 3] - size_m / 2) / resolution + 0.5) for axis in (0, 1)]
    cost = np.full((cells, cells), UNKNOWN, dtype=np.int8)
    ground = (terrain.label == TerrainClass.TRAVERSABLE) | (terrain.label == TerrainClass.INFLATION)
    lethal = (terrain.label == TerrainClass.OBSTACLE) | (terrain.label == TerrainClass.CLIFF)
    for which, value in ((ground, FREE), (lethal, LETHAL)):
        _paint(cost, terrain, np.flatnonzero(which), first, resolution, value)
    return TerrainGrid(cost, (first[0] * resolution, first[1] * resolution), resolution)


def _paint(cost: NDArray[np.int8], terrain: Terrain, nodes: NDArray[np.int64], first: list[int], resolution: float, value: int) -> None:
    """Set all cells whose centre lies in one of the voxels, and the cell that holds the voxel's centre."""
    spread = max(1, math.ceil(terrain.resolution / resolution))
    inner = (np.arange(spread) + 0.5) / spread * terrain.resolution
    for dx in inner:
        for dy in inner:
            x = np.floor((terrain.ix[nodes] * terrain.resolution + dx) / resolution).astype(np.int64) - first[0]
            y = np.floor((terrain.iy[nodes] * terrain.resolution + dy) / resolution).astype(np.int64) - first[1]
            inside = (x >= 0) & (y >= 0) & (x < cost.shape[1]) & (y < cost.shape[0])
            cost[y[inside], x[inside]] = value
