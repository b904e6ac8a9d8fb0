"""What the nodes need of every input, and how far its contents may go before they are taken for another unit."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class Needs:
    """What the nodes need of an input: its rate, how old it may be when it comes, and the longest pause between its stamps.

    Below `steady_rate_hz` the robot stands between two of them, for by then the last is too old to drive by.
    """

    least_rate_hz: float
    max_age_s: float
    max_gap_s: float
    steady_rate_hz: float = 0.0


NEEDS = {
    "scan": Needs(5.0, 0.2, 0.3, 8.0),
    "points": Needs(5.0, 0.3, 0.3, 8.0),
    "joint_states": Needs(15.0, 0.2, 0.11),
    "imu/data": Needs(25.0, 0.1, 0.1),
    "wheel_odom": Needs(8.0, 0.2, 0.21),
}
"""By topic. Motion stops 0.3 s after the last of an input; an IMU's pause over 0.1 s is bridged by a guess (`max_imu_gap_s`).

Scans beside a pause of tilt or wheels are lost to the sweep from `max_joint_gap_s` and `max_odometry_gap_s` of sweep_assembler_node on.
"""


@dataclass(frozen=True)
class CheckLimits:
    """What `check_robot` takes for a fault."""

    ahead_s: float = parameter(0.02, "s", "stamps may be ahead of the clock by this: a millisecond of chrony, and some jitter", low=0.0)
    apart_s: float = parameter(0.1, "s", "stamps of two inputs may be apart by this beyond their latencies", low=0.0)
    tilt_apart_s: float = parameter(
        0.02, "s", "those of tilt and laser by this beyond their jitter: at 1 rad/s they tilt a beam by as many rad", low=0.0
    )
    blind_share: float = parameter(
        0.98, "-", "a laser of which more beams hit nothing is covered, or its limits are wrong", low=0.0, high=1.0
    )
    level_rad: float = parameter(
        0.01, "rad", "the laser rests as near to the horizontal: horizontal_tolerance_rad of sweep_assembler_node", low=0.0
    )

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)
