"""What exploration may cost in seconds and metres, and when the rest of it is needed for the way home.

For `decide`, after every sweep. The way home is kept at the pace of the drives so far, with their sweeps, and costs no more than all of
them; beside it twice the dearest leg from one sweep to the next, that on which the robot goes out now and the way back from its end; and
what the first sweep took, for the last. What somebody paused is spent, and is no pace.
"""

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.config import ExplorationConfig


class Budget:
    """Counts seconds and metres; all costs are (2,), of both, without the pauses."""

    def __init__(self, config: ExplorationConfig, *, since_start: bool) -> None:
        """`since_start`: of the robot; else since the next sweep."""
        self.configure(config)
        self._last: NDArray[np.float64] | None = np.zeros(2) if since_start else None
        self._xyz: NDArray[np.floating] | None = None
        self._way_m = 0.0
        self._first: NDArray[np.float64] | None = None
        self._driving, self._dearest = np.zeros(2), np.zeros(2)
        self._paused_s = self._paused_before_s = 0.0

    def configure(self, config: ExplorationConfig) -> None:
        """Other limits; what was spent before counts."""
        self._limit: NDArray[np.float64] = np.array([config.budget_s, config.budget_m])

    @property
    def is_set(self) -> bool:
        """Whether there is a limit at all."""
        return bool(self._limit.any())

    def spend(self, elapsed_s: float, driven_m: float, xyz: NDArray[np.floating], paused_s: float) -> float:
        """After a sweep, `elapsed_s` since the start, `paused_s` of them by somebody, `driven_m` by odometry, and at (3,) `xyz` in map: the
        metres of the leg before it.

        While the robot drives, what odometry tells is as old as the last event: the leg is as long as the way is straight, at least.
        """
        straight_m = 0.0 if self._xyz is None else float(np.linalg.norm(xyz - self._xyz))
        self._xyz, self._way_m = xyz.copy(), max(driven_m, self._way_m + straight_m)
        now = np.array([elapsed_s - paused_s, self._way_m])
        self._paused_s, self._paused_before_s = paused_s, paused_s if self._last is None else self._paused_before_s
        leg, self._last = now - (now if self._last is None else self._last), now
        if self._first is None:
            self._first = leg
        else:
            self._driving += leg
            self._dearest = np.maximum(self._dearest, leg)
        return float(leg[1])

    def why_over(self, way_home_m: float) -> str:
        """Why the robot has to go home now, `way_home_m` over the ground; empty while it has not."""
        first = np.zeros(2) if self._first is None else self._first
        share = min(1.0, way_home_m / self._driving[1]) if self._driving[1] > 0.0 else 0.0
        spent, kept = first + self._driving, share * self._driving + 2.0 * self._dearest + first
        spent[0] += self._paused_s - self._paused_before_s
        for i, unit in enumerate("sm"):
            if 0.0 < self._limit[i] < spent[i] + kept[i]:
                return f"{spent[i]:.0f} of {self._limit[i]:.0f} {unit} are spent, and the way home of {way_home_m:.1f} m needs the rest"
        return ""
