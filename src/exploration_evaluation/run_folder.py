"""A finished run on disk: reads what its nodes left, has it scored, and writes summary.json.

Last step of the judge, and the only one that touches files. Whatever a score needs and cannot be read makes that score
None, with a line in the summary's "missing"; a partly written folder of a run that died is judged as far as it goes.
"""

import csv
import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from exploration_evaluation.config import EvaluationConfig, RobotShape
from exploration_evaluation.mesh import read_cloud
from exploration_evaluation.scores import (
    ContactEpisode,
    Motion,
    TrajectoryErrors,
    contact_episodes,
    coverage,
    divided_voxels,
    map_error,
    motion,
    trajectory_errors,
)
from exploration_evaluation.truth import ReachableGround, reachable_ground
from rigid_geometry import transform_points

Floats = NDArray[np.float64]
Trajectory = tuple[Floats, Floats]
V = TypeVar("V")

_REPORTED = (
    "world",
    "seed",
    "stop_reason",
    "sim_time_s",
    "wall_time_s",
    "sweeps",
    "loop_closures",
    "refused_matches",
    "local_classifications",
    "local_classification_time_s",
    "global_classifications",
    "global_classification_time_s",
    "config",
    "version",
)


def read_trajectory(path: Path) -> Trajectory:
    """(N,) stamps and (N, 4, 4) poses of a TUM file (stamp x y z qx qy qz qw); ValueError when absent, empty or malformed."""
    rows = _table(path, 8)
    if not len(rows) or not np.isfinite(rows).all() or (np.diff(rows[:, 0]) <= 0).any():
        raise ValueError(f"{path.name} holds no poses, or stamps that do not increase, or numbers that are not finite")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = Rotation.from_quat(rows[:, 4:8]).as_matrix(), rows[:, 1:4]
    return rows[:, 0], poses


def read_contacts(path: Path, gap_s: float = 1.0) -> tuple[ContactEpisode, ...]:
    """Collisions from contacts.csv (stamp,link,speed_mps,force_n); a file with a header only means none."""
    if not path.is_file():
        raise ValueError(f"{path.name} is not there")
    with path.open(newline="") as file:
        reader = csv.DictReader(file)
        if list(reader.fieldnames or []) != ["stamp", "link", "speed_mps", "force_n"]:
            raise ValueError(f"{path.name} has the columns {reader.fieldnames}, not stamp,link,speed_mps,force_n")
        rows = list(reader)
    numbers = {key: [_number(row[key], path) for row in rows] for key in ("stamp", "speed_mps", "force_n")}
    return contact_episodes(numbers["stamp"], tuple(row["link"] for row in rows), numbers["speed_mps"], numbers["force_n"], gap_s)


def read_occupied(path: Path) -> tuple[Floats, Floats]:
    """(N, 3) centres and (N,) edge lengths of the octomap's occupied leaves, map frame, from occupied.npz."""
    data = read_arrays(path, ("centers", "sizes"))
    centres, sizes = data["centers"].astype(np.float64), data["sizes"].astype(np.float64)
    if centres.ndim != 2 or centres.shape[1] != 3 or sizes.shape != (len(centres),):
        raise ValueError(f"{path.name} has centers {centres.shape} and sizes {sizes.shape}, not (N, 3) and (N,)")
    return centres, sizes


def read_arrays(path: Path, names: tuple[str, ...]) -> dict[str, NDArray[Any]]:
    """All arrays of an .npz file; ValueError when it is absent or damaged, or lacks one of `names`."""
    if not path.is_file():
        raise ValueError(f"{path.name} is not there")
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except Exception as error:  # numpy and zipfile raise half a dozen kinds for a file cut off
        raise ValueError(f"{path.name} cannot be read: {error}") from error
    lacking = [name for name in names if name not in arrays]
    if lacking:
        raise ValueError(f"{path.name} lacks {', '.join(lacking)}; it has {', '.join(arrays)}")
    return arrays


def read_json(path: Path) -> dict[str, Any]:
    """A JSON object; ValueError when the file is absent, cut off, or holds something else."""
    if not path.is_file():
        raise ValueError(f"{path.name} is not there")
    try:
        value = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path.name} is no JSON: {error}") from error
    if not isinstance(value, dict):
        raise ValueError(f"{path.name} holds a {type(value).__name__}, not an object")
    return value


def evaluate_run(
    directory: str | os.PathLike[str],
    vertices: ArrayLike,
    triangles: ArrayLike,
    robot: RobotShape | None = None,
    config: EvaluationConfig | None = None,
) -> dict[str, Any]:
    """Scores a run folder against the true mesh, (V, 3) and (T, 3) in the world frame, and writes its summary.json.

    The summary has all that run.json and counters.json report (`_REPORTED` at least, None where they do not) and, of the judge:
    success, coverage, map_rmse_m, map_p95_m, trajectory_ate_m, trajectory_origin_error_m, map_tilt_rad, collisions,
    collision_top_speed_mps, collision_top_force_n, max_tilt_rad, fell, distance_m, reachable_area_m2,
    turning_area_m2, and "missing": what is None and why. ValueError when the folder does not exist.
    """
    folder = Path(directory)
    if not folder.is_dir():
        raise ValueError(f"no run folder at {folder}")
    summary = _Judgement(folder, vertices, triangles, robot or RobotShape(), config or EvaluationConfig()).summary()
    write_json(folder / "summary.json", summary)
    return summary


def write_json(path: Path, value: Mapping[str, Any]) -> None:
    """Writes a JSON object so that a reader sees the old file or the whole new one; NaN becomes null."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    with beside.open("w", encoding="utf-8") as file:
        json.dump(_plain(value), file, indent=2, allow_nan=False)
        file.write("\n")
        file.flush()
        os.fsync(file.fileno())
    os.replace(beside, path)


class _Judgement:
    """One run being judged: every input is read once, and what cannot be had is noted once, with its reason."""

    def __init__(self, folder: Path, vertices: ArrayLike, triangles: ArrayLike, robot: RobotShape, config: EvaluationConfig) -> None:
        self._folder, self._mesh, self._robot, self._config = folder, (vertices, triangles), robot, config
        self._missing: list[str] = []

    def summary(self) -> dict[str, Any]:
        reported = self._reported()
        truth = self._try("truth", lambda: read_trajectory(self._folder / "trajectory_truth.txt"))
        errors = self._trajectory(truth)
        scores = {
            **self._motion(truth),
            **self._collisions(),
            **_trajectory_scores(errors),
            **self._coverage(truth, errors),
            **self._map_error(errors),
        }
        success = _succeeded(reported.get("stop_reason"), scores["fell"], scores["collisions"], self._map_saved())
        return {"success": success, **reported, **scores, "missing": self._missing}

    def _try(self, what: str, get: Callable[[], V]) -> V | None:
        try:
            return get()
        except ValueError as error:
            self._missing.append(f"{what}: {error}")
            return None

    def _reported(self) -> dict[str, Any]:
        known: dict[str, Any] = dict.fromkeys(_REPORTED)
        for name in ("run.json", "counters.json"):
            values = self._try(name, lambda name=name: read_json(self._folder / name))  # type: ignore[misc]
            known.update({key: value for key, value in (values or {}).items() if value is not None or key not in known})
        self._missing += [f"{key}: not reported by the run" for key in _REPORTED if known[key] is None]
        return known

    def _trajectory(self, truth: Trajectory | None) -> TrajectoryErrors | None:
        estimate = self._try("trajectory", lambda: read_trajectory(self._folder / "trajectory.txt"))
        if truth is None or estimate is None:
            self._missing.append("trajectory errors, coverage, map error: need truth and trajectory")
            return None
        return self._try("trajectory errors", lambda: trajectory_errors(*estimate, *truth))

    def _motion(self, truth: Trajectory | None) -> dict[str, Any]:
        found: Motion | None = None
        if truth is not None:
            found = motion(*truth, self._config.fall_tilt_rad, self._config.fall_speed_mps)
        return {
            "distance_m": found.distance_m if found else None,
            "max_tilt_rad": found.max_tilt_rad if found else None,
            "fell": found.fell if found else None,
        }

    def _collisions(self) -> dict[str, Any]:
        episodes = self._try("collisions", lambda: read_contacts(self._folder / "contacts.csv", self._config.contact_gap_s))
        return {
            "collisions": None if episodes is None else len(episodes),
            "collision_top_speed_mps": max((e.top_speed_mps for e in episodes), default=None) if episodes else None,
            "collision_top_force_n": max((e.top_force_n for e in episodes), default=None) if episodes else None,
        }

    def _coverage(self, truth: Trajectory | None, errors: TrajectoryErrors | None) -> dict[str, Any]:
        ground: ReachableGround | None = None
        if truth is not None:
            start = truth[1][0, :3, 3]
            ground = self._try("reachable ground", lambda: reachable_ground(*self._mesh, start, self._robot, self._config.cell_m))
        share = None
        if ground is not None and errors is not None:
            share = self._try("coverage", lambda: self._covered_share(ground, errors.T_world_map))
        return {
            "coverage": share,
            "reachable_area_m2": ground.covered_area_m2 if ground else None,
            "turning_area_m2": ground.area_m2 if ground else None,
        }

    def _covered_share(self, ground: ReachableGround, T_world_map: Floats) -> float:
        voxels = divided_voxels(*read_occupied(self._folder / "occupied.npz"), self._config.map_resolution_m)
        world = transform_points(T_world_map, voxels)
        return coverage(ground.covered_points, world, self._config.coverage_horizontal_m, self._config.coverage_vertical_m)

    def _map_error(self, errors: TrajectoryErrors | None) -> dict[str, Any]:
        error = None
        if errors is not None:
            error = self._try("map error", lambda: self._cloud_error(errors.T_world_map))
        return {"map_rmse_m": error.rms_m if error else None, "map_p95_m": error.p95_m if error else None}

    def _cloud_error(self, T_world_map: Floats) -> Any:
        cloud = transform_points(T_world_map, read_cloud(self._folder / "cloud.ply"))
        return map_error(cloud, *self._mesh, max_points=self._config.max_cloud_points)

    def _map_saved(self) -> bool:
        saved = [name for name in ("map.bt", "cloud.ply") if (self._folder / name).is_file() and (self._folder / name).stat().st_size]
        if len(saved) < 2:
            self._missing.append(f"saved map: of map.bt and cloud.ply only {saved or 'nothing'} is there")
        return len(saved) == 2


def _trajectory_scores(errors: TrajectoryErrors | None) -> dict[str, Any]:
    return {
        "trajectory_ate_m": errors.ate_rms_m if errors else None,
        "trajectory_origin_error_m": errors.origin_rms_m if errors else None,
        "map_tilt_rad": errors.map_tilt_rad if errors else None,
        "map_tilt_origin_rad": errors.map_tilt_origin_rad if errors else None,
        "unmatched_poses": errors.unmatched if errors else None,
    }


def _succeeded(stop_reason: Any, fell: bool | None, collisions: int | None, map_saved: bool) -> bool | None:
    """False when anything known speaks against it, None when something is not known, True otherwise."""
    explored = None if stop_reason is None else str(stop_reason).startswith("explored")
    parts = (explored, None if fell is None else not fell, None if collisions is None else collisions == 0, map_saved)
    if any(part is False for part in parts):
        return False
    return None if any(part is None for part in parts) else True


def _table(path: Path, columns: int) -> Floats:
    if not path.is_file():
        raise ValueError(f"{path.name} is not there")
    text = path.read_text(encoding="utf-8")
    # A run that was killed leaves half a line at the end; half a line anywhere else is damage.
    lines = text[: text.rfind("\n") + 1].splitlines()
    rows = [line.split() for line in lines if line.strip() and not line.startswith("#")]
    wrong = next((k for k, row in enumerate(rows) if len(row) != columns), None)
    if wrong is not None:
        raise ValueError(f"{path.name} has {len(rows[wrong])} numbers in row {wrong + 1}, not {columns}")
    try:
        return np.array(rows, dtype=np.float64).reshape(-1, columns)
    except ValueError as error:
        raise ValueError(f"{path.name} holds something that is no number: {error}") from error


def _number(text: str | None, path: Path) -> float:
    try:
        value = float(text or "nan")
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f"{path.name} holds {text!r} where a number is expected")
    return value


def _plain(value: Any) -> Any:
    """`value` with numpy scalars, arrays, tuples and paths as JSON knows them; what is not finite as None."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(v) for v in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, (str, int, type(None))) else str(value)
