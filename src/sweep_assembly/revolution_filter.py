"""First stage behind a spinning lidar: beams that tell nothing of the world are taken out, as `ScanFilter` does it for a laser.

Range limits, veiled points along each ring, and the robot's own body.
"""

import math

import numpy as np
from numpy.typing import NDArray

from robot_body import RobotBody
from sweep_assembly.geometry import FloatArray, TiltGeometry
from sweep_assembly.revolution import LidarConfig, Revolution, free_directions
from sweep_assembly.scan_filter import Mask, NeighbourLimits, ScanFilterConfig, body_reach, in_body, veiled_points

VEILING_STEP_RAD = math.radians(
    0.25
)  # angle and jump of veiling are set for beams so far apart: along one surface, ranges of wider ones differ more
MOST_WIDENED = 4.0
NEIGHBOURS_RAD = 0.05  # beams of a ring farther apart, because those between are missing, are no neighbours
DIRECTION_RAD = math.radians(1.0)  # beams of all rings that are fired while the lidar turns so far look the same way


class RevolutionFilter:
    """Filters of one lidar on one tilting mount; holds no state between revolutions."""

    def __init__(self, config: ScanFilterConfig, lidar: LidarConfig, mount: TiltGeometry, robot: RobotBody) -> None:
        """ValueError when a configuration is wrong."""
        problems = config.validate() + lidar.validate()
        if problems:
            raise ValueError("; ".join(problems))
        self._config, self._lidar, self._mount, self._robot = config, lidar, mount, robot
        self._body_reach_m = body_reach(robot, mount)

    def filter(self, revolution: Revolution, tilts_rad: FloatArray) -> Revolution:
        """The beams that ended on a surface, or met nothing; `tilts_rad` is (N,), NaN where the tilt is not known.

        Farther than `max_range_m` nothing was met. Beams that met nothing and point through the robot are left out: what swallowed
        them was its body, too near for an echo. So are those in whose direction no ring met anything: it may be too near as well.
        """
        limited = self._limited(revolution)
        ranges = _ranges(limited)
        dropped = (ranges < self._config.min_range_m) | self._veiled(limited, ranges) | self._on_body(limited, ranges, tilts_rad)
        dropped[limited.met_nothing] |= self._through_body(limited, tilts_rad)
        dropped |= limited.met_nothing & ~self._echo_beside(revolution, ~revolution.met_nothing & ~dropped)
        return limited.kept(~dropped)

    def _echo_beside(self, revolution: Revolution, echo: Mask) -> Mask:
        """(N,) whether one of the beams of the same direction, of any ring, has an `echo` (N,)."""
        turned = 2.0 * math.pi * self._lidar.rate_hz * revolution.times_s
        column = np.floor((turned - turned.min(initial=0.0)) / DIRECTION_RAD).astype(np.intp)
        return np.asarray(np.bincount(column, echo)[column] > 0.0)

    def _limited(self, revolution: Revolution) -> Revolution:
        points = revolution.points.copy()
        points[_ranges(revolution) > self._config.max_range_m] = np.nan
        return Revolution(points, revolution.rings, revolution.times_s)

    def _veiled(self, revolution: Revolution, ranges: NDArray[np.float32]) -> Mask:
        order = np.lexsort((revolution.times_s, revolution.rings))
        turned = 2.0 * math.pi * self._lidar.rate_hz * np.diff(revolution.times_s[order])
        apart = (np.diff(revolution.rings[order].astype(np.int64)) != 0) | (turned > NEIGHBOURS_RAD)
        veiled = np.zeros(len(ranges), dtype=np.bool_)
        veiled[order] = veiled_points(ranges[order], self._limits(turned, apart), self._config.veiling_max_points)
        return veiled

    def _limits(self, turned: FloatArray, apart: Mask) -> NeighbourLimits:
        """Limits for pairs of beams `turned` rad from each other; those `apart` are never suspect."""
        wider = np.clip(turned / VEILING_STEP_RAD, 1.0, MOST_WIDENED)
        columns = (np.sin(turned), np.cos(turned), np.tan(self._config.veiling_angle_rad * wider))
        jump_m = np.where(apart, np.inf, self._config.veiling_min_jump_m * wider)
        return NeighbourLimits(*(column.astype(np.float32) for column in (*columns, jump_m)))

    def _on_body(self, revolution: Revolution, ranges: NDArray[np.float32], tilts_rad: FloatArray) -> Mask:
        near = ranges < self._body_reach_m
        near[near] = in_body(self._mount.points_in_base(revolution.points[near].astype(np.float64), tilts_rad[near]), self._robot)
        return near

    def _through_body(self, revolution: Revolution, tilts_rad: FloatArray) -> Mask:
        """(M,) of the beams that met nothing: whether they leave the body's box through its bottom, or it is not known."""
        tilts = tilts_rad[revolution.met_nothing]
        ends = self._mount.points_in_base(free_directions(revolution, self._lidar), tilts)
        start = self._mount.points_in_base(np.zeros((tilts.size, 3)), tilts)
        low, high = np.array(self._robot.body_min_m), np.array(self._robot.body_max_m)
        with np.errstate(divide="ignore", invalid="ignore"):
            at = start + (ends - start) * ((low[2] - start[:, 2]) / (ends - start)[:, 2])[:, None]
        within = (at[:, :2] >= low[:2]).all(axis=1) & (at[:, :2] <= high[:2]).all(axis=1)
        return np.asarray((within & (ends[:, 2] < start[:, 2])) | ~np.isfinite(ends).all(axis=1))


def _ranges(revolution: Revolution) -> NDArray[np.float32]:
    """(N,) distances in metres; inf where nothing was met."""
    ranges: NDArray[np.float32] = np.linalg.norm(revolution.points, axis=1).astype(np.float32)
    ranges[revolution.met_nothing] = np.inf
    return ranges
