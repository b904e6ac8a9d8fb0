"""What the terrain analysis is told, in metres, and the same in voxels of one resolution."""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

from stage_config import check_ranges, parameter

_TREADS_ERR_M = 0.002  # of a step between two flat treads: means of a dozen surfaces each, of 1 mm

_INCLINED = 0.8  # of the steepest slope: measured ground that inclines less over two hands' breadths is gentle, whatever one alone does
_STEEP_MARGIN = 1.225  # voxels before the middle of measured ground that is too steep
_CLOSE_ERR_RAD = 0.0075  # of the slope of a hand's breadth
_PLANE_ERR_RAD = 0.003  # of the slope of a measured plane as large as the robot


@dataclass(frozen=True)
class TerrainConfig:
    """What the robot can drive on and how carefully the map is read."""

    robot_height_m: float = parameter(1.0, "m", "height of the robot above the ground", low=0.1, high=5.0)
    clearance_margin_m: float = parameter(0.10, "m", "room wanted above the robot", low=0.0, high=2.0)
    base_height_m: float = parameter(0.132, "m", "height of base_link above the ground", low=0.0, high=2.0)
    max_step_m: float = parameter(0.10, "m", "highest step the robot climbs", low=0.01, high=0.5)
    step_heights: str = parameter(
        "measured",
        "-",
        "steps by where beams ended in the voxels, where that is known; voxels: by the voxels alone",
        choices=("measured", "voxels"),
    )
    step_margin_m: float = parameter(0.01, "m", "how much lower than the highest step a measured one must be", low=0.0, high=0.2)
    max_slope_rad: float = parameter(math.radians(25.0), "rad", "steepest slope the robot drives", low=0.05, high=0.8)
    slope_margin_rad: float = parameter(
        math.radians(1.0),
        "rad",
        "how much gentler than the steepest slope one that is fitted to measured heights must be",
        low=0.0,
        high=0.2,
    )
    slope_radius_m: float = parameter(0.16, "m", "ground around a voxel that its slope is fitted to", low=0.1, high=1.0)
    voxel_slope_radius_m: float = parameter(
        0.35, "m", "the same where no heights are measured: slopes are stairs then, and look steeper over a short way", low=0.1, high=1.0
    )
    hole_bridge_voxels: int = parameter(3, "voxels", "widest unknown gap in a level floor that counts as floor", low=0, high=8)
    cliff_look_m: float = parameter(0.8, "m", "how far beyond an edge a drop is looked for", low=0.08, high=3.0)
    cliff_evidence: str = parameter(
        "seen", "-", "a cliff is a drop that was seen; assumed: any edge that was looked across (thesis 7.3)", choices=("seen", "assumed")
    )
    cliff_area_voxels: int = parameter(2, "voxels", "half width of the areas of the cliff check (thesis figure 5.12)", low=0, high=6)
    inflation_radius_m: float = parameter(0.60, "m", "distance kept from obstacles by the robot's centre", low=0.0, high=3.0)
    cliff_inflation_radius_m: float = parameter(0.60, "m", "distance kept from cliffs by the robot's centre", low=0.0, high=3.0)
    hit_margin_m: float = parameter(
        0.012, "m", "kept from obstacles beside their radius where it is measured where they were hit: beams err", low=0.0, high=0.5
    )
    cliff_margin_m: float = parameter(0.025, "m", "the same from cliffs: floor is hit more sparsely than what stands", low=0.0, high=0.5)
    hit_noise_m: float = parameter(
        0.01, "m", "scatter of beams around where they end, not part of what they met: noise of the laser and of poses", low=0.0, high=0.5
    )
    narrow_radius_m: float = parameter(
        0.385,
        "m",
        "distance of a passage's middle line from obstacles, where there is no room to turn and the robot drives straight through; "
        "inflation_radius_m or more: never",
        low=0.0,
        high=3.0,
    )
    narrow_cliff_radius_m: float = parameter(
        0.40, "m", "the same from cliffs, too steep ground and unseen floor; as much as cliff_inflation_radius_m: never", low=0.0, high=3.0
    )
    narrow_width_m: float = parameter(0.67, "m", "width of the robot: so wide a passage must be known ground all along", low=0.1, high=5.0)
    narrow_length_m: float = parameter(6.0, "m", "longest way without room to turn", low=0.0, high=20.0)
    run_up_m: float = parameter(0.5, "m", "way in line with a passage, over ground with room to turn, at both ends", low=0.0, high=5.0)
    longest_run_up_m: float = parameter(0.8, "m", "the same where there is more room", low=0.0, high=5.0)
    inflation_shape: str = parameter("circle", "-", "exact distance, or the square cuboid of the thesis", choices=("circle", "square"))
    start_search_radius_m: float = parameter(0.5, "m", "where around the robot the start voxel is looked for", low=0.05, high=2.0)
    start_height_tolerance_m: float = parameter(0.30, "m", "how far the start voxel may lie off the wheels' plane", low=0.05, high=2.0)
    min_traversable_voxels: int = parameter(50, "voxels", "a start voxel with less ground around it is discarded", low=1, high=100000)
    soft_clearance_m: float = parameter(0.5, "m", "width of the strip beyond the inflation that costs more", low=0.0, high=3.0)
    soft_clearance_weight: float = parameter(2.0, "-", "extra cost a metre at the inner edge of that strip", low=0.0, high=50.0)

    unknown_margin_m: float = parameter(
        0.56, "m", "width of the strip beside unknown floor where driving costs much more", low=0.0, high=3.0
    )
    unknown_weight: float = parameter(
        15.0, "-", "factor of the cost in that strip: an edge that was not seen may be a cliff", low=1.0, high=1000.0
    )

    kerb_rise_m: float = parameter(
        0.045, "m", "measured rise from one column to the next that a turning wheel would scrape along", low=0.0, high=0.5
    )
    kerb_margin_m: float = parameter(0.6, "m", "distance from such a rise within which the robot should not turn", low=0.0, high=3.0)
    kerb_weight: float = parameter(3.0, "-", "factor of the cost within it: kerbs are driven over, not along", low=1.0, high=1000.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        problems = check_ranges(self)
        if min(self.narrow_radius_m, self.narrow_cliff_radius_m) < self.narrow_width_m / 2:
            problems.append(f"narrow_radius_m or narrow_cliff_radius_m is below half of narrow_width_m = {self.narrow_width_m!r}")
        if self.slope_margin_rad >= self.max_slope_rad:
            problems.append(f"slope_margin_rad = {self.slope_margin_rad!r} is not below max_slope_rad = {self.max_slope_rad!r}")
        if self.cliff_look_m < self.max_step_m:
            problems.append(f"cliff_look_m = {self.cliff_look_m!r} is below max_step_m = {self.max_step_m!r}")
        return problems

    def without_passages(self) -> "TerrainConfig":
        """The same, but no way through without room to turn is looked for."""
        return replace(self, narrow_radius_m=self.inflation_radius_m, narrow_cliff_radius_m=self.cliff_inflation_radius_m)


class StepLimits(NamedTuple):
    """The highest step in voxels: where only the voxels are known, where heights are measured, and where flat treads on both sides are."""

    voxels: float
    measured: float
    treads: float

    @classmethod
    def of(cls, config: TerrainConfig, resolution: float) -> "StepLimits":
        """Those of a robot that climbs `max_step_m`."""
        metres = config.max_step_m + 0.01, config.max_step_m - config.step_margin_m, config.max_step_m + _TREADS_ERR_M
        return cls(*(m / resolution for m in metres))


class Limits(NamedTuple):
    """The configuration in voxels of one resolution, as the kernels take it.

    `steepest`: slopes above which fitted ground is inclined, nearly steep and steep; and nearly steep in a close look. `assumes_cliffs`:
    also where no drop was seen. `steep_margin`: what is too steep begins somewhere in its column, or, where slopes are fitted to a few
    columns of measured heights, in the one before.
    """

    resolution: float
    step: int
    steps: StepLimits
    clearance: int
    slope_reach: int
    max_slope: float
    steepest: tuple[float, float, float, float]
    max_plane_slope: float
    look: int
    inflation: int
    hit_margin: float
    hit_noise: float
    cliff_margin: float
    steep_margin: float
    cliff_area: int
    assumes_cliffs: bool

    @classmethod
    def of(cls, config: TerrainConfig, resolution: float, is_measured: bool) -> "Limits":
        """For a map with or without measured heights."""
        slope_radius_m, margin = (config.slope_radius_m, config.slope_margin_rad) if is_measured else (config.voxel_slope_radius_m, 0.0)
        fitted = math.tan(config.max_slope_rad - margin)
        inclined = _INCLINED * fitted if is_measured else fitted
        largest = max(config.inflation_radius_m, config.cliff_inflation_radius_m)
        return cls(
            resolution=resolution,
            step=max(1, math.ceil(config.max_step_m / resolution - 1e-9)),
            steps=StepLimits.of(config, resolution),
            clearance=math.ceil((config.robot_height_m + config.clearance_margin_m) / resolution - 1e-9),
            slope_reach=max(2, round(slope_radius_m / resolution)),
            max_slope=math.tan(config.max_slope_rad),
            steepest=(inclined, fitted, math.tan(config.max_slope_rad), math.tan(config.max_slope_rad - _CLOSE_ERR_RAD)),
            max_plane_slope=math.tan(config.max_slope_rad + _PLANE_ERR_RAD),
            look=max(1, round(config.cliff_look_m / resolution)),
            inflation=math.ceil(largest / resolution - 1e-9),
            hit_margin=config.hit_margin_m / resolution if is_measured else 0.0,
            hit_noise=config.hit_noise_m / resolution,
            cliff_margin=config.cliff_margin_m / resolution if is_measured else 0.0,
            steep_margin=_STEEP_MARGIN if is_measured else 0.5,
            cliff_area=config.cliff_area_voxels,
            assumes_cliffs=config.cliff_evidence == "assumed",
        )

    @property
    def margin(self) -> int:
        """Columns around every node of the flood that the analysis may look at."""
        return max(self.look, self.inflation, 4) + 8
