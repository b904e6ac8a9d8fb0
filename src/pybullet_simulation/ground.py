"""Ground that is not the same everywhere: patches where wheels slip more, and uphill more than down.

The odometry takes slip for a Markov process in time; here it is a function of place and slope, as Ishigami et al. 2007
("Terramechanics-based model for steering maneuver of planetary exploration rovers") and Wong ("Theory of Ground Vehicles") have it.
"""

import math

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig

Array = NDArray[np.float64]

_WAVES = 12
_SLIP_PATCH_M = 3.0  # how far apart patches of ground are that hold less or more


class _Field:
    """A smooth random field over the plane, of unit variance: waves of one length in random directions."""

    def __init__(self, length_m: float, rng: np.random.Generator) -> None:
        directions, self._phases = 2.0 * math.pi * rng.random((2, _WAVES))
        self._waves = np.column_stack([np.cos(directions), np.sin(directions)]) * (2.0 * math.pi / length_m)

    def at(self, points: Array) -> Array:
        """(N,) values at (N, 2) places."""
        return np.asarray(math.sqrt(2.0 / _WAVES) * np.cos(points @ self._waves.T + self._phases).sum(axis=1))


class Ground:
    """What the ground of a run does to the wheels, and the wheels' own radius."""

    def __init__(self, config: SimulationConfig, rng: np.random.Generator) -> None:
        """`rng` draws the ground and the wheels, once."""
        self._config = config
        self._slip, self._grip = _Field(_SLIP_PATCH_M, rng), _Field(_SLIP_PATCH_M, rng)
        self._radius = config.wheel_radius_sigma * float(rng.standard_normal())
        self.varies = bool(config.slip_patch_sigma or config.slip_per_climb or config.grip_patch_sigma or self._radius)

    def slip(self, sides: Array, climb: float) -> Array:
        """(2,) share by which the encoders of each side turn too much: at (2, 2) places of the sides, `climb` the sine of the slope
        in the direction of driving."""
        return self._config.slip_patch_sigma * self._slip.at(sides) + self._config.slip_per_climb * climb + self._radius

    def sideways_ratio(self, place: Array) -> float:
        """Sideways friction as a share of the one along a tyre, at (2,) a place."""
        share = 1.0 + self._config.grip_patch_sigma * float(self._grip.at(place[None])[0])
        return self._config.lateral_friction_ratio * min(max(share, 0.3), 1.7)
