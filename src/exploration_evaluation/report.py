"""A summary as text that fits one screen; what is not known is said, never left out."""

import math
import textwrap
from collections.abc import Mapping
from typing import Any

from exploration_evaluation.run_files import JsonObject
from exploration_evaluation.verdict import Fault

_UNKNOWN = "unknown"
_COLUMNS = 100
_MISSING_SHOWN = 5


def format_summary(summary: JsonObject) -> str:
    """At most 24 lines of 100 columns about a summary as `evaluate_run` returns it; absent keys read "unknown".

    Of a run that was not judged (no key "coverage"), such as a real robot's, only what the robot itself knows.
    """
    lines = [_headline(summary), ""]
    rows = (_judged_rows(summary) if "coverage" in summary else []) + _own_rows(summary)
    lines += [f"  {name:<15}{text}" for name, text in rows]
    missing = list(summary.get("missing") or ())
    if missing:
        lines += ["", "  not known:", *(f"    {text}"[:100] for text in missing[:_MISSING_SHOWN])]
    if len(missing) > _MISSING_SHOWN:
        lines.append(f'    and {len(missing) - _MISSING_SHOWN} more, see "missing" in summary.json')
    return "\n".join(lines)


def _headline(summary: Mapping[str, Any]) -> str:
    """The verdict, whole: over as many lines of 100 columns as it takes."""
    verdict = {True: "SUCCESS", False: "FAILED"}.get(summary.get("success"), "UNDECIDED")  # type: ignore[arg-type]
    where = f"{summary.get('world') or 'unknown world'}, seed {_value(summary, 'seed')}: " if "coverage" in summary else ""
    return textwrap.fill(f"{verdict}  {where}{_ending(summary)}", _COLUMNS, subsequent_indent="  ", break_long_words=False)


def _ending(summary: Mapping[str, Any]) -> str:
    """Why the run ended and, where the robot thinks that it explored all, what speaks against that: "explored, but 73.2 % of ..."."""
    reason = str(summary.get("stop_reason") or "no stop reason")
    against = [_fault(fault, summary) for fault in summary.get("faults") or () if fault not in (Fault.NOT_EXPLORED, Fault.BROKEN_OFF)]
    word, _, rest = reason.partition(":")
    return f"{word}, but {' and '.join(against)}:{rest}" if against and rest else f"{reason}{''.join(f', but {text}' for text in against)}"


def _fault(fault: str, s: Mapping[str, Any]) -> str:
    missed = _value(s, "missed_piece_m2", ".1f", " m2")
    known = {
        Fault.FELL: "it fell",
        Fault.TOUCHED: f"{_value(s, 'collisions')} collision{'s' if s.get('collisions') != 1 else ''}",
        Fault.NOT_SAVED: "its map was not saved",
        Fault.NOT_ON_DISK: "not all of it is on disk",
        Fault.MISSED: f"{_share(s, 'coverage')} of the reachable ground seen, {missed} missed in one piece",
        Fault.STAYED: "it never left its start",
        Fault.OUTSIDE: f"it came {_value(s, 'outside_m', '.2f', ' m')} to where it may not be",
        Fault.LATE: "it spent more than its budget",
        Fault.NOT_HOME: f"it ended {_value(s, 'end_from_start_m', '.2f', ' m')} and {_degrees(s, 'end_from_start_rad')} from its start",
    }
    return known.get(Fault(fault), fault) if fault in set(Fault) else fault


def _judged_rows(s: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        ("coverage", f"{_share(s, 'coverage')} of {_value(s, 'reachable_area_m2', '.1f', ' m2')} of reachable ground"),
        ("and straight", f"{_share(s, 'coverage_straight')} of {_value(s, 'reachable_straight_m2', '.1f', ' m2')}, with narrow places"),
        ("map error", f"RMS {_cm(s, 'map_rmse_m')}, 95 % under {_cm(s, 'map_p95_m')}, tilted by {_degrees(s, 'map_tilt_rad')}"),
        ("completeness", f"{_share(s, 'seen_surface_share')} of {_value(s, 'visible_surface_m2', '.0f', ' m2')} that can be seen"),
        ("terrain", _terrain(s.get("classification") or {})),
        ("trajectory", f"ATE {_cm(s, 'trajectory_ate_m')}, from the first pose {_cm(s, 'trajectory_origin_error_m')}"),
        ("collisions", _collisions(s)),
        ("tilt", f"at most {_degrees(s, 'max_tilt_rad')}, fell: {_value(s, 'fell')}"),
        ("shortest way", f"{_value(s, 'shortest_length_m', '.1f', ' m')}; driven {_value(s, 'path_ratio', '.2f')} of it"),
    ]


def _own_rows(s: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        (
            "driven",
            f"{_value(s, 'distance_m', '.1f', ' m')} in {_clock(s, 'sim_time_s')} of ROS time, {_clock(s, 'wall_time_s')} wall time",
        ),
        ("time", _time(s)),
        ("sweeps", f"{_value(s, 'sweeps')}, {_value(s, 'loop_closures')} loop closures, {_value(s, 'refused_matches')} matches refused"),
        ("classification", f"local {_classified(s, 'local')}, global {_classified(s, 'global')}"),
        ("version", _value(s, "version")),
    ]


def _time(s: Mapping[str, Any]) -> str:
    """Where the time went and, where that was asked for, how much longer it took than a robot takes that knows the world."""
    spent = s.get("time_spent") or {}
    total = sum(spent.values())
    names = ("driving", "turning", "sweeping", "waiting")
    parts = [f"{name} {_share({name: spent[f'{name}_s'] / total}, name)}" for name in names] if total > 0 else [_UNKNOWN]
    if s.get("clairvoyant_ratio") is not None:
        parts.append(f"{_value(s, 'clairvoyant_ratio', '.2f')} of the clairvoyant's {_clock(s, 'clairvoyant_time_s')}")
    return ", ".join(parts)


def _value(s: Mapping[str, Any], key: str, form: str = "", unit: str = "") -> str:
    value = s.get(key)
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return _UNKNOWN
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:{form}}{unit}" if not form or isinstance(value, (int, float)) else f"{value}{unit}"


def _scaled(s: Mapping[str, Any], key: str, factor: float, form: str, unit: str) -> str:
    value = s.get(key)
    return _value({key: value * factor}, key, form, unit) if isinstance(value, (int, float)) else _UNKNOWN


def _share(s: Mapping[str, Any], key: str) -> str:
    return _scaled(s, key, 100.0, ".1f", " %")


def _cm(s: Mapping[str, Any], key: str) -> str:
    return _scaled(s, key, 100.0, ".1f", " cm")


def _degrees(s: Mapping[str, Any], key: str) -> str:
    return _scaled(s, key, 180.0 / math.pi, ".1f", " deg")


def _clock(s: Mapping[str, Any], key: str) -> str:
    value = s.get(key)
    if not isinstance(value, (int, float)) or not math.isfinite(value):
        return _UNKNOWN
    return f"{int(value) // 60}:{int(value) % 60:02d} min"


def _collisions(s: Mapping[str, Any]) -> str:
    count = _value(s, "collisions")
    if not s.get("collisions"):
        return count
    return f"{count}, at up to {_value(s, 'collision_top_speed_mps', '.2f', ' m/s')} and {_value(s, 'collision_top_force_n', '.0f', ' N')}"


def _terrain(s: Mapping[str, Any]) -> str:
    """Ground that is classified wrongly, without the part within a voxel of the true border, which resolution alone makes."""
    parts = []
    for kind in ("safe", "unsafe"):
        area, edge = s.get(f"false_{kind}_m2"), (s.get(f"false_{kind}_by_cause") or {}).get("edge")
        parts.append(_UNKNOWN if area is None or edge is None else f"{area - edge:.1f} m2")
    return f"wrongly safe {parts[0]}, wrongly unsafe {parts[1]}, beyond a voxel from the border"


def _classified(s: Mapping[str, Any], scope: str) -> str:
    return f"{_value(s, f'{scope}_classifications')} in {_value(s, f'{scope}_classification_time_s', '.2f', ' s')}"
