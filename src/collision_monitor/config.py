"""Parameters of the collision monitor and the only home of their defaults."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class CollisionMonitorConfig:
    """What the robot needs to stand, and what may come towards it meanwhile."""

    reaction_s: float = parameter(
        0.2,
        "s",
        "from a beam to the brakes: the scan's 25 ms and its network's, two ticks of 50 ms, the command's way; where the clock runs free "
        "at least the age of the newest look, and the time to the next command",
        low=0.0,
        high=2.0,
    )
    deceleration_mps2: float = parameter(1.5, "m/s^2", "how fast the drive brakes", low=0.1, high=10.0)
    turn_deceleration_radps2: float = parameter(3.0, "rad/s^2", "how fast it ends a turn", low=0.1, high=20.0)
    approach_mps: float = parameter(
        1.6,
        "m/s",
        "how fast what the map does not know may come towards the robot: a person at a walk in ISO 13855",
        low=0.0,
        high=3.0,
        at_runtime=True,
    )
    margin_m: float = parameter(
        0.1, "m", "room left before it when the robot stands: a cell of the costmap, and noise", low=0.0, high=1.0, at_runtime=True
    )
    memory_s: float = parameter(
        1.3,
        "s",
        "what was not seen for so long is left to the costmap: a nodding laser that looks down does not see a metre ahead for 1.3 s",
        low=0.05,
        high=10.0,
        at_runtime=True,
    )
    standing_s: float = parameter(
        0.0,
        "s",
        "what lines met at one place for longer stands there, and is left to the follower; 0: whatever no sweep has mapped may move",
        low=0.0,
        high=3600.0,
    )
    recovery_s: float = parameter(1.0, "s", "time from a stop to the whole command when the way is free again", low=0.05, high=10.0)

    def validate(self) -> list[str]:
        """All violations of ranges."""
        return check_ranges(self)
