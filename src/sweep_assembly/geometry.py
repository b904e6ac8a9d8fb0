"""Where the beams of a scan point, and when they start; how the mount carries them to base_link is `TiltGeometry`'s."""

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from mount_calibration import TiltGeometry

__all__ = ["FloatArray", "ScanGeometry", "TiltGeometry"]

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
