"""Whether an IMU's units and mounting are those that it claims: gravity tells of acceleration, the wheels of turning."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from stage_config import check_ranges, parameter

FloatArray = NDArray[np.float64]
_DEGREES = math.degrees(1.0)
_GRAVITY_MPS2 = 9.81  # anywhere on the Earth it is so within 0.03, far nearer than a right IMU may be off


@dataclass(frozen=True)
class ImuLimits:
    """How far a right IMU may be from gravity and wheels."""

    gravity_off_mps2: float = parameter(
        1.0, "m/s^2", "the mean specific force may differ from gravity by this: ten times the bias of a cheap IMU", low=0.1, high=3.0
    )
    most_lean_rad: float = parameter(
        0.785, "rad", "the robot may lean by this; an axis that is mounted wrong leans by 1.57", low=0.3, high=1.2
    )
    judged_s: float = parameter(1.0, "s", "time over which gravity is judged, before and while an IMU is refused", low=0.1, high=10.0)
    frozen_rad: float = parameter(
        0.2, "rad", "turning of the wheels during which a right IMU's sample changes: noise alone changes it", low=0.05, high=10.0
    )
    turned_rad: float = parameter(1.0, "rad", "turning of the wheels by which the unit of the rates is judged", low=0.2, high=10.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)


def gravity_fault(force_base: FloatArray, frame: str, limits: ImuLimits) -> str | None:
    """What a mean specific force (3,), turned into base_link as `frame` is mounted, says against the IMU; None when it is gravity.

    The text is one line with its advice.
    """
    strength = float(np.linalg.norm(force_base))
    lean = math.acos(min(max(float(force_base[2]) / strength, -1.0), 1.0)) if strength > 0.0 else 0.0
    if abs(strength - _GRAVITY_MPS2) <= limits.gravity_off_mps2:
        return _mounting_fault(force_base / strength, lean, frame) if lean > limits.most_lean_rad else None
    felt = f"the IMU feels {strength:.2f} m/s^2, gravity is {_GRAVITY_MPS2:.2f}"
    share = limits.gravity_off_mps2 / _GRAVITY_MPS2
    if abs(strength - 1.0) <= share:
        return f"{felt}: it is in g; let the driver publish m/s^2 (REP 145)"
    if abs(strength / 1000.0 - 1.0) <= share:
        return f"{felt}: it is in milli-g; let the driver publish m/s^2 (REP 145)"
    if strength < 0.5:
        return f"{felt}: the driver has removed gravity; remap /imu/data to its raw topic, /imu/data_raw for example"
    return f"{felt}: a wrong scale or range; see the driver's settings"


def _mounting_fault(up: FloatArray, lean: float, frame: str) -> str:
    axis = int(np.argmax(np.abs(up)))
    way = f"{'-' if up[axis] < 0 else '+'}{'xyz'[axis]}"
    what = "is upside down" if lean > math.pi - 0.6 else f"leans by {math.degrees(lean):.0f} deg"
    return f"the IMU {what}: as {frame} is mounted, gravity says that up is {way} of base_link; correct the mount in the URDF"


def turning_fault(ratio: float) -> str | None:
    """What it says against the IMU that its yaw rate is so many times that of the wheels; None when both turn alike.

    A skid steer turns less than its wheels, and wheels that spin turn nothing, so all from 0 to 1 is right. A fault is what is nearer
    to -1 than to 0, and what is nearer to the 57 of degrees than to 1, as a factor.
    """
    if ratio < -0.5:
        return f"the IMU turns {-ratio:.1f} times as fast as the wheels, the other way round: see the IMU's mount, and the wheels' sign"
    if ratio > math.sqrt(_DEGREES):
        return f"the IMU turns {ratio:.0f} times as fast as the wheels: its rates are in deg/s; let the driver publish rad/s (REP 103)"
    return None
