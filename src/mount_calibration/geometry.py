"""How the tilting mount carries the laser: the one place where a measured tilt becomes a pose in base_link."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from mount_calibration.tilt_calibration import FloatArray, TiltCalibration
from rigid_geometry import as_transform


@dataclass(frozen=True, eq=False)
class TiltGeometry:
    """A mount that tilts about its y axis: T_base_laser = T_base_mount @ T_mount_true @ Ry(true tilt) @ T_tilt_laser, nose down positive.

    Both transforms are (4, 4) and as the robot's description says; ValueError when one is not rigid. The calibration says how the mount
    differs: all tilts that come in are measured ones, with the direction (-1 to 1) in which the mount was moved, 0 where it is not known.
    """

    T_base_mount: FloatArray
    T_tilt_laser: FloatArray
    calibration: TiltCalibration = field(default_factory=TiltCalibration)

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_base_mount", as_transform(self.T_base_mount))
        object.__setattr__(self, "T_tilt_laser", as_transform(self.T_tilt_laser))
        if problems := self.calibration.validate():
            raise ValueError("; ".join(problems))

    def with_backlash(self, backlash_rad: float) -> TiltGeometry:
        """The same mount with another play."""
        return replace(self, calibration=replace(self.calibration, backlash_rad=backlash_rad))

    def base_from_laser(self, tilt_rad: ArrayLike, direction: ArrayLike = 0.0) -> FloatArray:
        """(K, 4, 4) transforms T_base_laser at the (K,) or scalar measured tilts."""
        tilt = np.atleast_1d(self.calibration.true_tilt(tilt_rad, direction))
        turn: FloatArray = np.tile(np.eye(4), (tilt.size, 1, 1))
        turn[:, 0, 0] = turn[:, 2, 2] = np.cos(tilt)
        turn[:, 0, 2] = np.sin(tilt)
        turn[:, 2, 0] = -turn[:, 0, 2]
        return np.asarray(self._T_base_true @ turn @ self.T_tilt_laser)

    def points_in_base(self, points_laser: FloatArray, tilts_rad: FloatArray, direction: ArrayLike = 0.0) -> FloatArray:
        """(N, 3) points of `laser` in base_link, each at its own of (N,) measured tilts; NaN where the tilt is not known."""
        turned = self.turned(points_laser, tilts_rad, direction)
        return np.asarray(turned @ self._T_base_true[:3, :3].T + self._T_base_true[:3, 3])

    def turned(self, points_laser: FloatArray, tilts_rad: FloatArray, direction: ArrayLike = 0.0) -> FloatArray:
        """(N, 3) points of `laser` in the mount's frame, after the tilt."""
        x, y, z = (points_laser @ self.T_tilt_laser[:3, :3].T + self.T_tilt_laser[:3, 3]).T
        tilts = self.calibration.true_tilt(tilts_rad, direction)
        cosine, sine = np.cos(tilts), np.sin(tilts)
        return np.column_stack([cosine * x + sine * z, y, cosine * z - sine * x])

    @property
    def _T_base_true(self) -> FloatArray:
        return np.asarray(self.T_base_mount @ self.calibration.T_mount_true)
