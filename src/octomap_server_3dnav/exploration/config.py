"""What the search for the next goal is told; the parts it is made of have configurations of their own."""

import math
from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class ExplorationConfig:
    """The search for the next goal, and where on the way to it the robot stops."""

    local_radius_m: float = parameter(6.0, "m", "terrain that is searched for frontiers before the whole map is", low=1.0, high=100.0)
    max_looks: int = parameter(2, "-", "looks that did not change a frontier before it is set aside", low=1, high=20, at_runtime=True)
    max_failures: int = parameter(2, "-", "failed drives to a frontier before it is set aside", low=1, high=20, at_runtime=True)
    max_goals: int = parameter(
        6, "-", "goals at one frontier that brought the robot no nearer before it is set aside", low=1, high=100, at_runtime=True
    )
    edge_trim_m: float = parameter(
        1.2,
        "m",
        "distance from a potential cliff at which a path ends in place of planner/trim_m: a laser 0.9 m high sees 0.6 m deep behind it",
        low=0.0,
        high=5.0,
    )
    min_trim_m: float = parameter(0.75, "m", "but never nearer to the frontier than this: its floor is not known", low=0.0, high=5.0)
    unknown_clearance_m: float = parameter(
        0.40, "m", "distance of a path from floor that was not seen; half the robot's width and more", low=0.0, high=3.0
    )
    most_back_m: float = parameter(1.0, "m", "a goal beside a kerb is moved back along its path by at most this", low=0.0, high=10.0)
    max_refused_sweeps: int = parameter(
        2, "-", "sweeps in a row that match nothing after which the robot goes back to known ground; 0: never", low=0, high=100
    )
    lookouts: bool = parameter(
        True, "-", "at the end look, too, from where the robot can drive in straight but not turn: up a narrow ramp, into a dead end"
    )
    closer_factor: float = parameter(0.6, "-", "the path is trimmed to this share at every further look", low=0.1, high=1.0)

    turn_slope_rad: float = parameter(
        math.radians(8.0), "rad", "on steeper ground the robot does not turn to face the frontier", low=0.0, high=1.6
    )

    at_end: str = parameter(
        "stay",
        "-",
        "when nothing is left to explore the robot stays there or drives home, to where it began; end: as stay, and the launch ends",
        choices=("stay", "home", "end"),
        at_runtime=True,
    )
    budget_s: float = parameter(
        0.0,
        "s",
        "after so long the robot is home again, with what it knows by then; 0: it takes the time that it needs",
        low=0.0,
        high=1e6,
        at_runtime=True,
    )
    budget_m: float = parameter(0.0, "m", "the same in metres driven; 0: as many as it needs", low=0.0, high=1e6, at_runtime=True)
    home_tolerance_m: float = parameter(
        0.15, "m", "home is where it began within this distance, as a sweep there tells", low=0.02, high=2.0
    )
    home_tolerance_rad: float = parameter(0.15, "rad", "and this heading", low=0.02, high=3.2)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        problems = check_ranges(self)
        if self.max_goals < max(self.max_looks, self.max_failures):
            problems.append(f"max_goals = {self.max_goals!r} is below max_looks or max_failures")
        return problems
