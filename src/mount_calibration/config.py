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
    iterations: int = parameter(15, "-", "most steps of the fit", low=1, high=200)

    level_rad: float = parameter(
        0.006, "rad", "only where the robot stands as level as this the ground is used: thrice the odometry's level", low=0.0, high=0.1
    )

    attitude_bias_rad: float = parameter(
        0.002, "rad", "level of the odometry: an accelerometer's bias of 0.02 m/s^2 turns it by so much", low=0.0, high=0.1
    )
    attitude_sigma_rad: float = parameter(0.001, "rad", "noise of the odometry's roll and pitch at a place", low=1e-5, high=0.1)
    yaw_sigma_rad: float = parameter(0.05, "rad", "noise of its heading from place to place", low=1e-4, high=1.0)
    position_sigma_m: float = parameter(0.1, "m", "noise of its position from place to place", low=1e-3, high=1.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)
