"""The laser: where each beam of a tick starts and points, what it hits, and what the sensor makes of it."""

from dataclasses import dataclass

import numba
import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.records import ScanGeometry
from pybullet_simulation.robot_model import RobotModel
from pybullet_simulation.world import World, nearest_hits, raycasting_scene

Array = NDArray[np.float64]
Ranges = NDArray[np.float32]

FAR_M = 10.0  # the data sheet gives the noise up to here and beyond
GRAZING_SHARE = 0.05  # of the range: what neighbouring beams may differ on one surface seen at a grazing angle of 5 deg


@dataclass(frozen=True)
class Motion:
    """How the robot moved over a tick: rotations (S, 3, 3) and positions (S, 3) of base_link and tilts (S,), at S even steps."""

    rotations: Array
    positions: Array
    tilts: Array
    step_s: float


class Laser:
    """Scans of a world, of the robot's own body, with range noise and veiling."""

    def __init__(self, config: SimulationConfig, robot: RobotModel, world: World, rng: np.random.Generator) -> None:
        """`rng` feeds the noise of this laser alone."""
        self.geometry = ScanGeometry(range_min=config.range_min_m, range_max=config.range_max_m)
        self._config, self._rng = config, rng
        self._world = raycasting_scene(world.vertices, world.triangles)
        self._body = raycasting_scene(robot.body.vertices, robot.body.triangles)
        self._mount, self._offset = robot.T_base_mount[:3, 3].copy(), robot.T_tilt_laser[:3, 3].copy()
        angles = self.geometry.angles
        self._cos_sin = np.column_stack([np.cos(angles), np.sin(angles)])

    def scans(self, motion: Motion, starts_s: Array) -> list[Ranges]:
        """One (1081,) float32 array of ranges for each start, in seconds from the first step of the motion."""
        times = (starts_s[:, None] + np.arange(self.geometry.beams) * self.geometry.time_increment).ravel()
        cos_sin = np.tile(self._cos_sin, (len(starts_s), 1))
        in_world, in_base = _rays(
            cos_sin, times, motion.step_s, motion.rotations, motion.positions, motion.tilts, self._mount, self._offset
        )
        hits = nearest_hits(self._world, in_world)
        if motion.tilts.any():  # level, the scan plane passes above all of the body
            hits = np.minimum(hits, nearest_hits(self._body, in_base))
        return [self._measured(one) for one in hits.reshape(len(starts_s), -1)]

    def _measured(self, hits: Ranges) -> Ranges:
        """Ranges as the driver reports them: veiled at edges, noisy, inf and -inf outside of its limits."""
        seen = np.where(hits <= self._config.range_max_m, hits, np.float32(np.inf))
        veiled = self._veiled(seen)
        sigma = np.where(veiled > FAR_M, self._config.range_sigma_far_m, self._config.range_sigma_m)
        ranges = veiled + sigma * self._rng.standard_normal(veiled.size)
        ranges[ranges > self._config.range_max_m] = np.inf
        ranges[ranges < self._config.range_min_m] = -np.inf
        return np.asarray(ranges, np.float32)

    def _veiled(self, ranges: Ranges) -> Ranges:
        """At a depth edge the beam's spot lies on two surfaces, and now and then the sensor returns a range between them."""
        chance, share = self._rng.random((2, ranges.size - 1), dtype=np.float32)
        with np.errstate(invalid="ignore"):
            jump = np.diff(ranges)
            least = self._config.veiling_jump_m + GRAZING_SHARE * np.minimum(ranges[1:], ranges[:-1])
            edge = np.isfinite(jump) & (np.abs(jump) > least) & (chance < self._config.veiling_probability)
        out = ranges.copy()
        out[:-1][edge] += share[edge] * jump[edge]
        return out


@numba.njit(cache=True)
def _rays(cos_sin, times, step_s, rotations, positions, tilts, mount, offset):  # type: ignore[no-untyped-def]  # numba
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
        direction[0], direction[1], direction[2] = c * cos_sin[i, 0], cos_sin[i, 1], -s * cos_sin[i, 0]
        for r in range(3):
            at, along = (1 - u) * positions[k, r] + u * positions[k + 1, r], 0.0
            for j in range(3):
                a = (1 - u) * rotations[k, r, j] + u * rotations[k + 1, r, j]
                at += a * origin[j]
                along += a * direction[j]
            in_world[i, r], in_world[i, 3 + r] = at, along
            in_base[i, r], in_base[i, 3 + r] = origin[r], direction[r]
    return in_world, in_base
