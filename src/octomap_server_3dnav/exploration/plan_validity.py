"""Whether a plan still holds after a sweep on the way to its goal (thesis 6.2.2)."""

import math
from enum import Enum

import numpy as np

from octomap_server_3dnav.exploration.decision import Decision
from octomap_server_3dnav.exploration.tried_places import PLACE_RADIUS_M
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass


class Validity(Enum):
    """Whether a plan still holds after a sweep on the way."""

    VALID = "valid"
    PATH_BLOCKED = "path blocked"
    FRONTIER_GONE = "frontier gone"


def validity_in(terrain: Terrain, plan: Decision, min_voxels: int) -> Validity:
    """Whether the rest of a plan's path is still free in a terrain, taken after a sweep on the way, and its frontier still one.

    What lies outside the terrain counts as unchanged; ground that is gone from it is no way. The part that the robot stands on may be
    inflated, and where the path leads straight it may lie in ground that is wide enough for that. `min_voxels` make a frontier. ValueError
    for a decision without a path.
    """
    if plan.path is None or plan.frontier is None:
        raise ValueError(f"a decision of kind {plan.kind.value!r} has no path that could be valid")
    if not path_is_free(terrain, plan):
        return Validity.PATH_BLOCKED
    target = np.asarray(plan.frontier)
    if terrain.radius_m is not None:
        away_m = np.linalg.norm(target[:2] - np.asarray(terrain.robot_xyz)[:2])
        if away_m > terrain.radius_m - PLACE_RADIUS_M:
            return Validity.VALID
    near = np.linalg.norm(terrain.centers(terrain.frontiers()) - target, axis=1) <= PLACE_RADIUS_M
    return Validity.VALID if np.count_nonzero(near) >= min_voxels else Validity.FRONTIER_GONE


def path_is_free(terrain: Terrain, plan: Decision) -> bool:
    """Whether the rest of a plan's path is still free in a terrain, as in `validity_in`; of a plan without a path it is not."""
    if plan.path is None:
        return False
    from_robot = np.linalg.norm(plan.path[:, :2] - np.asarray(terrain.robot_xyz[:2]), axis=1)
    reach_m = math.inf if terrain.radius_m is None else terrain.radius_m
    is_within = True  # until the path leads out; where it comes in again, the flood need not have come
    for i in range(int(np.argmin(from_robot)), len(plan.path)):
        is_within &= bool(from_robot[i] < reach_m)
        if from_robot[i] <= PLACE_RADIUS_M:
            continue
        node = terrain.surface_near(plan.path[i])
        if node is None and is_within:
            return False
        if node is None or terrain.label[node] == TerrainClass.TRAVERSABLE:
            continue
        if plan.straight is None or not plan.straight[i] or not terrain.narrow[node]:
            return False
    return True
