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
        self._first_half: Revolution | None = None

    def half_turn(self, motion: Motion, begin_s: float) -> Revolution | None:
        """Goes on by half a revolution, over a motion of one tick that begins at `begin_s`; the whole one with its second half."""
        first = self._first_half
        half = self._measured(motion, begin_s, 0 if first is None else 1)
        self._first_half = half if first is None else None
        return None if first is None else _joined(first, half)

    def _measured(self, motion: Motion, begin_s: float, part: int) -> Revolution:
        geometry = self._geometry
        columns = np.arange(geometry.columns // 2) + part * (geometry.columns // 2)
        directions = geometry.directions(columns)
        times = np.broadcast_to(columns * geometry.column_s, directions.shape[:2])
        since_begin = times - part * geometry.duration_s / 2
        hits = self._caster.hits(directions.reshape(-1, 3), since_begin.ravel(), motion).reshape(times.shape)
        ranges = np.stack([self._errors.measured(ring) for ring in hits])
        return _revolution(begin_s, ranges, directions, times)


def _revolution(stamp_s: float, ranges: NDArray[np.float32], directions: Array, times: Array) -> Revolution:
    """(rings, columns) of measured ranges in the order in which they were fired, without those that were too near."""
    rings = np.broadcast_to(np.arange(len(ranges), dtype=np.uint16)[:, None], ranges.shape)
    points = np.where(np.isfinite(ranges), ranges, np.float32(np.nan))[..., None] * directions
    kept = ~np.isneginf(ranges.T)
    return Revolution(stamp_s, points.transpose(1, 0, 2)[kept].astype(np.float32), rings.T[kept], times.T[kept].astype(np.float32))


def _joined(first: Revolution, second: Revolution) -> Revolution:
    return Revolution(
        first.stamp_s,
        np.concatenate([first.points, second.points]),
        np.concatenate([first.rings, second.rings]),
        np.concatenate([first.times_s, second.times_s]),
    )
