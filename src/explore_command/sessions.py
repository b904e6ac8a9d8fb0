"""Sessions that go on: what ./explore --resume and --map need to know of the folder of an earlier run."""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

RUN, BEFORE = "run.json", "run_before.json"
"""What a run was started with; and what the one was that it goes on with, until it has written its own."""
ZONES, CONTACTS = "zones.yaml", "contacts.csv"
_PAUSE_S = 10.0


@dataclass(frozen=True)
class EarlierRun:
    """What a run was started with, None where it did not write it down; robot and zones are files in its folder.

    `of_world`: start, area, size, scale, up, models and ground, as the command line has them; None where nothing was said.
    """

    world: str | None = None
    seed: int | None = None
    sensor: str | None = None
    realism: str | None = None
    mapping: str | None = None
    movers: str | None = None
    profile: str | None = None
    robot: Path | None = None
    zones: Path | None = None
    of_world: Mapping[str, object] = field(default_factory=dict)


NO_RUN = EarlierRun()


def earlier_run(folder: Path) -> EarlierRun:
    """What run.json in the folder says, or of a run that went on but wrote none, the one before; robot.yaml and zones.yaml, too."""
    robot, zones = (path if path.is_file() else None for path in (folder / "robot.yaml", folder / ZONES))
    try:
        told = folder / RUN if (folder / RUN).exists() else folder / BEFORE
        run = json.loads(told.read_text())
        simulator = run.get("config", {}).get("pybullet_sim_node", {})
        return EarlierRun(
            world=str(run["world"]),
            seed=int(run["seed"]),
            sensor=run.get("sensor"),
            realism=simulator.get("realism"),
            mapping=run.get("mapping"),
            movers=str(simulator.get("movers") or ""),
            profile=run.get("profile"),
            robot=robot,
            zones=zones,
            of_world=_of_world({key: str(value) for key, value in simulator.items()}),
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return EarlierRun(robot=robot, zones=zones)


def _of_world(said: Mapping[str, str]) -> dict[str, object]:
    numbers = {name: [float(v) for v in said.get(name, "").split()] or None for name in ("start", "area", "size", "scale", "ground")}
    single = {name: values[0] for name in ("scale", "ground") if (values := numbers[name])}
    folders = [folder for folder in said.get("models", "").split(os.pathsep) if folder]
    return {**numbers, **single, "up": said.get("up") or None, "models": folders or None}


def clock_after(folder: Path, option: str) -> float:
    """Seconds at which the clock goes on after all sweeps of the session in a folder; ValueError when there is none."""
    from pose_graph_mapping.session.session_store import SessionStore  # loads gtsam: only when it is asked for

    if not (folder / "sweeps").is_dir():
        raise ValueError(f"{option} {folder}: no session there, sweeps/ is missing")
    try:
        sweeps = SessionStore(folder).sweeps
    except (ValueError, OSError) as error:
        raise ValueError(f"{option} {folder}: {error}") from error
    if not sweeps:
        raise ValueError(f"{option} {folder}: the session there holds no sweep")
    return float(round(max(sweep.stamp_s for sweep in sweeps) + _PAUSE_S))
