"""What is counted and averaged over runs: successes with their interval, means that know how many runs they cover, and ratios.

Nothing here fills a gap. A mean without a value, and a ratio to nothing, are None.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from statistics import NormalDist, fmean

from evaluation_report.campaign import Run

Measure = Callable[[Run], float | None]

_CONFIDENCE = 0.95


@dataclass(frozen=True)
class Interval:
    """Bounds of a share, 0..1."""

    low: float
    high: float


def wilson_interval(successes: int, trials: int) -> Interval:
    """The score interval of a share at 95 % (Wilson 1927, without continuity correction); ValueError for counts that are none."""
    if not (0 <= successes <= trials and trials > 0):
        raise ValueError(f"{successes} of {trials} is no share of at least one trial")
    z2 = NormalDist().inv_cdf(0.5 + 0.5 * _CONFIDENCE) ** 2
    share = successes / trials
    middle = share + 0.5 * z2 / trials
    half = math.sqrt(z2 * (share * (1.0 - share) + 0.25 * z2 / trials) / trials)
    scale = 1.0 + z2 / trials
    return Interval(max(0.0, (middle - half) / scale), min(1.0, (middle + half) / scale))


@dataclass(frozen=True)
class SuccessCount:
    """How many of the runs with a verdict succeeded, and how many were asked for."""

    succeeded: int
    judged: int
    asked: int

    @property
    def share(self) -> float | None:
        """Of those with a verdict; None without any."""
        return self.succeeded / self.judged if self.judged else None

    @property
    def interval(self) -> Interval | None:
        """Wilson's, at 95 %; None without any verdict."""
        return wilson_interval(self.succeeded, self.judged) if self.judged else None


def success_count(runs: Sequence[Run]) -> SuccessCount:
    """Counts verdicts; runs without one (missing, or not to be judged) are asked for but not counted."""
    verdicts = [run.verdict for run in runs if run.verdict is not None]
    return SuccessCount(sum(verdicts), len(verdicts), len(runs))


@dataclass(frozen=True)
class Mean:
    """An average (or sum, or maximum) over `runs` of the `asked` ones; None over none."""

    value: float | None
    runs: int
    asked: int

    @property
    def covers(self) -> str:
        """ "9/10": over how many of how many."""
        return f"{self.runs}/{self.asked}"


def mean_over(values: Iterable[float | None], asked: int, combine: Callable[[list[float]], float] = fmean) -> Mean:
    """`combine` of the known values."""
    known = [value for value in values if value is not None]
    return Mean(combine(known) if known else None, len(known), asked)


def mean_of(runs: Sequence[Run], measure: Measure, combine: Callable[[list[float]], float] = fmean) -> Mean:
    """Over the runs that ended by themselves; crashed, hung and missing ones are asked for but never averaged."""
    return mean_over((measure(run) for run in runs if run.averaged), len(runs), combine)


@dataclass(frozen=True)
class Ratio:
    """Mean of one profile over mean of another on the `pairs` seeds where both are known; `low` and `high` seed by seed."""

    value: float | None
    low: float | None
    high: float | None
    pairs: int


def paired_ratio(above: Sequence[Run], below: Sequence[Run], measure: Measure) -> Ratio:
    """Ratio of a measure over the seeds that both profiles finished."""
    others = {run.seed: measure(run) for run in below if run.averaged}
    numbers = ((measure(run), others.get(run.seed)) for run in above if run.averaged)
    pairs = [(a, b) for a, b in numbers if a is not None and b is not None]
    total = sum(b for _, b in pairs)
    each = [a / b for a, b in pairs if b > 0]
    if not pairs or total <= 0:
        return Ratio(None, None, None, len(pairs))
    return Ratio(sum(a for a, _ in pairs) / total, min(each), max(each), len(pairs))


def success_ratio(above: Sequence[Run], below: Sequence[Run]) -> Ratio:
    """Ratio of success rates over the seeds on which both profiles have a verdict; seed by seed it would be 0, 1 or nothing."""
    others = {run.seed: run.verdict for run in below}
    pairs = [(run.verdict, others.get(run.seed)) for run in above if run.verdict is not None and others.get(run.seed) is not None]
    base = sum(bool(b) for _, b in pairs)
    return Ratio(sum(bool(a) for a, _ in pairs) / base if base else None, None, None, len(pairs))
