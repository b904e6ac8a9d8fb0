"""Whether the mount still is as it was calibrated: each sweep is a small calibration of its own, and is compared with the one in use."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from mount_calibration.config import MountCalibrationConfig
from mount_calibration.estimate import estimate_mount
from mount_calibration.geometry import TiltGeometry
from mount_calibration.tilt_calibration import PARAMETERS, FloatArray
from mount_calibration.tilted_beams import Place
from robot_body import RobotBody
from stage_config import check_ranges, parameter

_BACKLASH = PARAMETERS.index("backlash_rad")
_SIGMAS = 3.0  # a change beyond so many sigma, and beyond the tolerance, is one
_BEAMS = 30_000  # hits used of a sweep: half a second on a busy core
_ITERATIONS = 5  # most steps of the fit of one sweep


@dataclass(frozen=True)
class MountWatchConfig:
    """When a mount counts as moved."""

    sweeps: int = parameter(5, "-", "the newest sweeps that are put together", low=1, high=100)
    least_sweeps: int = parameter(2, "-", "fewer say nothing: one may be of a place where something moved", low=1, high=100)
    tolerance_rad: float = parameter(0.0009, "rad", "and beyond this: a calibration is asked to be as good", low=0.0, high=0.1)
    tolerance_scale: float = parameter(0.001, "-", "the same for the scale", low=0.0, high=0.1)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        found = check_ranges(self)
        if self.least_sweeps > self.sweeps:
            found.append(f"least_sweeps = {self.least_sweeps} is above sweeps = {self.sweeps}")
        return found


@dataclass(frozen=True)
class MountVerdict:
    """`moved`: None while the sweeps do not say. `text`: a sentence for /diagnostics. `sweeps`: how many of them count."""

    moved: bool | None
    text: str
    sweeps: int


class MountWatch:
    """Takes a place after each sweep, and says whether the mount has moved since it was calibrated."""

    def __init__(self, geometry: TiltGeometry, config: MountWatchConfig, fit: MountCalibrationConfig, robot: RobotBody) -> None:
        """ValueError when a configuration is wrong."""
        if problems := config.validate() + fit.validate():
            raise ValueError("; ".join(problems))
        self._geometry, self._config, self._robot = geometry, config, robot
        self._fit = replace(fit, most_beams=_BEAMS, iterations=_ITERATIONS)
        self._changes: list[tuple[FloatArray, FloatArray]] = []

    def after(self, place: Place | None) -> MountVerdict:
        """The verdict with this sweep; one that the robot moved in (None), or that saw no plane twice, adds nothing."""
        if place is not None:
            found = estimate_mount([place], self._geometry, self._fit, self._robot)
            if not found.reason:
                change = found.calibration.values - self._geometry.calibration.values
                self._changes = [*self._changes, (change, found.calibration.sigmas)][-self._config.sweeps :]
        return self._verdict()

    def backlash(self) -> float | None:
        """Radians of the mount's play, once the sweeps know it to the tolerance; None before.

        Alone of all parameters it is seen at every place, by what was measured on the way down and on the way up.
        """
        if not self._changes:
            return None
        change, sigma = (float(values[_BACKLASH]) for values in self._mean_change())
        known_rad = max(0.0, self._geometry.calibration.backlash_rad + change)
        return known_rad if _SIGMAS * sigma <= self._config.tolerance_rad else None

    def _verdict(self) -> MountVerdict:
        count, known = len(self._changes), self._geometry.calibration
        if count < self._config.least_sweeps:
            return MountVerdict(None, f"{count} of {self._config.least_sweeps} sweeps compared with the mount's calibration", count)
        change, sigma = self._mean_change()
        calibrated = np.where(known.measured, known.sigmas, 0.0)
        limits = np.array([self._config.tolerance_scale if name == "scale" else self._config.tolerance_rad for name in PARAMETERS])
        limits += _SIGMAS * np.hypot(sigma, calibrated)
        off = [_said(name, c, limit) for name, c, limit in zip(PARAMETERS, change, limits, strict=True) if abs(c) > limit]
        if not off:
            return MountVerdict(False, f"the mount is as calibrated, by {count} sweeps", count)
        what = "the mount has moved" if known.measured.any() else "the mount is not calibrated"
        return MountVerdict(True, f"{what}: {', '.join(off)}; run calibrate_mount", count)

    def _mean_change(self) -> tuple[FloatArray, FloatArray]:
        """(5,) mean of the sweeps' changes, each weighted by how sure it is, and (5,) sigma; 0 and inf for what none of them saw."""
        changes, sigmas = (np.array([one[i] for one in self._changes]) for i in (0, 1))
        weights = np.where(np.isfinite(sigmas), 1.0 / sigmas**2, 0.0)
        total = weights.sum(axis=0)
        mean = (weights * np.where(weights > 0.0, changes, 0.0)).sum(axis=0) / np.maximum(total, 1e-30)
        with np.errstate(divide="ignore"):
            return mean, np.where(total > 0.0, 1.0 / np.sqrt(total), np.inf)


def _said(name: str, change: float, limit: float) -> str:
    """A parameter's change and its limit in the unit that people use: percent for the scale, degrees for the rest."""
    if name == "scale":
        return f"scale by {100.0 * change:+.2f} % (limit {100.0 * limit:.2f})"
    return f"{name.removesuffix('_rad').replace('_', ' ')} by {math.degrees(change):+.2f} deg (limit {math.degrees(limit):.2f})"
