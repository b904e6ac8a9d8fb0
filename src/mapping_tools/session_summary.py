"""The summary that ./map_bag leaves in a session folder, how it tells of it, and of which recordings an earlier one says the session is."""

from __future__ import annotations

import json
from pathlib import Path

from mapping_tools.map_origin import ORIGIN
from mapping_tools.tool_errors import say
from rigid_geometry import origin_text
from whole_files import write_whole

SUMMARY = "map_summary.json"
_OF_OTHER_TOOLS = ("run.json", "merge_summary.json")


def recordings_of(folder: Path) -> list[str] | None:
    """The full paths of the recordings that became a session, none where another tool made it; None of a run that was killed."""
    try:
        summary = json.loads((folder / SUMMARY).read_bytes())
        return [str(path) for path in summary.get("recordings", [str(Path(summary["recording"]).resolve())])]
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return [] if any((folder / name).is_file() for name in _OF_OTHER_TOOLS) else None


def ended(folder: Path, recording: Path, summary: dict[str, object]) -> int:
    """Writes the summary, says how it ended, and returns the exit code."""
    problems, missing, origin = summary["problems"], summary["not_placed"], summary["origin_m"]
    assert isinstance(problems, list) and isinstance(missing, list) and isinstance(origin, list)
    for text in problems:
        say(f"{recording}: {text}")
    if any(origin):
        say(f"{folder}: {origin_text(origin)} ({ORIGIN})")
    if summary["known"]:
        until = f"{summary['known']} sweeps up to stamp {summary['known_until_s']:.2f} s"
        say(f"{until} are taken for the session's own, and were passed over")
    if missing:
        say(f"{len(missing)} sweeps could not be placed: {', '.join(str(entry['sweep']) for entry in missing)}")
    say(f"{folder}: {summary['vertices']} vertices, {summary['edges']} edges, {summary['loop_closures']} loops closed")
    try:
        write_whole(folder / SUMMARY, (json.dumps(summary, indent=1, allow_nan=False) + "\n").encode("utf-8"))
    except OSError as error:
        say(f"{SUMMARY} could not be written: {error}")
        return 1
    return 0 if summary["complete"] else 1
