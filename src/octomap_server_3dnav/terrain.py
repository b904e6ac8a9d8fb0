"""Terrain classification (thesis 5.5, algorithm 3 lines 2-21): from column runs and a robot pose to classes and a navigation graph.

After the octree took in a sweep, before a goal is chosen. Free, occupied and unknown are three things here: a drop that was seen is a
cliff, a hole of a few unknown voxels is floor, and any other unknown floor is a frontier, worth a look.
"""

import math
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav import terrain_kernels as kernels
from octomap_server_3dnav.column_runs import ColumnRuns
from octomap_server_3dnav.surface_columns import Columns, Surfaces, crop_columns, surfaces_of
from octomap_server_3dnav.surface_graph import Links, kerbs, nearest_neighbours, slopes_of_open_ground, steppable_neighbours
from octomap_server_3dnav.surface_heights import SurfaceHeights
from rigid_geometry import as_transform
from rigid_geometry.transforms import Transform
from stage_config import check_ranges, parameter


class TerrainClass(IntEnum):
    """Class of a surface voxel (thesis figures 5.16-5.18)."""

    TRAVERSABLE = kernels.TRAVERSABLE
    OBSTACLE = kernels.OBSTACLE
    CLIFF = kernels.CLIFF
    INFLATION = kernels.INFLATION
    FRONTIER = kernels.FRONTIER


@dataclass(frozen=True)
class TerrainConfig:
    """What the robot can drive on and how carefully the map is read."""

    robot_height_m: float = parameter(1.0, "m", "height of the robot above the ground", low=0.1, high=5.0)
    clearance_margin_m: float = parameter(0.10, "m", "room wanted above the robot", low=0.0, high=2.0)
    base_height_m: float = parameter(0.132, "m", "height of base_link above the ground", low=0.0, high=2.0)
    max_step_m: float = parameter(0.10, "m", "highest step the robot climbs", low=0.01, high=0.5)
    step_heights: str = parameter(
        "measured",
        "-",
        "steps by where beams ended in the voxels, where that is known; voxels: by the voxels alone",
        choices=("measured", "voxels"),
    )
    step_margin_m: float = parameter(0.01, "m", "how much lower than the highest step a measured one must be", low=0.0, high=0.2)
    max_slope_rad: float = parameter(math.radians(25.0), "rad", "steepest slope the robot drives", low=0.05, high=0.8)
    slope_radius_m: float = parameter(0.35, "m", "ground around a voxel that its slope is fitted to", low=0.1, high=1.0)
    hole_bridge_voxels: int = parameter(3, "voxels", "widest unknown gap in a level floor that counts as floor", low=0, high=8)
    cliff_look_m: float = parameter(0.8, "m", "how far beyond an edge a drop is looked for", low=0.08, high=3.0)
    cliff_evidence: str = parameter(
        "seen", "-", "a cliff is a drop that was seen; assumed: any edge that was looked across (thesis 7.3)", choices=("seen", "assumed")
    )
    cliff_area_voxels: int = parameter(2, "voxels", "half width of the areas of the cliff check (thesis figure 5.12)", low=0, high=6)
    inflation_radius_m: float = parameter(0.60, "m", "distance kept from obstacles by the robot's centre", low=0.0, high=3.0)
    cliff_inflation_radius_m: float = parameter(0.60, "m", "distance kept from cliffs by the robot's centre", low=0.0, high=3.0)
    inflation_shape: str = parameter("circle", "-", "exact distance, or the square cuboid of the thesis", choices=("circle", "square"))
    start_search_radius_m: float = parameter(0.5, "m", "where around the robot the start voxel is looked for", low=0.05, high=2.0)
    start_height_tolerance_m: float = parameter(0.30, "m", "how far the start voxel may lie off the wheels' plane", low=0.05, high=2.0)
    min_traversable_voxels: int = parameter(50, "voxels", "a start voxel with less ground around it is discarded", low=1, high=100000)
    soft_clearance_m: float = parameter(0.5, "m", "width of the strip beyond the inflation that costs more", low=0.0, high=3.0)
    soft_clearance_weight: float = parameter(2.0, "-", "extra cost a metre at the inner edge of that strip", low=0.0, high=50.0)

    unknown_margin_m: float = parameter(
        0.56, "m", "width of the strip beside unknown floor where driving costs much more", low=0.0, high=3.0
    )
    unknown_weight: float = parameter(
        15.0, "-", "factor of the cost in that strip: an edge that was not seen may be a cliff", low=1.0, high=1000.0
    )

    kerb_rise_m: float = parameter(
        0.045, "m", "measured rise from one column to the next that a turning wheel would scrape along", low=0.0, high=0.5
    )
    kerb_margin_m: float = parameter(0.6, "m", "distance from such a rise within which the robot should not turn", low=0.0, high=3.0)
    kerb_weight: float = parameter(3.0, "-", "factor of the cost within it: kerbs are driven over, not along", low=1.0, high=1000.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        problems = check_ranges(self)
        if self.cliff_look_m < self.max_step_m:
            problems.append(f"cliff_look_m = {self.cliff_look_m!r} is below max_step_m = {self.max_step_m!r}")
        return problems


@dataclass(frozen=True, eq=False)
class Terrain:
    """Classified surface voxels and the navigation graph over them.

    Voxel (ix, iy, z) of the octree's index spans [i * resolution, (i + 1) * resolution) on each axis of map. N nodes: first
    `surface_count` surface voxels that the flood reached, sorted by column of the window (`window_key`, `window_size`,
    `column_start`) and height, then obstacle voxels beside them, then frontier voxels.

    Fields: ix, iy (N,) int32; z (N,) int16; label (N,) uint8 of TerrainClass; bridged (N,) bool, floor assumed over a hole; reached (N,)
    bool, in the second flood (frontiers: seen from such a node); near_kerb (N,) bool, where wheels should not turn; cost (N,) float32,
    factor on the length of a path, inf where no path may go; neighbours (N, 4) int32 to +x, +y, -x, -y, -1 for none (a frontier's are the
    nodes it was seen from); start, the voxel beneath the robot, and departure, where paths begin when the start lies in the inflation:
    node indices, None when there is none; radius_m of the classification, None for the whole map; robot_xyz, where base_link was.
    """

    resolution: float
    ix: NDArray[np.int32]
    iy: NDArray[np.int32]
    z: NDArray[np.int16]
    label: NDArray[np.uint8]
    bridged: NDArray[np.bool_]
    reached: NDArray[np.bool_]
    near_kerb: NDArray[np.bool_]
    cost: NDArray[np.float32]
    neighbours: NDArray[np.int32]
    start: int | None
    departure: int | None
    radius_m: float | None
    robot_xyz: tuple[float, float, float]
    surface_count: int
    window_key: tuple[int, int]
    window_size: tuple[int, int]
    column_start: NDArray[np.int64]

    def centers(self, nodes: NDArray[np.integer] | slice | None = None) -> NDArray[np.float32]:
        """(N, 3) centres in map, in metres, of all nodes or those given by index."""
        which = slice(None) if nodes is None else nodes
        voxels = np.stack([self.ix[which], self.iy[which], self.z[which]], axis=-1)
        return np.asarray((voxels + 0.5) * self.resolution, dtype=np.float32)

    def nodes_of(self, terrain_class: TerrainClass) -> NDArray[np.int64]:
        """Indices of the nodes of one class."""
        return np.flatnonzero(self.label == terrain_class)

    def surface_near(self, xyz: NDArray[np.floating] | tuple[float, float, float], reach_m: float = 0.3) -> int | None:
        """Surface node of the column at a point in map that is nearest in height, within `reach_m`; None when there is none."""
        wx = math.floor(xyz[0] / self.resolution) - self.window_key[0]
        wy = math.floor(xyz[1] / self.resolution) - self.window_key[1]
        if not (0 <= wx < self.window_size[0] and 0 <= wy < self.window_size[1]):
            return None
        column = wx * self.window_size[1] + wy
        nodes = np.arange(self.column_start[column], self.column_start[column + 1])
        if not nodes.size:
            return None
        gaps = np.abs((self.z[nodes] + 0.5) * self.resolution - xyz[2])
        return int(nodes[np.argmin(gaps)]) if gaps.min() <= reach_m else None

    def slope_near(self, xyz: NDArray[np.floating] | tuple[float, float, float], radius_m: float = 0.4) -> float | None:
        """Steepest slope in radians of the plane through the surface around a point in map; None when fewer than six voxels are there."""
        centers = self.centers(slice(0, self.surface_count)) - np.asarray(xyz, dtype=np.float64)
        near = centers[(np.hypot(centers[:, 0], centers[:, 1]) <= radius_m) & (np.abs(centers[:, 2]) <= radius_m)]
        if len(near) < 6:
            return None
        gradient = np.linalg.lstsq(np.column_stack([near[:, :2], np.ones(len(near))]), near[:, 2], rcond=None)[0][:2]
        return math.atan(float(np.hypot(*gradient)))

    @property
    def traversable_area_m2(self) -> float:
        """Ground that the robot's centre may reach without leaving what is known, seen from above."""
        return float(np.count_nonzero(self.reached & (self.label == TerrainClass.TRAVERSABLE))) * self.resolution**2

    @property
    def ground_area_m2(self) -> float:
        """Ground found by the first flood, with the inflated strip: an estimate of what was covered so far."""
        ground = (self.label == TerrainClass.TRAVERSABLE) | (self.label == TerrainClass.INFLATION)
        return float(np.count_nonzero(ground)) * self.resolution**2


@dataclass(frozen=True)
class _Limits:
    """The configuration in voxels of one resolution."""

    resolution: float
    step: int
    max_step: float
    max_measured_step: float
    clearance: int
    slope_reach: int
    max_slope: float
    look: int
    inflation: int

    @classmethod
    def of(cls, config: TerrainConfig, resolution: float) -> "_Limits":
        largest = max(config.inflation_radius_m, config.cliff_inflation_radius_m)
        return cls(
            resolution=resolution,
            step=max(1, math.ceil(config.max_step_m / resolution - 1e-9)),
            max_step=(config.max_step_m + 0.01) / resolution,
            max_measured_step=(config.max_step_m - config.step_margin_m) / resolution,
            clearance=math.ceil((config.robot_height_m + config.clearance_margin_m) / resolution - 1e-9),
            slope_reach=max(2, round(config.slope_radius_m / resolution)),
            max_slope=math.tan(config.max_slope_rad),
            look=max(1, round(config.cliff_look_m / resolution)),
            inflation=math.ceil(largest / resolution - 1e-9),
        )

    @property
    def margin(self) -> int:
        """Columns around every node of the flood that the analysis may look at."""
        return max(self.look, self.inflation, 4) + 8


@dataclass(frozen=True, eq=False)
class _Scene:
    """What the flood works on: the window's columns, their surfaces and links, and where the columns lie from the robot in metres."""

    columns: Columns
    key: tuple[int, int]
    surfaces: Surfaces
    links: Links
    x: NDArray[np.float64]
    y: NDArray[np.float64]

    def within(self, radius_m: float | None) -> NDArray[np.bool_]:
        """(C,) whether the middle of each column is within `radius_m` of the robot; all are when it is None."""
        spans, column = _spans_within(self.x, self.y, radius_m), np.arange(self.y.size)
        return np.asarray(((column >= spans[:, :1]) & (column < spans[:, 1:])).ravel())

    def nodes_within(self, radius_m: float) -> NDArray[np.int64]:
        """The surface nodes of those columns, ascending."""
        row = np.arange(self.x.size) * self.y.size
        nodes = self.surfaces.start[row[:, None] + _spans_within(self.x, self.y, radius_m)]
        return np.concatenate([np.arange(first, end) for first, end in nodes if first < end] or [np.empty(0, dtype=np.int64)])


def _spans_within(x: NDArray[np.float64], y: NDArray[np.float64], radius_m: float | None) -> NDArray[np.int64]:
    """(X, 2) first and end of the ascending y with np.hypot(x, y) <= radius_m in every row x; all of them when it is None."""
    if radius_m is None:
        return np.tile([0, y.size], (x.size, 1))
    half = np.sqrt(np.maximum(radius_m**2 - x**2, 0.0))
    padded = np.concatenate([[-np.inf], y, [np.inf]])  # the roots may round across a column: the two at each end are asked
    first, end = np.searchsorted(y, -half), np.searchsorted(y, half, side="right")
    first = first - (np.hypot(x, padded[first]) <= radius_m) + (np.hypot(x, padded[first + 1]) > radius_m)
    end = end + (np.hypot(x, padded[end + 1]) <= radius_m) - (np.hypot(x, padded[end]) > radius_m)
    return np.stack([first, np.maximum(first, end)], axis=1)


def _window(runs: ColumnRuns, robot: NDArray[np.float64], reach_m: float | None, margin: int) -> tuple[Columns, tuple[int, int]]:
    low = runs.origin_key
    high = (runs.origin_key[0] + runs.nx - 1, runs.origin_key[1] + runs.ny - 1)
    if reach_m is not None:
        x, y = (math.floor(v / runs.resolution) for v in robot[:2])
        span = math.ceil(reach_m / runs.resolution) + margin
        low, high = (x - span, y - span), (x + span, y + span)
    return crop_columns(runs, low, high, margin)


def _linked_spans(x: NDArray[np.float64], y: NDArray[np.float64], radius_m: float | None, margin: int) -> NDArray[np.int64]:
    """The spans within the radius without the columns of the margin."""
    spans = np.clip(_spans_within(x, y, radius_m), margin, y.size - margin)
    spans[:margin], spans[x.size - margin :] = margin, margin
    return spans


def _links(surfaces: Surfaces, ny: int, spans: NDArray[np.int64], limits: _Limits) -> Links:
    near = nearest_neighbours(surfaces.start, surfaces.z, ny, spans, limits.step)
    graph = steppable_neighbours(near, surfaces, limits.max_step, limits.max_measured_step)
    slope = slopes_of_open_ground(surfaces.start, surfaces.z, graph, ny, spans, limits.slope_reach, limits.max_slope)
    return Links(near, graph, slope)


def _surfaces(columns: Columns, key: tuple[int, int], heights: SurfaceHeights | None, config: TerrainConfig, limits: _Limits) -> Surfaces:
    surfaces = surfaces_of(columns, limits.clearance, config.hole_bridge_voxels, limits.step)
    if heights is None or config.step_heights == "voxels":
        return surfaces
    ix, iy = np.divmod(surfaces.column, np.int32(columns.ny))
    return surfaces.at_heights(heights.at(ix + key[0], iy + key[1], surfaces.z))


def _scene(
    runs: ColumnRuns,
    heights: SurfaceHeights | None,
    robot: NDArray[np.float64],
    reach_m: float | None,
    config: TerrainConfig,
    limits: _Limits,
) -> _Scene:
    columns, key = _window(runs, robot, reach_m, limits.margin)
    surfaces = _surfaces(columns, key, heights, config, limits)
    x = (np.arange(columns.nx) + key[0] + 0.5) * runs.resolution - robot[0]
    y = (np.arange(columns.ny) + key[1] + 0.5) * runs.resolution - robot[1]
    linked_m = None if reach_m is None else reach_m + (limits.slope_reach + 4) * runs.resolution  # as far as slopes and steps look
    return _Scene(columns, key, surfaces, _links(surfaces, columns.ny, _linked_spans(x, y, linked_m, limits.margin), limits), x, y)


def _start_candidates(scene: _Scene, T_map_base: Transform, config: TerrainConfig, limits: _Limits) -> NDArray[np.int64]:
    """Surface nodes beneath the robot, the nearest to the wheels' contact plane first (thesis: getStartingVoxel)."""
    ground = T_map_base[:3, 3] - config.base_height_m * T_map_base[:3, 2]
    up = T_map_base[:3, 2]
    if up[2] < 0.5:
        return np.empty(0, dtype=np.int64)  # on its side: there is no ground beneath the wheels
    column = scene.surfaces.column
    nodes = scene.nodes_within(config.start_search_radius_m)
    dx = (column[nodes] // scene.columns.ny + scene.key[0] + 0.5) * limits.resolution - ground[0]
    dy = (column[nodes] % scene.columns.ny + scene.key[1] + 0.5) * limits.resolution - ground[1]
    expected = ground[2] - (up[0] * dx + up[1] * dy) / up[2]
    miss = np.abs((scene.surfaces.z[nodes] + 0.5) * limits.resolution - expected)
    fits = miss <= config.start_height_tolerance_m
    order = np.lexsort((nodes[fits], np.round(np.hypot(dx, dy)[fits] + miss[fits], 6)))
    return np.asarray(nodes[fits][order])


def _first_flood(
    scene: _Scene, candidates: NDArray[np.int64], reach_m: float | None, config: TerrainConfig, limits: _Limits
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], int | None]:
    """Labels of the first candidate with enough ground around it (algorithm 3 lines 8-16) and what its nodes see, or none and None."""
    inside = scene.within(reach_m)
    shape = _shape(config, limits)
    tried = np.zeros(scene.surfaces.z.size, dtype=bool)
    for first in candidates:
        if tried[first]:
            continue
        label, traversable, seen = kernels.flood(
            scene.columns, scene.surfaces, scene.links, first, inside, limits.clearance, limits.slope_reach, shape
        )
        if traversable >= config.min_traversable_voxels:
            return label, seen, int(first)
        tried |= label == TerrainClass.TRAVERSABLE
    unreached = np.full(scene.surfaces.z.size, kernels.UNREACHED, dtype=np.uint8)
    return unreached, np.empty((unreached.size, 4), dtype=np.uint8), None


def _shape(config: TerrainConfig, limits: _Limits) -> tuple[int, int, int, float, bool]:
    return limits.step, config.cliff_area_voxels, limits.look, limits.max_slope, config.cliff_evidence == "assumed"


def _half_widths(radius_m: float, shape: str, resolution: float) -> NDArray[np.int64]:
    """(2 * R + 1,) columns to both sides that an inflation takes in the rows from -R to R around a barrier."""
    reach = int(radius_m / resolution + 1e-9)
    steps = np.arange(-reach, reach + 1)
    if shape == "square":
        return np.full(steps.size, reach, dtype=np.int64)
    inside = (steps[:, None] ** 2 + steps**2) * resolution**2 <= radius_m**2 + 1e-9
    return np.asarray(inside.sum(axis=1) // 2, dtype=np.int64)


def _unique_pairs(column: NDArray[np.int64], z: NDArray[np.int64]) -> NDArray[np.int64]:
    """(M, 2) sorted distinct pairs; as single numbers they sort ten times faster than as rows."""
    keys = np.unique(column * 2**16 + z + 2**15)
    return np.stack([keys >> 16, (keys & 0xFFFF) - 2**15], axis=1)


def _inflate(scene: _Scene, label: NDArray[np.uint8], obstacles: NDArray[np.int64], config: TerrainConfig, limits: _Limits) -> None:
    """addRobotPadding: obstacles and cliffs take the ground around them at their own level out of the graph."""
    column, z = scene.surfaces.column, scene.surfaces.z
    own, cliff = np.flatnonzero(label == TerrainClass.OBSTACLE), np.flatnonzero(label == TerrainClass.CLIFF)
    groups = (
        (np.r_[column[own], obstacles[:, 0]], np.r_[z[own], obstacles[:, 2]], config.inflation_radius_m),
        (column[cliff].astype(np.int64), z[cliff].astype(np.int64), config.cliff_inflation_radius_m),
    )
    for columns, levels, radius in groups:
        pairs = _unique_pairs(columns, levels)
        band = limits.step + math.ceil(radius / limits.resolution * limits.max_slope)
        widths = _half_widths(radius, config.inflation_shape, limits.resolution)
        kernels.inflate(label, scene.surfaces, pairs[:, 0].copy(), pairs[:, 1].copy(), widths, band, scene.columns.nx, scene.columns.ny)


def _departure(scene: _Scene, label: NDArray[np.uint8], start: int, config: TerrainConfig) -> tuple[int | None, NDArray[np.bool_]]:
    """changeStartingPointIfInsidePadding: the nearest traversable node over the ground, and (N,) the nodes connected with it."""
    component, sizes = kernels.components(label, scene.links.graph, start, config.min_traversable_voxels)
    if component[start] >= 0 and sizes[0] >= config.min_traversable_voxels:
        return start, component == 0
    if not sizes.size:
        return None, np.zeros(label.size, dtype=bool)
    large = component >= 0
    if sizes.max() >= config.min_traversable_voxels:
        large &= sizes[component] >= config.min_traversable_voxels
    passable = (label == TerrainClass.TRAVERSABLE) | (label == TerrainClass.INFLATION)
    seeds = np.zeros(label.size, dtype=bool)
    seeds[start] = True
    far = label.size + 1
    hops = kernels.hops_from(seeds, passable, scene.links.graph, far)
    hops[~large] = far
    nearest = int(np.argmin(hops))
    if hops[nearest] == far:
        return None, np.zeros(label.size, dtype=bool)
    return nearest, component == component[nearest]


def _frontier_edges(
    scene: _Scene, label: NDArray[np.uint8], seen: NDArray[np.uint8], radius_m: float | None, limits: _Limits
) -> NDArray[np.int64]:
    sources = (label == TerrainClass.TRAVERSABLE) | (label == TerrainClass.INFLATION)
    if radius_m is not None:
        sources &= scene.within(radius_m)[scene.surfaces.column]
    graph, clearance = scene.links.graph, limits.clearance
    return np.asarray(kernels.frontier_edges(scene.columns, scene.surfaces, label, graph, sources, seen, clearance, limits.step))


def _near_kerbs(scene: _Scene, label: NDArray[np.uint8], config: TerrainConfig, limits: _Limits) -> NDArray[np.bool_]:
    """(N,) whether a wheel of a robot that turns there would scrape along a rise that is too low to be an obstacle."""
    ground = (label == TerrainClass.TRAVERSABLE) | (label == TerrainClass.INFLATION)
    edge = ground & kerbs(scene.links.graph, scene.surfaces, config.kerb_rise_m / limits.resolution)
    reach = round(config.kerb_margin_m / limits.resolution)
    return np.asarray(kernels.hops_from(edge, ground, scene.links.graph, reach + 1) <= reach)


def _soft_cost(
    scene: _Scene,
    label: NDArray[np.uint8],
    near_kerb: NDArray[np.bool_],
    edges: NDArray[np.int64],
    config: TerrainConfig,
    limits: _Limits,
) -> NDArray[np.float32]:
    """Cost factor of every node: 1 in the open, more towards inflation, kerbs and the unknown, inf in it and on what cannot be driven."""
    width = max(1, round(config.soft_clearance_m / limits.resolution))
    free = label == TerrainClass.TRAVERSABLE
    hops = kernels.hops_from(label == TerrainClass.INFLATION, free, scene.links.graph, width)
    cost_at = 1.0 + config.soft_clearance_weight * (1.0 - np.arange(width + 1) / width)
    cost: NDArray[np.float32] = cost_at.astype(np.float32)[hops]
    cost[near_kerb] *= np.float32(config.kerb_weight)
    beside = round(config.unknown_margin_m / limits.resolution)
    seen_from = np.zeros(label.size, dtype=bool)
    seen_from[edges[:, 2]] = True
    near_unknown = kernels.hops_from(seen_from, free | (label == TerrainClass.INFLATION), scene.links.graph, beside + 1) <= beside
    cost[near_unknown] = (cost_at * config.unknown_weight).astype(np.float32)[hops[near_unknown]]
    cost[~free] = np.inf
    return cost


def _unique_frontiers(edges: NDArray[np.int64], step: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(F, 2) column and z of the frontier voxels, one a column and level, and (M,) which one each edge leads to."""
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    column, z = edges[order, 0], edges[order, 1]
    new = np.r_[True, (np.diff(column) != 0) | (np.diff(z) > step + 1)] if order.size else np.zeros(0, dtype=bool)
    group_sorted = np.cumsum(new) - 1
    group = np.empty(order.size, dtype=np.int64)
    group[order] = group_sorted
    highest = np.r_[new[1:], True] if order.size else new
    return np.stack([column[highest], z[highest]], axis=1), group


def _filled(voxels: NDArray[np.int64], terrain_class: TerrainClass) -> NDArray[np.uint8]:
    return np.full(len(voxels), terrain_class, dtype=np.uint8)


def _assemble(
    scene: _Scene,
    label: NDArray[np.uint8],
    start: int | None,
    departure: int | None,
    reached: NDArray[np.bool_],
    near_kerb: NDArray[np.bool_],
    obstacles: NDArray[np.int64],
    edges: NDArray[np.int64],
    cost: NDArray[np.float32],
    limits: _Limits,
    radius_m: float | None,
    robot: NDArray[np.float64],
) -> Terrain:
    keep, number = kernels.number_nodes(label)
    obstacles = _unique_pairs(obstacles[:, 0], obstacles[:, 1])
    frontiers, frontier_of_edge = _unique_frontiers(edges, limits.step)
    beside = np.concatenate([obstacles, frontiers])
    neighbours = kernels.drivable_neighbours(label, scene.links.graph, keep, number, len(beside))
    parents = neighbours[len(neighbours) - len(frontiers) :]
    parents[frontier_of_edge, (edges[:, 3] + 2) % 4] = number[edges[:, 2]]
    seen_from_reached = np.zeros(len(frontiers), dtype=bool)
    seen_from_reached[frontier_of_edge[reached[edges[:, 2]]]] = True
    column = np.concatenate([scene.surfaces.column[keep], beside[:, 0].astype(np.int32)])
    ix, iy = np.divmod(column, np.int32(scene.columns.ny))
    return Terrain(
        resolution=limits.resolution,
        ix=ix + np.int32(scene.key[0]),
        iy=iy + np.int32(scene.key[1]),
        z=np.concatenate([scene.surfaces.z[keep], beside[:, 1].astype(np.int16)]),
        label=np.concatenate([label[keep], _filled(obstacles, TerrainClass.OBSTACLE), _filled(frontiers, TerrainClass.FRONTIER)]),
        bridged=np.concatenate([scene.surfaces.bridged[keep], np.zeros(len(beside), dtype=bool)]),
        reached=np.concatenate([reached[keep], np.zeros(len(obstacles), dtype=bool), seen_from_reached]),
        near_kerb=np.concatenate([near_kerb[keep], np.zeros(len(beside), dtype=bool)]),
        cost=np.concatenate([cost[keep], np.full(len(beside), np.inf, dtype=np.float32)]),
        neighbours=neighbours,
        start=None if start is None else int(number[start]),
        departure=None if departure is None else int(number[departure]),
        radius_m=radius_m,
        robot_xyz=(float(robot[0]), float(robot[1]), float(robot[2])),
        surface_count=int(keep.size),
        window_key=scene.key,
        window_size=(scene.columns.nx, scene.columns.ny),
        column_start=kernels.column_starts(scene.surfaces.start, number),
    )


def classify(
    runs: ColumnRuns, T_map_base: Transform, config: TerrainConfig, radius_m: float | None, heights: SurfaceHeights | None = None
) -> Terrain:
    """The terrain around the robot at `T_map_base` out to `radius_m`, or of the whole map when it is None.

    `heights` are those of the hits in the voxels; without them steps are judged by voxels, 8 cm of which may be 1 cm or 15 cm.

    The ground plane beneath the robot must already be in the map (algorithm 3 line 2). When no start voxel has enough ground around it,
    the terrain has no nodes and `start` is None; when all ground is inflated `departure` is None. The flood goes on for one inflation
    radius beyond `radius_m`, so that what lies inside is inflated by what lies just outside. ValueError for a transform that is not rigid
    or a radius that is not positive. Thesis 5.5, algorithm 3 lines 2-21.
    """
    T_map_base = as_transform(T_map_base)
    if radius_m is not None and not radius_m > 0:
        raise ValueError(f"radius_m must be positive metres or None for the whole map, not {radius_m!r}")
    limits = _Limits.of(config, runs.resolution)
    robot = T_map_base[:3, 3]
    reach_m = None if radius_m is None else radius_m + (limits.inflation + 1) * runs.resolution
    scene = _scene(runs, heights, robot, reach_m, config, limits)
    label, seen, start = _first_flood(scene, _start_candidates(scene, T_map_base, config, limits), reach_m, config, limits)
    kernels.mark_steps(label, scene.links.near, scene.links.graph, scene.surfaces.level)
    obstacles = kernels.obstacles_seen(
        scene.columns, scene.surfaces, label, scene.links.near, limits.clearance, limits.step, limits.inflation, limits.max_slope
    )
    _inflate(scene, label, obstacles, config, limits)
    departure, reached = (None, np.zeros(label.size, dtype=bool)) if start is None else _departure(scene, label, start, config)
    edges = _frontier_edges(scene, label, seen, radius_m, limits)
    near_kerb = _near_kerbs(scene, label, config, limits)
    cost = _soft_cost(scene, label, near_kerb, edges, config, limits)
    return _assemble(scene, label, start, departure, reached, near_kerb, obstacles, edges, cost, limits, radius_m, robot)
