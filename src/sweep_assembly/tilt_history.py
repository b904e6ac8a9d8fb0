"""The mount's tilt at the time of each beam, from joint samples that came before and after it."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import JUMP_BACK_S

KEPT_SAMPLES = 1000  # a mount whose joint is sampled a thousand times a second takes a hundred in a revolution


class TiltHistory:
    """The newest joint samples; answers for times that lie between them and for no others."""

    def __init__(self) -> None:
        self._stamps: deque[float] = deque(maxlen=KEPT_SAMPLES)
        self._tilts: deque[float] = deque(maxlen=KEPT_SAMPLES)

    def add(self, stamp_s: float, tilt_rad: float) -> None:
        """Takes a sample; ValueError when it is not finite.

        One that is late or doubled is left out. A much older one means that time jumped: start afresh.
        """
        if not np.isfinite([stamp_s, tilt_rad]).all():
            raise ValueError(f"tilt {tilt_rad} rad at {stamp_s} s: both must be finite")
        if self._stamps and stamp_s <= self._stamps[-1]:
            if stamp_s > self._stamps[-1] - JUMP_BACK_S:
                return
            self._stamps.clear()
            self._tilts.clear()
        self._stamps.append(stamp_s)
        self._tilts.append(tilt_rad)

    def reaches(self, stamp_s: float) -> bool:
        """True when a sample at or after `stamp_s` is there."""
        return bool(self._stamps) and self._stamps[-1] >= stamp_s - 1e-6

    def at(self, stamps_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) tilts in radians at (n,) times, linear between samples; NaN before the first and after the last."""
        if not self._stamps:
            return np.full(np.shape(stamps_s), np.nan)
        known = np.interp(stamps_s, np.array(self._stamps), np.array(self._tilts))
        outside = (stamps_s < self._stamps[0] - 1e-6) | (stamps_s > self._stamps[-1] + 1e-6)
        return np.where(outside, np.nan, known)
