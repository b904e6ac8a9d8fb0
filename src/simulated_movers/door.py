"""A door: opens, stays open, shuts, stays shut; it stops before whoever stands in its leaf's way, as doors with a light barrier do."""

import math

import numpy as np
from numpy.typing import NDArray

from simulated_movers.ground import OpenGround, RobotSeen, gap_between
from simulated_movers.shapes import DOOR_M
from simulated_movers.specification import MoverSpec

Array = NDArray[np.float64]

KEPT_M = 0.1
DISC_EVERY_M = 0.1


class Door:
    """A leaf on its hinge; `place` (4,) is the hinge's x, y, the ground, and where the leaf points."""

    leg_rad = 0.0

    def __init__(self, spec: MoverSpec, ground: OpenGround, rng: np.random.Generator) -> None:
        self._spec = spec
        self._opens, self._open_share = True, 0.0
        self._stands_s = float(rng.uniform(0.0, spec.pause_s))
        middle = np.array(spec.start) + spec.width_m / 2.0 * np.array([math.cos(spec.closed_rad), math.sin(spec.closed_rad)])
        self.place = np.array([*spec.start, ground.height_at(middle), spec.closed_rad])

    @property
    def discs(self) -> Array:
        """(K, 3) what its leaf covers: x, y, radius."""
        return self._discs_at(float(self.place[3]))

    def _discs_at(self, yaw: float) -> Array:
        along = np.append(np.arange(DISC_EVERY_M, self._spec.width_m, DISC_EVERY_M), self._spec.width_m)
        x, y = self.place[0] + along * math.cos(yaw), self.place[1] + along * math.sin(yaw)
        return np.column_stack([x, y, np.full(len(along), DOOR_M)])

    def step(self, dt_s: float, robot: RobotSeen, others: Array) -> None:
        """Goes on by `dt_s`; `others` (M, 3) are the discs that the movers beside it cover."""
        if self._stands_s > 0.0:
            self._stands_s -= dt_s
            return
        turned = self._spec.speed_mps * dt_s / self._spec.width_m / abs(self._spec.swing_rad)
        share = float(np.clip(self._open_share + (turned if self._opens else -turned), 0.0, 1.0))
        yaw = self._spec.closed_rad + share * self._spec.swing_rad
        there, here = self._discs_at(yaw), self.discs
        if all(self._gap(there, robot, rest) >= min(KEPT_M, self._gap(here, robot, rest)) for rest in (None, others)):
            self._open_share, self.place[3] = share, yaw
        if share in (0.0, 1.0):
            self._opens, self._stands_s = not self._opens, self._spec.pause_s

    def _gap(self, discs: Array, robot: RobotSeen, others: Array | None) -> float:
        return robot.gap_m(discs, 0.0) if others is None else gap_between(discs, others)
