"""How far along the path the ground is known: what a robot that maps while it drives may count on."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from path_following.reference_path import ReferencePath
from path_following.surroundings import Surroundings
from robot_body import RobotBody

_SPACING_M = 0.02


@dataclass(frozen=True)
class KnownGround:
    """Asks under the middle of the path and beside it where the wheels roll; a gap shorter than `gap_m` they roll over."""

    beside_m: tuple[float, ...]
    gap_m: float

    @classmethod
    def under(cls, robot: RobotBody) -> "KnownGround":
        """Of a robot: half its track to both sides; a wheel does not fall into a gap shorter than its radius."""
        return cls((0.0, robot.track_m / 2, -robot.track_m / 2), robot.wheel_radius_m)

    def ahead_m(self, around: Surroundings, path: ReferencePath, s: float, look_m: float) -> float:
        """Metres of known ground from arc length `s` on; inf where it is known for `look_m`, or to the path's end.

        What is not free is another question: its ground is known, or the costmap keeps the robot's middle off it.
        """
        left = min(look_m, path.length - s)
        if left <= 0.0:
            return math.inf
        along = s + np.linspace(0.0, left, math.ceil(left / _SPACING_M) + 1)
        nearest = math.inf
        for points in self._lines(path.points_at(along)):
            nearest = min(nearest, self._first_gap_m(~around.is_known(points), along - s))
        return nearest

    def _lines(self, middle: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        if len(middle) < 2:
            return [middle]
        ahead = np.gradient(middle, axis=0)
        left = np.column_stack([-ahead[:, 1], ahead[:, 0]]) / np.maximum(np.linalg.norm(ahead, axis=1), 1e-9)[:, None]
        return [middle + beside * left for beside in self.beside_m]

    def _first_gap_m(self, unknown: NDArray[np.bool_], along_m: NDArray[np.float64]) -> float:
        """Where the first stretch of unknown ground begins that is as long as `gap_m`, or that begins and does not end."""
        borders = np.flatnonzero(np.diff(np.concatenate([[False], unknown, [False]])))
        for first, end in borders.reshape(-1, 2):
            if end == len(unknown) or along_m[end] - along_m[first] >= self.gap_m:
                return float(along_m[max(first - 1, 0)])
        return math.inf
