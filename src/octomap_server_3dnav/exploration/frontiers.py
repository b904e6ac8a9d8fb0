"""Frontiers as targets (thesis 5.5): frontier voxels are clustered, split to what one sweep can look at, and sorted by cost.

After `terrain.classify`, before a path is planned. The cost is the thesis's, distance + angle * weight, less what a look may show.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.frontier_gain import unknown_area_m2
from octomap_server_3dnav.navigation.planner import PlannerConfig, distances_over_ground
from octomap_server_3dnav.octree.voxel_clusters import cluster_voxels
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass
from rigid_geometry import yaw_of
from rigid_geometry.transforms import Transform
from stage_config import check_ranges, parameter

_TARGET_RADIUS_M = 1.0  # extent of one target: larger clusters are split


@dataclass(frozen=True)
class FrontierConfig:
    """Which frontiers are worth a look, and which one first."""

    min_voxels: int = parameter(6, "voxels", "smaller clusters are ignored", low=1, high=1000, at_runtime=True)
    min_inflated_voxels: int = parameter(
        15, "voxels", "the same for clusters beside inflated ground only", low=1, high=1000, at_runtime=True
    )
    least_last_gain_m2: float = parameter(
        2.5, "m2", "smaller ones of these, down to min_voxels, are looked at last, if a look may show this much ground", low=0.0, high=100.0
    )
    least_lookout_gain_m2: float = parameter(
        1.5, "m2", "the last look of all is from where the robot cannot turn, if it may show this much ground", low=0.0, high=100.0
    )
    approach_m: float = parameter(1.0, "m", "farthest traversable ground from which such a cluster is looked at", low=0.0, high=5.0)
    angle_weight_m_per_rad: float = parameter(0.5, "m/rad", "cost of turning to a frontier", low=0.0, high=20.0, at_runtime=True)
    gain_weight_m_per_m2: float = parameter(
        0.1,
        "m/m2",
        "way that is worth a square metre of ground that a look may show; 0: none, as in the thesis",
        low=0.0,
        high=10.0,
        at_runtime=True,
    )
    gain_radius_m: float = parameter(
        3.0, "m", "ground around a frontier of which a look may show something", low=0.5, high=20.0, at_runtime=True
    )
    frontier_distance: str = parameter("path", "-", "distance over the ground, or straight as in the thesis", choices=("path", "euclidean"))

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)


@dataclass(frozen=True)
class Frontier:
    """A place worth a look: xyz of its middle voxel in map, the traversable node nearest to it, its voxels (node indices).

    `distance_m` over the ground, and its `cost`; `last`: it lies beside inflated ground only and is so small that it may be a side of
    what stands there, and is looked at when nothing else is left; `potential_cliff`: most of its voxels are; gain_m2: ground that a look
    may show.
    """

    xyz: tuple[float, float, float]
    node: int
    voxels: tuple[int, ...]
    distance_m: float
    cost: float
    last: bool
    potential_cliff: bool
    gain_m2: float


def _approach_nodes(terrain: Terrain, frontier: NDArray[np.int64], approach_m: float, distance: NDArray[np.float64]) -> NDArray[np.int64]:
    """(F,) the reached traversable node from which each frontier voxel is approached, -1 when none is within `approach_m`."""
    parents = terrain.neighbours[frontier]
    parent_distance = np.where(parents >= 0, distance[parents], np.inf)
    best = np.argmin(parent_distance, axis=1)
    node = np.where(np.isfinite(parent_distance.min(axis=1)), parents[np.arange(len(parents)), best], -1).astype(np.int64)
    missing = np.flatnonzero(node < 0)
    if missing.size:
        at = np.stack([terrain.ix - terrain.window_key[0], terrain.iy - terrain.window_key[1], terrain.z], axis=1)[frontier[missing]]
        z, size = terrain.z[: terrain.surface_count], np.array([terrain.columns.nx, terrain.columns.ny])
        node[missing] = _nearest(terrain.column_start, z, distance, size, at.astype(np.int64), approach_m / terrain.resolution)
    return node


@njit(cache=True)
def _nearest(start: Any, z: Any, distance: Any, size: Any, places: Any, within: Any) -> Any:
    """(F,) node of finite distance nearest to each of (F, 3) voxels of the window of `size` (2,) columns, -1 for none `within` voxels."""
    out, reach = np.full(len(places), -1, np.int64), int(within)
    for i in range(len(places)):
        x, y, level = places[i]
        best = within**2 + 1e-6
        for ix in range(max(0, x - reach), min(size[0], x + reach + 1)):
            for iy in range(max(0, y - reach), min(size[1], y + reach + 1)):
                for n in range(start[ix * size[1] + iy], start[ix * size[1] + iy + 1]):
                    square = (ix - x) ** 2 + (iy - y) ** 2 + (np.int64(z[n]) - level) ** 2
                    if square < best and distance[n] < np.inf:
                        best, out[i] = square, n
    return out


def _costs(
    terrain: Terrain, frontier: NDArray[np.int64], distance: NDArray[np.float64], T_map_base: Transform, weight: float
) -> NDArray[np.float64]:
    offset = terrain.centers(frontier)[:, :2].astype(np.float64) - T_map_base[:2, 3]
    turn = np.arctan2(offset[:, 1], offset[:, 0]) - yaw_of(T_map_base)
    angle = np.abs(np.arctan2(np.sin(turn), np.cos(turn)))
    return np.asarray(distance + weight * angle)


def _split(xyz: NDArray[np.float32], cost: NDArray[np.float64], radius_m: float) -> list[NDArray[np.int64]]:
    """Groups of voxels around the cheapest one left, until none is left."""
    left = np.lexsort((np.arange(cost.size), np.round(cost, 6)))
    groups = []
    while left.size:
        near = np.linalg.norm(xyz[left] - xyz[left[0]], axis=1) <= radius_m
        groups.append(left[near])
        left = left[~near]
    return groups


def find_frontiers(terrain: Terrain, T_map_base: Transform, config: FrontierConfig, planner: PlannerConfig) -> list[Frontier]:
    """The frontiers that traversable ground leads to, cheapest first: distance + angle * weight (thesis 6.2.2) - gain * weight.

    A cluster counts when one of its voxels lies beside ground that the second flood reached; one that lies wholly beside inflated ground
    must be larger or have much to show, and traversable ground must come near it. Clusters larger than one sweep can look at are split
    into several targets.
    """
    frontier = terrain.frontiers()
    if not frontier.size or terrain.departure is None:
        return []
    distance = distances_over_ground(terrain, planner)
    node = _approach_nodes(terrain, frontier, config.approach_m, distance)
    xyz = terrain.centers(frontier)
    gap = np.linalg.norm(xyz - terrain.centers(np.maximum(node, 0)), axis=1)
    straight = np.linalg.norm(xyz - np.asarray(terrain.robot_xyz, dtype=np.float32), axis=1)
    length = np.where(node >= 0, distance[node] + gap if config.frontier_distance == "path" else straight, np.inf)
    cost = _costs(terrain, frontier, length, T_map_base, config.angle_weight_m_per_rad)
    groups, small = _groups(terrain, frontier, cost, config)
    middle = np.array([_middle(xyz, members) for members in groups], dtype=np.int64)
    gain = unknown_area_m2(terrain, frontier[middle], config.gain_radius_m)
    least = [cost[members].min() for members in groups] - config.gain_weight_m_per_m2 * gain
    found = [
        Frontier(
            xyz=(float(xyz[m, 0]), float(xyz[m, 1]), float(xyz[m, 2])),
            node=int(node[m]),
            voxels=tuple(np.sort(frontier[members]).tolist()),
            distance_m=float(length[m]),
            cost=float(least[i]),
            last=small[i],
            potential_cliff=_are_edges(terrain, frontier[members]),
            gain_m2=float(gain[i]),
        )
        for i, (m, members) in enumerate(zip(middle.tolist(), groups, strict=True))
        if not small[i] or gain[i] >= config.least_last_gain_m2
    ]
    return sorted(found, key=lambda f: (round(f.cost, 6), f.xyz))


def _groups(
    terrain: Terrain, frontier: NDArray[np.int64], cost: NDArray[np.float64], config: FrontierConfig
) -> tuple[list[NDArray[np.int64]], list[bool]]:
    """The voxels (indices into `frontier`) of every target, and whether it lies beside inflated ground only and is small for that."""
    xyz, cluster = terrain.centers(frontier), cluster_voxels(np.stack([terrain.ix, terrain.iy, terrain.z], axis=1)[frontier])
    groups, small = [], []
    for number in range(int(cluster.max()) + 1):
        members = np.flatnonzero(cluster == number)
        is_inflated = not terrain.reached[frontier[members]].any()
        usable = members[np.isfinite(cost[members])]
        if members.size < config.min_voxels or not usable.size:
            continue
        parts = _split(xyz[usable], cost[usable], _TARGET_RADIUS_M)
        groups += [usable[part] for part in parts]
        small += [is_inflated and members.size < config.min_inflated_voxels] * len(parts)
    return groups, small


def _middle(xyz: NDArray[np.float32], members: NDArray[np.int64]) -> int:
    """The member nearest to the middle, by whose own node a target is approached."""
    return int(members[np.argmin(np.round(np.linalg.norm(xyz[members] - xyz[members].mean(axis=0), axis=1), 5))])


def _are_edges(terrain: Terrain, voxels: NDArray[np.int64]) -> bool:
    """Whether most of the frontier voxels are potential cliffs."""
    return bool(2 * np.count_nonzero(terrain.label[voxels] == TerrainClass.POTENTIAL_CLIFF) > len(voxels))


def facing_yaw(from_xyz: NDArray[np.floating] | tuple[float, ...], to_xyz: NDArray[np.floating] | tuple[float, ...]) -> float:
    """Yaw in map of the direction from one point to another."""
    return math.atan2(to_xyz[1] - from_xyz[1], to_xyz[0] - from_xyz[0])
