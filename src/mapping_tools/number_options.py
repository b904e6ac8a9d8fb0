"""Numbers that options of the tools give: what is none is told with the option's name, before work."""

import math
from collections.abc import Sequence

from explore_command.arguments import ArgumentProblem


def check_finite(option: str, values: Sequence[float] | None) -> None:
    """ArgumentProblem for NaN and infinity; None, an option that was not given, is right."""
    if values is not None and not all(math.isfinite(v) for v in values):
        raise ArgumentProblem(f"{option} {' '.join(f'{v:g}' for v in values)}: expected {len(values)} finite numbers")


def check_not_negative(option: str, value: float) -> None:
    """ArgumentProblem for NaN, infinity, and what is below 0."""
    if not (math.isfinite(value) and value >= 0.0):
        raise ArgumentProblem(f"{option} {value:g}: expected 0 or more")
