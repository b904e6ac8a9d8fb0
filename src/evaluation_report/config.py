"""What a user may want to turn in a report."""

from dataclasses import dataclass

from stage_config import check_ranges, parameter


@dataclass(frozen=True)
class ReportConfig:
    """The pictures of the runs are most of the page; they share a budget, so that a report of many runs can still be sent by mail."""

    picture_width_px: int = parameter(760, "px", "width of a run's picture in the page", low=200, high=2000)
    pictures_budget_mb: float = parameter(3.2, "MB", "size of all embedded pictures together, before encoding as text", low=0.2, high=100.0)
    picture_limit_kb: float = parameter(90.0, "kB", "size of one picture", low=5.0, high=1000.0)

    def validate(self) -> list[str]:
        """All violations of ranges."""
        return check_ranges(self)
