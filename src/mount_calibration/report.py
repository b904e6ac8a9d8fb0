"""What a calibration found, as a table for people."""

from __future__ import annotations

import math

import numpy as np

from mount_calibration.estimate import MountEstimate
from mount_calibration.tilt_calibration import PARAMETERS

NAMES = ("tilt offset", "tilt scale", "backlash", "mount roll", "mount pitch")
WHY_NOT = {
    "offset_rad": "the ground is not level and even enough here; turn the robot on the spot between sweeps",
    "scale": "too little is seen twice, in front of the laser and over its back",
    "backlash_rad": "too few hits while the mount rose, or while it fell",
    "mount_roll_rad": "as the tilt offset",
    "mount_pitch_rad": "turns about the same axis as the tilt offset, which holds both",
}


def estimate_table(found: MountEstimate) -> str:
    """A line a parameter, with its sigma or why there is none; then how thick planes were and are."""
    if found.reason:
        return f"no calibration: {found.reason}"
    values, sigmas = found.calibration.values, found.calibration.sigmas
    lines = [_line(*row) for row in zip(PARAMETERS, NAMES, values.tolist(), sigmas.tolist(), strict=True)]
    lines.append(f"planes {found.planes}, hits off them by {1000 * found.before_m:.1f} mm before and {1000 * found.after_m:.1f} mm after")
    return "\n".join(lines)


def _line(parameter: str, name: str, value: float, sigma: float) -> str:
    if not np.isfinite(sigma):
        return f"{name:<12} not observable: {WHY_NOT[parameter]}"
    if parameter == "scale":
        return f"{name:<12} {100 * (value - 1):+8.3f} %    sigma {100 * sigma:.3f}"
    return f"{name:<12} {math.degrees(value):+8.3f} deg  sigma {math.degrees(sigma):.3f}"
