"""The judgement at a run's end: whoever is there to make it, the monitor or ./explore, makes it from the folder alone."""

from pathlib import Path
from typing import Any

from exploration_evaluation.mesh import read_mesh
from exploration_evaluation.report import format_summary
from exploration_evaluation.run_files import read_json, write_json
from exploration_evaluation.run_folder import evaluate_run
from exploration_evaluation.verdict import INTERRUPTED as INTERRUPTED
from whole_files import refusal


def judged_at_end(folder: Path) -> str:
    """Writes summary.json and the pictures of a run that is over; the text for the terminal.

    Of a run that ended before it had a world, the summary holds what the run reported. ValueError when the folder does not exist.
    """
    if not (folder / "world.ply").exists():
        reported = {**_read(folder / "run.json"), **_read(folder / "counters.json")}
        try:
            write_json(folder / "summary.json", {**reported, "success": False})
        except OSError as error:
            return _not_judged(folder, error)
        return f"ended before it began: {reported.get('stop_reason') or 'no stop reason'}"
    try:
        summary = evaluate_run(folder, *read_mesh(folder / "world.ply"))
    except OSError as error:
        return _not_judged(folder, error)
    from exploration_evaluation.pictures import draw_pictures  # matplotlib takes a second to load

    try:
        draw_pictures(folder, summary)
    except (ValueError, OSError) as error:
        return f"{format_summary(summary)}\nno pictures: {why_not(error, folder)}"
    return format_summary(summary)


def judged_for_monitor(folder: Path, reason: str) -> str:
    """As `judged_at_end`, where the monitor could not; `reason` says why the run ended, unless the monitor came to write a better one."""
    counters = _read(folder / "counters.json")
    if counters.get("stop_reason") in (None, INTERRUPTED):
        try:
            write_json(folder / "counters.json", {**counters, "stop_reason": reason})
        except OSError as error:
            return _not_judged(folder, error)
    return judged_at_end(folder)


def why_not(error: Exception, folder: Path) -> str:
    """What a person is told of a file that could not be written to a folder, or read there."""
    return refusal(error, folder) if isinstance(error, OSError) else str(error)


def _not_judged(folder: Path, error: OSError) -> str:
    return f"not judged: {refusal(error, folder / 'summary.json')}; then: python -m exploration_evaluation {folder}"


def _read(path: Path) -> dict[str, Any]:
    try:
        return read_json(path)
    except ValueError:
        return {}
