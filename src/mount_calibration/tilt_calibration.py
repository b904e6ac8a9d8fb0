"""What was measured of a tilting mount: how its true tilt follows from the measured one, how it leans, and how sure that is.

true tilt = scale * measured + offset - direction * backlash / 2, direction +1 while the measured tilt rises and -1 while it falls.
The mount's own pose is turned by its roll and pitch: T_base_mount @ Rx(roll) @ Ry(pitch).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid_geometry import transform_from_rpy

FloatArray = NDArray[np.float64]

PARAMETERS = ("offset_rad", "scale", "backlash_rad", "mount_roll_rad", "mount_pitch_rad")
NOMINAL = (0.0, 1.0, 0.0, 0.0, 0.0)
_LOW = (-0.2, 0.9, -0.01, -0.2, -0.2)
_HIGH = (0.2, 1.1, 0.1, 0.2, 0.2)


def _unknown() -> FloatArray:
    return np.diag(np.full(len(PARAMETERS), np.inf))


@dataclass(frozen=True, eq=False)
class TiltCalibration:
    """The five parameters, radians but for `scale`, and their (5, 5) covariance in the order of `PARAMETERS`.

    A variance of inf says that the parameter was not measured: its value is the nominal one. The identity has measured none.
    """

    offset_rad: float = 0.0
    scale: float = 1.0
    backlash_rad: float = 0.0
    mount_roll_rad: float = 0.0
    mount_pitch_rad: float = 0.0
    covariance: FloatArray = field(default_factory=_unknown)

    @classmethod
    def of_values(cls, values: Iterable[float], covariance: FloatArray | None = None) -> TiltCalibration:
        """From five numbers in the order of `PARAMETERS`; without a covariance none of them counts as measured."""
        offset_rad, scale, backlash_rad, roll_rad, pitch_rad = (float(value) for value in values)
        return cls(offset_rad, scale, backlash_rad, roll_rad, pitch_rad, _unknown() if covariance is None else covariance)

    def validate(self) -> list[str]:
        """All violations, as sentences; empty when the calibration can be used."""
        found = [
            f"{name} = {value!r} is no finite number from {low} to {high}"
            for name, value, low, high in zip(PARAMETERS, self.values.tolist(), _LOW, _HIGH, strict=True)
            if not (math.isfinite(value) and low <= value <= high)
        ]
        covariance = np.asarray(self.covariance, dtype=np.float64)
        if covariance.shape != (len(PARAMETERS), len(PARAMETERS)) or np.isnan(covariance).any():
            return [*found, f"covariance is no ({len(PARAMETERS)}, {len(PARAMETERS)}) matrix of numbers"]
        known = covariance[np.ix_(self.measured, self.measured)]
        if not np.isfinite(known).all() or not np.allclose(known, known.T) or np.linalg.eigvalsh(known).min(initial=1.0) <= 0.0:
            found.append("covariance of what was measured is not finite, symmetric and positive definite")
        return found

    @property
    def values(self) -> FloatArray:
        """(5,) in the order of `PARAMETERS`."""
        return np.array([getattr(self, name) for name in PARAMETERS], dtype=np.float64)

    @property
    def sigmas(self) -> FloatArray:
        """(5,) standard deviations; inf for what was not measured."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def measured(self) -> NDArray[np.bool_]:
        """(5,) whether each parameter was measured."""
        return np.isfinite(np.diag(self.covariance))

    @property
    def is_nominal(self) -> bool:
        """Whether it changes nothing: no calibration."""
        return bool(np.array_equal(self.values, NOMINAL))

    @cached_property
    def T_mount_true(self) -> FloatArray:
        """(4, 4) turn of the mount from where the robot's description puts it."""
        return transform_from_rpy((0.0, 0.0, 0.0), (self.mount_roll_rad, 0.0, 0.0)) @ transform_from_rpy(
            (0.0, 0.0, 0.0), (0.0, self.mount_pitch_rad, 0.0)
        )

    def true_tilt(self, measured_rad: ArrayLike, direction: ArrayLike = 0.0) -> FloatArray:
        """True tilts of measured ones; `direction` from -1 to 1, 0 where it is not known (half of the backlash is lost then)."""
        half = 0.5 * self.backlash_rad
        return np.asarray(
            self.scale * np.asarray(measured_rad, dtype=np.float64) + self.offset_rad - half * np.asarray(direction, dtype=np.float64)
        )


class TiltDirection:
    """Which way the mount was moved last, as its play remembers it: +1 rising, -1 falling, between them while the play is crossed.

    The true tilt follows only where the play is used up, so that a mount at rest keeps the direction in which it came.
    """

    def __init__(self, backlash_rad: float) -> None:
        """0 until the mount has moved by half of `backlash_rad`; without backlash it stays 0."""
        self._half_rad, self._follower_rad = 0.5 * backlash_rad, math.nan

    def after(self, measured_rad: float) -> float:
        """The direction once the mount has moved to a measured tilt."""
        if self._half_rad <= 0.0:
            return 0.0
        if math.isnan(self._follower_rad):
            self._follower_rad = measured_rad
        self._follower_rad = min(max(self._follower_rad, measured_rad - self._half_rad), measured_rad + self._half_rad)
        return (measured_rad - self._follower_rad) / self._half_rad


def tilt_directions(measured_rad: FloatArray, backlash_rad: float) -> FloatArray:
    """(M,) `TiltDirection` after each of (M,) samples in the order of time."""
    direction = TiltDirection(backlash_rad)
    return np.array([direction.after(float(tilt)) for tilt in measured_rad], dtype=np.float64)
