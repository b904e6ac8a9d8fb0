"""Parameters of sweep assembly and the only home of their defaults."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class SweepAssemblyConfig:
    """When a sweep begins and ends, and which gaps in the inputs it stands."""

    horizontal_tolerance_rad: float = parameter(0.01, "rad", "tilt up to which the laser counts as horizontal", low=1e-4, high=0.2)
    still_rate_rad_s: float = parameter(
        0.05, "rad/s", "tilt rate up to which the mount rests; below the sweep's rate at the horizon", low=1e-4
    )
    windows: str = parameter(
        "rest",
        "-",
        "rest: sweeps go from rest to rest; turning_points: or are half of a nod; travelled: a part of the way, as always of a fixed lidar",
        choices=("rest", "turning_points", "travelled"),
    )
    travelled_m: float = parameter(1.0, "m", "travelled: a sweep ends so far from where it began", low=0.1, high=5.0)
    travelled_rad: float = parameter(0.7, "rad", "or when the robot has turned by so much since", low=0.1, high=3.0)
    travelled_s: float = parameter(2.0, "s", "or after so long: of a robot that stands, too", low=0.3, high=30.0)
    whole_sweep_rad: float = parameter(1.3, "rad", "no nod tilts lower: what does is a whole sweep, from rest to rest", low=0.1, high=3.1)
    least_nod_rad: float = parameter(0.3, "rad", "a shorter way from turn to turn is no nod", low=0.05, high=3.0)
    max_duration_s: float = parameter(30.0, "s", "a sweep that takes longer is dropped", low=0.1)
    max_joint_gap_s: float = parameter(0.11, "s", "scans that overlap a longer pause of the joint samples are dropped", low=1e-3)
    max_odometry_gap_s: float = parameter(0.21, "s", "scans that overlap a longer pause of the odometry are dropped", low=1e-3)
    buffer_s: float = parameter(60.0, "s", "oldest data kept while another topic is silent; at 40 Hz a second of scans is 0.2 MB", low=1.0)

    free_range_m: float = parameter(
        5.0,
        "m",
        "beams without an echo are free up to here: farther off, a dark floor at a grazing angle sends none either",
        low=0.5,
        high=60.0,
    )
    free_beam_stride: int = parameter(3, "-", "of those beams one in so many is kept", low=1, high=100)
    stray_neighbours: int = parameter(
        2, "-", "a point with fewer others near it is no surface, and is left out; 0: all are kept", high=20, low=0
    )
    stray_radius_m: float = parameter(0.08, "m", "how near they have to be", low=0.01, high=2.0)
    stray_radius_ratio: float = parameter(0.02, "-", "or this share of the point's range, where that is more", low=0.0, high=0.5)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        found = check_ranges(self)
        if self.buffer_s <= self.max_duration_s:
            found.append(f"buffer_s = {self.buffer_s} is not above max_duration_s = {self.max_duration_s}")
        return found
