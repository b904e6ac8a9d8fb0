"""The scores of a run as the report shows them: heading, unit, how to read it from the summary, and how runs are combined."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from statistics import fmean

from evaluation_report.campaign import Run
from evaluation_report.statistics import Measure

_DEGREES = 57.29577951308232


@dataclass(frozen=True)
class Score:
    """`factor` turns the summary's SI value into the shown unit; `combine` is what the last line of a table shows ("mean", ...)."""

    key: str
    heading: str
    unit: str
    factor: float
    digits: int
    combined: str = "mean"

    def of(self, run: Run) -> float | None:
        """The run's value in SI units."""
        return run.number(self.key)

    @property
    def combine(self) -> Callable[[list[float]], float]:
        """What `combined` names."""
        known: dict[str, Callable[[list[float]], float]] = {"mean": fmean, "sum": sum, "greatest": max}
        return known[self.combined]


SCORES: tuple[Score, ...] = (
    Score("coverage", "coverage", "%", 100.0, 1),
    Score("map_rmse_m", "map accuracy RMS", "cm", 100.0, 1),
    Score("map_p95_m", "map accuracy 95 %", "cm", 100.0, 1),
    Score("map_completeness_rms_m", "completeness RMS", "cm", 100.0, 1),
    Score("map_completeness_p95_m", "completeness 95 %", "cm", 100.0, 1),
    Score("seen_surface_share", "visible surface mapped", "%", 100.0, 1),
    Score("trajectory_ate_m", "ATE", "cm", 100.0, 1),
    Score("rpe_translation_m", "RPE", "cm", 100.0, 1),
    Score("rpe_rotation_rad", "RPE rotation", "deg", _DEGREES, 2),
    Score("wrong_edges", "wrong edges of the graph", "", 1.0, 0, "sum"),
    Score("classification.false_safe_m2", "false safe", "m²", 1.0, 3),
    Score("classification.false_unsafe_m2", "false unsafe", "m²", 1.0, 1),
    Score("collisions", "collisions", "", 1.0, 0, "sum"),
    Score("max_tilt_rad", "greatest tilt", "deg", _DEGREES, 0, "greatest"),
    Score("fell", "falls", "", 1.0, 0, "sum"),
    Score("path_ratio", "path driven / shortest", "", 1.0, 2),
    Score("clairvoyant_ratio", "time / clairvoyant's", "", 1.0, 2),
    Score("time_spent.driving_s", "driving", "s", 1.0, 0),
    Score("time_spent.turning_s", "turning on the spot", "s", 1.0, 0),
    Score("time_spent.sweeping_s", "standing to sweep", "s", 1.0, 0),
    Score("time_spent.waiting_s", "waiting", "s", 1.0, 0),
)

CHAOS_SCORES: tuple[Score, ...] = (
    Score("chaos.kill", "kills", "", 1.0, 0, "sum"),
    Score("chaos.stop", "stops", "", 1.0, 0, "sum"),
    Score("chaos.starve", "starvings", "", 1.0, 0, "sum"),
    Score("chaos.restarts", "restarts", "", 1.0, 0, "sum"),
)


def scores_of(runs: Iterable[Run]) -> tuple[Score, ...]:
    """The scores that are shown of runs: what a bad hand did only where there was one."""
    return SCORES + (CHAOS_SCORES if any(run.number("chaos.kill") is not None for run in runs) else ())


def class_time(run: Run) -> float | None:
    """Seconds of all classification; None unless both parts are known."""
    local, whole = run.number("local_classification_time_s"), run.number("global_classification_time_s")
    return None if local is None or whole is None else local + whole


def missed_area(run: Run) -> float | None:
    """Reachable ground that the map does not cover, in m2."""
    share, area = run.number("coverage"), run.number("reachable_area_m2")
    return None if share is None or area is None else (1.0 - share) * area


def keyed(key: str) -> Measure:
    """The measure that reads one number of the summary."""
    return lambda run: run.number(key)


@dataclass(frozen=True)
class Compared:
    """A measure by which profiles are compared, and which way is better."""

    key: str
    heading: str
    better: str
    measure: Measure


COMPARED: tuple[Compared, ...] = (
    Compared("coverage", "coverage", "more is better", keyed("coverage")),
    Compared("runtime_s", "runtime", "less is better", keyed("runtime_s")),
    Compared("sim_time_s", "simulated time", "less is better", keyed("sim_time_s")),
    Compared("class_time_s", "classification time", "less is better", class_time),
    Compared("distance_m", "distance driven", "less is better", keyed("distance_m")),
)
