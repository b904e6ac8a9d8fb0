"""The robot's body and abilities, and every length that follows from them."""

from __future__ import annotations

import math
from dataclasses import dataclass

from robot_body.mounts import SensorMount
from stage_config import check_ranges, parameter

_SAME_M = 1e-6  # lengths that differ by less are equal: sums of decimals
NEEDED_SENSORS = ("laser", "imu")
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
    max_acceleration_mps2: float = parameter(
        3.0, "m/s^2", "how fast its drive changes the forward speed; husky_control's controller has 3", low=0.1, high=20.0
    )
    max_turn_acceleration_radps2: float = parameter(
        6.0, "rad/s^2", "how fast its drive changes the turn rate; husky_control's controller has 6", low=0.1, high=50.0
    )
    own_echo_margin_m: float = parameter(0.10, "m", "echoes this near to the outline are its own: cables, noise, a mast", low=0.0, high=1.0)
    mounts: tuple[SensorMount, ...] = parameter(
        MOUNTS, "-", "frame of each sensor, and its pose there or 'from: urdf'; laser and imu are needed"
    )

    def validate(self) -> list[str]:
        """All violations of ranges, and contradictions between values that are in range, as sentences."""
        problems = check_ranges(self)
        return problems + self._contradictions({problem.partition(" = ")[0] for problem in problems}) + self._mount_problems()

    def _contradictions(self, wrong: set[str]) -> list[str]:
        """Those that do not concern the `wrong` values."""
        wheels, axles = self.track_m + self.wheel_width_m, self.wheelbase_m + 2 * self.wheel_radius_m
        rules = (  # a value, those that must not be more than it, and what these are together
            ("width_m", "track_m wheel_width_m", wheels, f"track_m + wheel_width_m = {wheels:.4g}"),
            ("length_m", "wheelbase_m wheel_radius_m", axles, f"wheelbase_m + 2 wheel_radius_m = {axles:.4g}"),
            ("height_m", "base_height_m", self.base_height_m, f"base_height_m = {self.base_height_m}"),
            ("height_m", "ground_clearance_m", self.ground_clearance_m, f"ground_clearance_m = {self.ground_clearance_m}"),
            ("wheel_radius_m", "max_step_m", self.max_step_m, f"max_step_m = {self.max_step_m}"),
            ("ground_clearance_m", "max_step_m", self.max_step_m, f"max_step_m = {self.max_step_m}"),
        )
        return [
            f"{name} = {getattr(self, name)} is below {text}"
            for name, others, least, text in rules
            if getattr(self, name) < least - _SAME_M and not wrong & {name, *others.split()}
        ]

    def _mount_problems(self) -> list[str]:
        sensors = {mount.sensor for mount in self.mounts}
        found = [f"mounts has no {sensor}" for sensor in NEEDED_SENSORS if sensor not in sensors]
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
        """From the middle line to a side: half the width."""
        return self.width_m / 2

    @property
    def half_length_m(self) -> float:
        """From the middle to the front or rear: half the length."""
        return self.length_m / 2

    @property
    def turning_radius_m(self) -> float:
        """Free distance that the middle needs to turn in place: to a corner of the outline, hypot(length, width) / 2."""
        return math.hypot(self.length_m, self.width_m) / 2

    @property
    def standing_base_m(self) -> float:
        """Shortest distance between what it stands on: the track, the wheelbase, or with one axle half its length, where a caster is."""
        return min(self.track_m, self.wheelbase_m or self.half_length_m)

    @property
    def standing_tolerance_m(self) -> float:
        """How far ground under the robot may lie off the plane of its wheels: a slope and a step under half its length (0.331 m)."""
        return self.half_length_m * math.tan(self.max_slope_rad) + self.max_step_m

    @property
    def passage_radius_m(self) -> float:
        """Free distance of a passage's middle line from obstacles: half the width, and what the middle strays.

        That the heading strays, too, is not in it: an obstacle is seen while driving, and the outline is looked at along the way.
        """
        return self.half_width_m + self.straying_m

    @property
    def passage_cliff_radius_m(self) -> float:
        """Distance of a passage's middle line from cliffs, so that the outer edge of every wheel stays on the ground.

        Half the track and half a wheel, what the middle strays, and how far the heading takes a front wheel beside the middle:
        wheelbase / 2 * sin(straying_rad). A drop is not seen while driving, so nothing else keeps a wheel from it.
        """
        return (self.track_m + self.wheel_width_m) / 2 + self.straying_m + self.wheelbase_m / 2 * math.sin(self.straying_rad)

    @property
    def rolled_over_m(self) -> float:
        """Widest gap in the ground that a wheel rolls over: it sinks in by no more than the highest step, as deep as its axle at most."""
        depth = min(self.max_step_m, self.wheel_radius_m)
        return 2.0 * math.sqrt(depth * (2.0 * self.wheel_radius_m - depth))

    @property
    def effective_track_m(self) -> float:
        """Track of a robot without skidding that would turn as this one: track times effective_track_factor."""
        return self.track_m * self.effective_track_factor

    def climbing_rad(self, radius_m: float) -> float:
        """Steepest that the ground under a wheel of a radius stands where it climbs the highest step: acos(1 - max_step / radius)."""
        return math.acos(max(1.0 - self.max_step_m / radius_m, 0.0))

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
