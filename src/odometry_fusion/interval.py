"""What the IMU measured between two instants: the unit in which the filter works."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import StampedBuffer

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ImuInterval:
    """IMU over (start, end], the end at `end_stamp_s`.

    `rates` (K, 3) rad/s, means over consecutive stretches of `durations` (K,) s; `mean_rate` (3,) rad/s over all; `mean_accel`
    (3,) m/s^2 of the samples inside, None when there are none; `longest_gap_s` between samples.
    """

    end_stamp_s: float
    rates: FloatArray
    durations: FloatArray
    mean_rate: FloatArray
    mean_accel: FloatArray | None
    longest_gap_s: float

    @property
    def duration_s(self) -> float:
        """Length of the interval in seconds."""
        return float(self.durations.sum())


def imu_interval(imu: StampedBuffer[list[float]], start_s: float, end_s: float) -> ImuInterval:
    """The interval (start_s, end_s]; samples are rows of gyro x, y, z, accel x, y, z, and rates linear between them."""
    stamps, samples = imu.around(start_s, end_s)
    rows = np.array(samples, dtype=np.float64)
    inside = (stamps > start_s) & (stamps <= end_s)
    knots = np.concatenate([[start_s], stamps[inside & (stamps < end_s)], [end_s]])
    at_knots = np.column_stack([np.interp(knots, stamps, rows[:, axis]) for axis in range(3)])
    rates, durations = 0.5 * (at_knots[:-1] + at_knots[1:]), np.diff(knots)
    return ImuInterval(
        end_stamp_s=end_s,
        rates=rates,
        durations=durations,
        mean_rate=durations @ rates / (end_s - start_s),
        mean_accel=rows[inside, 3:].mean(axis=0) if inside.any() else None,
        longest_gap_s=float(np.diff(stamps, prepend=min(start_s, stamps[0])).max()),
    )
