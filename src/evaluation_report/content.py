"""Everything that a report says, before it is set as HTML or Markdown."""

from dataclasses import dataclass

from evaluation_report import charts
from evaluation_report.campaign import Campaign, Run, Status, world_name
from evaluation_report.configuration import difference_table, reference_lines
from evaluation_report.gallery import RunCard, run_cards
from evaluation_report.measures import keyed
from evaluation_report.statistics import mean_of, success_count
from evaluation_report.tables import (
    SuccessRow,
    Table,
    printed_table,
    ratio_table,
    run_table,
    score_table,
    success_rows,
)
from evaluation_report.thesis_tables import THESIS_TABLES
from evaluation_report.wording import UNKNOWN, clock, counted, listed, percent, ranges


@dataclass(frozen=True)
class WorldPart:
    """What is said of one world; a chart is an SVG, empty when no run has the numbers for it."""

    name: str
    printed_number: str
    run_tables: tuple[Table, ...]
    ratios: Table | None
    scores: tuple[Table, ...]
    time_chart: str
    distance_chart: str
    activity_chart: str


@dataclass(frozen=True)
class Content:
    """A report's parts in their order."""

    title: str
    asked: str
    ended: str
    findings: tuple[str, ...]
    facts: tuple[tuple[str, str], ...]
    left_out: tuple[tuple[str, str], ...]
    left_out_runs: int
    success: tuple[SuccessRow, ...]
    worlds: tuple[WorldPart, ...]
    gallery: tuple[tuple[str, tuple[RunCard, ...]], ...]
    differences: Table | None
    configuration: tuple[str, ...]
    packages: tuple[str, ...]
    profiles: tuple[str, ...]
    reference: str
    not_asked: tuple[str, ...]


def report_content(campaign: Campaign) -> Content:
    """Computes all tables and draws all charts and small pictures of a campaign."""
    return Content(
        title=f"{listed([world_name(w) for w in campaign.worlds])}, seeds {ranges(campaign.seeds)}",
        asked=_asked(campaign),
        ended=_ended(campaign),
        findings=tuple(_finding(campaign, world) for world in campaign.worlds),
        facts=_facts(campaign),
        left_out=_left_out(campaign),
        left_out_runs=sum(_is_left_out(run) for run in campaign.runs),
        success=success_rows(campaign),
        worlds=tuple(_world(campaign, world) for world in campaign.worlds),
        gallery=tuple((profile, run_cards(campaign, profile)) for profile in _reference_first(campaign)),
        differences=difference_table(campaign),
        configuration=reference_lines(campaign),
        packages=_packages(campaign),
        profiles=campaign.profiles,
        reference=campaign.reference,
        not_asked=campaign.not_asked,
    )


def _reference_first(campaign: Campaign) -> list[str]:
    return sorted(campaign.profiles, key=lambda name: name != campaign.reference)


def _asked(campaign: Campaign) -> str:
    worlds, profiles = [world_name(w) for w in campaign.worlds], list(campaign.profiles)
    return (
        f"{counted(len(campaign.runs), 'run')} asked for: {'worlds' if len(worlds) > 1 else 'world'} {listed(worlds)}; "
        f"{'seeds' if len(campaign.seeds) > 1 else 'seed'} {ranges(campaign.seeds)}; "
        f"{'profiles' if len(profiles) > 1 else 'profile'} {listed(profiles)}."
    )


def _ended(campaign: Campaign) -> str:
    names = {Status.WALL_LIMIT: "ran into the wall time limit", Status.SIM_LIMIT: "ran into the simulated time limit"}
    counts = [(status, sum(run.status is status for run in campaign.runs)) for status in Status]
    return listed([f"{n} {names.get(status, status.value)}" for status, n in counts if n]) + "."


def _finding(campaign: Campaign, world: str) -> str:
    """A world's result in a sentence; every mean says how many runs it covers."""
    runs = campaign.runs_of(world, campaign.reference)
    count = success_count(runs)
    bounds = count.interval
    succeeded = f"{count.succeeded} of {count.judged} succeeded" if count.judged else "no run was judged"
    if bounds is not None:
        succeeded += f" (95 % interval {100 * bounds.low:.0f}–{100 * bounds.high:.0f} %)"
    parts = [succeeded]
    for heading, key in (("mean coverage", "coverage"), ("mean runtime", "runtime_s")):
        mean = mean_of(runs, keyed(key))
        text = percent(mean.value, 1) if key == "coverage" else f"{clock(mean.value)} min"
        parts.append(f"{heading} {'not known' if mean.value is None else text} ({mean.covers} runs)")
    return f"{campaign.reference} on {world_name(world)}: {'; '.join(parts)}."


def _is_left_out(run: Run) -> bool:
    return not run.averaged or run.verdict is None


def _left_out(campaign: Campaign) -> tuple[tuple[str, str], ...]:
    """Runs that are in no mean, with the reason; seeds of one profile and world with the same reason together."""
    seeds: dict[tuple[str, str, str], list[int]] = {}
    for run in filter(_is_left_out, campaign.runs):
        seeds.setdefault((run.profile, world_name(run.world), _why_left_out(run)), []).append(run.seed)
    return tuple((f"{profile}, {world} {ranges(numbers)}", why) for (profile, world, why), numbers in seeds.items())


def _why_left_out(run: Run) -> str:
    what = "not judged" if run.averaged else run.status.value
    return f"{what}: {run.error}" if run.error and run.error != what else what


def _facts(campaign: Campaign) -> tuple[tuple[str, str], ...]:
    machine, limits = campaign.machine, campaign.limits
    cores = machine.get("cores")
    processor = str(machine.get("cpu") or "unknown") + (f", {counted(cores, 'core')}" if isinstance(cores, int) else "")
    given = [
        f"{value:.0f} s {name}" for name, value in (("simulated", limits.get("sim_s")), ("wall", limits.get("wall_s"))) if _real(value)
    ]
    return (
        ("version", campaign.version),
        ("started", campaign.started.replace("T", " ")),
        ("machine", processor),
        ("Python", str(machine.get("python") or "unknown")),
        ("sensor", campaign.sensor),
        ("realism", campaign.realism),
        ("mapping", _mappings(campaign)),
        ("runs at a time", UNKNOWN if campaign.jobs is None else str(campaign.jobs)),
        ("limits of a run", ", ".join(given) or "unknown"),
    )


def _mappings(campaign: Campaign) -> str:
    """What was asked; where every run maps as its profile says, what the runs say, by profile."""
    if campaign.mapping != "by_profile":
        return campaign.mapping.replace("_", " ")
    of = {p: sorted({mapping for run in campaign.runs if run.profile == p and (mapping := run.text("mapping"))}) for p in campaign.profiles}
    told = {p: " and ".join(mappings).replace("_", " ") or UNKNOWN for p, mappings in of.items()}
    return told[campaign.profiles[0]] if len(set(told.values())) == 1 else ", ".join(f"{p}: {mapping}" for p, mapping in told.items())


def _real(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _packages(campaign: Campaign) -> tuple[str, ...]:
    packages = campaign.machine.get("packages")
    return tuple(f"{name} {version}" for name, version in sorted(packages.items())) if isinstance(packages, dict) else ()


def _world(campaign: Campaign, world: str) -> WorldPart:
    printed = THESIS_TABLES.get(world_name(world))
    tables = [run_table(profile, campaign.runs_of(world, profile)) for profile in _reference_first(campaign)]
    if printed is not None:
        tables.insert(1, printed_table(printed))
    return WorldPart(
        name=world_name(world),
        printed_number=printed.number if printed else "",
        run_tables=tuple(tables),
        ratios=ratio_table(campaign, world),
        scores=tuple(score_table(profile, campaign.runs_of(world, profile)) for profile in _reference_first(campaign)),
        time_chart=charts.coverage_chart(campaign, world) or "",
        distance_chart=charts.coverage_chart(campaign, world, over_distance=True) or "",
        activity_chart=charts.activity_chart(campaign, world) or "",
    )
