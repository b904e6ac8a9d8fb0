"""A robot that jumps from goal to goal through a voxel world and sees by rays: the choice of goals to its end, without physics or ROS."""

import math
from dataclasses import dataclass, field

import numpy as np
from numba import njit
from numpy.typing import NDArray
from terrain_worlds import BELOW, FREE, OCCUPIED, RESOLUTION, decide, pose, runs_of

from octomap_server_3dnav.exploration.decide import Explorer
from octomap_server_3dnav.exploration.decision import Decision, DecisionKind

SENSOR_HEIGHT = 0.88


@njit(cache=True)
def _cast(world, known, origin, directions, range_voxels, noise):
    """Mark what each ray passes as free and where it ends, `noise` voxels off, as occupied; origin in voxels."""
    nx, ny, nz = world.shape
    for i, d in enumerate(directions):
        voxel = np.floor(origin).astype(np.int64)
        step = np.where(d > 0, 1, -1)
        delta = 1.0 / np.maximum(np.abs(d), 1e-9)
        ahead = np.where(d > 0, voxel + 1 - origin, origin - voxel) * delta
        while True:
            x, y, z = voxel
            if x < 0 or y < 0 or z < 0 or x >= nx or y >= ny or z >= nz:
                break
            if world[x, y, z] == OCCUPIED:
                entered = np.max(np.where(ahead - delta > 0, ahead - delta, 0.0))
                x, y, z = np.floor(origin + d * (entered + 1e-6 + noise[i])).astype(np.int64)
                if 0 <= x < nx and 0 <= y < ny and 0 <= z < nz:
                    known[x, y, z] = OCCUPIED
                break
            if known[x, y, z] != OCCUPIED:
                known[x, y, z] = FREE
            axis = np.argmin(ahead)
            if ahead[axis] > range_voxels:
                break
            voxel[axis] += step[axis]
            ahead[axis] += delta[axis]


def sweep_directions(lines: int = 200, beams: int = 400) -> NDArray[np.float64]:
    """(N, 3) rays of a tilting laser: lines dense near the horizon before and behind, straight down left out (the robot's own body)."""
    tilt = np.concatenate([np.linspace(-0.6, 1.15, lines), np.linspace(2.0, 2.9, lines // 2)])
    beam = np.radians(np.linspace(-135, 135, beams))
    x, y = np.cos(beam)[None, :] * np.ones((tilt.size, 1)), np.sin(beam)[None, :] * np.ones((tilt.size, 1))
    return np.stack([x * np.cos(tilt)[:, None], y, -x * np.sin(tilt)[:, None]], axis=2).reshape(-1, 3)


@dataclass
class Journey:
    """What happened: the decisions, and the poses of the robot."""

    decisions: list[Decision] = field(default_factory=list)
    poses: list[NDArray[np.float64]] = field(default_factory=list)
    known: NDArray[np.uint8] | None = None


def _plane_beneath(world, known, x, y, half=0.7):
    """The start plane that the octree inserts under the robot."""
    ix, iy, n = int(x / RESOLUTION), int(y / RESOLUTION), int(half / RESOLUTION)
    block = np.s_[ix - n : ix + n + 1, iy - n : iy + n + 1]
    known[block][world[block] == OCCUPIED] = OCCUPIED


def explore(world, x, y, ground, planner: Explorer, most: int = 80, noise_m: float = 0.0) -> Journey:
    """Sweep, decide, jump to the goal, until there is none or `most` decisions were made."""
    known = np.zeros_like(world)
    _plane_beneath(world, known, x, y)
    journey = Journey(known=known)
    rays = sweep_directions()
    random, yaw = np.random.default_rng(0), 0.0
    for _ in range(most):
        c, s = math.cos(yaw), math.sin(yaw)
        turned = rays @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        origin = np.array([x + 0.2 * c, y + 0.2 * s, ground + SENSOR_HEIGHT]) / RESOLUTION + np.array([0, 0, BELOW])
        _cast(world, known, origin, turned, 12.0 / RESOLUTION, noise_m / RESOLUTION * random.standard_normal(len(rays)))
        T_map_base = pose(x, y, ground, yaw)
        decision = decide(planner, runs_of(known), T_map_base, earlier=journey.poses)
        journey.decisions.append(decision)
        journey.poses.append(T_map_base)
        if decision.kind is not DecisionKind.GOAL:
            return journey
        x, y, ground, yaw = decision.goal
    return journey
