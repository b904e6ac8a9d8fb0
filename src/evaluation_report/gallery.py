"""The runs one by one, worst first: what happened, why, and how to watch it again."""

import base64
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evaluation_report.campaign import Campaign, Grade, Run, Status, world_name
from evaluation_report.measures import missed_area
from evaluation_report.pictures import small_picture
from evaluation_report.wording import UNKNOWN, clock, counted, number, percent

_ORDER = {Status.MISSING: 0, Status.CRASHED: 1, Status.WALL_LIMIT: 2, Status.SIM_LIMIT: 3, Status.FINISHED: 4}
_GRADES = {Grade.GOOD: "succeeded", Grade.PARTIAL: "left ground unexplored", Grade.FAILED: "failed"}
_CAUSES_SHOWN = 2
_WORTH_NAMING_M2 = 0.05
_PICTURE_WIDTH_PX = 760  # of a run's picture in the page
# The pictures of the runs are most of the page. They share a budget, so that a report of many runs can be sent by mail.
_PICTURES_BUDGET_MB = 3.2  # of all embedded pictures together, before encoding as text
_PICTURE_LIMIT_KB = 90.0  # size of one picture


@dataclass(frozen=True)
class RunCard:
    """One run as it is shown; `picture` is a data URI; it and the command are empty when there is nothing to see."""

    title: str
    verdict: str
    good: bool
    stop_reason: str
    causes: tuple[str, ...]
    facts: tuple[tuple[str, str], ...]
    command: str
    picture: str


def worst_first(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Missing, crashed and hung ones, then failures, then by coverage, collisions and tilt."""
    return tuple(sorted(runs, key=_badness))


def _badness(run: Run) -> tuple[float, ...]:
    success = {Grade.FAILED: 0, None: 1, Grade.PARTIAL: 2, Grade.GOOD: 3}[run.grade]
    known = (run.number("coverage"), run.number("collisions"), run.number("max_tilt_rad"))
    coverage, collisions, tilt = (-1.0 if value is None else value for value in known)
    return (_ORDER[run.status], success, coverage, -collisions, -tilt)


def run_cards(campaign: Campaign, profile: str) -> tuple[RunCard, ...]:
    """The runs of a profile, worst first."""
    return tuple(_card(campaign, run) for run in worst_first([run for run in campaign.runs if run.profile == profile]))


def _card(campaign: Campaign, run: Run) -> RunCard:
    limit = min(1e3 * _PICTURE_LIMIT_KB, 1e6 * _PICTURES_BUDGET_MB / len(campaign.runs))
    picture = small_picture(run.folder, _PICTURE_WIDTH_PX, limit)
    return RunCard(
        title=f"{world_name(run.world)}, seed {run.seed}",
        verdict=_verdict(run),
        good=run.verdict is True,
        stop_reason=run.text("stop_reason") or "not known",
        causes=tuple(causes(campaign, run)),
        facts=_facts(run),
        command="" if run.status is Status.MISSING else f"./replay {shown_path(run.folder)}",
        picture=f"data:image/webp;base64,{base64.b64encode(picture).decode()}" if picture else "",
    )


def _verdict(run: Run) -> str:
    if run.status is not Status.FINISHED:
        return str(run.status.value)
    return "not judged" if run.grade is None else _GRADES[run.grade]


def shown_path(folder: Path) -> str:
    """As a person would type it: relative to where the report is made, when it lies below."""
    try:
        return str(folder.resolve().relative_to(Path.cwd()))
    except ValueError:
        return str(folder)


def causes(campaign: Campaign, run: Run) -> list[str]:
    """What is known to have gone wrong, gravest first; nothing for a run without a flaw."""
    found = _why_not_finished(campaign, run)
    if run.averaged and run.error:
        found.append(run.error)
    if run.number("fell"):
        found.append(f"fell, tilted by {number(run.number('max_tilt_rad'), 0, 180 / math.pi)} deg")
    if (touches := run.number("collisions")) is not None and touches > 0:
        found.append(f"{counted(int(touches), 'collision')}, at up to {number(run.number('collision_top_speed_mps'), 2)} m/s")
    found.append(_by_cause(run, "false_safe", "taken for safe", 3, 0.0))
    if run.averaged and not (run.text("stop_reason") or "explored").startswith("explored"):
        found.append("ended before everything reachable was seen")
    if (area := missed_area(run)) is not None and area > _WORTH_NAMING_M2:
        found.append(f"{area:.1f} m² of reachable ground not mapped")
    found.append(_by_cause(run, "false_unsafe", "taken for closed", 1, _WORTH_NAMING_M2))
    if run.verdict is None and run.averaged and not run.error:
        missing = run.summary.get("missing")
        found.append("not judged: " + (str(missing[0]) if isinstance(missing, list) and missing else "the summary has no verdict"))
    return [text for text in found if text]


def _why_not_finished(campaign: Campaign, run: Run) -> list[str]:
    limits = campaign.limits
    if run.status is Status.MISSING:
        return [run.error or "no outcome was written"]
    if run.status is Status.CRASHED:
        return [run.error or "crashed, without a message"]
    if run.status is Status.WALL_LIMIT:
        return [run.error or f"stopped after {_seconds(limits.get('wall_s'))} of wall time"]
    if run.status is Status.SIM_LIMIT:
        return [run.error or f"stopped after {_seconds(limits.get('sim_s'))} of simulated time"]
    return []


def _seconds(limit: object) -> str:
    return f"{limit:.0f} s" if isinstance(limit, (int, float)) else "its limit"


def _by_cause(run: Run, key: str, text: str, decimals: int, least_m2: float) -> str:
    """Ground classified wrongly, with the causes that make up most of it; nothing for no more than `least_m2`."""
    classification = run.summary.get("classification")
    parts = classification.get(f"{key}_by_cause") if isinstance(classification, dict) else None
    area = run.number(f"classification.{key}_m2")
    if area is None or area <= least_m2:
        return ""
    known = {str(c): v for c, v in parts.items() if isinstance(v, (int, float)) and v > 0} if isinstance(parts, dict) else {}
    largest = sorted(known.items(), key=lambda item: (-item[1], item[0]))[:_CAUSES_SHOWN]
    why = ", ".join(f"{cause.replace('_', ' ')} {value:.{decimals}f}" for cause, value in largest)
    return f"{area:.{decimals}f} m² {text}" + (f" ({why})" if why else "")


def _facts(run: Run) -> tuple[tuple[str, str], ...]:
    if not run.summary:
        return ()
    sweeps, distance = run.number("sweeps"), run.number("distance_m")
    return (
        ("coverage", percent(run.number("coverage"), 1)),
        ("runtime", f"{clock(run.number('runtime_s'))} min" if run.number("runtime_s") is not None else UNKNOWN),
        ("driven", f"{number(distance, 0)} m" if distance is not None else UNKNOWN),
        ("sweeps", number(sweeps, 0)),
    )
