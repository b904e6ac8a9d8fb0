"""Of many runs: how many failed, each with its cause, and what that says of the share that succeeds."""

from collections.abc import Sequence
from pathlib import Path

from scipy.stats import binomtest

from evaluation_report.campaign import Campaign, Run, Status, load_campaign, world_name
from evaluation_report.measures import CHAOS_SCORES
from evaluation_report.wording import UNKNOWN
from whole_files import write_whole

SOAK_FILE = "soak.md"
_CONFIDENCE = 0.95
_COLUMNS = ("world", "runs", "failures", "success, 95 %", "at least, at 95 %", *(score.heading for score in CHAOS_SCORES))


def write_soak(campaign_dir: Path) -> str:
    """The table and the causes as Markdown, which go to soak.md, too. ValueError as `load_campaign` raises it."""
    text = soak_text(load_campaign(campaign_dir))
    write_whole(campaign_dir / SOAK_FILE, text)
    return text


def soak_text(campaign: Campaign) -> str:
    """A row a world and one of all. What was made and is not known to be a success is a failure; missing runs are not counted."""
    made = [run for run in campaign.runs if run.status is not Status.MISSING]
    rows = [_row(world_name(world), [run for run in made if run.world == world]) for world in campaign.worlds]
    lines = [_line(_COLUMNS), _line(["--"] * len(_COLUMNS)), *map(_line, [*rows, _row("all", made)]), ""]
    lines += [f"- {run.name}: {cause(run)}" for run in made if not run.verdict]
    missing = [run.name for run in campaign.runs if run.status is Status.MISSING]
    return "\n".join([*lines, *([f"\nNot made: {'; '.join(missing)}"] if missing else []), ""])


def cause(run: Run) -> str:
    """Why a run is no success, in its own words."""
    faults = run.summary.get("faults")
    words = [run.error or "", *(map(str, faults) if isinstance(faults, list) else ()), run.text("stop_reason") or ""]
    return "; ".join(dict.fromkeys(word for word in words if word)) or "not judged"


def _line(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _row(name: str, runs: Sequence[Run]) -> list[str]:
    succeeded = sum(bool(run.verdict) for run in runs)
    done = [[run.number(score.key) for run in runs] for score in CHAOS_SCORES]
    told = [f"{sum(v for v in values if v is not None):.0f}" if any(v is not None for v in values) else UNKNOWN for values in done]
    return [name, str(len(runs)), str(len(runs) - succeeded), *_shares(succeeded, len(runs)), *told]


def _shares(succeeded: int, runs: int) -> tuple[str, str]:
    """The interval of the share that succeeds, and its lower bound alone (Clopper and Pearson 1934): of 300 without a failure 99 %."""
    if not runs:
        return UNKNOWN, UNKNOWN
    both = binomtest(succeeded, runs).proportion_ci(_CONFIDENCE, "exact")
    least = binomtest(succeeded, runs, alternative="greater").proportion_ci(_CONFIDENCE, "exact").low
    return f"{100 * both.low:.1f}–{100 * both.high:.1f} %", f"{100 * least:.1f} %"
