"""What the judge assumes: the robot's body, and the tolerances of the scores. Every default of this stage is here."""

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


@dataclass(frozen=True)
class EvaluationConfig:
    """Resolution of the truth and tolerances of the scores."""

    cell_m: float = parameter(0.10, "m", "edge of a cell of ground in the truth", low=0.02, high=1.0)
    coverage_horizontal_m: float = parameter(
        0.12, "m", "farthest mapped voxel, along x or y, that covers a cell of ground", low=0.0, high=1.0
    )
    coverage_vertical_m: float = parameter(0.10, "m", "farthest mapped voxel, along z, that covers a cell of ground", low=0.0, high=1.0)
    map_resolution_m: float = parameter(
        0.08, "m", "finest voxel of a map whose run does not tell; pruned ones are divided", low=0.01, high=1.0
    )
    max_cloud_points: int = parameter(400_000, "-", "points of the cloud that are measured against the true mesh", low=100)
    min_coverage: float = parameter(
        0.95, "-", "share of the reachable ground that a success has to exceed; runs that end well have over 0.99", low=0.0, high=1.0
    )
    max_missed_piece_m2: float = parameter(
        5.0, "m2", "largest connected piece of reachable ground that a success may lack: a small room or a deck", low=0.0
    )
    stayed_m: float = parameter(1.0, "m", "the robot's length: one that came no farther has never left its start", low=0.0)
    stayed_coverage: float = parameter(0.995, "-", "coverage from which one that stayed has seen all that there is", low=0.0, high=1.0)
    outside_m: float = parameter(0.05, "m", "by which the outline may come to where the robot may not be", low=0.0)
    home_m: float = parameter(0.2, "m", "one that was to end at home is there within this distance", low=0.0)
    home_rad: float = parameter(0.2, "rad", "and this heading", low=0.0, high=3.2)
    budget_share: float = parameter(1.05, "-", "of its budget that a run may have spent: odometry counts the metres", low=1.0)
    contact_gap_s: float = parameter(1.0, "s", "pause after which a contact counts as another collision", low=0.0)
    unwatched_s: float = parameter(
        0.5,
        "s",
        "longest step between true poses of a run that was watched: a monitor that is started again in lock-step loses 0.3 s",
        low=0.05,
    )
    own_touch_mps: float = parameter(
        0.05, "m/s", "speed of the robot above which a touch with a mover is its own; slower, the mover has touched it", low=0.0, high=1.0
    )
    ghost_off_m: float = parameter(
        0.2, "m", "distance to the true surfaces beyond which a mapped voxel is none of them", low=0.05, high=1.0
    )
    ghost_reach_m: float = parameter(0.7, "m", "how near to a mover's place such a voxel is taken for its ghost", low=0.1, high=3.0)
    still_speed_mps: float = parameter(0.02, "m/s", "speed up to which the robot stands", low=0.0, high=1.0)
    full_speed_share: float = parameter(
        0.9, "-", "of the speed that it seldom exceeds: faster is full speed, at which the ground ahead is asked for", low=0.1, high=1.0
    )
    start_blind_m: float = parameter(
        1.2,
        "m",
        "so near its start the laser sees no ground, and the robot assumes it: how early it was shown is not asked",
        low=0.0,
        high=5.0,
    )
    still_turn_rate_radps: float = parameter(0.02, "rad/s", "turn up to which it stands", low=0.0, high=1.0)
    fall_tilt_rad: float = parameter(0.87, "rad", "tilt of the body beyond which it has fallen", low=0.3, high=3.1)
    fall_speed_mps: float = parameter(1.5, "m/s", "downward speed beyond which the body falls (0.11 m of free fall)", low=0.3)

    def validate(self) -> list[str]:
        """All violations of ranges."""
        return check_ranges(self)
