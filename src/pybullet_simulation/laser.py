"""The laser: where each beam of a tick points, and the scans that come of it."""

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.beam_casting import BeamCaster, Motion
from pybullet_simulation.config import SimulationConfig
from pybullet_simulation.range_errors import RangeErrors
from pybullet_simulation.records import ScanGeometry
from pybullet_simulation.robot_model import RobotModel
from pybullet_simulation.world import World

__all__ = ["Laser", "Motion"]

Array = NDArray[np.float64]
Ranges = NDArray[np.float32]


class Laser:
    """Scans of a world, of the robot's own body, with range noise and veiling."""

    def __init__(self, config: SimulationConfig, robot: RobotModel, world: World, rng: np.random.Generator) -> None:
        """`rng` feeds the noise of this laser alone."""
        self.geometry = ScanGeometry(range_min=config.range_min_m, range_max=config.range_max_m)
        self._caster, self._errors = BeamCaster(config, robot, world), RangeErrors(config, rng)
        angles = self.geometry.angles
        self._directions = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(angles.size)])

    def scans(self, motion: Motion, starts_s: Array) -> list[Ranges]:
        """One (1081,) float32 array of ranges for each start, in seconds from the first step of the motion."""
        times = (starts_s[:, None] + np.arange(self.geometry.beams) * self.geometry.time_increment).ravel()
        found = self._caster.hits(np.tile(self._directions, (len(starts_s), 1)), times, motion)
        hits, incidence = (values.reshape(len(starts_s), -1) for values in found)
        return [self._errors.measured(*one) for one in zip(hits, incidence, strict=True)]
