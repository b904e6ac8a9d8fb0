"""What was seen in a short time while the robot moved, de-skewed by odometry: points in base_link as it stood at the end."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import STAMP_TOLERANCE_S, interpolate_transforms, inverse
from scan_tracking.config import ScanTrackingConfig
from scan_tracking.local_map import thinned
from sweep_assembly import TiltGeometry
from sweep_assembly.assembler import along_nodes
from sweep_assembly.beams import FreeBeams, Sensor

Array = NDArray[np.float64]

NODE_SPACING_S = 0.005  # 3 rad/s bends a 12 m beam by 0.3 mm between two of them
_PER_POINT = 4  # beams that are moved for each point wanted: most of them share a cell
_NO_FREE_BEAMS = FreeBeams(1.0, 1 << 40)
_MOST_POINTS = 1500  # most points of a bundle


@dataclass(frozen=True, eq=False)
class Bundle:
    """(N, 3) points and where their beams started, in base_link at the bundle's end."""

    points: Array
    origins: Array

    def __len__(self) -> int:
        return len(self.points)


@dataclass(frozen=True, eq=False)
class Samples:
    """(M,) stamps with as many values around a bundle."""

    stamps_s: Array
    values: Array

    def pause_s(self, begin_s: float, end_s: float) -> float:
        """The longest time between two of them; infinite where they do not reach from `begin_s` to `end_s`."""
        if not len(self.stamps_s) or self.stamps_s[0] > begin_s + STAMP_TOLERANCE_S or self.stamps_s[-1] < end_s - STAMP_TOLERANCE_S:
            return math.inf
        return float(np.diff(self.stamps_s).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class Motion:
    """How base_link and the mount moved: odometry, (M, 4, 4) poses, and the mount's (M, 2) measured tilts and directions."""

    odometry: Samples
    tilts: Samples


class Bundler:
    """Makes bundles of the readings of one sensor on a tilting mount."""

    def __init__(self, config: ScanTrackingConfig, sensor: Sensor, mount: TiltGeometry) -> None:
        self._config, self._sensor, self._mount = config, sensor, mount

    def bundle(self, stamps_s: Array, readings: Sequence[object], span_s: tuple[float, float], motion: Motion) -> Bundle:
        """Of the readings that overlap a span of time; empty where the tilt is not known, or nothing was in range."""
        begin, end = max(span_s[0], motion.tilts.stamps_s[0]), min(span_s[1], motion.tilts.stamps_s[-1])
        if not len(readings) or end <= begin:
            return Bundle(np.zeros((0, 3)), np.zeros((0, 3)))
        beams = self._sensor.beams(stamps_s, readings, (begin, end), _NO_FREE_BEAMS)
        ranges = np.linalg.norm(beams.hits, axis=1)
        kept = np.flatnonzero((ranges > self._config.min_range_m) & (ranges < self._config.max_range_m))
        kept = kept[:: max(1, len(kept) // (_PER_POINT * _MOST_POINTS))]
        nodes = np.linspace(span_s[0], span_s[1], max(2, round((span_s[1] - span_s[0]) / NODE_SPACING_S) + 1))
        points, origins = along_nodes(nodes, self._laser_poses(nodes, motion), beams.times_s[kept], beams.hits[kept])
        chosen = thinned(points.astype(np.float64), self._config.cell_m, _MOST_POINTS)
        return Bundle(points[chosen].astype(np.float64), origins[chosen].astype(np.float64))

    def _laser_poses(self, nodes: Array, motion: Motion) -> Array:
        """(K, 4, 4) poses of the laser in base_link as it stands at the last of (K,) times."""
        T_odom_base = interpolate_transforms(motion.odometry.stamps_s, motion.odometry.values, nodes)
        tilts, directions = (np.interp(nodes, motion.tilts.stamps_s, values) for values in motion.tilts.values.T)
        return np.asarray(inverse(T_odom_base[-1]) @ T_odom_base @ self._mount.base_from_laser(tilts, directions))
