"""What a ranging sensor makes of the distances that its beams hit at: biased, noisy, veiled at edges, and limited."""

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.config import SimulationConfig

Ranges = NDArray[np.float32]
Array = NDArray[np.float64]

FAR_M = 10.0  # the data sheet gives the noise up to here and beyond
GRAZING_SHARE = 0.05  # of the range: what neighbouring beams may differ on one surface seen at a grazing angle of 5 deg
_VEILING_JUMP_M = 0.15  # difference of neighbouring ranges that makes a depth edge, beside 5 % of the range


class RangeErrors:
    """The errors of one sensor."""

    def __init__(self, config: SimulationConfig, rng: np.random.Generator) -> None:
        """`rng` feeds the noise of this sensor alone."""
        self._config, self._rng = config, rng

    def measured(self, hits: Ranges, incidence: Ranges) -> Ranges:
        """(N,) ranges of neighbouring beams as the driver reports them: inf and -inf outside of the sensor's limits.

        `incidence` (N,): the cosine of the angle between beam and normal, 1 where a beam meets its surface head on.
        """
        seen = np.where((hits <= self._config.range_max_m) & ~self._faint(hits, incidence), hits, np.float32(np.inf))
        veiled = self._veiled(seen)
        ranges = veiled + self._errors(veiled, incidence)
        if self._config.range_step_m:
            ranges = np.round(ranges / self._config.range_step_m) * self._config.range_step_m
        ranges[ranges > self._config.range_max_m] = np.inf
        ranges[ranges < self._config.range_min_m] = -np.inf
        return np.asarray(ranges, np.float32)

    def _faint(self, hits: Ranges, incidence: Ranges) -> NDArray[np.bool_]:
        """(N,) whether less light comes back than from a surface of 10 % at FAR_M, met head on; a Lambertian one throws back its cosine."""
        if not self._config.reflectivity:
            return np.zeros(hits.shape, np.bool_)
        return np.asarray(self._config.reflectivity * incidence / np.square(hits) < 0.1 / FAR_M**2)

    def _errors(self, ranges: Ranges, incidence: Ranges) -> Array:
        """(N,) errors: noise and bias, neither more than the data sheet's accuracy."""
        far = ranges > FAR_M
        sigma = np.where(far, self._config.range_sigma_far_m, self._config.range_sigma_m)
        limit = np.where(far, self._config.range_limit_far_m, self._config.range_limit_m)
        errors = sigma * self._rng.standard_normal(ranges.size)
        if self._config.range_incidence_bias_m:
            errors += self._config.range_incidence_bias_m * (1.0 - incidence)
        return np.minimum(np.maximum(errors, -limit), limit)

    def _veiled(self, ranges: Ranges) -> Ranges:
        """At a depth edge the beam's spot lies on two surfaces, and now and then the sensor returns a range between them."""
        chance, share = self._rng.random((2, ranges.size - 1), dtype=np.float32)
        with np.errstate(invalid="ignore"):
            jump = np.diff(ranges)
            least = _VEILING_JUMP_M + GRAZING_SHARE * np.minimum(ranges[1:], ranges[:-1])
            edge = np.isfinite(jump) & (np.abs(jump) > least) & (chance < self._config.veiling_probability)
        out = ranges.copy()
        out[:-1][edge] += share[edge] * jump[edge]
        return out
