"""The configuration of a campaign's runs: what the profiles have in common, and where they differ."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from evaluation_report.campaign import Campaign, Run
from evaluation_report.tables import Cell, Row, Table
from evaluation_report.wording import UNKNOWN

# These differ from run to run by their nature.
_OF_THE_RUN = {"out", "seed", "world", "start", "size", "area"}
_VARIES = "varies between runs"


def profile_parameters(campaign: Campaign, profile: str) -> dict[str, str]:
    """node/section/name to value, over all runs of a profile that say theirs; a value that is not the same in all of them is told so."""
    found: dict[str, str] = {}
    for run in campaign.runs:
        if run.profile == profile:
            for name, value in _flat(_config(run)):
                found[name] = value if found.get(name, value) == value else _VARIES
    return found


def difference_table(campaign: Campaign) -> Table | None:
    """Parameters in which the profiles differ; None when they do not, or there is one profile."""
    by_profile = [profile_parameters(campaign, profile) for profile in campaign.profiles]
    names = sorted({name for parameters in by_profile for name in parameters})
    known = [parameters for parameters in by_profile if parameters]
    differing = [name for name in names if len({parameters.get(name) for parameters in known}) > 1]
    if not differing:
        return None
    rows = (Row((Cell(name), *(Cell(parameters.get(name, UNKNOWN)) for parameters in by_profile))) for name in differing)
    return Table("Where the profiles differ", ("parameter", *campaign.profiles), tuple(rows))


def reference_lines(campaign: Campaign) -> tuple[str, ...]:
    """All parameters of the reference profile, one a line."""
    return tuple(f"{name}: {value}" for name, value in sorted(profile_parameters(campaign, campaign.reference).items()))


def _config(run: Run) -> Mapping[str, Any]:
    config = run.summary.get("config")
    return config if isinstance(config, Mapping) else {}


def _flat(config: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    for name, value in config.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{above}{name}/")
        elif name not in _OF_THE_RUN:
            yield f"{above}{name}", _text(value)


def _text(value: Any) -> str:
    if isinstance(value, Sequence) and not isinstance(value, str):
        return ", ".join(_text(v) for v in value)
    return " ".join(str(value).split())
