"""The spinning lidar: 16 beams that turn together, ten times a second, clockwise from the back, on the laser's mount."""

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.beam_casting import BeamCaster, Motion
from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.lidar_config import SpinningLidarConfig
from pybullet_simulation.range_errors import RangeErrors
from pybullet_simulation.records import LidarGeometry, Revolution
from pybullet_simulation.robot_model import RobotModel
from pybullet_simulation.world import World

Array = NDArray[np.float64]


class SpinningLidar:
    """Revolutions of a world, of the robot's own body, with the laser's range noise and veiling along each ring."""

    def __init__(
        self, config: SimulationConfig, lidar: SpinningLidarConfig, robot: RobotModel, world: World, rng: np.random.Generator
    ) -> None:
        """`rng` feeds the noise of this lidar alone."""
        self._geometry = LidarGeometry(lidar.columns)
        self._caster, self._errors = BeamCaster(config, robot, world), RangeErrors(config, rng)

    def revolution(self, motion: Motion, start_s: float, stamp_s: float) -> Revolution:
        """The revolution that begins `start_s` seconds from the motion's first step, and is stamped `stamp_s`."""
        geometry = self._geometry
        columns = np.arange(geometry.columns)
        directions = geometry.directions(columns)
        times = np.broadcast_to(columns * geometry.column_s, directions.shape[:2])
        found = self._caster.hits(directions.reshape(-1, 3), start_s + times.ravel(), motion)
        hits, incidence = (values.reshape(times.shape) for values in found)
        ranges = np.stack([self._errors.measured(*ring) for ring in zip(hits, incidence, strict=True)])
        return _revolution(stamp_s, ranges, directions, times)


def _revolution(stamp_s: float, ranges: NDArray[np.float32], directions: Array, times: Array) -> Revolution:
    """(rings, columns) of measured ranges in the order in which they were fired, without those that were too near."""
    rings = np.broadcast_to(np.arange(len(ranges), dtype=np.uint16)[:, None], ranges.shape)
    points = np.where(np.isfinite(ranges), ranges, np.float32(np.nan))[..., None] * directions
    kept = ~np.isneginf(ranges.T)
    return Revolution(stamp_s, points.transpose(1, 0, 2)[kept].astype(np.float32), rings.T[kept], times.T[kept].astype(np.float32))
