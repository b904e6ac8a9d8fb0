"""What one tick of the simulation delivers: plain, frozen records that a node turns into messages."""

import math
from dataclasses import dataclass, replace
from typing import TypeVar

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
class LidarGeometry:
    """Beams of the spinning lidar, a Velodyne VLP-16: ring 0 looks down the most; column c is fired c * column_s after the stamp."""

    columns: int
    rings: int = 16
    lowest_rad: float = math.radians(-15.0)
    highest_rad: float = math.radians(15.0)
    duration_s: float = 0.1

    @property
    def column_s(self) -> float:
        """Seconds from column to column."""
        return self.duration_s / self.columns

    @property
    def elevations(self) -> Array:
        """(rings,) angles above the plane of rotation in rad."""
        return np.linspace(self.lowest_rad, self.highest_rad, self.rings)

    def directions(self, columns: NDArray[np.int_]) -> Array:
        """(rings, C, 3) unit vectors of C columns in `laser`: clockwise seen from above, from straight behind."""
        azimuths = math.pi - 2.0 * math.pi * columns / self.columns
        flat, up = np.cos(self.elevations)[:, None], np.sin(self.elevations)[:, None]
        return np.stack(np.broadcast_arrays(flat * np.cos(azimuths), flat * np.sin(azimuths), up), axis=-1)


@dataclass(frozen=True)
class Revolution:
    """One turn of the spinning lidar, beam by beam: `stamp_s` is the time of the first, `times_s` (N,) float32 are seconds after it.

    `points` (N, 3) float32 in m in `laser`, NaN where the beam met nothing in range; beams whose echo came from too near are left
    out. `rings` (N,) uint16.
    """

    stamp_s: float
    points: NDArray[np.float32]
    rings: NDArray[np.uint16]
    times_s: NDArray[np.float32]


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
    """Forward speed (m/s) and turn rate (rad/s) from the encoders, mean over the 0.05 s before the stamp, by the drive's own kinematics."""

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
    """A link that touches what is not ground: the robot's speed there in m/s before it did, and normal force in N (strongest of the tick).

    `other` is the mover that it touches, empty for the world.
    """

    link: str
    speed_mps: float
    force_n: float
    other: str = ""


Sample = Scan | Revolution | JointSample | ImuSample | WheelOdometry
S = TypeVar("S", Scan, Revolution, JointSample, ImuSample, WheelOdometry)


@dataclass(frozen=True)
class Delivery:
    """A sample of the sensor that is heard on `topic`, and when its message comes."""

    time_s: float
    topic: str
    sample: Sample


@dataclass(frozen=True)
class TickData:
    """What came of the sensors in a tick of 0.05 s that ends at `stamp_s`, in the order in which it came, and the truth about the tick."""

    stamp_s: float
    deliveries: tuple[Delivery, ...]
    truth: Truth
    contacts: tuple[Contact, ...]
    sweeping: bool

    @property
    def scans(self) -> tuple[Scan, ...]:
        """Of the laser."""
        return self._of(Scan)

    @property
    def revolutions(self) -> tuple[Revolution, ...]:
        """Of the spinning lidar."""
        return self._of(Revolution)

    @property
    def joints(self) -> tuple[JointSample, ...]:
        """Of the joints' encoders."""
        return self._of(JointSample)

    @property
    def imu(self) -> tuple[ImuSample, ...]:
        """Of the IMU."""
        return self._of(ImuSample)

    @property
    def wheel_odometry(self) -> tuple[WheelOdometry, ...]:
        """Of the drive's controller."""
        return self._of(WheelOdometry)

    def _of(self, kind: type[S]) -> tuple[S, ...]:
        return tuple(d.sample for d in self.deliveries if isinstance(d.sample, kind))


def strongest(contacts: list[Contact]) -> tuple[Contact, ...]:
    """One contact of each link with the world and each mover, in the order of first touch: the fastest and the strongest of the tick."""
    best: dict[tuple[str, str], Contact] = {}
    for one in contacts:
        known = best.get((one.link, one.other), one)
        speed, force = max(known.speed_mps, one.speed_mps), max(known.force_n, one.force_n)
        best[one.link, one.other] = replace(one, speed_mps=speed, force_n=force)
    return tuple(best.values())
