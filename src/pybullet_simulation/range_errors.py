"""What a ranging sensor makes of the distances that its beams hit at: veiled at edges, noisy, and limited."""

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig

Ranges = NDArray[np.float32]

FAR_M = 10.0  # the data sheet gives the noise up to here and beyond
GRAZING_SHARE = 0.05  # of the range: what neighbouring beams may differ on one surface seen at a grazing angle of 5 deg


class RangeErrors:
    """The errors of one sensor."""

    def __init__(self, config: SimulationConfig, rng: np.random.Generator) -> None:
        """`rng` feeds the noise of this sensor alone."""
        self._config, self._rng = config, rng

    def measured(self, hits: Ranges) -> Ranges:
        """(N,) ranges of neighbouring beams as the driver reports them: veiled, noisy, inf and -inf outside of the sensor's limits."""
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
