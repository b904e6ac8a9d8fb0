"""Where ground ends, and how far the middle of the robot keeps off: the inflation of the thesis (5.5, addRobotPadding), by the hit.

After the first flood, in `terrain.classify`. An obstacle or a cliff is where beams ended in its voxel, not in the middle, up to 6 cm
away; ground that is too steep begins where the slope that is fitted to its column and to the next would be at its limit between them. All
places are in voxels of the window.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain import kernels as kernels
from octomap_server_3dnav.terrain.classified_terrain import TerrainClass
from octomap_server_3dnav.terrain.cliff_edges import BEFORE, cliff_edges
from octomap_server_3dnav.terrain.config import Limits, TerrainConfig
from octomap_server_3dnav.terrain.hit_extent import RIM, Floats, Ints, middles, of_things, reach_of
from octomap_server_3dnav.terrain.scene import Scene
from octomap_server_3dnav.terrain.surface_columns import DX, DY, NO_VOXEL

_BITS = 16  # of a level
_LOWEST = -(2 ** (_BITS - 1))
_FOOT = 1  # voxels above the ground's, from which what stands is measured: a rock's foot is a slope that is too steep
_FLANK = 0.15  # voxels before the rim of a step's column that its flank may begin
_POINTS = np.empty((0, 3))  # of barriers that extend nowhere


class Radii(NamedTuple):
    """Voxels to keep from obstacles, from the middle of ground that is too steep or too high a step, and from cliffs."""

    obstacles: float
    steep: float
    cliffs: float


class Barriers(NamedTuple):
    """Obstacles, ground that is too steep or too high a step, and cliffs: x, y of the window and level, (M, 3) each; and how far the
    obstacles and the cliffs extend from there, `reach` and `edge` (M, 3) as `terrain_kernels.inflate` takes it, or (0, 3) where nothing is
    known of that."""

    obstacles: Floats
    steep: Floats
    cliffs: Floats
    reach: Floats
    edge: Floats

    def as_points(self) -> "Barriers":
        """The same without their extent."""
        return self._replace(reach=_POINTS, edge=_POINTS)


@njit(cache=True)
def distinct_rows(rows: Any, a: Any, b: Any) -> Any:
    """(M, 3) what is distinct in the columns 0, a and b of some rows, sorted; the latter are numbers of 16 bits.

    As single numbers they sort ten times faster than as rows.
    """
    keys = np.empty(len(rows), np.int64)
    for i in range(len(rows)):
        keys[i] = (rows[i, 0] << _BITS | (rows[i, a] - _LOWEST)) << _BITS | (rows[i, b] - _LOWEST)
    keys.sort()
    out, n = np.empty((keys.size, 3), np.int64), 0
    for i in range(keys.size):
        if i == 0 or keys[i] != keys[i - 1]:
            out[n, 0], out[n, 1] = keys[i] >> 2 * _BITS, (keys[i] >> _BITS & (1 << _BITS) - 1) + _LOWEST
            out[n, 2] = (keys[i] & (1 << _BITS) - 1) + _LOWEST
            n += 1
    return out[:n]


def _rims(places: Floats, direction: Ints) -> Floats:
    """Just inside of the rims of columns (M, 3) that one comes to in a direction (M,)."""
    back = np.stack([DX[direction], DY[direction], np.zeros_like(direction)], axis=1)
    return np.asarray(places - 0.99 * RIM * back)


def barriers_of(
    scene: Scene, label: NDArray[np.uint8], obstacles: Ints, steps: Ints, cliff: Ints, heights: SurfaceHeights | None, limits: Limits
) -> tuple[Barriers, Barriers]:
    """The places of all barriers as they were measured, and in voxels, where the local costmap has them: of `obstacles` and `steps` as
    `terrain_kernels.barriers_seen` and `mark_steps` give them, of the nodes that are obstacles, and of `cliff` nodes, some of which may be
    obstacles to the ground below.

    Obstacles are where beams ended in their column from its foot up to the robot's height, and those that nobody has hit in the middle of
    it; cliffs as `cliff_edges` tells. Measured steps begin just before their column, what is too steep where two slopes tell.
    """
    column, z, ny = scene.surfaces.column, scene.surfaces.z.astype(np.int64), scene.columns.ny
    is_steep, rise = label == TerrainClass.OBSTACLE, steps[:0]
    if heights is not None:
        is_steep[steps[:, 0]], rise = False, steps
    steep = np.flatnonzero(is_steep)
    at, level, voxel = distinct_rows(obstacles, 2, 3).T
    stand, too_steep, too_high, cliffs = (
        middles(columns, levels, ny)
        for columns, levels in ((at, level), (column[steep], z[steep]), (column[rise[:, 0]], z[rise[:, 0]]), (column[cliff], z[cliff]))
    )
    in_voxels = Barriers(np.concatenate([stand, too_high]), too_steep, cliffs, _POINTS, _POINTS)
    if heights is None:
        return in_voxels, in_voxels
    low, high = (np.where(voxel >= kernels.PASSED, NO_VOXEL, level + above) for above in (_FOOT, limits.clearance))
    things = of_things(heights, scene, at, low, high, limits.hit_noise)
    met, rims, edges = stand.copy(), _rims(too_high, rise[:, 1]), cliff_edges(heights, scene, cliff, limits)
    met[:, :2] += things[:, 1:3]
    gets_steep = kernels.steep_edges(label, scene.surfaces, scene.links, steep, ny, BEFORE, limits)
    stands_within = reach_of(things, limits.hit_noise)
    stands_within[voxel == kernels.PASSED] = 0.0
    reach = np.concatenate([stands_within, np.tile([0.0, 0.0, _FLANK], (len(rims), 1))])
    measured = Barriers(np.concatenate([met, rims]), np.concatenate([gets_steep, edges.rounded]), edges.sharp, reach, edges.reach)
    return measured, in_voxels


def turning_radii(config: TerrainConfig, limits: Limits) -> Radii:
    """How far the middle of the robot keeps off to turn everywhere; the thesis's cuboids are whole voxels."""
    near, cliff = config.inflation_radius_m / limits.resolution, config.cliff_inflation_radius_m / limits.resolution
    if config.inflation_shape == "square":
        return Radii(*(math.floor(radius + 1e-9) for radius in (near, near, cliff)))
    return Radii(near + limits.hit_margin, near + limits.steep_margin, cliff + limits.cliff_margin)


def passage_radii(config: TerrainConfig, limits: Limits) -> Radii:
    """How far the middle line of a passage keeps off; of ground that is too steep as of a cliff, at whose rim some often seems so."""
    near, cliff = config.narrow_radius_m / limits.resolution, config.narrow_cliff_radius_m / limits.resolution
    return Radii(near, max(near, cliff), cliff)


def narrow_radii(config: TerrainConfig, limits: Limits) -> Radii:
    """How far from barriers no voxel can hold the middle of a passage: the voxel's corner may be farther off. As far as to turn: never."""
    turning, passage = turning_radii(config, limits), passage_radii(config, limits)
    beside_obstacles = config.narrow_radius_m < config.inflation_radius_m
    beside_cliffs = config.narrow_cliff_radius_m < config.cliff_inflation_radius_m
    narrow = (beside_obstacles, beside_obstacles, beside_cliffs)
    return Radii(*(max(0.0, p - math.sqrt(0.5)) if is_on else t for is_on, p, t in zip(narrow, passage, turning, strict=True)))


def inflate(scene: Scene, label: NDArray[np.uint8], barriers: Barriers, radii: Radii, shape: str, limits: Limits) -> None:
    """addRobotPadding: obstacles and cliffs take the ground around them, at their own level and within `radii`, out of the graph."""
    inflate_around(scene, label, barriers.obstacles, radii.obstacles, shape, limits, barriers.reach)
    inflate_around(scene, label, barriers.steep, radii.steep, shape, limits)
    inflate_around(scene, label, barriers.cliffs, radii.cliffs, shape, limits, barriers.edge)


def inflate_around(
    scene: Scene, label: NDArray[np.uint8], places: Floats, radius: float, shape: str, limits: Limits, reach: Floats = _POINTS
) -> None:
    """The same around (M, 3) places of one kind, that extend as far as `reach` says."""
    band = limits.step + math.ceil(radius * limits.max_slope)
    kernels.inflate(label, scene.surfaces, places, reach, radius, shape == "square", band, scene.columns.nx, scene.columns.ny)
