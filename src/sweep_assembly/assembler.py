"""Scans, or a lidar's revolutions, of one sweep, with joint samples and odometry, become one de-skewed cloud in base_link.

Thesis 5.3, figure 5.6.

Inputs come a message at a time, in order within a topic and in any order between topics. The sweep depends on the stamps
only: it is given out when everything up to its end is there.
"""

import math
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import ArrayLike, NDArray

from mount_calibration import Place, TiltDirection, TiltedBeams, steady_directions
from rigid_geometry import (
    STAMP_TOLERANCE_S,
    StampedBuffer,
    as_transform,
    interpolate_transforms,
    inverse,
    rotation_angle,
    translation_distance,
)
from sweep_assembly.assembly_config import SweepAssemblyConfig
from sweep_assembly.beams import Beams, FreeBeams, Sensor
from sweep_assembly.geometry import FloatArray, TiltGeometry
from sweep_assembly.stray_points import stray_points
from sweep_assembly.sweep_window import NodWindowDetector, SweepWindow, SweepWindowDetector, TravelWindowDetector

_MOST_BREAKS = 2000  # in the longest sweep: one a sample of the odometry
NODE_SPACING_S = 0.002  # the laser's pose is exact at nodes and linear between them: 3 rad/s bends a 30 m beam by 0.1 mm
_STANDING_M = 0.01  # odometry may differ by so much over a sweep of a robot that stands
_STANDING_RAD = 0.005  # and may turn by so much


@dataclass(frozen=True, eq=False)
class Sweep:
    """One de-skewed cloud, in base_link as it stood at `stamp_s`.

    `stamp_s`, `start_stamp_s`: the ends of its `SweepWindow`.
    `points`: (N, 3) float32 metres, in the order in which they were measured. `origins`: (N, 3) float32, where the laser was
    for each of them. `free_ends`, `free_origins`: (M, 3) float32, the same for a thinned part of the beams that met nothing, cut at
    `free_range_m`: what lies along them was seen to be free.
    `missing`: share of the readings that are not among them; NaN where a reading does not tell when the next one comes.
    `place`: the same hits as the mount's calibration takes them; None when the robot moved meanwhile, or the mount went one way only.
    """

    stamp_s: float
    start_stamp_s: float
    points: NDArray[np.float32]
    origins: NDArray[np.float32]
    free_ends: NDArray[np.float32]
    free_origins: NDArray[np.float32]
    place: Place | None = None
    missing: float = math.nan


class SweepAssembler:
    """Collects joints, odometry and scans, and gives out each sweep once."""

    def __init__(self, config: SweepAssemblyConfig, sensor: Sensor, tilt_geometry: TiltGeometry) -> None:
        """For a sensor on a tilting mount; ValueError when the configuration is wrong."""
        problems = config.validate()
        if problems:
            raise ValueError("; ".join(problems))
        self._config = config
        self._sensor = sensor
        self._longest_s = 0.0  # that a reading took so far
        self._breaks_s: deque[float] = deque(maxlen=_MOST_BREAKS)
        self._tilt_geometry = tilt_geometry
        self._dropped: Counter[str] = Counter()
        self._reset()

    @property
    def dropped(self) -> dict[str, int]:
        """How many messages, scans and sweeps were given up, by reason."""
        return dict(self._dropped)

    def set_backlash(self, backlash_rad: float) -> None:
        """The mount's play from now on; not while it sweeps. ValueError when it can be none."""
        self._tilt_geometry = self._tilt_geometry.with_backlash(backlash_rad)
        self._direction = TiltDirection(backlash_rad)

    def add_joint(self, stamp_s: float, tilt_rad: float) -> None:
        """Takes the tilt at a time. What is not finite, late or repeated is dropped and counted."""
        if not np.isfinite([stamp_s, tilt_rad]).all():
            self._dropped["joint_not_finite"] += 1
        elif self._joints.takes(stamp_s, self._reset):
            self._joints.append(stamp_s, (tilt_rad, self._direction.after(tilt_rad)))
            if not isinstance(self._detector, TravelWindowDetector):
                self._ends_with(self._detector.add(stamp_s, tilt_rad))

    def add_odometry(self, stamp_s: float, T_odom_base: ArrayLike) -> None:
        """Takes the (4, 4) pose of base_link at a time. What is not finite, not rigid, late or repeated is dropped and counted."""
        try:
            pose = as_transform(T_odom_base)
        except ValueError:
            self._dropped["odometry_not_rigid"] += 1
            return
        if not np.isfinite(stamp_s):
            self._dropped["odometry_not_finite"] += 1
        elif self._odometry.takes(stamp_s, self._reset):
            self._odometry.append(stamp_s, pose)
            if isinstance(self._detector, TravelWindowDetector):
                self._ends_with(self._detector.add(stamp_s, pose))

    def break_at(self, stamp_s: float) -> None:
        """How the robot came to where it is at a time cannot be told: sweeps over that are given up."""
        self._breaks_s.append(stamp_s)
        for window in [window for window in self._pending if self._is_torn(window)]:
            self._pending.remove(window)
            self._dropped["sweep_torn"] += 1

    def _is_torn(self, window: SweepWindow) -> bool:
        return any(window.start_stamp_s < at <= window.end_stamp_s for at in self._breaks_s)

    def _ends_with(self, window: SweepWindow | None) -> None:
        if window and self._is_torn(window):
            self._dropped["sweep_torn"] += 1
        elif window:
            self._pending.append(window)
        self._trim()

    def add_scan(self, stamp_s: float, filtered: object) -> None:
        """Takes a filtered reading, of a laser a `Scan`, with the stamp of the first beam; only what was hit becomes points.

        ValueError for one of another sensor. What is late or repeated is dropped and counted.
        """
        reading = self._sensor.checked(filtered)
        if not np.isfinite(stamp_s):
            self._dropped["scan_not_finite"] += 1
        elif self._scans.takes(stamp_s, self._reset):
            self._scans.append(stamp_s, reading)
            self._longest_s = max(self._longest_s, self._sensor.duration_of(reading))

    def poll(self) -> Sweep | None:
        """The oldest sweep that is complete and was not given out yet. Call until it returns None."""
        while self._pending and self._complete(self._pending[0]):
            window = self._pending.pop(0)
            sweep = self._assemble(window)
            self._trim()
            if sweep is not None:
                return sweep
            self._dropped["sweep_empty"] += 1
        return None

    def _reset(self) -> None:
        config = self._config
        self._joints: StampedBuffer[tuple[float, float]] = StampedBuffer("joint", config.buffer_s, self._dropped)
        self._odometry: StampedBuffer[FloatArray] = StampedBuffer("odometry", config.buffer_s, self._dropped)
        self._scans: StampedBuffer[Any] = StampedBuffer("scan", config.buffer_s, self._dropped)
        self._direction = TiltDirection(self._tilt_geometry.calibration.backlash_rad)
        self._detector = _detector(config, self._dropped)
        self._pending: list[SweepWindow] = []

    def _complete(self, window: SweepWindow) -> bool:
        """Whether nothing of the sweep can be missing any more."""
        end = window.end_stamp_s - STAMP_TOLERANCE_S
        odometry, scan = self._odometry.last_stamp_s, self._scans.last_stamp_s
        return odometry is not None and odometry >= end and scan is not None and self._sensor.known_until(scan) >= end

    def _trim(self) -> None:
        needed_from = self._pending[0].start_stamp_s if self._pending else self._detector.needed_from_s
        if needed_from is None:
            return
        self._joints.forget_before(needed_from)
        self._odometry.forget_before(needed_from)
        self._scans.forget_before(needed_from - self._longest_s)

    def _assemble(self, window: SweepWindow) -> Sweep | None:
        stamps, scans = self._usable_scans(window)
        if stamps.size == 0:
            return None
        free = FreeBeams(self._config.free_range_m, self._config.free_beam_stride)
        beams = self._sensor.beams(stamps, scans, (window.start_stamp_s, window.end_stamp_s), free)
        if beams.times_s.size == 0:
            return None
        trajectory = self._laser_poses(window)
        points, origins = self._without_strays(*along_nodes(*trajectory, beams.times_s, beams.hits))
        if not len(points):
            return None
        free_ends, free_origins = along_nodes(*trajectory, beams.free_times_s, beams.free_ends)
        whole = (window.end_stamp_s, window.start_stamp_s, points, origins, free_ends, free_origins)
        return Sweep(*whole, self._place(window, beams), self._missing(window, stamps, scans))

    def _without_strays(self, points: NDArray[np.float32], origins: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        config = self._config
        ranges = np.linalg.norm(points - origins, axis=1).astype(np.float64)
        radius_m = np.maximum(config.stray_radius_m, config.stray_radius_ratio * ranges)
        kept = ~stray_points(points, radius_m, config.stray_neighbours)
        return points[kept], origins[kept]

    def _usable_scans(self, window: SweepWindow) -> tuple[FloatArray, list[Any]]:
        """Scans that overlap the window, less those with too long a pause of joints or odometry around them."""
        stamps, scans = self._scans.between(window.start_stamp_s - self._longest_s, window.end_stamp_s)
        ends = stamps + [self._sensor.duration_of(scan) for scan in scans]
        blind = _overlaps_gap(stamps, ends, self._joints.stamps, self._config.max_joint_gap_s, window)
        lost = _overlaps_gap(stamps, ends, self._odometry.stamps, self._config.max_odometry_gap_s, window) & ~blind
        self._count("scan_without_joints", blind)
        self._count("scan_without_odometry", lost)
        usable = ~(blind | lost)
        return stamps[usable], [scan for scan, good in zip(scans, usable, strict=True) if good]

    def _missing(self, window: SweepWindow, stamps: FloatArray, scans: list[Any]) -> float:
        period_s = min(self._sensor.period_of(scan) for scan in scans)
        begun = np.count_nonzero((stamps >= window.start_stamp_s) & (stamps < window.end_stamp_s))
        due = (window.end_stamp_s - window.start_stamp_s) / period_s if period_s > 0.0 else math.nan
        return max(0.0, 1.0 - float(begun) / due) if math.isfinite(due) else math.nan

    def _count(self, reason: str, mask: NDArray[np.bool_]) -> None:
        if mask.any():
            self._dropped[reason] += int(mask.sum())

    def _laser_poses(self, window: SweepWindow) -> tuple[FloatArray, FloatArray]:
        """(K,) node times and (K, 4, 4) poses of the laser in base_link at the end: every input stamp is a node, and enough between."""
        joint_stamps, odometry_stamps = self._joints.stamps, self._odometry.stamps
        start = max(window.start_stamp_s, odometry_stamps[0])
        end = min(window.end_stamp_s, odometry_stamps[-1])
        regular = np.linspace(start, end, int(np.ceil((end - start) / NODE_SPACING_S)) + 1)
        nodes = np.unique(np.concatenate([regular, joint_stamps, odometry_stamps]))
        nodes = nodes[(nodes >= start) & (nodes <= end)]
        T_odom_base = interpolate_transforms(odometry_stamps, np.stack(self._odometry.values), nodes)
        tilts, directions = (np.interp(nodes, joint_stamps, values) for values in np.array(self._joints.values).T)
        return nodes, inverse(T_odom_base[-1]) @ T_odom_base @ self._tilt_geometry.base_from_laser(tilts, directions)

    def _place(self, window: SweepWindow, beams: Beams) -> Place | None:
        _, poses = self._odometry.between(window.start_stamp_s, window.end_stamp_s)
        stood = all(
            translation_distance(T, poses[-1]) <= _STANDING_M and rotation_angle(inverse(poses[-1]) @ T) <= _STANDING_RAD for T in poses
        )
        if not (poses and stood and window.from_rest):
            return None
        joint_stamps, tilts = self._joints.stamps, np.array(self._joints.values)[:, 0]
        directions = steady_directions(joint_stamps, tilts, beams.times_s)
        at_beams = np.interp(beams.times_s, joint_stamps, tilts)
        return Place(TiltedBeams(beams.hits.astype(np.float32), at_beams, directions), poses[-1])


def _detector(config: SweepAssemblyConfig, dropped: Counter[str]) -> SweepWindowDetector | NodWindowDetector | TravelWindowDetector:
    if config.windows == "travelled":
        return TravelWindowDetector(config.travelled_m, config.travelled_rad, config.travelled_s)
    rest = SweepWindowDetector(config.horizontal_tolerance_rad, config.still_rate_rad_s, config.max_duration_s, dropped)
    return rest if config.windows == "rest" else NodWindowDetector(rest, config.whole_sweep_rad, config.least_nod_rad)


def _overlaps_gap(starts: FloatArray, ends: FloatArray, stamps: FloatArray, max_gap_s: float, window: SweepWindow) -> NDArray[np.bool_]:
    """(S,) whether each scan overlaps a stretch of the window in which `stamps` pause for longer than allowed or do not reach."""
    found = np.zeros(starts.shape, dtype=np.bool_)
    pauses = np.flatnonzero(np.diff(stamps) > max_gap_s)
    gaps: Sequence[tuple[float, float]] = [(stamps[i], stamps[i + 1]) for i in pauses]
    outside = [(-np.inf, stamps[0]), (stamps[-1], np.inf)]
    for low, high in [*gaps, *outside]:
        low, high = max(low, window.start_stamp_s), min(high, window.end_stamp_s)
        if high > low:
            found |= (starts < high) & (ends > low)
    return found


@njit(cache=True)
def along_nodes(
    nodes: FloatArray, T_base_laser: FloatArray, times: FloatArray, laser_points: FloatArray
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """(N, 3) float32 points and origins of (N, 3) points in `laser`, with the laser's pose linear in time between the nodes."""
    points, origins = np.empty((times.size, 3), np.float32), np.empty((times.size, 3), np.float32)
    last = nodes.size - 1
    for n in range(times.size):
        i = min(max(np.searchsorted(nodes, times[n], side="right") - 1, 0), max(last - 1, 0))
        j = min(i + 1, last)
        f = min(max((times[n] - nodes[i]) / (nodes[j] - nodes[i]), 0.0), 1.0) if j > i else 0.0
        for axis in range(3):
            a, b = T_base_laser[i, axis], T_base_laser[j, axis]
            origin = a[3] + f * (b[3] - a[3])
            x, y, z = a[0] + f * (b[0] - a[0]), a[1] + f * (b[1] - a[1]), a[2] + f * (b[2] - a[2])
            points[n, axis] = laser_points[n, 0] * x + laser_points[n, 1] * y + laser_points[n, 2] * z + origin
            origins[n, axis] = origin
    return points, origins


def compile_kernels() -> None:
    """Compiles the kernel for the types that a sweep passes."""
    along_nodes(np.arange(2.0), np.tile(np.eye(4), (2, 1, 1)), np.zeros(1), np.zeros((1, 3)))
