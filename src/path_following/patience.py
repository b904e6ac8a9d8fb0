"""How long a goal may be driven to in vain, whatever path is driven: each sweep brings a new one."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

PATIENCE_S = 30.0
_PROGRESS_M = 0.1
_STEP_S = 0.5  # odometry comes oftener; a longer gap is a clock that was set, or a robot that was away


@dataclass
class Patience:
    """Counts the seconds in which the robot was free to drive and came no farther."""

    _at: NDArray[np.float64] | None = None
    _stamp_s: float | None = None
    _in_vain_s: float = field(default=0.0)

    def is_over(self, stamp_s: float, xyz: NDArray[np.float64], *, is_held: bool) -> bool:
        """Whether it has lasted too long, by where the robot is now (3,) m in map. Time in which somebody held it does not count."""
        passed_s = 0.0 if self._stamp_s is None else stamp_s - self._stamp_s
        self._stamp_s = stamp_s
        if self._at is None or float(np.linalg.norm(xyz - self._at)) >= _PROGRESS_M:
            self._at, self._in_vain_s = xyz.copy(), 0.0
        elif not is_held:
            self._in_vain_s += min(max(passed_s, 0.0), _STEP_S)
        return self._in_vain_s > PATIENCE_S
