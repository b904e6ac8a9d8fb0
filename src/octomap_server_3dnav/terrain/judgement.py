"""The judgements of the terrain analysis, in the order of algorithm 3: start, flood, inflation, departure, frontiers, costs."""

from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.voxel_clusters import cluster_voxels
from octomap_server_3dnav.terrain import kernels as kernels
from octomap_server_3dnav.terrain.barriers import inflate_around, turning_radii
from octomap_server_3dnav.terrain.classified_terrain import TerrainClass
from octomap_server_3dnav.terrain.config import Limits, TerrainConfig
from octomap_server_3dnav.terrain.hit_extent import middles
from octomap_server_3dnav.terrain.scene import Scene
from octomap_server_3dnav.terrain.surface_graph import kerbs
from rigid_geometry.transforms import Transform


def start_candidates(scene: Scene, T_map_base: Transform, config: TerrainConfig, limits: Limits) -> NDArray[np.int64]:
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


def first_flood(
    scene: Scene, candidates: NDArray[np.int64], inside: NDArray[np.bool_], config: TerrainConfig, limits: Limits
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], int | None]:
    """Labels of the first candidate with enough ground around it (algorithm 3 lines 8-16) and what its nodes see, or none and None.

    The flood stays in columns that are `inside` (C,).
    """
    tried = np.zeros(scene.surfaces.z.size, dtype=bool)
    for first in candidates:
        if tried[first]:
            continue
        label, traversable, seen = kernels.flood(scene.columns, scene.surfaces, scene.links, first, inside, limits)
        if traversable >= config.min_traversable_voxels:
            return label, seen, int(first)
        tried |= label == TerrainClass.TRAVERSABLE
    unreached = np.full(scene.surfaces.z.size, kernels.UNREACHED, dtype=np.uint8)
    return unreached, np.empty((unreached.size, 4), dtype=np.uint8), None


class Departure(NamedTuple):
    """Where paths begin: a node, None when there is none, its steps from the start, and (N,) the traversable ground connected with it."""

    node: int | None
    steps: int
    reached: NDArray[np.bool_]


def departure_of(scene: Scene, label: NDArray[np.uint8], start: int | None, config: TerrainConfig) -> Departure:
    """changeStartingPointIfInsidePadding: the start, or the nearest traversable node over the ground with enough of it around."""
    nowhere = Departure(None, 0, np.zeros(label.size, dtype=bool))
    if start is None:
        return nowhere
    component, sizes = kernels.components(label, scene.links.graph, start, config.min_traversable_voxels)
    if component[start] >= 0 and sizes[0] >= config.min_traversable_voxels:
        return Departure(start, 0, component == 0)
    if not sizes.size:
        return nowhere
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
        return nowhere
    return Departure(nearest, int(hops[nearest]), component == component[nearest])


class UnknownFloor(NamedTuple):
    """Edges (E, 5) beside unknown floor, as `terrain_kernels.unknown_edges` gives them: frontiers, and gaps beside things, which no
    look is taken for."""

    frontiers: NDArray[np.int64]
    gaps: NDArray[np.int64]


def unknown_floor(scene: Scene, label: NDArray[np.uint8], seen: NDArray[np.uint8], radius_m: float | None, limits: Limits) -> UnknownFloor:
    """searchFrontiers: `terrain_kernels.unknown_edges` from the ground within `radius_m` of the robot."""
    inside = scene.within(radius_m)
    found = kernels.unknown_edges(scene.columns, scene.surfaces, label, scene.links.graph, inside, seen, limits.step, limits.clearance)
    is_gap = found[:, 5].astype(bool)
    return UnknownFloor(found[~is_gap, :5], found[is_gap, :5])


def off_doubtful_floor(
    scene: Scene,
    label: NDArray[np.uint8],
    unknown: UnknownFloor,
    start: int | None,
    before: Departure,
    config: TerrainConfig,
    limits: Limits,
) -> tuple[NDArray[np.uint8], Departure]:
    """The labels with ground around that unknown floor out of the graph that is not going to be looked at, and the departure.

    Frontiers and gaps beside inflated ground only may be a cliff, or a side of what stands there; so may floor beside them that is itself
    assumed over a hole. Where nothing is left near the start the robot already stands amid such: labels and departure stay what they were
    `before`.
    """
    doubtful = np.concatenate([edges[_is_doubtful(before.reached, edges, scene.columns.ny)] for edges in unknown])
    if not len(doubtful):
        return label, before
    seen_from, surfaces, kept = doubtful[:, 2], scene.surfaces, label.copy()
    assumed = seen_from[surfaces.bridged[seen_from]]
    beside = middles(surfaces.column[assumed], surfaces.z[assumed], scene.columns.ny)
    places = np.concatenate([middles(doubtful[:, 0], doubtful[:, 1], scene.columns.ny), beside])
    inflate_around(scene, kept, places, turning_radii(config, limits).cliffs, config.inflation_shape, limits)
    departure = departure_of(scene, kept, start, config)
    is_near = departure.node is not None and departure.steps <= 2 * limits.inflation
    return (kept, departure) if is_near else (label, before)


def _is_doubtful(reached: NDArray[np.bool_], edges: NDArray[np.int64], ny: int) -> NDArray[np.bool_]:
    """(E,) which edges belong to places of unknown floor that no `reached` (N,) ground lies beside."""
    place = cluster_voxels(np.column_stack([edges[:, 0] // ny, edges[:, 0] % ny, edges[:, 1]]))
    is_open = np.zeros(len(edges), dtype=bool)
    is_open[place[reached[edges[:, 2]]]] = True
    return np.asarray(~is_open[place])


def near_kerbs(scene: Scene, label: NDArray[np.uint8], config: TerrainConfig, limits: Limits) -> NDArray[np.bool_]:
    """(N,) whether a wheel of a robot that turns there would scrape along a rise that is too low to be an obstacle."""
    ground = (label == TerrainClass.TRAVERSABLE) | (label == TerrainClass.INFLATION)
    edge = ground & kerbs(scene.links.graph, scene.surfaces, config.kerb_rise_m / limits.resolution)
    reach = round(config.kerb_margin_m / limits.resolution)
    return np.asarray(kernels.hops_from(edge, ground, scene.links.graph, reach + 1) <= reach)


def soft_cost(
    scene: Scene,
    label: NDArray[np.uint8],
    near_kerb: NDArray[np.bool_],
    edges: NDArray[np.int64],
    config: TerrainConfig,
    limits: Limits,
) -> NDArray[np.float32]:
    """Cost factor of every node: 1 in the open, more towards inflation, kerbs and the unknown, inf in it and on what cannot be driven."""
    width, beside = max(1, round(config.soft_clearance_m / limits.resolution)), round(config.unknown_margin_m / limits.resolution)
    free, graph = label == TerrainClass.TRAVERSABLE, scene.links.graph
    inflated, seen_from = label == TerrainClass.INFLATION, np.zeros(label.size, dtype=bool)
    seen_from[edges[:, 2]] = True
    hops = kernels.hops_from(inflated, free, graph, width)
    near_unknown = kernels.hops_from(seen_from, free | inflated, graph, beside + 1) <= beside
    cost_at = 1.0 + config.soft_clearance_weight * (1.0 - np.arange(width + 1) / width)
    at_unknown = (cost_at * config.unknown_weight).astype(np.float32)
    return np.asarray(_costs(free, hops, near_unknown, near_kerb, cost_at.astype(np.float32), at_unknown, np.float32(config.kerb_weight)))


@njit(cache=True)
def _costs(free: Any, hops: Any, near_unknown: Any, near_kerb: Any, cost_at: Any, at_unknown: Any, kerb_weight: Any) -> Any:
    """(N,) float32: of free nodes `cost_at` their number of hops from the inflation, more near kerbs and `at_unknown`; inf of others."""
    cost = np.full(free.size, np.inf, np.float32)
    for s in range(free.size):
        if not free[s]:
            continue
        if near_unknown[s]:
            cost[s] = at_unknown[hops[s]]
        else:
            cost[s] = cost_at[hops[s]] * kerb_weight if near_kerb[s] else cost_at[hops[s]]
    return cost
