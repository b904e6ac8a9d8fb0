"""Where ground ends, and how far the middle of the robot keeps off: the inflation of the thesis (5.5, addRobotPadding), by the hit.

After the first flood, in `terrain.classify`. An obstacle or a cliff is where beams ended in its voxel, not in the middle, up to 6 cm
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
_AT_RIM = 0.4  # where the hits at the rim of a voxel begin
_SPILLING = 3.0  # times as many hits in the voxel beside


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


def _places(heights: SurfaceHeights, scene: Scene, column: Ints, voxel: Ints) -> NDArray[np.float32]:
    """(M, 3) how many beams ended in these voxels, and where, from the middle of their columns; there where none did."""
    ny = scene.columns.ny
    found = heights.places(column // ny + scene.key[0], column % ny + scene.key[1], voxel)
    return np.asarray(np.nan_to_num(found, nan=0.0))


def _from_middles(heights: SurfaceHeights, scene: Scene, column: Ints, voxel: Ints) -> NDArray[np.float32]:
    """(M, 2) where the things in these voxels are, from the middle of their columns.

    What sticks a centimetre into a voxel, beside one that far more beams met, are the beams that ended too soon: it is where those of both
    ended on average.
    """
    found, ahead = _places(heights, scene, column, voxel), np.stack([DX, DY], axis=1).astype(np.float32)
    count, offset = found[:, :1], found[:, 1:]
    at_rim, k = np.nonzero(offset @ ahead.T > _AT_RIM)
    beyond = _places(heights, scene, column[at_rim] + DX[k] * scene.columns.ny + DY[k], voxel[at_rim])
    many = beyond[:, :1]
    mean = offset[at_rim] + many / (many + count[at_rim]) * (beyond[:, 1:] + ahead[k] - offset[at_rim])
    spilling = np.flatnonzero(many >= _SPILLING * count[at_rim])
    spilling = spilling[np.argsort(many[spilling, 0], kind="stable")]  # of two the one with more hits is written last
    offset[at_rim[spilling]] = mean[spilling]
    return offset


def _doubtful_way(scene: Scene, cliff: Ints) -> Floats:
    """(M, 2) the last voxel before the edge of those cliffs whose floor is assumed over a hole, as across a corner of the void; else 0."""
    beyond = (scene.links.graph[cliff] < 0).astype(np.float64) @ np.stack([DX, DY], axis=1)
    length = np.maximum(1.0, np.hypot(beyond[:, :1], beyond[:, 1:]))
    return np.asarray(scene.surfaces.bridged[cliff, None] * beyond / length)


def barriers_of(
    scene: Scene, label: NDArray[np.uint8], obstacles: Ints, steps: Ints, cliff: Ints, heights: SurfaceHeights | None
) -> tuple[Barriers, Barriers]:
    """The places of all barriers as they were measured, and in voxels, where the local costmap has them: of `obstacles` and `steps` as
    `terrain_kernels.obstacles_seen` and `mark_steps` give them, of the nodes that are obstacles, and of `cliff` nodes, some of which may be
    obstacles to the ground below.

    Obstacles are where beams ended in the lowest voxel that is in the way, cliffs where they ended in theirs, and those that nobody has hit
    in the middle of their column, cliffs on assumed floor a voxel nearer. Measured steps begin where their column does.
    """
    column, z, ny = scene.surfaces.column, scene.surfaces.z.astype(np.int64), scene.columns.ny
    steep, rise = np.flatnonzero(label == TerrainClass.OBSTACLE), steps[:0]
    if heights is not None:
        steep, rise = np.setdiff1d(steep, steps[:, 0]), steps
    at, level, voxel = _unique(obstacles[:, 0], obstacles[:, 2], obstacles[:, 3])
    stand, too_steep, too_high, cliffs = (
        middles(columns, levels, ny)
        for columns, levels in ((at, level), (column[steep], z[steep]), (column[rise[:, 0]], z[rise[:, 0]]), (column[cliff], z[cliff]))
    )
    in_voxels = Barriers(np.concatenate([stand, too_high]), too_steep, cliffs.copy())
    if heights is None:
        return in_voxels, in_voxels
    stand[:, :2] += _from_middles(heights, scene, at, voxel)
    cliffs[:, :2] -= _doubtful_way(scene, cliff)
    cliffs[:, :2] += _places(heights, scene, column[cliff].astype(np.int64), z[cliff])[:, 1:]
    return Barriers(np.concatenate([stand, _rims(too_high, rise[:, 1])]), too_steep, cliffs), in_voxels


def turning_radii(config: TerrainConfig, limits: Limits) -> Radii:
    """How far the middle of the robot keeps off to turn everywhere; the thesis's cuboids are whole voxels."""
    near, cliff = config.inflation_radius_m / limits.resolution, config.cliff_inflation_radius_m / limits.resolution
    if config.inflation_shape == "square":
        return Radii(*(math.floor(radius + 1e-9) for radius in (near, near, cliff)))
    return Radii(near + limits.hit_margin, near + _RIM + limits.hit_margin, cliff + limits.hit_margin)


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
