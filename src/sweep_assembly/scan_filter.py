"""First stage behind the laser: readings that are no surface of the world become NaN (thesis 5.3, first paragraph).

Range limits, veiled points between a near edge and what lies behind it, and the robot's own body. Of horizontal scans it
also makes the short-range ones that the obstacle layer of the costmap reads while driving.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from robot_body import RobotBody
from stage_config import check_below, check_ranges, parameter
from sweep_assembly.geometry import FloatArray, ScanGeometry, TiltGeometry
from sweep_assembly.scan import Ranges, Scan

Mask = NDArray[np.bool_]
NOTHING_IN_RANGE_M = 1e6  # stands for +inf where differences of ranges are taken


@dataclass(frozen=True)
class ScanFilterConfig:
    """What counts as a valid reading of the laser."""

    min_range_m: float = parameter(0.15, "m", "nearer readings are invalid", low=0.0)
    max_range_m: float = parameter(30.0, "m", "farther readings mean that nothing is in range", low=0.5)
    veiling_angle_rad: float = parameter(
        0.10, "rad", "a pair of neighbouring points is suspect when their line is this near to the beam", low=0.0, high=0.8
    )
    veiling_min_jump_m: float = parameter(0.15, "m", "and their ranges differ by this much, several times the range noise", low=0.0)
    veiling_max_points: int = parameter(
        3, "-", "suspect points in a row that are veiled; more are a surface at a low angle", low=0, high=50
    )
    horizontal_max_range_m: float = parameter(2.5, "m", "range of the horizontal scans for the obstacle layer", low=0.2)
    horizontal_tolerance_rad: float = parameter(0.01, "rad", "tilt up to which a scan counts as horizontal", low=0.0, high=0.2)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self) + check_below(self, "min_range_m", "max_range_m")


@dataclass(frozen=True, eq=False)
class NeighbourLimits:
    """What makes two neighbouring beams suspect, (n - 1,) float32 each, or one value for all pairs.

    Sine and cosine of the angle between them, tangent of the angle to the beam up to which their line is suspect, least difference of
    ranges in metres.
    """

    sine: Ranges | np.float32
    cosine: Ranges | np.float32
    steepness: Ranges | np.float32
    jump_m: Ranges | np.float32


class ScanFilter:
    """Filters of a laser on a tilting mount; holds no state between scans, which may differ in layout and limits."""

    def __init__(self, config: ScanFilterConfig, tilt_geometry: TiltGeometry, robot: RobotBody) -> None:
        """ValueError when the configuration is wrong."""
        problems = config.validate()
        if problems:
            raise ValueError("; ".join(problems))
        self._config, self._robot, self._mount = config, robot, tilt_geometry
        self._body_reach_m = body_reach(robot, tilt_geometry)

    def filter(self, scan: Scan, tilt_at_beam: ArrayLike) -> Ranges:
        """(n,) float32 ranges in metres with NaN where the reading is no surface, +inf where nothing is in range (REP 117).

        `tilt_at_beam` is the tilt in radians, (n,) or a scalar. Where it is NaN the robot's body cannot be told from obstacles, so
        readings near enough to be the body become NaN. ValueError on another number of tilts.
        """
        limited = self._limited(scan)
        veiled = veiled_points(limited, self._limits(scan.geometry), self._config.veiling_max_points)
        body = self._on_body(scan.geometry, limited, _tilts(scan, tilt_at_beam))
        limited[veiled] = np.nan
        limited[body] = np.nan
        return limited

    def horizontal(self, filtered: Scan, tilt: ArrayLike) -> Scan:
        """The scan for the obstacle layer: all NaN unless the laser is horizontal, +inf beyond the short range.

        `filtered` has the ranges that `filter` returned; `tilt` (n,) or a scalar in radians. ValueError on another number of tilts.
        """
        tilts, reach_m = _tilts(filtered, tilt), min(self._config.horizontal_max_range_m, filtered.range_max_m)
        ranges = filtered.ranges.copy()
        if bool(np.all(np.abs(tilts) <= self._config.horizontal_tolerance_rad)):
            ranges[ranges > reach_m] = np.inf
        else:
            ranges[:] = np.nan
        return Scan(filtered.geometry, ranges, min(filtered.range_min_m, 0.5 * reach_m), reach_m, filtered.period_s)

    def _limited(self, scan: Scan) -> Ranges:
        ranges = scan.readings()
        ranges[ranges > self._config.max_range_m] = np.inf
        ranges[ranges < self._config.min_range_m] = np.nan
        return ranges

    def _limits(self, geometry: ScanGeometry) -> NeighbourLimits:
        increment = abs(geometry.angle_increment)
        return NeighbourLimits(
            np.float32(math.sin(increment)),
            np.float32(math.cos(increment)),
            np.float32(math.tan(self._config.veiling_angle_rad)),
            np.float32(self._config.veiling_min_jump_m),
        )

    def _on_body(self, geometry: ScanGeometry, ranges: Ranges, tilts: FloatArray) -> NDArray[np.intp]:
        """Indices of readings inside the body's box; only those in reach of the box are moved to base_link."""
        near = np.flatnonzero(ranges < self._body_reach_m)
        if near.size == 0:
            return near
        tilt = tilts[near] if tilts.ndim else np.broadcast_to(tilts, near.shape)
        points = self._mount.points_in_base(ranges[near, None] * geometry.directions[near], tilt)
        return near[in_body(points, self._robot)]


def _tilts(scan: Scan, tilt: ArrayLike) -> FloatArray:
    tilts = np.asarray(tilt, dtype=np.float64)
    if tilts.shape not in ((), (scan.geometry.count,)):
        raise ValueError(f"tilt is a scalar or one value a beam ({scan.geometry.count},), not {tilts.shape}")
    return tilts


def in_body(points_base: FloatArray, robot: RobotBody) -> Mask:
    """(N,) whether (N, 3) points lie in the own body's box, or it is not known where they lie."""
    outside = (points_base < robot.body_min_m) | (points_base > robot.body_max_m)
    return np.asarray(~outside.any(axis=1))  # NaN is on no side, hence not outside


def body_reach(robot: RobotBody, tilt_geometry: TiltGeometry) -> np.float32:
    """Range in metres beyond which no reading is of the own body, whatever the tilt."""
    corners = np.array(list(itertools.product(*zip(robot.body_min_m, robot.body_max_m, strict=True))))
    from_mount = np.linalg.norm(corners - tilt_geometry.T_base_mount[:3, 3], axis=1).max()
    return np.float32(from_mount + np.linalg.norm(tilt_geometry.T_tilt_laser[:3, 3]))


def veiled_points(ranges: Ranges, limits: NeighbourLimits, max_points: int) -> Mask:
    """(n,) points that hang between a near edge and the background.

    The angle at the farther point between its beam and the line to its neighbour is laser_filters' test for shadows. Taken alone
    it also removes every wall and floor seen at a low angle; those give long rows of suspect pairs, veiling short ones.
    """
    signs = _suspect_steps(ranges, limits)
    inner = (signs[1:] == signs[:-1]) & (signs[1:] != 0)
    veiled = np.zeros(ranges.shape, dtype=np.bool_)
    if inner.any():
        rows = np.concatenate([[0], np.cumsum(signs[1:] != signs[:-1])])
        row_lengths = np.bincount(rows)[rows[1:]]
        veiled[1:-1] = inner & (row_lengths <= max_points + 1)
    return veiled


def _suspect_steps(ranges: Ranges, limits: NeighbourLimits) -> NDArray[np.int8]:
    """(n - 1,) for every pair of neighbours: 0, or +1 / -1 when it steps away / nearer nearly along the beam."""
    finite = np.minimum(ranges, np.float32(NOTHING_IN_RANGE_M))
    first, second = finite[:-1], finite[1:]
    near, far = np.minimum(first, second), np.maximum(first, second)
    with np.errstate(invalid="ignore"):  # a NaN of whatever bits is near nothing
        along_beam = near * limits.sine < limits.steepness * (far - near * limits.cosine)
        suspect = along_beam & (far - near > limits.jump_m)
    return np.where(suspect, np.where(second > first, np.int8(1), np.int8(-1)), np.int8(0))
