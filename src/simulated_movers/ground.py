"""Where movers can go, and what of the robot they heed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class OpenGround:
    """A grid over the ground that the robot's start leads to: `height` (rows, columns) in m, NaN elsewhere, and `clear_m`, the distance
    to what is no such ground; cell [r, c] is centred at (x0 + c * step_m, y0 + r * step_m)."""

    height: Array
    clear_m: Array
    x0: float
    y0: float
    step_m: float

    def _cells(self, xy: Array) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
        """Rows and columns of (N, 2) places, and which lie on the grid."""
        c, r = np.rint((xy - (self.x0, self.y0)) / self.step_m).astype(np.int64).T
        rows, columns = self.height.shape
        return np.clip(r, 0, rows - 1), np.clip(c, 0, columns - 1), (r >= 0) & (r < rows) & (c >= 0) & (c < columns)

    def clear_at(self, xy: Array) -> Array:
        """(N,) free distance around (N, 2) places, 0 off the grid."""
        row, column, inside = self._cells(xy)
        return np.where(inside, self.clear_m[row, column], 0.0)

    def height_at(self, xy: Array) -> float:
        """Height of the ground at (2,), NaN where it is not open."""
        row, column, inside = self._cells(xy[None])
        return float(self.height[row[0], column[0]]) if inside[0] else float("nan")

    def is_open(self, start: Array, end: Array, radius_m: float) -> bool:
        """Whether something round can go straight from (2,) to (2,)."""
        steps = int(np.linalg.norm(end - start) / self.step_m) + 1
        along = np.linspace(0.0, 1.0, steps + 1)[:, None]
        return bool((self.clear_at(start + along * (end - start)) >= radius_m).all())

    def places(self, radius_m: float) -> Array:
        """(N, 2) where something round can stand."""
        rows, columns = np.nonzero(self.clear_m >= radius_m)
        return np.column_stack([self.x0 + columns * self.step_m, self.y0 + rows * self.step_m])


@dataclass(frozen=True)
class RobotSeen:
    """The robot as movers see it: x, y, yaw, forward speed, and half its outline."""

    x: float
    y: float
    yaw: float
    speed_mps: float
    half_length_m: float
    half_width_m: float

    def ahead(self, distance_m: float) -> Array:
        """(2,) a place so far from its end, where it drives to."""
        reach = np.copysign(self.half_length_m + distance_m, self.speed_mps)
        return np.array([self.x + reach * np.cos(self.yaw), self.y + reach * np.sin(self.yaw)])

    def is_before(self, xy: Array, aside_m: float) -> bool:
        """Whether (2,) lies before it, where it drives to, so near to the middle of its way."""
        along, aside = self._in_its_frame(xy[None])
        return bool(along[0] * self.speed_mps > 0.0 and abs(aside[0]) <= aside_m)

    def _in_its_frame(self, xy: Array) -> tuple[Array, Array]:
        c, s, offset = np.cos(self.yaw), np.sin(self.yaw), xy - (self.x, self.y)
        return c * offset[:, 0] + s * offset[:, 1], c * offset[:, 1] - s * offset[:, 0]

    def gap_m(self, discs: Array, heeded_s: float) -> float:
        """Least distance from (K, 3) discs x, y, radius to its outline, and to where it will be within so many seconds."""
        along, aside = self._in_its_frame(discs[:, :2])
        way = self.speed_mps * heeded_s
        dx = np.maximum(np.maximum(-self.half_length_m + min(way, 0.0) - along, along - self.half_length_m - max(way, 0.0)), 0.0)
        dy = np.maximum(np.abs(aside) - self.half_width_m, 0.0)
        return float((np.hypot(dx, dy) - discs[:, 2]).min())


def gap_between(discs: Array, others: Array) -> float:
    """Least distance between (K, 3) and (M, 3) discs, inf without others."""
    if not len(others):
        return float("inf")
    apart = np.hypot(*(discs[:, None, :2] - others[None, :, :2]).transpose(2, 0, 1))
    return float((apart - discs[:, None, 2] - others[None, :, 2]).min())
