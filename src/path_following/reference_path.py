"""The path as the follower sees it: evenly spaced, without the steps of the planner's grid, measured by arc length."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid_geometry import legs_of

Pose = tuple[float, float, float]
"""x m, y m, yaw rad in map."""

_SPACING_M = 0.05
_BRAKING_M = 0.03  # from the speed at which corners are come to


@dataclass(frozen=True)
class Projection:
    """Where the robot is along the path: arc length `s`, signed distance `off_path` (left positive), metres."""

    s: float
    off_path: float


@dataclass(frozen=True)
class Stretch:
    """Part of a path that is driven straight, because there is no room to turn: arc lengths in metres, first point and heading in map.

    At a corner another begins where it ends (`leads_to_corner`), or it begins where another ends (`from_corner`): there the robot turns on
    the spot.
    """

    begin: float
    end: float
    begin_xy: tuple[float, float]
    heading: float
    from_corner: bool = False
    leads_to_corner: bool = False

    @property
    def over(self) -> float:
        """Arc length at which it is left: before a corner as much earlier as the brakes need."""
        return self.end - _BRAKING_M if self.leads_to_corner else self.end

    def point_at(self, s: float) -> NDArray[np.float64]:
        """(2,) point of its line at an arc length of the path, also beyond its ends."""
        along = s - self.begin
        return np.array(self.begin_xy) + along * np.array([math.cos(self.heading), math.sin(self.heading)])


class ReferencePath:
    """A polyline in the map's x-y plane with arc length; the planner's heights need no following: the ground has them."""

    def __init__(self, points: ArrayLike, smoothing_m: float, straight: Sequence[bool] = ()) -> None:
        """(K, 3) or (K, 2) finite points in map, K >= 1; `straight` (K,) or empty: whether from each to the next there is no room to turn.

        From the last point on, that is whether a passage begins there. ValueError otherwise.
        """
        given = np.asarray(points, dtype=np.float64)
        if given.ndim != 2 or len(given) == 0 or given.shape[1] not in (2, 3) or not np.isfinite(given).all():
            raise ValueError(f"a path is (K, 3) finite points with K >= 1, not {given!r}")
        if len(straight) not in (0, len(given)):
            raise ValueError(f"straight has one value for each of the {len(given)} points or none, not {len(straight)}")
        self.ends_at_passage = bool(len(straight)) and bool(straight[-1])
        even = _resampled(given[:, :2])
        legs = _legs(given[:, :2], straight)
        borders = _indices_of(legs, given[:, :2], len(even))
        self.xy = _smoothed(even, round(smoothing_m / _SPACING_M), borders)
        self._s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self.xy, axis=0), axis=1))])
        begins, ends = {first for first, _ in legs}, {last for _, last in legs}
        s = [float(self._s[int(np.argmin(np.linalg.norm(self.xy - even[k], axis=1)))]) for k in borders]
        self.stretches = [
            Stretch(s[i], s[i + 1], (float(a[0]), float(a[1])), math.atan2(b[1] - a[1], b[0] - a[0]), first in ends, last in begins)
            for i, (first, last) in zip(range(0, len(s), 2), legs, strict=True)
            for a, b in [given[[first, last]]]
        ]

    @property
    def length(self) -> float:
        """Arc length in metres."""
        return float(self._s[-1])

    @property
    def goal(self) -> NDArray[np.float64]:
        """(2,) last point in map."""
        goal: NDArray[np.float64] = self.xy[-1]
        return goal

    def project(self, xy: NDArray[np.float64], s_from: float, s_to: float) -> Projection:
        """The nearest place of the path between two arc lengths: a path that crosses itself on two levels needs the limits."""
        first = max(0, int(np.searchsorted(self._s, s_from, side="right")) - 1)
        last = max(first, min(len(self._s) - 1, int(np.searchsorted(self._s, s_to))))
        if first == last:
            return Projection(float(self._s[first]), float(np.linalg.norm(xy - self.xy[first])))
        a, b = self.xy[first:last], self.xy[first + 1 : last + 1]
        along, lengths = b - a, self._s[first + 1 : last + 1] - self._s[first:last]
        share = np.clip(((xy - a) * along).sum(axis=1) / lengths**2, 0.0, 1.0)
        distances = np.linalg.norm(a + share[:, None] * along - xy, axis=1)
        k = int(np.argmin(distances))
        side = along[k, 0] * (xy[1] - a[k, 1]) - along[k, 1] * (xy[0] - a[k, 0])
        return Projection(float(self._s[first + k] + share[k] * lengths[k]), math.copysign(float(distances[k]), side))

    def points_at(self, s: NDArray[np.float64]) -> NDArray[np.float64]:
        """(N, 2) points at arc lengths `s` (N,); beyond the end the path is taken to go on straight."""
        inside = np.column_stack([np.interp(s, self._s, self.xy[:, axis]) for axis in range(2)])
        beyond = np.maximum(0.0, s - self.length)
        return inside + beyond[:, None] * self._direction(self.length) if beyond.any() else inside

    def stretch_at(self, s: float, before_m: float, farthest: float = 0.0) -> Stretch | None:
        """The straight stretch that arc length `s` lies in, or at most `before_m` before; None when there is none.

        None either that was over at `farthest`, where the robot has been: it is not entered again when room for a turn is made behind.
        """
        within = (stretch for stretch in self.stretches if stretch.begin - before_m <= s < stretch.over)
        return next((stretch for stretch in within if farthest < stretch.over), None)

    def heading_at(self, s: float) -> float:
        """Direction of the path around arc length `s`, radians."""
        direction = self._direction(s)
        return math.atan2(direction[1], direction[0])

    def _direction(self, s: float) -> NDArray[np.float64]:
        a, b = self.points_at(np.array([max(0.0, min(s, self.length) - 0.15), min(self.length, s + 0.15)]))
        norm = max(float(np.linalg.norm(b - a)), 1e-9)
        direction: NDArray[np.float64] = (b - a) / norm
        return direction


def _resampled(xy: NDArray[np.float64]) -> NDArray[np.float64]:
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(xy, axis=0), axis=1))])
    if s[-1] < 1e-6:
        only: NDArray[np.float64] = xy[-1:]
        return only
    at = np.linspace(0.0, s[-1], max(2, math.ceil(s[-1] / _SPACING_M) + 1))
    return np.column_stack([np.interp(at, s, xy[:, axis]) for axis in range(2)])


def _legs(given: NDArray[np.float64], straight: Sequence[bool]) -> list[tuple[int, int]]:
    """Indices of the points where straight stretches begin and end."""
    flags = np.concatenate([[False], np.array(straight, dtype=bool)[:-1], [False]])
    changes = np.flatnonzero(np.diff(flags.astype(int))).reshape(-1, 2).tolist()
    return [(begin + i, begin + j) for begin, end in changes for i, j in legs_of(given[begin : end + 1])]


def _indices_of(legs: list[tuple[int, int]], given: NDArray[np.float64], count: int) -> list[int]:
    """Of the first and last given point of every leg, where they lie among `count` evenly spaced ones on the same way."""
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(given, axis=0), axis=1))])
    return [round(float(s[k] / s[-1]) * (count - 1)) for leg in legs for k in leg] if s[-1] > 0 else []


def _smoothed(xy: NDArray[np.float64], half_window: int, borders: list[int]) -> NDArray[np.float64]:
    """Mean over `half_window` points to each side, over fewer towards the ends and the borders, which stay where they are."""
    count = len(xy)
    index = np.arange(count)
    half = np.minimum(half_window, np.abs(index[:, None] - [0, *borders, count - 1]).min(axis=1))
    sums = np.concatenate([np.zeros((1, 2)), np.cumsum(xy, axis=0)])
    smooth: NDArray[np.float64] = (sums[index + half + 1] - sums[index - half]) / (2 * half + 1)[:, None]
    distinct = np.concatenate([[True], np.linalg.norm(np.diff(smooth, axis=0), axis=1) > 1e-9])
    thinned: NDArray[np.float64] = smooth[distinct]
    return thinned
