"""Whether a spinning lidar turns and looks as config/lidar.yaml says: beams without an echo are placed by that file."""

import math

import numpy as np
from numpy.typing import NDArray

from sensor_checks.rows import Level, Row, judged

FloatArray = NDArray[np.float64]
_TURN_OFF = 0.05  # as a share: a motor's speed is not exact
_RING_OFF_RAD = math.radians(1.0)  # two voxels of 0.1 m, ten metres away


def lidar_rows(
    topic: str, stamps_s: FloatArray, beams: tuple[FloatArray, NDArray[np.integer]], elevations: FloatArray, rate_hz: float
) -> list[Row]:
    """Turns a second by the stamps of its clouds, and the angles of its rings; no row of what cannot be told.

    `beams`: (N, 3) points in the laser's frame, NaN for no echo, and their (N,) rings. `elevations` (rings,) in rad and `rate_hz`: as
    the file has them.
    """
    return _turns(topic, stamps_s, rate_hz) + _rings(topic, *beams, elevations)


def _turns(topic: str, stamps_s: FloatArray, rate_hz: float) -> list[Row]:
    steps = np.diff(np.unique(stamps_s))
    if not len(steps):
        return []
    found_hz = 1.0 / float(np.median(steps))
    advice = f"free beams would point elsewhere: set rate_hz to {found_hz:.1f} in config/lidar.yaml, or the driver to {rate_hz:g} Hz"
    found = f"{found_hz:.1f} a second, config/lidar.yaml has {rate_hz:g}"
    return [judged(topic, "turns", found, (abs(found_hz / rate_hz - 1.0) > _TURN_OFF, Level.ERROR, advice))]


def _rings(topic: str, points: FloatArray, rings: NDArray[np.integer], elevations: FloatArray) -> list[Row]:
    ranges = np.linalg.norm(points, axis=1)
    hits = np.isfinite(ranges) & (ranges > 0.0)
    if not hits.any():
        return []
    heights, ring = np.arcsin(points[hits, 2] / ranges[hits]), rings[hits]
    numbers = np.unique(ring)
    angles = np.array([np.median(heights[ring == number]) for number in numbers])
    least, most = np.degrees(angles.min()), np.degrees(angles.max())
    low, high = np.degrees(elevations[[0, -1]])
    found = f"{len(numbers)} rings from {least:.1f} to {most:.1f} deg; config/lidar.yaml has {len(elevations)} from {low:.1f} to {high:.1f}"
    off = _off(numbers, angles, elevations)
    said = f"rings are up to {np.degrees(off.max()):.1f} deg from where that file puts free beams"
    return [
        judged(
            topic,
            "rings",
            found,
            (rings.max() >= len(elevations), Level.ERROR, f"set rings to {rings.max() + 1}, and lowest_rad and highest_rad"),
            (max(off[0], off[-1]) > _RING_OFF_RAD, Level.ERROR, f"{said}: set rings, lowest_rad and highest_rad"),
            (off.max() > _RING_OFF_RAD, Level.WARN, f"{said}, for they are not evenly spaced; floor and obstacles are where they are"),
        )
    ]


def _off(numbers: NDArray[np.integer], angles: FloatArray, elevations: FloatArray) -> FloatArray:
    """(N,) differences between rings and their angles in rad, counted from below or from above as it fits better."""
    if numbers.max() >= len(elevations):
        return np.full(len(numbers), math.inf)
    below, above = (np.abs(angles - counted[numbers]) for counted in (elevations, elevations[::-1]))
    return np.asarray(below if below.max() <= above.max() else above)
