"""Sessions that go on: what ./explore --resume and --map need to know of the folder of an earlier run."""

import json
from dataclasses import dataclass
from pathlib import Path

_PAUSE_S = 10.0


@dataclass(frozen=True)
class EarlierRun:
    """The world (name or file), seed, sensor, realism, mapping, movers and robot's file of a run, None where it did not write them down."""

    world: str | None
    seed: int | None
    sensor: str | None
    realism: str | None
    mapping: str | None
    movers: str | None
    robot: Path | None


NO_RUN = EarlierRun(None, None, None, None, None, None, None)


def earlier_run(folder: Path) -> EarlierRun:
    """What run.json in the folder says, and robot.yaml beside it."""
    robot = folder / "robot.yaml"
    try:
        run = json.loads((folder / "run.json").read_text())
        simulator = run.get("config", {}).get("pybullet_sim_node", {})
        realism, movers = simulator.get("realism"), str(simulator.get("movers") or "")
        sensor, mapping = run.get("sensor"), run.get("mapping")
        return EarlierRun(str(run["world"]), int(run["seed"]), sensor, realism, mapping, movers, robot if robot.is_file() else None)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return NO_RUN


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
