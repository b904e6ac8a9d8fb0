"""Where ground ends, and how far the middle of the robot keeps off: the inflation of the thesis (5.5, addRobotPadding), by the hit.

After the first flood, in `terrain.classify`. An obstacle or a cliff is where beams ended in its voxel, not in the middle, up to 6 cm
away; ground that is too steep begins where the slope that is fitted to its column and to the next would be at its limit between them. All
places are in voxels of the window.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav import terrain_kernels as kernels
from octomap_server_3dnav.classified_terrain import TerrainClass
from octomap_server_3dnav.surface_columns import DX, DY, NO_VOXEL
from octomap_server_3dnav.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain_config import Limits, TerrainConfig
from octomap_server_3dnav.terrain_scene import Scene

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_BITS = 16  # of a level
_LOWEST = -(2 ** (_BITS - 1))
_RIM = 0.5  # voxels from the middle of a column to its rim
_AT_RIM = 0.4  # where the hits at the rim of a voxel begin
_FOOT = 1  # voxels above the ground's, from which what stands is measured: a rock's foot is a slope that is too steep
_FALLING = 0.25  # voxels from one column to the next, 14 degrees: less is the unevenness of a floor
_FEW = 10.0  # voxels, divided by the hits in a column: how far beyond them a part of a thing may stand that none met
_UNMET = 0.7  # voxels around the middle of a column that a thing may take up which no beam met: it may hang over beside it
_FLANK = 0.15  # voxels before the rim of a step's column that its flank may begin
_SURE = 2  # beams that ended on the floor before a cliff: of fewer it may begin a voxel nearer
_MANY = 6  # hits whose mean tells whether the ground fills a column
_ASIDE = 0.25  # voxels that it lies off the middle then where it does not
_BEFORE = 0.2  # voxels before the middle of its column that a slope gets too steep, where the slopes beside it do not tell
_POINTS = np.empty((0, 3))  # of barriers that extend nowhere


class Radii(NamedTuple):
    """Voxels to keep from obstacles, from the middle of ground that is too steep or too high a step, and from cliffs."""

    obstacles: float
    steep: float
    cliffs: float


class Barriers(NamedTuple):
    """Obstacles, ground that is too steep or too high a step, and cliffs: x, y of the window and level, (M, 3) each; and how far the
    obstacles extend from there, `reach` (M, 3) as `terrain_kernels.inflate` takes it, or (0, 3) where nothing is known of that."""

    obstacles: Floats
    steep: Floats
    cliffs: Floats
    reach: Floats

    def as_points(self) -> "Barriers":
        """The same without their extent."""
        return self._replace(reach=_POINTS)


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


def _spread(heights: SurfaceHeights, scene: Scene, column: Ints, low: Ints, high: Ints) -> Floats:
    """(M, 6) of the hits of some columns from one voxel to another, as `SurfaceHeights.spread` gives them."""
    ny = scene.columns.ny
    return heights.spread(column // ny + scene.key[0], column % ny + scene.key[1], low, high)


def _together(hits: Floats, more: Floats) -> Floats:
    """(M, 6) the spread of two groups of hits as of one."""
    count, share = hits[:, :1] + more[:, :1], more[:, :1] / (hits[:, :1] + more[:, :1])
    off = more[:, 1:3] - hits[:, 1:3]
    between = share * (1 - share) * off[:, [0, 1, 0]] * off[:, [0, 1, 1]]
    return np.concatenate([count, hits[:, 1:3] + share * off, (1 - share) * hits[:, 3:] + share * more[:, 3:] + between], axis=1)


def _of_things(heights: SurfaceHeights, scene: Scene, column: Ints, low: Ints, high: Ints) -> Floats:
    """(M, 6) the spread of what stands in these columns.

    What sticks a centimetre into a column, beside one that as many beams met, are the beams that ended too soon: the hits of both are of
    one thing.
    """
    found, ahead = _spread(heights, scene, column, low, high), np.stack([DX, DY], axis=1)
    at_rim, k = np.nonzero(found[:, 1:3] @ ahead.T > _AT_RIM)
    beyond = _spread(heights, scene, column[at_rim] + DX[k] * scene.columns.ny + DY[k], low[at_rim], high[at_rim])
    beyond[:, 1:3] += ahead[k]
    many = np.flatnonzero(beyond[:, 0] >= found[at_rim, 0])
    many = many[np.argsort(beyond[many, 0], kind="stable")]  # of two the one with more hits is written last
    found[at_rim[many]] = _together(found[at_rim[many]], beyond[many])
    return found


def _reach(things: Floats, noise: float) -> Floats:
    """(M, 3) how far things extend around the mean place of their hits, as `terrain_kernels.inflate` takes it: what is spread evenly ends
    at the root of three standard deviations. The noise of the beams, in voxels, is not part of them.

    What few beams met may end where none did: the fewer, the farther, and most where none did.
    """
    xx, yy, xy = 3.0 * things[:, 3:].T
    mean, off, angle = 0.5 * (xx + yy) - 3.0 * noise**2, np.hypot(0.5 * (xx - yy), xy), 0.5 * np.arctan2(2.0 * xy, xx - yy)
    length, width = np.sqrt(np.maximum(mean + off, 0.0)), np.sqrt(np.maximum(mean - off, 0.0))
    unmet = np.minimum(np.where(things[:, 0] > 0, _RIM, _UNMET), _FEW / np.maximum(things[:, 0], 1.0))
    return np.column_stack([(length - width) * np.cos(angle), (length - width) * np.sin(angle), width + unmet])


def _way_over(scene: Scene, cliff: Ints) -> Floats:
    """(M, 2) the last voxel before the edge of cliffs."""
    beyond = (scene.links.graph[cliff] < 0).astype(np.float64) @ np.stack([DX, DY], axis=1)
    return np.asarray(beyond / np.maximum(1.0, np.hypot(beyond[:, :1], beyond[:, 1:])))


def _inner_corners(heights: SurfaceHeights, scene: Scene, cliff: Ints) -> Floats:
    """(C, 3) where ground ends within a column that is beside the end of an edge, diagonally before the drop, and no cliff itself."""
    graph, ahead, is_cliff = scene.links.graph, np.stack([DX, DY], axis=1), np.zeros(len(scene.links.graph), np.bool_)
    is_cliff[cliff] = True
    nodes, ways = [], []
    for k in range(4):
        edge = cliff[graph[cliff, k] < 0]
        for aside in ((k + 1) % 4, (k + 3) % 4):
            beside = graph[edge, aside]
            nodes.append(beside[(beside >= 0) & ~is_cliff[beside]].astype(np.int64))
            ways.append(np.tile(ahead[k] - ahead[aside], (len(nodes[-1]), 1)))
    node, way = np.concatenate(nodes), np.concatenate(ways)
    column, z = scene.surfaces.column[node].astype(np.int64), scene.surfaces.z[node].astype(np.int64)
    met = _spread(heights, scene, column, z, z)
    ends = (met[:, 0] >= _MANY) & ((met[:, 1:3] * way).sum(axis=1) < -_ASIDE)
    places = middles(column, z, scene.columns.ny)
    places[:, :2] += met[:, 1:3]
    return np.asarray(places[ends])


def _is_rounded(scene: Scene, cliff: Ints) -> NDArray[np.bool_]:
    """(M,) cliffs towards which the ground falls already and beyond which it goes on little lower, as at the rim of a crater."""
    near, graph, level = scene.links.near[cliff], scene.links.graph[cliff], scene.surfaces.level
    behind = np.roll(graph, 2, axis=1)  # of every direction the node the other way
    fall = np.where((graph < 0) & (near >= 0) & (behind >= 0), level[behind] - level[cliff, None], -np.inf)
    return np.asarray(fall.max(axis=1, initial=-np.inf) > _FALLING)


def barriers_of(
    scene: Scene, label: NDArray[np.uint8], obstacles: Ints, steps: Ints, cliff: Ints, heights: SurfaceHeights | None, limits: Limits
) -> tuple[Barriers, Barriers]:
    """The places of all barriers as they were measured, and in voxels, where the local costmap has them: of `obstacles` and `steps` as
    `terrain_kernels.barriers_seen` and `mark_steps` give them, of the nodes that are obstacles, and of `cliff` nodes, some of which may be
    obstacles to the ground below.

    Obstacles are where beams ended in their column from its foot up to the robot's height, cliffs where they ended in their voxel,
    and those that nobody has hit in the middle of their column, cliffs on floor that less than two beams met a voxel nearer, and in
    inner corners where the ground ends. Measured steps begin just before their column; what is too steep where the slopes of two columns
    tell, rounded cliffs somewhere in theirs.
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
    in_voxels = Barriers(np.concatenate([stand, too_high]), too_steep, cliffs.copy(), _POINTS)
    if heights is None:
        return in_voxels, in_voxels
    low, high = (np.where(voxel == NO_VOXEL, NO_VOXEL, level + above) for above in (_FOOT, limits.clearance))
    things = _of_things(heights, scene, at, low, high)
    stand[:, :2] += things[:, 1:3]
    rounded, over = _is_rounded(scene, cliff), _way_over(scene, cliff)
    rims_of_craters = cliffs[rounded]
    rims_of_craters[:, :2] -= _BEFORE * over[rounded]
    edges = kernels.steep_edges(label, scene.surfaces, scene.links, steep, ny, _BEFORE, limits)
    cliff, cliffs = cliff[~rounded], cliffs[~rounded]
    met = _spread(heights, scene, column[cliff].astype(np.int64), z[cliff], z[cliff])
    cliffs[:, :2] += met[:, 1:3] - (met[:, :1] < _SURE) * over[~rounded]
    cliffs = np.concatenate([cliffs, _inner_corners(heights, scene, cliff)])
    rims = _rims(too_high, rise[:, 1])
    reach = np.concatenate([_reach(things, limits.hit_noise), np.tile([0.0, 0.0, _FLANK], (len(rims), 1))])
    return Barriers(np.concatenate([stand, rims]), np.concatenate([edges, rims_of_craters]), cliffs, reach), in_voxels


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
    inflate_around(scene, label, barriers.cliffs, radii.cliffs, shape, limits)


def inflate_around(
    scene: Scene, label: NDArray[np.uint8], places: Floats, radius: float, shape: str, limits: Limits, reach: Floats = _POINTS
) -> None:
    """The same around (M, 3) places of one kind, that extend as far as `reach` says."""
    band = limits.step + math.ceil(radius * limits.max_slope)
    kernels.inflate(label, scene.surfaces, places, reach, radius, shape == "square", band, scene.columns.nx, scene.columns.ny)
