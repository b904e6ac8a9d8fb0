"""Where the beams of a scan point, when they start, and how the tilting mount carries them to base_link."""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import as_transform

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class ScanGeometry:
    """The layout of a scan's beams, as in sensor_msgs/LaserScan; ValueError when it is none.

    Beam i points along (cos a, sin a, 0) in `laser` with a = angle_min + i * angle_increment (rad), and is fired
    i * time_increment seconds after the scan's stamp.
    """

    angle_min: float
    angle_increment: float
    time_increment: float
    count: int

    def __post_init__(self) -> None:
        if not math.isfinite(self.angle_min) or not 0.0 < abs(self.angle_increment) < math.pi:
            raise ValueError(f"angles of a scan are finite, its increment is not zero: {self.angle_min}, {self.angle_increment} rad")
        if not (math.isfinite(self.time_increment) and self.time_increment >= 0.0):
            raise ValueError(f"the time from beam to beam is zero or more seconds, not {self.time_increment}")
        if self.count < 2:
            raise ValueError(f"a scan has at least two beams, not {self.count}")

    @property
    def duration_s(self) -> float:
        """Seconds from the first beam to the last one."""
        return self.time_increment * (self.count - 1)

    @cached_property
    def beam_times(self) -> FloatArray:
        """(count,) seconds from the scan's stamp to each beam."""
        return np.arange(self.count, dtype=np.float64) * self.time_increment

    @property
    def directions(self) -> FloatArray:
        """(count, 3) unit vectors of the beams in `laser`."""
        return _directions(self.angle_min, self.angle_increment, self.count)


@lru_cache(maxsize=8)
def _directions(angle_min: float, angle_increment: float, count: int) -> FloatArray:
    angles = angle_min + angle_increment * np.arange(count)
    directions = np.stack([np.cos(angles), np.sin(angles), np.zeros(count)], axis=1)
    directions.setflags(write=False)  # all scans of this layout share it
    return directions


@dataclass(frozen=True, eq=False)
class TiltGeometry:
    """A mount that tilts about its y axis: T_base_laser(tilt) = T_base_mount @ Ry(tilt) @ T_tilt_laser, nose down positive.

    Both transforms are (4, 4); ValueError when one is not rigid.
    """

    T_base_mount: FloatArray
    T_tilt_laser: FloatArray

    def __post_init__(self) -> None:
        object.__setattr__(self, "T_base_mount", as_transform(self.T_base_mount))
        object.__setattr__(self, "T_tilt_laser", as_transform(self.T_tilt_laser))

    def base_from_laser(self, tilt_rad: FloatArray | float) -> FloatArray:
        """(K, 4, 4) transforms T_base_laser at the (K,) or scalar tilts."""
        tilt = np.atleast_1d(np.asarray(tilt_rad, dtype=np.float64))
        turn: FloatArray = np.tile(np.eye(4), (tilt.size, 1, 1))
        turn[:, 0, 0] = turn[:, 2, 2] = np.cos(tilt)
        turn[:, 0, 2] = np.sin(tilt)
        turn[:, 2, 0] = -turn[:, 0, 2]
        return np.asarray(self.T_base_mount @ turn @ self.T_tilt_laser)

    def points_in_base(self, points_laser: FloatArray, tilts_rad: FloatArray) -> FloatArray:
        """(N, 3) points of `laser` in base_link, each at its own of (N,) tilts; NaN where the tilt is not known."""
        x, y, z = (points_laser @ self.T_tilt_laser[:3, :3].T + self.T_tilt_laser[:3, 3]).T
        cosine, sine = np.cos(tilts_rad), np.sin(tilts_rad)
        turned = np.column_stack([cosine * x + sine * z, y, cosine * z - sine * x])
        return np.asarray(turned @ self.T_base_mount[:3, :3].T + self.T_base_mount[:3, 3])
