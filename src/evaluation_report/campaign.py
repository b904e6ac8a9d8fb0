"""A campaign folder as `./evaluate` leaves it, read into plain dataclasses; first step of the report.

Every run that was asked for is there, also one of which nothing is on disk: it has the status "missing". What cannot be read
leaves an empty summary and a reason, so that a campaign can be reported in any state.
"""

import enum
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from exploration_evaluation import read_json
from exploration_evaluation.verdict import Fault

REFERENCE_PROFILE = "ours"
# A run that ended well and left larger parts unexplored: the thesis marks such with "~" and counts them apart. The judge calls that a fault
# now; summaries of earlier versions tell their coverage only.
GOOD_COVERAGE = 0.90


class Status(enum.Enum):
    """How a run ended; MISSING is one that was not made, or whose worker died before it could say so."""

    FINISHED = "finished"
    CRASHED = "crashed"
    WALL_LIMIT = "wall limit"
    SIM_LIMIT = "sim limit"
    MISSING = "missing"


class Grade(enum.Enum):
    """The marks of the thesis's tables 7.1 and 7.2."""

    GOOD = "✓"
    PARTIAL = "~"
    FAILED = "×"


@dataclass(frozen=True)
class Run:
    """One run that was asked for, with whatever is known of it.

    `error` says why there is less than a finished run has, `version` which code made it.
    """

    world: str
    seed: int
    profile: str
    folder: Path
    status: Status
    error: str | None
    summary: Mapping[str, Any]
    version: str | None = None

    @property
    def name(self) -> str:
        """As a person would call it."""
        return f"{self.profile}, {world_name(self.world)} {self.seed}"

    @property
    def verdict(self) -> bool | None:
        """Whether it succeeded; a crash, a limit and a partial success are failures, a missing run or one without judgement is None."""
        return None if self.grade is None else self.grade is Grade.GOOD

    @property
    def grade(self) -> Grade | None:
        """As the thesis grades its runs; None for a missing run or one that could not be judged."""
        if self.status is Status.MISSING:
            return None
        coverage = self.number("coverage")
        if self.status is Status.FINISHED and self.summary.get("faults") == [Fault.MISSED]:
            return Grade.PARTIAL
        if self.status is not Status.FINISHED or self.summary.get("success") is False:
            return Grade.FAILED
        if self.summary.get("success") is not True or coverage is None:
            return None
        return Grade.GOOD if coverage >= GOOD_COVERAGE else Grade.PARTIAL

    @property
    def averaged(self) -> bool:
        """Whether its numbers enter means: a run cut short by a crash or a limit has numbers of another thing."""
        return self.status is Status.FINISHED

    def number(self, key: str) -> float | None:
        """A finite number of the summary, None when it is unknown; dots lead into objects, booleans count 0 and 1."""
        value: Any = self.summary
        for part in key.split("."):
            value = value.get(part) if isinstance(value, Mapping) else None
        known = isinstance(value, (int, float)) and math.isfinite(value)
        return float(value) if known else None

    def text(self, key: str) -> str | None:
        """A text of the summary, None when it is unknown or empty."""
        value = self.summary.get(key)
        return value if isinstance(value, str) and value else None

    def curve(self) -> tuple[tuple[float, float, float], ...]:
        """Time (s), distance (m) and coverage (0..1) at each sweep; points that are not whole are left out."""
        points = self.summary.get("coverage_curve")
        rows = points if isinstance(points, list) else []
        numbers = (tuple(row.get(key) for key in ("time_s", "distance_m", "coverage")) for row in rows if isinstance(row, Mapping))
        return tuple(p for p in numbers if all(isinstance(v, (int, float)) and math.isfinite(v) for v in p))  # type: ignore[misc]


@dataclass(frozen=True)
class Campaign:
    """What was asked, on which machine, and all runs in the order world, profile, seed."""

    directory: Path
    worlds: tuple[str, ...]
    seeds: tuple[int, ...]
    profiles: tuple[str, ...]
    version: str
    started: str
    jobs: int | None
    sensor: str
    realism: str
    mapping: str
    limits: Mapping[str, Any]
    machine: Mapping[str, Any]
    runs: tuple[Run, ...]
    not_asked: tuple[str, ...]

    @property
    def reference(self) -> str:
        """The profile that the others are compared with."""
        return REFERENCE_PROFILE if REFERENCE_PROFILE in self.profiles else self.profiles[0]

    def runs_of(self, world: str, profile: str) -> tuple[Run, ...]:
        """The runs of one world and profile, by seed."""
        return tuple(run for run in self.runs if (run.world, run.profile) == (world, profile))


def world_name(world: str) -> str:
    """A world without folder and extension, as it stands in the name of a run's folder."""
    return Path(world).stem if Path(world).suffix or "/" in world else world


def load_campaign(directory: Path | str) -> Campaign:
    """Reads campaign.json and all run folders; ValueError when there is no campaign, or it does not say what was asked."""
    folder = Path(directory)
    asked = read_json(folder / "campaign.json")
    worlds, seeds, profiles = (_asked(asked, key, kind) for key, kind in (("worlds", str), ("seeds", int), ("profiles", str)))
    profiles = tuple(Path(profile).stem for profile in profiles)  # so their folders are called, and they may be files
    runs = tuple(_load_run(folder, world, seed, profile) for world in worlds for profile in profiles for seed in seeds)
    jobs, begun_with = asked.get("jobs"), str(asked.get("version") or "unknown")
    return Campaign(
        directory=folder,
        worlds=worlds,
        seeds=seeds,
        profiles=profiles,
        version=", ".join({run.version or begun_with: None for run in runs if run.status is not Status.MISSING}) or begun_with,
        started=str(asked.get("started") or "unknown"),
        jobs=jobs if isinstance(jobs, int) else None,
        sensor=str(asked.get("sensor") or "tilting"),  # the only one there was when campaigns did not say
        realism=str(asked.get("realism") or "ideal"),  # likewise
        mapping=str(asked.get("mapping") or "stop_and_go"),  # likewise
        limits=_mapping(asked.get("limits")),
        machine=_mapping(asked.get("machine")),
        runs=runs,
        not_asked=tuple(_not_asked(folder, {run.folder for run in runs})),
    )


def _asked(asked: Mapping[str, Any], key: str, kind: type) -> tuple[Any, ...]:
    values = asked.get(key)
    if not isinstance(values, list) or not values or not all(isinstance(v, kind) for v in values):
        raise ValueError(f'campaign.json: "{key}" is a list of at least one {kind.__name__}, not {values!r}')
    return tuple(values)


def _load_run(folder: Path, world: str, seed: int, profile: str) -> Run:
    place = folder / "runs" / profile / f"{world_name(world)}-{seed}"
    status, error, outcome = _outcome(place)
    summary: Mapping[str, Any] = {}
    if status is not Status.MISSING:
        try:
            summary = read_json(place / "summary.json")
        except ValueError as reason:
            error = error or f"not judged: {reason}"
    chaos = _mapping(outcome.get("chaos"))  # what a bad hand did to it
    return Run(world, seed, profile, place, status, error, {**summary, "chaos": chaos} if chaos else summary, outcome.get("version"))


def _outcome(place: Path) -> tuple[Status, str | None, Mapping[str, Any]]:
    """How it ended, why there is less than a finished run has, and all that its outcome.json says."""
    try:
        outcome = read_json(place / "outcome.json")
        status = Status(outcome.get("status"))
    except ValueError as reason:
        started = place.is_dir() and any(place.iterdir())
        return Status.MISSING, f"begun but not ended: {reason}" if started else "not made", {}
    error = outcome.get("error")
    return status, str(error) if error else None, outcome


def _not_asked(folder: Path, asked: set[Path]) -> Iterator[str]:
    for place in sorted(folder.glob("runs/*/*/outcome.json")):
        if place.parent not in asked:
            yield f"{place.parent.parent.name}/{place.parent.name}"


def _mapping(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, Mapping) else {}
