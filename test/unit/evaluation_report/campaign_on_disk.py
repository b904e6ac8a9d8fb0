"""Small campaign folders, written by hand: summaries of a few lines, and no maps."""

import json
from pathlib import Path
from typing import Any

SUMMARY: dict[str, Any] = {
    "success": True,
    "stop_reason": "explored: no reachable frontier is left in the whole map",
    "sim_time_s": 400.0,
    "compute_s": 20.0,
    "runtime_s": 420.0,
    "sweeps": 30,
    "local_classifications": 40,
    "local_classification_time_s": 1.25,
    "global_classifications": 2,
    "global_classification_time_s": 0.25,
    "coverage": 0.9,
    "reachable_area_m2": 200.0,
    "map_rmse_m": 0.02,
    "map_p95_m": 0.05,
    "map_completeness_rms_m": 0.03,
    "map_completeness_p95_m": 0.06,
    "seen_surface_share": 0.97,
    "trajectory_ate_m": 0.004,
    "rpe_translation_m": 0.002,
    "rpe_rotation_rad": 0.001,
    "classification": {
        "false_safe_m2": 0.5,
        "false_unsafe_m2": 2.0,
        "false_safe_by_cause": {"obstacle": 0.5},
        "false_unsafe_by_cause": {"grazing_lines": 1.5, "edge": 0.5},
    },
    "collisions": 0,
    "collision_top_speed_mps": None,
    "max_tilt_rad": 0.2,
    "fell": False,
    "path_ratio": 1.4,
    "time_spent": {"driving_s": 180.0, "turning_s": 20.0, "sweeping_s": 160.0, "waiting_s": 40.0},
    "distance_m": 80.0,
    "activity_s": {"driving": 200.0, "sweeping": 160.0, "waiting": 40.0},
    "coverage_curve": [
        {"time_s": 10.0, "distance_m": 0.0, "coverage": 0.2},
        {"time_s": 200.0, "distance_m": 40.0, "coverage": 0.6},
        {"time_s": 390.0, "distance_m": 80.0, "coverage": 0.9},
    ],
    "config": {"octomap_server_3dnav_node": {"resolution": 0.08, "out": "somewhere"}},
    "missing": [],
}
MACHINE = {"cpu": "a processor", "cores": 2, "python": "3.11.2", "packages": {"numpy": "2.4.6"}}


def write_campaign(
    folder: Path,
    worlds: tuple[str, ...] = ("ramp",),
    seeds: tuple[int, ...] = (1, 2, 3, 4),
    profiles: tuple[str, ...] = ("ours",),
) -> Path:
    """campaign.json only: all runs are missing."""
    folder.mkdir(parents=True, exist_ok=True)
    asked: dict[str, Any] = {"format": 1, "worlds": worlds, "seeds": seeds, "profiles": profiles, "version": "v1-2-gabc"}
    asked |= {"started": "2026-11-21T16:00:00", "jobs": 2, "limits": {"sim_s": 1800.0, "wall_s": 900.0}, "machine": MACHINE}
    (folder / "campaign.json").write_text(json.dumps(asked))
    return folder


def write_run(
    folder: Path, world: str, seed: int, profile: str = "ours", status: str = "finished", error: str | None = None, **changed: Any
) -> Path:
    """A run that ended; `changed` replaces values of the summary."""
    place = folder / "runs" / profile / f"{world}-{seed}"
    place.mkdir(parents=True)
    outcome = {"world": world, "seed": seed, "profile": profile, "status": status, "exit_code": 0, "error": error}
    (place / "outcome.json").write_text(json.dumps({**outcome, "wall_s": 100.0, "started": "2026-11-21T16:00:01", "attempts": 1}))
    (place / "summary.json").write_text(json.dumps({**SUMMARY, "world": world, "seed": seed, **changed}))
    return place
