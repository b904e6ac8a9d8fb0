"""Beams of a sensor on the tilting mount: where each starts and points at its own time, and the nearest surface that it hits."""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.robot_model import RobotModel
from pybullet_simulation.world import World, nearest_hits, raycasting_scene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """How the robot moved over a tick: rotations (S, 3, 3) and positions (S, 3) of base_link and tilts (S,), at S even steps."""

    rotations: Array
    positions: Array
    tilts: Array
    step_s: float


class BeamCaster:
    """Casts beams at a world and at the robot's own body."""

    def __init__(self, robot: RobotModel, world: World) -> None:
        self._world = raycasting_scene(world.vertices, world.triangles)
        self._body = raycasting_scene(robot.body.vertices, robot.body.triangles)
        self._mount, self._offset = robot.T_base_mount[:3, 3].copy(), robot.T_tilt_laser[:3, 3].copy()

    def hits(self, directions: Array, times_s: Array, motion: Motion) -> NDArray[np.float32]:
        """(N,) distances to what (N, 3) unit directions in `laser`, at (N,) seconds from the motion's first step, hit; inf for nothing."""
        in_world, in_base = _rays(
            directions, times_s, motion.step_s, motion.rotations, motion.positions, motion.tilts, self._mount, self._offset
        )
        hits = nearest_hits(self._world, in_world)
        if motion.tilts.any():  # level, all beams pass above all of the body
            hits = np.minimum(hits, nearest_hits(self._body, in_base))
        return hits


@numba.njit(cache=True)
def _rays(directions, times, step_s, rotations, positions, tilts, mount, offset):  # type: ignore[no-untyped-def]  # numba
    """Rays (N, 6) float32 in the world and in base_link, each at its own time; linear between steps (error under 1e-5 at 5 ms)."""
    n, last = times.size, tilts.size - 2
    in_world, in_base = np.empty((n, 6), np.float32), np.empty((n, 6), np.float32)
    origin, direction = np.empty(3), np.empty(3)
    for i in range(n):
        k = min(int(times[i] / step_s), last)
        u = times[i] / step_s - k
        tilt = (1 - u) * tilts[k] + u * tilts[k + 1]
        c, s = np.cos(tilt), np.sin(tilt)
        origin[0] = mount[0] + c * offset[0] + s * offset[2]
        origin[1] = mount[1] + offset[1]
        origin[2] = mount[2] - s * offset[0] + c * offset[2]
        direction[0] = c * directions[i, 0] + s * directions[i, 2]
        direction[1] = directions[i, 1]
        direction[2] = -s * directions[i, 0] + c * directions[i, 2]
        for r in range(3):
            at, along = (1 - u) * positions[k, r] + u * positions[k + 1, r], 0.0
            for j in range(3):
                a = (1 - u) * rotations[k, r, j] + u * rotations[k + 1, r, j]
                at += a * origin[j]
                along += a * direction[j]
            in_world[i, r], in_world[i, 3 + r] = at, along
            in_base[i, r], in_base[i, 3 + r] = origin[r], direction[r]
    return in_world, in_base
