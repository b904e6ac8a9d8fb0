"""What the terrain analysis is told, in metres, and the same in voxels of one resolution."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from robot_body import RobotBody
from stage_config import check_ranges, parameter

_SIDE_COLUMNS = 2  # unknown columns beside what stands that count as a side of it, which beams passed by


@dataclass(frozen=True)
class TerrainConfig:
    """How carefully the map is read; what the robot can do stands in `robot_body.RobotBody`."""

    clearance_margin_m: float = parameter(0.10, "m", "room wanted above the robot", low=0.0, high=2.0)
    range_noise_m: float = parameter(0.01, "m", "sigma of a range: from the laser's data sheet", low=0.0, high=0.2)
    pose_noise_m: float = parameter(0.004, "m", "sigma of a sweep's place in the map", low=0.0, high=0.2)
    confidence: float = parameter(2.0, "-", "sigmas by which a slope or a step must be within the robot's limits", low=0.0, high=6.0)
    slope_tolerance_rad: float = parameter(
        0.009,
        "rad",
        "by which a plane as large as the robot may be steeper than its limit: a ramp of that limit is driven",
        low=0.0,
        high=0.1,
    )
    step_tolerance_m: float = parameter(
        0.012,
        "m",
        "by which a step, with its sigmas, may be higher than the robot's limit: a kerb of that limit is climbed",
        low=0.0,
        high=0.05,
    )
    margin_m: float = parameter(0.025, "m", "kept from what is blocked, a drop or too steep, beside the robot's radius", low=0.0, high=0.5)
    fill_columns: int = parameter(3, "voxels", "widest unknown gap in a floor that counts as floor, if wheels roll over it", low=0, high=8)
    look_m: float = parameter(0.8, "m", "how far beyond an edge a drop is looked for", low=0.08, high=3.0)
    cliff_evidence: str = parameter(
        "seen", "-", "a cliff is a drop that was seen; assumed: any edge that was looked across (thesis 7.3)", choices=("seen", "assumed")
    )
    step_heights: str = parameter("measured", "-", "heights by where beams ended, or by voxels alone", choices=("measured", "voxels"))
    inflation_shape: str = parameter("circle", "-", "exact distance, or the square cuboid of the thesis", choices=("circle", "square"))
    min_ground_voxels: int = parameter(50, "voxels", "a start voxel with less ground around it is discarded", low=1, high=100000)
    soft_clearance_m: float = parameter(0.5, "m", "width of the strip beyond the inflation that costs more", low=0.0, high=3.0)
    soft_clearance_weight: float = parameter(2.0, "-", "extra cost a metre at the inner edge of that strip", low=0.0, high=50.0)
    unknown_margin_m: float = parameter(
        0.56, "m", "width of the strip beside unknown floor where driving costs much more", low=0.0, high=3.0
    )
    unknown_weight: float = parameter(
        15.0, "-", "factor of the cost there, where an edge may be a cliff, and near a step that may be too high", low=1.0, high=1000.0
    )
    kerb_rise_m: float = parameter(
        0.045, "m", "rise from one column to the next that a turning wheel would scrape along", low=0.0, high=0.5
    )
    kerb_weight: float = parameter(
        3.0, "-", "factor of the cost within the turning radius of such a rise: kerbs are driven over, not along", low=1.0, high=1000.0
    )

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)


class Limits(NamedTuple):
    """Configuration and robot in voxels of one resolution, as the kernels take them.

    `step` and `clearance` count whole voxels; `max_step` and the
    tangents `max_slope` and `max_plane_slope` are the robot's, the first and last with their tolerance; `noise` is the
    sigma of one hit; `keep_off` the distance of the robot's middle from what is blocked, a drop or too steep. `fill` is the
    widest gap in a floor that is filled, in columns, and `strip` the widest between the lines on a wall.
    """

    resolution: float
    step: int
    clearance: int
    max_step: float
    max_slope: float
    max_plane_slope: float
    noise: float
    pose_noise: float
    confidence: float
    fill: int
    strip: int
    side: int
    look: int
    keep_off: float
    assumes_cliffs: bool
    is_square: bool

    @classmethod
    def of(cls, config: TerrainConfig, robot: RobotBody, resolution: float) -> "Limits":
        """For maps of this resolution in metres."""
        is_square = config.inflation_shape == "square"
        keep_off = (robot.turning_radius_m + config.margin_m + config.confidence * config.pose_noise_m) / resolution
        return cls(
            resolution=resolution,
            step=max(1, math.ceil(robot.max_step_m / resolution - 1e-9)),
            clearance=math.ceil((robot.height_m + config.clearance_margin_m) / resolution - 1e-9),
            max_step=(robot.max_step_m + config.step_tolerance_m) / resolution,
            max_slope=math.tan(robot.max_slope_rad),
            max_plane_slope=math.tan(robot.max_slope_rad + config.slope_tolerance_rad),
            noise=config.range_noise_m / resolution,
            pose_noise=config.pose_noise_m / resolution,
            confidence=config.confidence,
            fill=min(config.fill_columns, int(robot.rolled_over_m / resolution + 1e-9)),
            strip=config.fill_columns,
            side=_SIDE_COLUMNS,
            look=max(1, round(config.look_m / resolution)),
            keep_off=float(math.floor(robot.turning_radius_m / resolution + 1e-9)) if is_square else keep_off,
            assumes_cliffs=config.cliff_evidence == "assumed",
            is_square=is_square,
        )

    @property
    def margin(self) -> int:
        """Columns around every node of the flood that the analysis may look at."""
        return max(self.look, math.ceil(self.keep_off), 4) + 8
