"""What the calibration of the mount takes as a plane, as level ground, and as well enough known."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter

LEAST_SWEEPS, MOST_SWEEPS = 1, 100  # of a calibration at one place; a hundred take half an hour


def asked_sweeps(value: object) -> int:
    """How many sweeps are asked for, as a number or a text; ValueError for what is no whole number in the range."""
    text = str(value).strip()
    if isinstance(value, bool) or not text.isdecimal() or not LEAST_SWEEPS <= int(text) <= MOST_SWEEPS:
        raise ValueError(f"sweeps:={text}: expected a whole number from {LEAST_SWEEPS} to {MOST_SWEEPS}")
    return int(text)


@dataclass(frozen=True)
class MountCalibrationConfig:
    """Parameters of the estimate."""

    max_range_m: float = parameter(10.0, "m", "farther hits are left out: beyond, a UTM-30LX is three times as noisy", low=1.0, high=100.0)
    most_beams: int = parameter(
        120_000, "-", "hits used of all places together; half of them rising ones, where there are so many", low=1000
    )
    cell_m: float = parameter(0.5, "m", "edge of the cells in which hits are compared with a plane", low=0.1, high=3.0)
    least_points: int = parameter(4, "-", "hits of one kind from which they count in a cell: three make a plane", low=4, high=1000)
    least_spread_m: float = parameter(0.05, "m", "rms width of the hits of a cell that hold a plane", low=0.01, high=1.0)
    planar_sigmas: float = parameter(2.0, "-", "thicker than so many of the median thickness a cell is no plane", low=1.0, high=10.0)
    most_cut: float = parameter(0.2, "-", "share of the hits of a cell that may lie within the noise of a face", low=0.0, high=1.0)
    robust_sigmas: float = parameter(2.0, "-", "distance from the plane at which a hit weighs half (Cauchy)", low=1.0, high=10.0)
    iterations: int = parameter(15, "-", "most steps of the fit", low=1, high=200)

    level_rad: float = parameter(
        0.006, "rad", "only where the robot stands as level as this the ground is used: thrice the odometry's level", low=0.0, high=0.1
    )
    ground_radius_m: float = parameter(2.5, "m", "ground up to here from the laser says where the wheels stand", low=1.0, high=10.0)
    ground_height_m: float = parameter(0.15, "m", "hits count as ground up to so far from the wheels' plane", low=0.02, high=0.5)
    ground_flat_m: float = parameter(0.0003, "m", "no ground is flatter than so much below the wheels", low=1e-5, high=0.1)
    patch_m: float = parameter(0.1, "m", "size of a patch of ground as a wheel feels it", low=0.02, high=0.5)
    least_patches: int = parameter(50, "-", "patches of ground that say how uneven it is", low=10, high=10_000)

    attitude_bias_rad: float = parameter(
        0.002, "rad", "level of the odometry: an accelerometer's bias of 0.02 m/s^2 turns it by so much", low=0.0, high=0.1
    )
    attitude_sigma_rad: float = parameter(0.001, "rad", "noise of the odometry's roll and pitch at a place", low=1e-5, high=0.1)
    yaw_sigma_rad: float = parameter(0.05, "rad", "noise of its heading from place to place", low=1e-4, high=1.0)
    position_sigma_m: float = parameter(0.1, "m", "noise of its position from place to place", low=1e-3, high=1.0)

    usable_sigma_rad: float = parameter(
        0.004,
        "rad",
        "an angle that is known less well than this is not observable: 0.23 deg, half of what mounts are off by",
        low=1e-5,
        high=0.1,
    )
    usable_sigma_scale: float = parameter(0.001, "-", "the same for the scale: at a tilt of a radian the same angle", low=1e-5, high=0.1)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)
