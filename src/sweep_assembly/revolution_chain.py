"""Revolutions of a spinning lidar, with joint samples and odometry, become filtered ones and the level scans of the obstacle layer.

Inputs come a message at a time, in order within a topic and in any order between topics; the outcome depends on the stamps only.
"""

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid_geometry import STAMP_TOLERANCE_S, StampedBuffer, as_transform, interpolate_transforms, inverse
from robot_body import RobotBody
from sweep_assembly.assembler import along_nodes
from sweep_assembly.geometry import FloatArray, TiltGeometry
from sweep_assembly.revolution import LidarConfig, Revolution, check_rate, counted_from_below, free_directions
from sweep_assembly.revolution_filter import RevolutionFilter
from sweep_assembly.scan_filter import ScanFilterConfig
from sweep_assembly.tilt_history import TiltHistory

BUFFER_S = 5.0
MOST_TICKS = 100
TURN_SLACK_S = 0.002  # by which a turn may begin before its stamp
LONGEST_TURNS = 1.05  # a motor's speed is not exact
POSES = 21  # of the laser in a revolution, and linear between: 1 rad/s bends a 2.5 m beam by 0.01 mm
FAR_M = 1000.0  # stands for beams that met nothing where their ends are moved
MOST_PITCH_RAD = 0.02  # of a mount at tilt 0: rings of one that is pitched meet the ground
LEVEL_BEAMS = 450  # of the level scan: fewer than a ring's, so that none stays empty when the robot turns


@dataclass(frozen=True, eq=False)
class FilteredRevolution:
    """What became of a revolution: the one with all that is left of it (None for a stamp at which none ended) and its level scan.

    `end_stamp_s` is the time of both; `level_ranges` (450,) float32 metres around `laser` as it stood then, from azimuth -pi on: inf
    beyond the short range, NaN where nothing is known, and everywhere while the mount was not level, or where it is fixed and pitched.
    """

    end_stamp_s: float
    revolution: Revolution | None
    level_ranges: NDArray[np.float32]


class RevolutionChain:
    """Waits for what belongs together, filters, and gives out in order."""

    def __init__(self, config: ScanFilterConfig, lidar: LidarConfig, mount: TiltGeometry, robot: RobotBody) -> None:
        """ValueError when a configuration is wrong."""
        self._filter = RevolutionFilter(config, lidar, mount, robot)
        self._config, self._lidar, self._mount = config, lidar, mount
        self._T_base_laser = mount.base_from_laser(0.0)[0]
        self._lies_level = self._T_base_laser[2, 2] >= math.cos(MOST_PITCH_RAD)
        self._ring = int(np.argmin(np.abs(lidar.elevations)))  # of two that are as near to level the lower one
        self.dropped: Counter[str] = Counter()
        self._reset()

    def _reset(self) -> None:
        self._tilts = TiltHistory()
        self._odometry: StampedBuffer[FloatArray] = StampedBuffer("odometry", BUFFER_S, self.dropped)
        self._waiting: StampedBuffer[Revolution] = StampedBuffer("revolution", BUFFER_S, self.dropped)
        self._ticks: list[float] = []
        self._last_end_s: float | None = None

    def add_joint(self, stamp_s: float, tilt_rad: float) -> None:
        """Takes the tilt at a time; ValueError when it is not finite."""
        self._tilts.add(stamp_s, tilt_rad)

    def add_odometry(self, stamp_s: float, T_odom_base: ArrayLike) -> None:
        """Takes the (4, 4) pose of base_link at a time; ValueError when it is none. What is late is dropped and counted."""
        pose = as_transform(T_odom_base)
        if self._odometry.takes(stamp_s, self._reset):
            self._odometry.append(stamp_s, pose)
            self._ticks = [*self._ticks[-MOST_TICKS:], stamp_s]

    def add_revolution(self, stamp_s: float, revolution: Revolution) -> None:
        """Takes a revolution as its driver stamps it, with its first beam or its last; ValueError when it is not one turn around the stamp.

        What is late is dropped and counted.
        """
        check_rate(revolution, self._lidar)
        stamp_s, turn = self._from_first_beam(stamp_s, counted_from_below(revolution, self._lidar))
        if self._waiting.takes(stamp_s, self._reset):
            self._waiting.append(stamp_s, turn)

    def _from_first_beam(self, stamp_s: float, revolution: Revolution) -> tuple[float, Revolution]:
        times_s, longest_s = revolution.times_s, LONGEST_TURNS * self._lidar.duration_s
        if not times_s.size or (times_s.min() > -TURN_SLACK_S and times_s.max() < longest_s):
            return stamp_s, revolution
        if np.ptp(times_s) < longest_s and abs(times_s.min()) < longest_s:
            first_s = float(times_s.min())
            return stamp_s + first_s, Revolution(revolution.points, revolution.rings, times_s - first_s)
        said = f"{times_s.min():.4f} to {times_s.max():.4f} s"
        raise ValueError(f"beams of a revolution are within one turn, {self._lidar.duration_s:.3f} s, of its stamp, not {said} after it")

    def poll(self) -> Iterator[FilteredRevolution]:
        """What is complete by now, oldest first; for each stamp of the odometry at which no revolution ended, that none did."""
        while True:
            yield from self._blanks()
            first = self._waiting.first()
            if first is None or not self._reaches(first[0] + self._lidar.duration_s):
                return
            self._waiting.drop_first()
            yield self._filtered(*first)

    def _blanks(self) -> Iterator[FilteredRevolution]:
        """Stamps that the next revolution cannot end at: it takes a whole turn."""
        while self._ticks and (self._last_end_s is None or self._ticks[0] < self._last_end_s + self._lidar.duration_s - 1e-3):
            stamp_s = self._ticks.pop(0)
            if self._last_end_s is None or stamp_s > self._last_end_s + 1e-3:
                yield FilteredRevolution(stamp_s, None, np.full(LEVEL_BEAMS, np.nan, np.float32))

    def _reaches(self, stamp_s: float) -> bool:
        odometry_s = self._odometry.last_stamp_s
        return self._tilts.reaches(stamp_s) and odometry_s is not None and odometry_s >= stamp_s - STAMP_TOLERANCE_S

    def _filtered(self, stamp_s: float, whole: Revolution) -> FilteredRevolution:
        self._last_end_s = stamp_s + self._lidar.duration_s
        tilts = self._tilts.at(stamp_s + whole.times_s)
        filtered = self._filter.filter(whole, tilts)
        level = self._lies_level and bool(np.all(np.abs(tilts) <= self._config.horizontal_tolerance_rad))  # False where a tilt is not known
        ranges = self._level_ranges(stamp_s, filtered) if level else np.full(LEVEL_BEAMS, np.nan, np.float32)
        self._odometry.forget_before(stamp_s)
        return FilteredRevolution(self._last_end_s, filtered, ranges)

    def _level_ranges(self, stamp_s: float, filtered: Revolution) -> NDArray[np.float32]:
        """The nearest return of the most level ring in each direction, as seen from where `laser` is at the revolution's end."""
        on_ring = filtered.rings == self._ring
        ring = filtered.kept(on_ring)
        points = ring.points.astype(np.float64)
        if ring.met_nothing.any():
            points[ring.met_nothing] = FAR_M * free_directions(filtered, self._lidar)[on_ring[filtered.met_nothing]]
        known = np.isfinite(points[:, 0])
        points = self._deskewed(stamp_s, points[known], ring.times_s[known])
        distances = np.hypot(points[:, 0], points[:, 1]).astype(np.float32)
        distances[distances > self._config.horizontal_max_range_m] = np.inf
        bins = np.floor((np.arctan2(points[:, 1], points[:, 0]) / (2.0 * math.pi) + 0.5) * LEVEL_BEAMS).astype(np.intp) % LEVEL_BEAMS
        ranges = np.full(LEVEL_BEAMS, np.nan, np.float32)
        np.fmin.at(ranges, bins, distances)
        return ranges

    def _deskewed(self, stamp_s: float, points_laser: FloatArray, times_s: FloatArray) -> FloatArray:
        """(N, 3) points, each measured at its own time, in `laser` as it stands at the revolution's end."""
        stamps, poses = self._odometry.stamps, np.stack(self._odometry.values)
        nodes = stamp_s + np.linspace(0.0, self._lidar.duration_s, POSES)
        T_odom_laser = interpolate_transforms(stamps, poses, np.clip(nodes, stamps[0], stamps[-1])) @ self._T_base_laser
        points, _ = along_nodes(nodes, inverse(T_odom_laser[-1]) @ T_odom_laser, stamp_s + times_s, points_laser)
        return np.asarray(points, np.float64)
