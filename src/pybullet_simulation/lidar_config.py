"""Parameters of the spinning lidar that can take the tilting laser's place; its ranges are measured as the laser's are."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class SpinningLidarConfig:
    """How densely the lidar looks around, and how its mount nods during a sweep."""

    columns: int = parameter(900, "-", "directions in which all rings fire during a revolution; 900 are 0.4 deg apart", low=90, high=3600)
    revolutions: int = parameter(
        20, "-", "revolutions, of 0.1 s, during the slow part of a sweep; the mount's slew rate sets the fewest", low=1, high=200
    )
    sweep_start_rad: float = parameter(
        1.6, "rad", "tilt at which the slow part of a sweep starts, looking straight down and up", low=0.4, high=3.05
    )
    sweep_end_rad: float = parameter(
        -0.79, "rad", "tilt at which the slow part ends, looking up in front and down behind", low=-0.79, high=0.0
    )

    def validate(self) -> list[str]:
        """All violations, as sentences; empty when the configuration can be used."""
        return check_ranges(self)
