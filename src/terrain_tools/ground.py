"""Where the robot can stand: why a start or a goal is none, and the nearest place that would be one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.octree.column_runs import ColumnRuns, VoxelState
from octomap_server_3dnav.octree.octree import OctreeMap
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass, TerrainConfig, classify
from rigid_geometry import transform_from_rpy
from robot_body import RobotBody

Array = NDArray[np.float64]
Point = tuple[float, float, float]

_MOST_TRIES, _MOST_TOPS = 300, 200_000  # places at which ground is looked for, about three seconds, and tops that they are chosen from
_LOOK_M = 3.0  # around each
_WHAT_IS_THERE = {
    VoxelState.FREE: "it lies in the air",
    VoxelState.OCCUPIED: "it lies inside something occupied",
    VoxelState.UNKNOWN: "it lies where nothing was seen",
}
_WHY_NO_GOAL = {
    TerrainClass.OBSTACLE: "an obstacle is there",
    TerrainClass.CLIFF: "a cliff is there",
    TerrainClass.INFLATION: "the ground there is too near to an obstacle or a cliff",
    TerrainClass.FRONTIER: "the floor there was not seen",
    TerrainClass.POTENTIAL_CLIFF: "there may be a cliff: beams passed over an edge, and saw nothing behind it",
    TerrainClass.TRAVERSABLE: "the ground there is cut off from that of the start by obstacles, cliffs or their inflation",
}


@dataclass(frozen=True)
class Place:
    """Traversable ground: the centre of its voxel in map, and how far it lies from what was asked for, in metres."""

    xyz: Point
    distance_m: float

    def __str__(self) -> str:
        x, y, z = self.xyz
        return f"({x:.2f} {y:.2f} {z:.2f}), {self.distance_m:.2f} m away"


def pose_on(ground: Point, robot: RobotBody) -> Array:
    """T_map_base of a level robot whose wheels stand at a point."""
    return np.asarray(transform_from_rpy((ground[0], ground[1], ground[2] + robot.base_height_m)))


def tops_with_room(runs: ColumnRuns, height_m: float) -> Array:
    """(N, 3) centres of the occupied voxels above which a robot of this height would fit, if all that is unknown were free."""
    occupied = np.flatnonzero(runs.occupied)
    column = runs.columns[occupied]
    room = np.full(occupied.size, np.inf)
    below = np.flatnonzero(column[:-1] == column[1:])
    room[below] = runs.z_lo[occupied[below + 1]].astype(np.int64) - runs.z_hi[occupied[below]] - 1
    fits = room * runs.resolution >= height_m - 1e-9
    ix, iy = np.divmod(column[fits], max(1, runs.ny))
    voxels = np.stack([ix + runs.origin_key[0], iy + runs.origin_key[1], runs.z_hi[occupied[fits]]], axis=1)
    return np.asarray((voxels + 0.5) * runs.resolution)


def nearest_ground(runs: ColumnRuns, asked: Point, config: TerrainConfig, robot: RobotBody) -> Place | None:
    """Traversable ground near a point, by starting at one top after the other, the nearest first; None when a few hundred are none."""
    left = _nearest(tops_with_room(runs, robot.height_m + config.clearance_margin_m), asked, _MOST_TOPS)
    for _ in range(_MOST_TRIES):
        if not left.size:
            return None
        top = left[np.argmin(np.linalg.norm(left - asked, axis=1))]
        here = (float(top[0]), float(top[1]), float(top[2]))
        found = nearest_reached(classify(runs, pose_on(here, robot), config, robot, _LOOK_M), asked)
        if found is not None:
            return found
        tried = (np.hypot(*(left - top)[:, :2].T) <= robot.half_length_m) & (np.abs(left[:, 2] - top[2]) <= robot.standing_tolerance_m)
        left = left[~tried]
    return None


def _nearest(points: Array, asked: Point, count: int) -> Array:
    """The `count` points nearest to one, in any order; all where there are no more."""
    if len(points) <= count:
        return points
    return points[np.argpartition(np.linalg.norm(points - asked, axis=1), count)[:count]]


def nearest_reached(terrain: Terrain, asked: Point) -> Place | None:
    """The traversable ground of a terrain nearest to a point, of that which its start leads to; None when there is none."""
    nodes = np.flatnonzero(terrain.reached & (terrain.label == TerrainClass.TRAVERSABLE))
    if not nodes.size:
        return None
    centers = terrain.centers(nodes).astype(np.float64)
    gaps = np.linalg.norm(centers - asked, axis=1)
    x, y, z = (float(v) for v in centers[np.argmin(gaps)])
    return Place((x, y, z), float(gaps.min()))


def why_no_start(octree: OctreeMap, runs: ColumnRuns, terrain: Terrain, asked: Point, config: TerrainConfig, robot: RobotBody) -> str:
    """What is wrong with a start inside the map from which `terrain` has no ground to drive on."""
    if terrain.start is not None:
        return "all ground around it is too near to obstacles or cliffs"
    tops = tops_with_room(runs, robot.height_m + config.clearance_margin_m) - asked
    near = np.hypot(tops[:, 0], tops[:, 1]) <= robot.half_length_m
    if (near & (np.abs(tops[:, 2]) <= robot.standing_tolerance_m)).any():
        area = config.min_ground_voxels * runs.resolution**2
        return f"what lies there leads to less than {area:.2g} m2 of ground that the robot can drive on"
    state = VoxelState(int(octree.states_at([asked])[0]))
    reach = f"no ground lies within {robot.half_length_m:g} m beside it and {robot.standing_tolerance_m:g} m above or below"
    return f"{_WHAT_IS_THERE[state]}, and {reach}"


def why_no_goal(octree: OctreeMap, runs: ColumnRuns, terrain: Terrain, asked: Point, tolerance_m: float) -> str:
    """What is wrong with a goal within whose tolerance the start leads to no traversable ground."""
    gaps = np.linalg.norm(terrain.centers().astype(np.float64) - asked, axis=1)
    if gaps.size and gaps.min() <= tolerance_m:
        return _WHY_NO_GOAL[TerrainClass(int(terrain.label[np.argmin(gaps)]))]
    near = np.linalg.norm(tops_with_room(runs, 0.0) - asked, axis=1) <= tolerance_m
    if near.any():
        return "the start does not lead to what lies there"
    return outside(runs, asked) or _WHAT_IS_THERE[VoxelState(int(octree.states_at([asked])[0]))]


def outside(runs: ColumnRuns, asked: Point) -> str | None:
    """That a point lies beside the columns of which something is known, or None."""
    z_range = runs.z_range
    if z_range is None:
        return "the map is empty"
    low = np.array([*runs.origin_key, z_range[0]]) * runs.resolution
    high = np.array([runs.origin_key[0] + runs.nx, runs.origin_key[1] + runs.ny, z_range[1] + 1]) * runs.resolution
    if (low[:2] <= asked[:2]).all() and (asked[:2] <= high[:2]).all():
        return None
    spans = ", ".join(f"{axis} {a:.1f} to {b:.1f}" for axis, a, b in zip("xyz", low, high, strict=True))
    return f"it lies outside the map, which spans {spans} m"
