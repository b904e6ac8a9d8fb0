"""The local terrain as a flat grid, for the terrain layer of the costmap (thesis 5.5.2, 6.2.1).

After the local `terrain.classify` of the robot's surroundings, before move_base's costmap. Only what the flood reached or ran into is
projected: what lies on another level, a bridge above or a tunnel below, does not show.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass
from rigid_geometry import as_transform
from rigid_geometry.transforms import Transform
from stage_config import check_ranges, parameter

LETHAL, FREE, UNKNOWN = 100, 0, -1


@dataclass(frozen=True, eq=False)
class TerrainGrid:
    """cost (ny, nx) int8 of a map-aligned grid: 100 obstacle or cliff, 0 ground, -1 not reached; height (ny, nx) float32 of the ground's
    surface in map, NaN where there is none; cell [0, 0] starts at origin_xy in map."""

    cost: NDArray[np.int8]
    height: NDArray[np.float32]
    origin_xy: tuple[float, float]
    resolution: float


@dataclass(frozen=True)
class LocalGridConfig:
    """What the local twin node classifies and projects."""

    radius_m: float = parameter(5.0, "m", "terrain around the robot that is classified", low=1.0, high=20.0)
    size_m: float = parameter(
        8.0, "m", "side of the grid; a little more than the costmap's, which moves on until the next sweep", low=1.0, high=40.0
    )
    resolution_m: float = parameter(0.08, "m", "side of a cell; the octree's resolution keeps it free of resampling", low=0.01, high=0.5)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)


def project(terrain: Terrain, T_map_base: Transform, size_m: float, resolution: float) -> TerrainGrid:
    """A square grid of `size_m` around the robot; in every cell an obstacle or a cliff wins over ground.

    Inflated ground is free here, the costmap inflates by itself; so is floor assumed over a hole. Cells are whole multiples of `resolution`
    in map, so that grids of successive poses lie on one raster. ValueError when a size is not positive.
    """
    if not (size_m > 0 and resolution > 0):
        raise ValueError(f"size_m and resolution must be positive metres, not {size_m!r} and {resolution!r}")
    T_map_base = as_transform(T_map_base)
    cells = math.ceil(size_m / resolution - 1e-9)
    first = [math.floor((T_map_base[axis, 3] - size_m / 2) / resolution + 0.5) for axis in (0, 1)]
    cost = np.full((cells, cells), UNKNOWN, dtype=np.int8)
    height = np.full((cells, cells), np.nan, dtype=np.float32)
    ground = (terrain.label == TerrainClass.TRAVERSABLE) | (terrain.label == TerrainClass.INFLATION)
    lethal = (terrain.label == TerrainClass.OBSTACLE) | (terrain.label == TerrainClass.CLIFF)
    for which, value in ((ground, FREE), (lethal, LETHAL)):
        _paint(cost, terrain, np.flatnonzero(which), first, resolution, value)
    nodes = np.flatnonzero(ground)
    _paint(height, terrain, nodes, first, resolution, (terrain.z[nodes] + 1) * terrain.resolution)
    return TerrainGrid(cost, height, (first[0] * resolution, first[1] * resolution), resolution)


def _paint(
    cells: NDArray[np.int8] | NDArray[np.float32],
    terrain: Terrain,
    nodes: NDArray[np.int64],
    first: list[int],
    resolution: float,
    value: ArrayLike,
) -> None:
    """Set all cells that evenly spread points of the voxels fall into, so that no cell between them stays empty."""
    values = np.broadcast_to(np.asarray(value), nodes.shape)
    spread = max(1, math.ceil(terrain.resolution / resolution))
    inner = (np.arange(spread) + 0.5) / spread * terrain.resolution
    for dx in inner:
        for dy in inner:
            x = np.floor((terrain.ix[nodes] * terrain.resolution + dx) / resolution).astype(np.int64) - first[0]
            y = np.floor((terrain.iy[nodes] * terrain.resolution + dy) / resolution).astype(np.int64) - first[1]
            inside = (x >= 0) & (y >= 0) & (x < cells.shape[1]) & (y < cells.shape[0])
            cells[y[inside], x[inside]] = values[inside]
