"""What the mount's drive does: it rests level, makes one sweep when asked, or nods until it is told to stop."""

from collections import deque

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.sweep_profile import Nod, SweepProfile

Array = NDArray[np.float64]


class MountDrive:
    """Moves that follow on each other, each from rest to rest; what is asked for begins when the one under way is over."""

    def __init__(self, sweep: SweepProfile, nod: Nod) -> None:
        self._sweep, self._nod = sweep, nod
        self._moves: deque[tuple[float, SweepProfile]] = deque()
        self._sweep_start_s: float | None = None
        self.nodding = False

    @property
    def sweeping(self) -> bool:
        """Whether a sweep was asked for and is not over."""
        return self._sweep_start_s is not None

    def sweep_left_s(self, now_s: float) -> float:
        """What is left of the sweep under way, in seconds; 0 when there is none."""
        return 0.0 if self._sweep_start_s is None else self._sweep.duration_s - (now_s - self._sweep_start_s)

    def start_sweep(self, now_s: float) -> None:
        """Begins a sweep now. ValueError while the mount moves otherwise."""
        if self._sweep_start_s is not None:
            raise ValueError(f"a sweep is running since {self._sweep_start_s:.2f} s")
        if self.nodding or not self.is_level(now_s):
            raise ValueError("the mount nods")
        self._sweep_start_s = now_s
        self._moves = deque([(now_s, self._sweep)])

    def nod(self, wanted: bool, now_s: float) -> None:
        """Nods from now on, or comes to rest level after the move under way. ValueError while a sweep is made."""
        if wanted and self._sweep_start_s is not None:
            raise ValueError(f"a sweep is running since {self._sweep_start_s:.2f} s")
        if wanted and self.is_level(now_s):
            self._moves = deque([(now_s, self._nod.begin)])
        self.nodding = wanted

    def is_level(self, now_s: float) -> bool:
        """Whether it rests level, and no move is left."""
        return all(start_s + move.duration_s <= now_s + 1e-9 and move.tilts_rad[-1] == 0.0 for start_s, move in self._moves)

    def tilts(self, times_s: Array) -> tuple[Array, Array]:
        """Tilt and tilt rate, (S,) each, at rising times that follow on those of the last call."""
        self._plan_until(float(times_s[-1]))
        tilts, rates = np.zeros(times_s.size), np.zeros(times_s.size)
        for start_s, move in self._moves:
            since = times_s >= start_s
            tilts[since], rates[since] = move.tilt_at(times_s[since] - start_s), move.rate_at(times_s[since] - start_s)
        return tilts, rates

    def finish(self, now_s: float) -> None:
        """Forgets what is over by now."""
        if self._sweep_start_s is not None and now_s - self._sweep_start_s >= self._sweep.duration_s - 1e-9:
            self._sweep_start_s = None
        while len(self._moves) > 1 and self._moves[1][0] <= now_s:
            self._moves.popleft()

    def _plan_until(self, end_s: float) -> None:
        while self._moves:
            start_s, move = self._moves[-1]
            over_s, tilt = start_s + move.duration_s, float(move.tilts_rad[-1])
            if over_s >= end_s or (tilt == 0.0 and not self.nodding):
                return
            self._moves.append((over_s, self._nod.after(tilt) if self.nodding else self._nod.to_level(tilt)))
