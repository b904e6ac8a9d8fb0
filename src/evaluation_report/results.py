"""The report's numbers for programs: SI units, null for what is not known."""

from evaluation_report.campaign import Campaign, Run
from evaluation_report.measures import COMPARED, class_time, missed_area, scores_of
from evaluation_report.statistics import mean_of, paired_ratio, success_count, success_ratio

_COUNTED = (
    "runtime_s",
    "sim_time_s",
    "compute_s",
    "clairvoyant_time_s",
    "distance_m",
    "sweeps",
    "refused_matches",
    "local_classifications",
    "local_classification_time_s",
    "global_classifications",
    "global_classification_time_s",
)


def results(campaign: Campaign) -> dict[str, object]:
    """One object a run, and success, means and ratios by world and profile; every mean with the runs that it covers."""
    return {
        "format": 1,
        "worlds": list(campaign.worlds),
        "seeds": list(campaign.seeds),
        "profiles": list(campaign.profiles),
        "version": campaign.version,
        "started": campaign.started,
        "runs": [_run(run) for run in campaign.runs],
        "groups": [_group(campaign, world, profile) for world in campaign.worlds for profile in campaign.profiles],
    }


def _run(run: Run) -> dict[str, object]:
    scores = {score.key: run.number(score.key) for score in scores_of([run])}
    counted = {key: run.number(key) for key in _COUNTED}
    return {
        "world": run.world,
        "seed": run.seed,
        "profile": run.profile,
        "status": run.status.value,
        "success": run.verdict,
        "error": run.error,
        "stop_reason": run.text("stop_reason"),
        **counted,
        "class_time_s": class_time(run),
        "missed_m2": missed_area(run),
        **scores,
    }


def _group(campaign: Campaign, world: str, profile: str) -> dict[str, object]:
    runs = campaign.runs_of(world, profile)
    count = success_count(runs)
    bounds = count.interval
    combined = {}
    for score in scores_of(runs):
        found = mean_of(runs, score.of, score.combine)
        combined[score.key] = {score.combined: found.value, "runs": found.runs, "asked": found.asked}
    for compared in COMPARED:
        found = mean_of(runs, compared.measure)
        combined[compared.key] = {"mean": found.value, "runs": found.runs, "asked": found.asked}
    return {
        "world": world,
        "profile": profile,
        "succeeded": count.succeeded,
        "judged": count.judged,
        "asked": count.asked,
        "wilson_95": [bounds.low, bounds.high] if bounds else None,
        "combined": combined,
        "ratios": _ratios(campaign, world, profile),
    }


def _ratios(campaign: Campaign, world: str, profile: str) -> dict[str, object] | None:
    """The reference over this profile; None for the reference itself."""
    if profile == campaign.reference:
        return None
    ours, theirs = campaign.runs_of(world, campaign.reference), campaign.runs_of(world, profile)
    found = {"success": success_ratio(ours, theirs)} | {c.key: paired_ratio(ours, theirs, c.measure) for c in COMPARED}
    return {key: {"ratio": r.value, "low": r.low, "high": r.high, "pairs": r.pairs} for key, r in found.items()}
