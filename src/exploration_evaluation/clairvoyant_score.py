"""A judged run against the clairvoyant: adds to its summary.json what a robot that knew the world would have taken.

Last, and only where it is asked for, because it takes seconds: of one core 0.5 s in `rooms`, 3.5 s in `ramp`. What was computed is kept
in ~/.cache/explore_3dnav/clairvoyant, or below XDG_CACHE_HOME, one file for each world, start, robot, sensor and speed.
"""

import contextlib
import hashlib
import os
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from exploration_evaluation.clairvoyant import SENSOR_VIEWS, Clairvoyant, ClairvoyantConfig, clairvoyant
from exploration_evaluation.config import RobotShape
from exploration_evaluation.mesh import Floats, Ints, read_mesh
from exploration_evaluation.run_files import JsonObject, read_json, read_robot, read_trajectory, write_json
from exploration_evaluation.truth import CELL_M, reachable_ground
from exploration_evaluation.verdict import Fault

SUMMARY_KEYS = ("clairvoyant_time_s", "clairvoyant_ratio", "clairvoyant")
_METHOD = 1  # to be raised when the same question gets another answer
_WHAT = "clairvoyant"


def add_clairvoyant(directory: str | os.PathLike[str], cache: Path | None = None) -> JsonObject:
    """Adds SUMMARY_KEYS to the summary.json of a judged run folder, and returns all of it.

    clairvoyant: of both kinds of robot; clairvoyant_time_s: of the kind that drove, by the run's "mapping"; clairvoyant_ratio: the run's
    simulated time over that, None for a run that did not explore all. What cannot be had is None, with a line in "missing". `cache`: where
    results are kept, None for the user's own. ValueError when the run was not judged.
    """
    folder = Path(directory)
    summary = read_json(folder / "summary.json")
    missing = [text for text in summary.get("missing") or () if not text.startswith(_WHAT)]
    known: dict[str, Any] = dict.fromkeys(SUMMARY_KEYS)
    try:
        found = _of_run(folder, summary, cache_folder() if cache is None else cache)
        time_s = found.stopping_s if summary.get("mapping", "stop_and_go") == "stop_and_go" else found.driving_s
        known |= {"clairvoyant_time_s": time_s, "clairvoyant": asdict(found)}
        known["clairvoyant_ratio"] = _ratio(summary, time_s)
    except ValueError as error:
        missing.append(f"{_WHAT}: {error}")
    summary |= {**known, "missing": missing}
    write_json(folder / "summary.json", summary)
    return summary


def cache_folder() -> Path:
    """Where results are kept by default."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "explore_3dnav" / "clairvoyant"


def _ratio(summary: JsonObject, time_s: float) -> float:
    if {Fault.NOT_EXPLORED, Fault.MISSED} & set(summary.get("faults") or ()):
        raise ValueError("no ratio for a run that did not explore all")
    if not time_s > 0:
        raise ValueError("all is seen from the start, which takes a robot that maps while driving no time")
    return _number(summary, "sim_time_s") / time_s


def _of_run(folder: Path, summary: JsonObject, cache: Path) -> Clairvoyant:
    sensor = summary.get("sensor")
    if sensor not in SENSOR_VIEWS:
        raise ValueError(f"nothing is known of the views of sensor {sensor}; only of {', '.join(SENSOR_VIEWS)}")
    speed_mps = _number(summary, "config", "move_base_node", "follower", "max_speed_mps")
    start = np.round(read_trajectory(folder / "trajectory_truth.txt")[1][0, :3, 3], 2)
    robot = read_robot(folder)
    view = replace(SENSOR_VIEWS[sensor], eye_m=robot.laser_height_m)
    return _kept(cache, read_mesh(folder / "world.ply"), start, robot, speed_mps, view)


def _kept(
    cache: Path, mesh: tuple[Floats, Ints], start: NDArray[np.float64], robot: RobotShape, speed_mps: float, view: ClairvoyantConfig
) -> Clairvoyant:
    """From the cache, or computed and put there; a cache that cannot be read or written costs time only."""
    about = repr((_METHOD, CELL_M, start.tolist(), robot, speed_mps, view))
    digest = hashlib.sha256(b"".join([mesh[0].tobytes(), mesh[1].tobytes(), about.encode()])).hexdigest()
    path = cache / f"{digest[:32]}.json"
    with contextlib.suppress(ValueError, TypeError):
        return Clairvoyant(**read_json(path))
    found = clairvoyant(*mesh, reachable_ground(*mesh, start, robot, CELL_M), start, speed_mps, view)
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        write_json(path, asdict(found))
    return found


def _number(summary: JsonObject, *names: str) -> float:
    value: Any = summary
    for name in names:
        value = value.get(name) if isinstance(value, dict) else None
    if not isinstance(value, (int, float)) or not value > 0:
        raise ValueError(f"{'/'.join(names)} is not known")
    return float(value)
