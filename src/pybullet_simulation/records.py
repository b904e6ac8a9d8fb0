"""What one tick of the simulation delivers: plain, frozen records that a node turns into messages."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ScanGeometry:
    """Angles, times and limits of the laser, a Hokuyo UTM-30LX; beam i points along angle_min + i * angle_increment in `laser`."""

    angle_min: float = math.radians(-135.0)
    angle_max: float = math.radians(135.0)
    angle_increment: float = math.radians(0.25)
    beams: int = 1081
    scan_time: float = 0.025
    time_increment: float = 0.025 / 1440
    range_min: float = 0.1
    range_max: float = 30.0

    @property
    def angles(self) -> Array:
        """(beams,) angles in rad."""
        return np.linspace(self.angle_min, self.angle_max, self.beams)


@dataclass(frozen=True)
class Scan:
    """One turn of the laser: `stamp_s` is the time of its first beam.

    `ranges` (1081,) float32 in m, by REP 117: inf where nothing was in range, -inf where it was too near.
    """

    stamp_s: float
    ranges: NDArray[np.float32]


@dataclass(frozen=True)
class JointSample:
    """Measured joint positions (rad) and velocities (rad/s), tilt joint first, then the four wheels."""

    stamp_s: float
    names: tuple[str, ...]
    positions: tuple[float, ...]
    velocities: tuple[float, ...]


@dataclass(frozen=True)
class ImuSample:
    """Angular velocity `gyro` (3,) in rad/s and specific force `accel` (3,) in m/s^2 (+9.81 on z at rest), in `imu_link`."""

    stamp_s: float
    gyro: Array
    accel: Array


@dataclass(frozen=True)
class WheelOdometry:
    """Forward speed (m/s) and turn rate (rad/s) from the encoders, mean over the tick, by the drive's own kinematics."""

    stamp_s: float
    v: float
    w: float


@dataclass(frozen=True)
class Truth:
    """Where the robot really is: pose of base_link in the world, linear (3,) m/s and angular (3,) rad/s velocity in base_link."""

    stamp_s: float
    T_world_base: Array
    linear: Array
    angular: Array


@dataclass(frozen=True)
class Contact:
    """A link that touches what is not ground: speed of the link in m/s when it did, and normal force in N (strongest of the tick)."""

    link: str
    speed_mps: float
    force_n: float


@dataclass(frozen=True)
class TickData:
    """All that the sensors measured during one tick of 0.05 s that ends at `stamp_s`, and the truth about it."""

    stamp_s: float
    scans: tuple[Scan, ...]
    joints: tuple[JointSample, ...]
    imu: tuple[ImuSample, ...]
    wheel_odometry: WheelOdometry
    truth: Truth
    contacts: tuple[Contact, ...]
    sweeping: bool
