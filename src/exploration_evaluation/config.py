"""The robot's body as the judge sees it. The tolerances of a score stand in the module of that score."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robot_body import RobotBody
from stage_config import check_ranges, parameter

Floats = NDArray[np.float64]

_DEFAULT = RobotBody()
_ROOM_ABOVE_M = 0.10  # above the robot, where it is judged to fit


@dataclass(frozen=True)
class RobotShape:
    """The body whose reach is judged: a cylinder where it turns, a box where it drives straight; `of` makes it of the robot of the run."""

    circumscribed_radius_m: float = parameter(
        _DEFAULT.turning_radius_m, "m", "free distance the centre needs to turn in place", low=0.05, high=5.0
    )
    inscribed_radius_m: float = parameter(
        _DEFAULT.half_width_m, "m", "ground this near to a reachable centre lies under the body", low=0.0, high=5.0
    )
    length_m: float = parameter(
        _DEFAULT.length_m, "m", "outline, along the robot's x, with which it drives straight where it cannot turn", low=0.1, high=5.0
    )
    width_m: float = parameter(_DEFAULT.width_m, "m", "outline, along the robot's y", low=0.1, high=5.0)
    wheel_width_m: float = parameter(
        _DEFAULT.wheel_width_m,
        "m",
        "no wheel falls into a seam narrower than this, nor, where seams cross, than half of it",
        low=0.0,
        high=1.0,
    )
    height_m: float = parameter(_DEFAULT.height_m, "m", "highest part of the robot above the ground", low=0.1, high=5.0)
    headroom_m: float = parameter(
        _DEFAULT.height_m + _ROOM_ABOVE_M, "m", "free height above ground that the robot can stand on", low=0.1, high=6.0
    )
    ground_clearance_m: float = parameter(
        _DEFAULT.ground_clearance_m, "m", "height from which a thing beside the ground touches the body", low=0.0, high=2.0
    )
    max_slope_rad: float = parameter(_DEFAULT.max_slope_rad, "rad", "steepest ground that is driven", low=0.01, high=1.4)
    max_step_m: float = parameter(_DEFAULT.max_step_m, "m", "highest step between neighbouring cells of ground", low=0.0, high=1.0)
    laser_height_m: float = parameter(0.92, "m", "its laser above the ground, of the run's robot.urdf", low=0.0, high=5.0)
    base_height_m: float = parameter(_DEFAULT.base_height_m, "m", "its base_link above the ground", low=0.0, high=2.0)

    @classmethod
    def of(cls, robot: RobotBody) -> "RobotShape":
        """The shape of a robot."""
        return cls(
            circumscribed_radius_m=robot.turning_radius_m,
            inscribed_radius_m=robot.half_width_m,
            length_m=robot.length_m,
            width_m=robot.width_m,
            wheel_width_m=robot.wheel_width_m,
            height_m=robot.height_m,
            headroom_m=robot.height_m + _ROOM_ABOVE_M,
            ground_clearance_m=robot.ground_clearance_m,
            max_slope_rad=robot.max_slope_rad,
            max_step_m=robot.max_step_m,
            base_height_m=robot.base_height_m,
        )

    def foot(self, T_world_base: Floats) -> Floats:
        """(N, 3) points of the ground below (N, 4, 4) poses."""
        return np.asarray(T_world_base[:, :3, 3] - self.base_height_m * T_world_base[:, :3, 2])

    @property
    def level_m(self) -> float:
        """Difference in height up to which ground beside the robot lies on its own level."""
        return self.circumscribed_radius_m * math.tan(self.max_slope_rad) + self.max_step_m

    def rise_m(self, cell_m: float) -> float:
        """Difference in height up to which cells side by side may be one ground: a step, or the steepest slope."""
        return max(self.max_step_m, cell_m * math.tan(self.max_slope_rad))

    def validate(self) -> list[str]:
        """All violations of ranges, and radii or heights in the wrong order."""
        found = check_ranges(self)
        if self.inscribed_radius_m > self.circumscribed_radius_m:
            found.append(f"inscribed_radius_m = {self.inscribed_radius_m} is above circumscribed_radius_m = {self.circumscribed_radius_m}")
        if self.headroom_m < self.height_m:
            found.append(f"headroom_m = {self.headroom_m} is below height_m = {self.height_m}")
        if self.ground_clearance_m < self.max_step_m:
            found.append(f"ground_clearance_m = {self.ground_clearance_m} is below max_step_m = {self.max_step_m}")
        return found
