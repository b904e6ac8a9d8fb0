"""The judgements of the terrain analysis over the flooded ground: start, departure, costs (thesis 5.5, algorithm 3 lines 2-20)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.terrain.classified_terrain import INFLATION, TRAVERSABLE, UNREACHED
from octomap_server_3dnav.terrain.config import Limits, TerrainConfig
from octomap_server_3dnav.terrain.flood import components, flood, hops_from
from octomap_server_3dnav.terrain.graph import kerbs
from octomap_server_3dnav.terrain.scene import Scene
from rigid_geometry.transforms import Transform
from robot_body import RobotBody


def start_candidates(scene: Scene, T_map_base: Transform, robot: RobotBody, limits: Limits) -> NDArray[np.int64]:
    """Surface nodes beneath the robot, the nearest to the wheels' contact plane first (thesis: getStartingVoxel)."""
    ground = T_map_base[:3, 3] - robot.base_height_m * T_map_base[:3, 2]
    up = T_map_base[:3, 2]
    if up[2] < 0.5:
        return np.empty(0, dtype=np.int64)  # on its side: there is no ground beneath the wheels
    column = scene.surfaces.column
    nodes = scene.nodes_within(max(robot.half_length_m, limits.resolution))
    dx = (column[nodes] // scene.columns.ny + scene.key[0] + 0.5) * limits.resolution - ground[0]
    dy = (column[nodes] % scene.columns.ny + scene.key[1] + 0.5) * limits.resolution - ground[1]
    expected = ground[2] - (up[0] * dx + up[1] * dy) / up[2]
    miss = np.abs((scene.surfaces.z[nodes] + 0.5) * limits.resolution - expected)
    fits = miss <= robot.standing_tolerance_m
    order = np.lexsort((nodes[fits], np.round(np.hypot(dx, dy)[fits] + miss[fits], 6)))
    return np.asarray(nodes[fits][order])


def first_flood(
    scene: Scene, candidates: NDArray[np.int64], inside: NDArray[np.bool_], least: int, limits: Limits
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], int | None]:
    """Labels of the first candidate with the `least` ground around it and what lies beside its nodes, or none and None.

    The flood stays in columns that are `inside` (C,).
    """
    tried = np.zeros(scene.surfaces.z.size, dtype=bool)
    for first in candidates:
        if tried[first]:
            continue
        label, traversable, seen = flood(scene.columns, scene.surfaces, scene.links, first, inside, limits)
        if traversable >= least:
            return label, seen, int(first)
        tried |= label == TRAVERSABLE
    unreached = np.full(scene.surfaces.z.size, UNREACHED, dtype=np.uint8)
    return unreached, np.zeros((unreached.size, 4), dtype=np.uint8), None


class Departure(NamedTuple):
    """Where paths begin: a node, None when there is none, and (N,) the traversable ground connected with it."""

    node: int | None
    reached: NDArray[np.bool_]


def departure_of(scene: Scene, label: NDArray[np.uint8], start: int | None, least: int) -> Departure:
    """changeStartingPointIfInsidePadding: the start, or the nearest traversable node over the ground with the `least` of it around."""
    nowhere = Departure(None, np.zeros(label.size, dtype=bool))
    if start is None:
        return nowhere
    component, sizes = components(label, scene.links.graph, start, least)
    if component[start] >= 0 and sizes[0] >= least:
        return Departure(start, component == 0)
    if not sizes.size:
        return nowhere
    large = component >= 0
    if sizes.max() >= least:
        large &= sizes[component] >= least
    passable = (label == TRAVERSABLE) | (label == INFLATION)
    seeds = np.zeros(label.size, dtype=bool)
    seeds[start] = True
    far = label.size + 1
    hops = hops_from(seeds, passable, scene.links.graph, far)
    hops[~large] = far
    nearest = int(np.argmin(hops))
    return nowhere if hops[nearest] == far else Departure(nearest, component == component[nearest])


def near_kerbs(scene: Scene, label: NDArray[np.uint8], config: TerrainConfig, robot: RobotBody, limits: Limits) -> NDArray[np.bool_]:
    """(2, N) whether a wheel of a robot that turns there would scrape along a rise that is no obstacle, and along one that may be too high:
    within `confidence` sigmas of two poses of the highest step, and sure to be a kerb."""
    ground, graph = (label == TRAVERSABLE) | (label == INFLATION), scene.links.graph
    reach = round(robot.turning_radius_m / limits.resolution)
    unsure_m = config.confidence * np.hypot(config.pose_noise_m, config.pose_noise_m)
    rises_m = config.kerb_rise_m, max(config.kerb_rise_m, robot.max_step_m - 2 * unsure_m)
    edges = (ground & kerbs(graph, scene.surfaces, rise_m / limits.resolution, config.confidence) for rise_m in rises_m)
    return np.array([hops_from(edge, ground, graph, reach + 1) <= reach for edge in edges])


def soft_cost(
    scene: Scene,
    judged: tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.bool_]],
    edges: NDArray[np.int64],
    config: TerrainConfig,
    limits: Limits,
) -> NDArray[np.float32]:
    """Cost factor of every node: 1 in the open, more towards inflation, kerbs and the unknown, inf where no path may go.

    `judged`: label (N,), distance (N,) from the nearest barrier, and whether kerbs are near, as `near_kerbs` has it.
    """
    label, distance, (near_kerb, near_limit) = judged
    ground, seen_from = (label == TRAVERSABLE) | (label == INFLATION), np.zeros(label.size, dtype=bool)
    seen_from[edges[:, 2]] = True
    beside = round(config.unknown_margin_m / limits.resolution)
    near_unknown = hops_from(seen_from, ground, scene.links.graph, beside + 1) <= beside
    width = max(config.soft_clearance_m / limits.resolution, 1e-6)
    cost = 1.0 + config.soft_clearance_weight * np.clip(1.0 - (distance - limits.keep_off) / width, 0.0, 1.0)
    cost *= np.where(near_unknown | near_limit, config.unknown_weight, np.where(near_kerb, config.kerb_weight, 1.0))
    return np.where(label == TRAVERSABLE, cost, np.inf).astype(np.float32)
