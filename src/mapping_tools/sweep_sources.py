"""What is mapped: one sweep after the other, in base_link, with what odometry and gravity say of it. Bags and folders both give these."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid_geometry import FAR_M, LeapWatch, transform_points

Array = NDArray[np.float64]
Singles = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class SourceSweep:
    """A sweep under the name that messages call it by.

    points, origins (N, 3) float32 in base_link; T_odom_base (4, 4), gravity_base (3,) with its sigma, and `free`, the ends and origins of
    beams that met nothing: None where nothing is known; lost: nobody knows the way since the sweep before.
    """

    name: str
    stamp_s: float
    points: Singles
    origins: Singles
    T_odom_base: Array | None = None
    gravity_base: Array | None = None
    gravity_sigma_rad: float | None = None
    free: tuple[Singles, Singles] | None = None
    lost: bool = False


@dataclass(frozen=True)
class Unreadable:
    """A sweep that was found and could not be read or joined with odometry."""

    name: str
    stamp_s: float | None
    reason: str


@dataclass(frozen=True, eq=False)
class Mount:
    """Where clouds were measured: T_base_cloud (4, 4) takes them to base_link; sensor (3,): where beams start, in the cloud's frame."""

    T_base_cloud: Array
    sensor: Array

    def placed(self, points: ArrayLike, origins: ArrayLike | None) -> tuple[Singles, Singles]:
        """Finite points and origins in base_link, float32 as a session keeps them.

        ValueError when no point is finite, or when they lie too far from base_link to be told apart in float32.
        """
        points = np.asarray(points, dtype=np.float64)
        starts = np.broadcast_to(self.sensor, points.shape) if origins is None else np.asarray(origins, dtype=np.float64)
        finite = np.isfinite(points).all(axis=1) & np.isfinite(starts).all(axis=1)
        if not finite.any():
            raise ValueError(f"none of its {len(points)} points is finite")
        placed = [np.asarray(transform_points(self.T_base_cloud, rows[finite]), dtype=np.float64) for rows in (points, starts)]
        away = float(np.abs(np.median(placed[0], axis=0)).max())
        if away > FAR_M:
            raise ValueError(f"its points lie {away:,.0f} m from base_link: give clouds in the sensor's frame, and its pose as odometry")
        return placed[0].astype(np.float32), placed[1].astype(np.float32)


class UnknownWays:
    """Where in time an odometry knew nothing of its way, as its covariance tells."""

    def __init__(self) -> None:
        self._leaps, self._unknown_s = LeapWatch(), list[float]()

    def add(self, stamp_s: float, covariance: Array) -> bool:
        """Takes the covariance (36,) of a pose's position and rotation; whether nothing is known of the way to this stamp."""
        if leapt := self._leaps.leapt(float(covariance[0]), float(covariance[7])):
            self._unknown_s.append(stamp_s)
        return leapt

    def until(self, stamp_s: float) -> bool:
        """Whether there was one since the stamp that was asked for before."""
        later = [at for at in self._unknown_s if at > stamp_s]
        is_lost, self._unknown_s = len(later) < len(self._unknown_s), later
        return is_lost


class LeftOut:
    """Messages that could not be used: how many of each topic, and why the last of them."""

    def __init__(self) -> None:
        self._counts, self._why = Counter[str](), dict[str, str]()

    def add(self, topic: str, error: ValueError) -> None:
        """Counts one of a topic."""
        self._counts[topic] += 1
        self._why[topic] = " ".join(str(error).split())

    @property
    def notes(self) -> list[str]:
        """A line a topic."""
        return [f"{count} messages of {topic} left out, the last one: {self._why[topic]}" for topic, count in self._counts.items()]


class StoppedError(Exception):
    """Somebody asked a source to stop."""


def never() -> bool:
    """For who does not stop."""
    return False


class SweepSource(Protocol):
    """A recording that is read once."""

    @property
    def problem(self) -> str | None:
        """Why it ended early; None when it is whole."""
        ...

    @property
    def progress(self) -> float:
        """Share of it that has been read, 0 to 1."""
        ...

    @property
    def notes(self) -> Sequence[str]:
        """What of it was left out and is no sweep, a line each."""
        ...

    def sweeps(self, is_stopping: Callable[[], bool] = never) -> Iterator[SourceSweep | Unreadable]:
        """In order. ValueError when this is not a recording that can be mapped: nothing of it fits.

        `is_stopping` is asked before every message or file: StoppedError when it says so.
        """
        ...
