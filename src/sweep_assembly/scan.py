"""One scan of a 2-D laser with what its message says of it: layout and limits may differ from scan to scan."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sweep_assembly.geometry import ScanGeometry

Ranges = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Scan:
    """(n,) float32 ranges in metres with their layout, and the limits between which they are readings, as in sensor_msgs/LaserScan.

    `period_s`: from scan to scan, 0 where it is not told. ValueError when the number of ranges or the limits make no sense.
    """

    geometry: ScanGeometry
    ranges: Ranges
    range_min_m: float = 0.0
    range_max_m: float = np.inf
    period_s: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "ranges", np.asarray(self.ranges, dtype=np.float32))
        if self.ranges.shape != (self.geometry.count,):
            raise ValueError(f"a scan of {self.geometry.count} beams has as many ranges, not {self.ranges.shape}")
        if not self.range_min_m < self.range_max_m:
            raise ValueError(
                f"scan whose range_min {self.range_min_m} m is not below its range_max {self.range_max_m} m: nothing lies between"
            )

    def readings(self) -> Ranges:
        """A copy of the ranges: +inf from `range_max_m` on, where drivers put what met nothing, NaN below `range_min_m` (REP 117)."""
        ranges = self.ranges.copy()
        ranges[ranges >= np.float32(self.range_max_m)] = np.inf
        ranges[ranges < np.float32(self.range_min_m)] = np.nan
        return ranges
