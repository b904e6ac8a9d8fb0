"""Where ground ends, and how far the middle of the robot keeps off: the inflation of the thesis (5.5, addRobotPadding), by the hit.

After the first flood, in `terrain.classify`. An obstacle is where beams ended in its voxel, not in that voxel's middle, which is up to 6 cm
away; ground that is too steep begins somewhere in its column. All places are in voxels of the window.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav import terrain_kernels as kernels
from octomap_server_3dnav.classified_terrain import TerrainClass
from octomap_server_3dnav.surface_columns import DX, DY
from octomap_server_3dnav.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain_config import Limits, TerrainConfig
from octomap_server_3dnav.terrain_scene import Scene

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_BITS = 16  # of a level
_LOWEST = -(2 ** (_BITS - 1))
_RIM = 0.5  # voxels from the middle of a column to its rim


class Radii(NamedTuple):
    """Voxels to keep from obstacles, from the middle of ground that is too steep or too high a step, and from cliffs."""

    obstacles: float
    steep: float
    cliffs: float


class Barriers(NamedTuple):
    """Obstacles, ground that is too steep or too high a step, and cliffs: x, y of the window and level, (M, 3) each."""

    obstacles: Floats
    steep: Floats
    cliffs: Floats

    def in_voxels(self) -> "Barriers":
        """The same with obstacles in the middle of their columns, where the local costmap has them."""
        return self._replace(obstacles=np.column_stack([np.floor(self.obstacles[:, :2]) + 0.5, self.obstacles[:, 2]]))


def _unique(column: Ints, *numbers: Ints) -> list[Ints]:
    """Sorted distinct rows of columns and up to two numbers of 16 bits; as single numbers they sort ten times faster than as rows."""
    keys, rows = column.astype(np.int64), []
    for number in numbers:
        keys = (keys << _BITS) + (number - _LOWEST)
    keys = np.unique(keys)
    for _ in numbers:
        rows.append((keys & (2**_BITS - 1)) + _LOWEST)
        keys >>= _BITS
    return [keys, *reversed(rows)]


def unique_pairs(column: Ints, z: Ints) -> Ints:
    """(M, 2) sorted distinct pairs of a column and a level."""
    return np.stack(_unique(column, z), axis=1)


def middles(column: NDArray[np.integer], level: NDArray[np.integer], ny: int) -> Floats:
    """(M, 3) the middles of some columns, at their levels."""
    return np.column_stack([column // ny + 0.5, column % ny + 0.5, level])


def _rims(places: Floats, direction: Ints) -> Floats:
    """Just inside of the rims of columns (M, 3) that one comes to in a direction (M,)."""
    back = np.stack([DX[direction], DY[direction], np.zeros_like(direction)], axis=1)
    return np.asarray(places - 0.99 * _RIM * back)


def barriers_of(
    scene: Scene, label: NDArray[np.uint8], obstacles: Ints, steps: Ints, cliff: Ints, heights: SurfaceHeights | None
) -> Barriers:
    """The places of all barriers: of `obstacles` and `steps` as `terrain_kernels.obstacles_seen` and `mark_steps` give them, of the nodes
    that are obstacles, and of `cliff` nodes, some of which may be obstacles to the ground below.

    Obstacles are where beams ended in the lowest voxel that is in the way, those that nobody has hit in the middle of their column.
    Measured steps begin where their column does.
    """
    column, z, ny = scene.surfaces.column, scene.surfaces.z, scene.columns.ny
    steep = np.flatnonzero(label == TerrainClass.OBSTACLE)
    at, level, voxel = _unique(obstacles[:, 0], obstacles[:, 2], obstacles[:, 3])
    places = middles(at, level, ny)
    if heights is not None:
        offset = heights.at(at // ny + scene.key[0], at % ny + scene.key[1], voxel)[:, 2:]
        places[:, :2] += np.nan_to_num(offset, nan=0.0)
        steep = np.setdiff1d(steep, steps[:, 0])
        places = np.concatenate([places, _rims(middles(column[steps[:, 0]], z[steps[:, 0]], ny), steps[:, 1])])
    return Barriers(places, middles(column[steep], z[steep], ny), middles(column[cliff], z[cliff], ny))


def turning_radii(config: TerrainConfig, limits: Limits) -> Radii:
    """How far the middle of the robot keeps off to turn everywhere; the thesis's cuboids are whole voxels."""
    near, cliff = config.inflation_radius_m / limits.resolution, config.cliff_inflation_radius_m / limits.resolution
    if config.inflation_shape == "square":
        return Radii(*(math.floor(radius + 1e-9) for radius in (near, near, cliff)))
    return Radii(near + limits.hit_margin, near + _RIM + limits.hit_margin, cliff)


def passage_radii(config: TerrainConfig, limits: Limits) -> Radii:
    """How far the middle line of a passage keeps off."""
    near, cliff = config.narrow_radius_m / limits.resolution, config.narrow_cliff_radius_m / limits.resolution
    return Radii(near, near + _RIM, cliff)


def narrow_radii(config: TerrainConfig, limits: Limits) -> Radii:
    """How far from barriers no voxel can hold the middle of a passage: the voxel's corner may be farther off. As far as to turn: never."""
    turning, passage = turning_radii(config, limits), passage_radii(config, limits)
    beside_obstacles = config.narrow_radius_m < config.inflation_radius_m
    beside_cliffs = config.narrow_cliff_radius_m < config.cliff_inflation_radius_m
    narrow = (beside_obstacles, beside_obstacles, beside_cliffs)
    return Radii(*(max(0.0, p - math.sqrt(0.5)) if is_on else t for is_on, p, t in zip(narrow, passage, turning, strict=True)))


def inflate(scene: Scene, label: NDArray[np.uint8], barriers: Barriers, radii: Radii, shape: str, limits: Limits) -> None:
    """addRobotPadding: obstacles and cliffs take the ground around them, at their own level and within `radii`, out of the graph."""
    for places, radius in zip(barriers, radii, strict=True):
        inflate_around(scene, label, places, radius, shape, limits)


def inflate_around(scene: Scene, label: NDArray[np.uint8], places: Floats, radius: float, shape: str, limits: Limits) -> None:
    """The same around (M, 3) places of one kind."""
    band = limits.step + math.ceil(radius * limits.max_slope)
    kernels.inflate(label, scene.surfaces, places, radius, shape == "square", band, scene.columns.nx, scene.columns.ny)
