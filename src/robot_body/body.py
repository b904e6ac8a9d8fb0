"""The robot's body and abilities, and every length that follows from them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_body.mounts import SensorMount
from stage_config import check_ranges, parameter

_SAME_M = 1e-6  # lengths that differ by less are equal: sums of decimals
MOUNTS = (SensorMount("imu", "imu_link"), SensorMount("laser", "laser"))


@dataclass(frozen=True)
class RobotBody:
    """What the robot is and can do; base_link lies in the middle of its outline, x forward, y left, z up."""

    name: str = parameter("husky", "-", "what it is called")
    urdf: str = parameter("husky.urdf", "-", "robot description: a file beside robot.yaml, or one of the package's folder urdf/")
    length_m: float = parameter(0.99, "m", "length of the outline, a rectangle around base_link", low=0.1, high=5.0)
    width_m: float = parameter(0.67, "m", "width of the outline", low=0.1, high=5.0)
    height_m: float = parameter(1.0, "m", "highest point above the ground, whatever its laser tilts to", low=0.1, high=5.0)
    base_height_m: float = parameter(0.132, "m", "base_link above the ground that the wheels stand on", low=0.0, high=2.0)
    ground_clearance_m: float = parameter(0.132, "m", "belly above that ground", low=0.01, high=2.0)
    wheel_radius_m: float = parameter(0.1651, "m", "radius of a wheel", low=0.02, high=1.0)
    wheel_width_m: float = parameter(0.0992, "m", "width of a wheel", low=0.005, high=1.0)
    track_m: float = parameter(0.5708, "m", "distance of the middles of left and right wheels", low=0.05, high=5.0)
    wheelbase_m: float = parameter(0.512, "m", "distance of front and rear axles", low=0.0, high=5.0)
    effective_track_factor: float = parameter(
        1.16, "-", "effective over true track: what a skid steer loses in turns, more on a floor with more grip", low=0.5, high=3.0
    )
    turning_slide_m: float = parameter(
        0.15,
        "m/rad",
        "how far it slides aside for every radian of a turn where the ground falls to that side by one in ten",
        low=0.0,
        high=1.0,
    )
    straying_m: float = parameter(0.05, "m", "how far its middle strays from a straight line that it drives along", low=0.0, high=0.5)
    straying_rad: float = parameter(0.058, "rad", "how far its heading strays from that line", low=0.0, high=0.5)
    max_step_m: float = parameter(0.10, "m", "highest step that it climbs", low=0.01, high=0.5)
    max_slope_rad: float = parameter(math.radians(25.0), "rad", "steepest slope that it drives", low=0.05, high=0.8)
    max_speed_mps: float = parameter(1.0, "m/s", "fastest that its drive can do, not what it explores with", low=0.01, high=2.0)
    max_turn_rate_radps: float = parameter(1.5, "rad/s", "fastest turn that its drive can do", low=0.01, high=4.0)
    own_echo_margin_m: float = parameter(0.10, "m", "echoes this near to the outline are its own: cables, noise, a mast", low=0.0, high=1.0)
    mounts: tuple[SensorMount, ...] = parameter(MOUNTS, "-", "frame of each sensor, and its pose there or 'from: urdf'; laser is needed")

    def validate(self) -> list[str]:
        """All violations of ranges, and contradictions, as sentences."""
        return check_ranges(self) + self._contradictions() + self._mount_problems()

    def _contradictions(self) -> list[str]:
        wheels_m, axles_m = self.track_m + self.wheel_width_m, self.wheelbase_m + 2 * self.wheel_radius_m
        rules = (
            ("width_m", self.width_m >= wheels_m - _SAME_M, f"below track_m + wheel_width_m = {wheels_m:.4g}: wheels stick out"),
            ("length_m", self.length_m >= axles_m - _SAME_M, f"below wheelbase_m + 2 wheel_radius_m = {axles_m:.4g}: wheels stick out"),
            ("height_m", self.height_m > self.base_height_m, f"not above base_height_m = {self.base_height_m}"),
            ("height_m", self.height_m > self.ground_clearance_m, f"not above ground_clearance_m = {self.ground_clearance_m}"),
            ("max_step_m", self.max_step_m <= self.wheel_radius_m, f"above wheel_radius_m = {self.wheel_radius_m}"),
            ("max_step_m", self.max_step_m <= self.ground_clearance_m, f"above ground_clearance_m = {self.ground_clearance_m}"),
        )
        return [
            f"{name} = {getattr(self, name)} is {text}" for name, holds, text in rules if not holds and math.isfinite(getattr(self, name))
        ]

    def _mount_problems(self) -> list[str]:
        found = [] if any(mount.sensor == "laser" for mount in self.mounts) else ["mounts has no laser"]
        frames = [mount.frame for mount in self.mounts]
        return found + [f"mounts: frame {frame} is given twice" for frame in sorted({f for f in frames if frames.count(f) > 1})]

    def mount(self, sensor: str) -> SensorMount:
        """The mount of one sensor. ValueError when there is none."""
        for mount in self.mounts:
            if mount.sensor == sensor:
                return mount
        raise ValueError(f"robot {self.name} has no mount {sensor!r}; it has {', '.join(m.sensor for m in self.mounts)}")

    @property
    def half_width_m(self) -> float:
        """From the middle line to a side: half the width (0.335 m)."""
        return self.width_m / 2

    @property
    def half_length_m(self) -> float:
        """From the middle to the front or rear: half the length (0.495 m)."""
        return self.length_m / 2

    @property
    def turning_radius_m(self) -> float:
        """Free distance that the middle needs to turn in place: to a corner of the outline, hypot(length, width) / 2 (0.598 m)."""
        return math.hypot(self.length_m, self.width_m) / 2

    @property
    def passage_radius_m(self) -> float:
        """Free distance of a passage's middle line from obstacles: half the width, and what the middle strays (0.385 m).

        That the heading strays, too, is not in it: an obstacle is seen while driving, and the outline is looked at along the way.
        """
        return self.half_width_m + self.straying_m

    @property
    def passage_cliff_radius_m(self) -> float:
        """Distance of a passage's middle line from cliffs, so that the outer edge of every wheel stays on the ground (0.400 m).

        Half the track and half a wheel, what the middle strays, and how far the heading takes a front wheel beside the middle:
        wheelbase / 2 * sin(straying_rad). A drop is not seen while driving, so nothing else keeps a wheel from it.
        """
        return (self.track_m + self.wheel_width_m) / 2 + self.straying_m + self.wheelbase_m / 2 * math.sin(self.straying_rad)

    @property
    def effective_track_m(self) -> float:
        """Track of a robot without skidding that would turn as this one: track times effective_track_factor (0.662 m)."""
        return self.track_m * self.effective_track_factor

    @property
    def body_min_m(self) -> tuple[float, float, float]:
        """Lower corner in base_link of the box in which echoes are the robot's own: outline and ground, and own_echo_margin_m."""
        more = self.own_echo_margin_m
        return -self.half_length_m - more, -self.half_width_m - more, -self.base_height_m - more

    @property
    def body_max_m(self) -> tuple[float, float, float]:
        """Upper corner of that box: outline and highest point, and own_echo_margin_m."""
        more = self.own_echo_margin_m
        return self.half_length_m + more, self.half_width_m + more, self.height_m - self.base_height_m + more
