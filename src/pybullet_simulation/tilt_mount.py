"""How the laser truly lies, against what the encoder of its tilt drive says: play in the gear, and an offset of the factory's zero."""

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig

Array = NDArray[np.float64]


class TiltMount:
    """The mount's play is a hysteresis: the laser follows only when the drive has crossed it. Scale and roll are the beam caster's."""

    def __init__(self, config: SimulationConfig, rng: np.random.Generator) -> None:
        """`rng` draws the offset, once; the laser lies in the middle of its play."""
        self._half_play = config.tilt_backlash_rad / 2.0
        self.offset_rad = config.tilt_offset_sigma_rad * float(rng.standard_normal())
        self._followed = 0.0

    def true_tilts(self, measured: Array) -> Array:
        """(S,) true tilts at steps that follow on those of the last call, whose last is the first of these."""
        if not self._half_play and not self.offset_rad:
            return measured
        true = np.empty_like(measured)
        for i, tilt in enumerate(measured.tolist()):
            self._followed = min(max(self._followed, tilt - self._half_play), tilt + self._half_play)
            true[i] = self._followed
        return true + self.offset_rad
