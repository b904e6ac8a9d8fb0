"""What run_replay_node is told: what to show, and how fast."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class ReplayConfig:
    """What is shown, and how fast."""

    run: str = parameter("", "-", "folder of the run to show; empty: none")
    other: str = parameter("", "-", "folder of the run to compare it with; empty: none")
    bag: str = parameter("", "-", "bag to show instead of a run; empty: none")
    speed: float = parameter(10.0, "-", "simulated seconds in a second of wall time; 0: without waiting", low=0.0)
    viewer: bool = parameter(False, "-", "wait for a viewer before the first frame, and stay after the last one")
    frame_rate_hz: float = parameter(25.0, "1/s", "poses of the robot in a second of wall time", low=1.0, high=200.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        found = check_ranges(self)
        if bool(self.run) == bool(self.bag):
            found.append(f"either run or bag must be given, not run = {self.run!r} and bag = {self.bag!r}")
        if self.other and not self.run:
            found.append(f"other = {self.other!r} needs a run to be compared with")
        return found
