"""Parameters of the local costmap and the only home of their defaults."""

from dataclasses import dataclass

from robot_body import RobotBody
from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class CostmapConfig:
    """What the window, the obstacle layer and the inflation layer are made of."""

    size_m: float = parameter(
        6.0, "m", "side of the square window around the robot; a large one brings in what lies behind ramps", low=1.0, high=40.0
    )
    resolution_m: float = parameter(
        0.08, "m", "side of a cell; the octree's keeps the terrain layer free of resampling", low=0.01, high=0.5
    )
    obstacle_range_m: float = parameter(
        2.5, "m", "hits of the horizontal scan farther than this mark nothing: they may be a ramp", low=0.0, high=30.0, at_runtime=True
    )
    clearing_range_m: float = parameter(3.0, "m", "beams clear cells up to this range", low=0.0, high=30.0)
    ground_tolerance_m: float = parameter(
        0.25, "m", "a hit this close to known traversable ground is that ground (robot pitched)", low=0.0, high=1.0, at_runtime=True
    )
    overhead_margin_m: float = parameter(
        0.2, "m", "a hit so much higher than the robot over known traversable ground is passed under", low=0.0, high=5.0
    )
    least_hits: int = parameter(2, "-", "beams of one line that must end in a voxel; fewer are taken for stray", low=1, high=100)
    keep_s: float = parameter(
        10.0,
        "s",
        "what lines met is forgotten when they did not meet it again for so long; a mount that nods looks at the same tilt every 4 s",
        low=0.1,
        at_runtime=True,
    )
    inflation_radius_m: float = parameter(
        0.90, "m", "cells farther than this from every lethal cell cost nothing", low=0.0, high=5.0, at_runtime=True
    )
    cost_scaling_factor: float = parameter(
        5.0,
        "1/m",
        "rate of the exponential fall of the cost beyond half the robot's width, within which it is 253",
        low=0.0,
        high=100.0,
        at_runtime=True,
    )

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        problems = check_ranges(self)
        if self.size_m < 4 * self.resolution_m:
            problems.append(f"size_m = {self.size_m} is less than four cells of {self.resolution_m} m")
        return problems

    def contradictions(self, robot: RobotBody) -> list[str]:
        """What does not go with the robot, as sentences."""
        if self.inflation_radius_m < robot.half_width_m:
            return [f"inflation_radius_m = {self.inflation_radius_m} is below half of the robot's width_m = {robot.width_m}"]
        return []
