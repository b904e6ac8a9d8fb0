"""The files of a run folder: what its nodes left, as arrays, and the summary that the judge adds.

The only module of the judge that reads a run. Every reader raises ValueError, with the file's name, for a file that is absent,
cut off where that loses more than its last line, or holds something else than it should.
"""

import csv
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from exploration_evaluation.config import RobotShape
from exploration_evaluation.scores import ContactEpisode, contact_episodes
from robot_body import DESCRIPTION, laser_height_m, load_robot
from whole_files import write_whole

Floats = NDArray[np.float64]
Trajectory = tuple[Floats, Floats]

_EVENT_COLUMNS = ["stamp_s", "wall_s", "state", "reason", "sweeps"]
_STAMP_TOLERANCE_S = 1e-3
_CONTACT_GAP_S = 1.0  # pause after which a contact counts as another collision
_OWN_TOUCH_MPS = 0.05  # speed of the robot above which a touch with a mover is its own; slower, the mover has touched it
_VOXEL_M = 0.08  # of the map of a run that does not tell

JsonObject = dict[str, Any]
"""What a JSON file holds: names, and values of whatever type the file says."""


def read_trajectory(path: Path) -> Trajectory:
    """(N,) increasing stamps and (N, 4, 4) poses of a TUM file (stamp x y z qx qy qz qw); ValueError when absent, empty or malformed."""
    stamps, poses = read_sweep_poses(path)
    if (np.diff(stamps) <= 0).any():
        raise ValueError(f"{path.name} holds stamps that do not increase")
    return stamps, poses


def read_sweep_poses(path: Path) -> Trajectory:
    """The same of the sweeps of a session, in their order: stamps go back where the robot's clock was set back."""
    rows = _table(path, 8)
    if not len(rows) or not np.isfinite(rows).all():
        raise ValueError(f"{path.name} holds no poses, or numbers that are not finite")
    poses = np.tile(np.eye(4), (len(rows), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = Rotation.from_quat(rows[:, 4:8]).as_matrix(), rows[:, 1:4]
    return rows[:, 0], poses


def mapped_sweeps(folder: Path) -> int:
    """How many poses of trajectory.txt are of this run, and not of one before that it went on from.

    Those from the first on that is not before the first line of events.csv. ValueError when one of the files is absent, or holds
    something else.
    """
    stamps, _ = read_sweep_poses(folder / "trajectory.txt")
    told_s, _, _ = read_events(folder / "events.csv")
    if not len(told_s):
        raise ValueError("events.csv has no event: nobody knows when the run began")
    return int(np.logical_or.accumulate(stamps >= told_s[0]).sum())


def read_robot(folder: Path) -> RobotShape:
    """The shape of the robot that drove, from its robot.yaml and robot.urdf; the project's own where a run of before has none."""
    path, urdf = folder / "robot.yaml", folder / DESCRIPTION
    if not path.is_file():
        return RobotShape()
    robot = load_robot(path)
    if not urdf.is_file():
        return RobotShape.of(robot)
    height_m = laser_height_m(robot, urdf.read_text(encoding="utf-8"))
    return replace(RobotShape.of(robot), laser_height_m=round(height_m, 2))


def read_contacts(path: Path) -> tuple[ContactEpisode, ...]:
    """Collisions from contacts.csv (stamp,link,speed_mps,force_n,other); a file with a header only means none.

    A mover, `other`, that touches a robot which stands, or is slower than `_OWN_TOUCH_MPS`, is no collision of the robot.
    """
    if not path.is_file():
        raise ValueError(f"{path.name} is not there")
    with path.open(newline="") as file:
        reader = csv.DictReader(file)
        if list(reader.fieldnames or [])[:4] != ["stamp", "link", "speed_mps", "force_n"]:
            raise ValueError(f"{path.name} has the columns {reader.fieldnames}, not stamp,link,speed_mps,force_n")
        rows = [row for row in reader if not row.get("other") or _number(row["speed_mps"], path) > _OWN_TOUCH_MPS]
    numbers = {key: [_number(row[key], path) for row in rows] for key in ("stamp", "speed_mps", "force_n")}
    return contact_episodes(numbers["stamp"], numbers["speed_mps"], numbers["force_n"], _CONTACT_GAP_S)


def read_sweeps(folder: Path, stamps: ArrayLike) -> Iterator[NDArray[np.floating]]:
    """The (N, 3) points, base_link, of the sweep of every vertex, one after the other, from sweeps/000000.npz and on.

    `stamps` are those of trajectory.txt. ValueError when a sweep is absent or damaged, or of another time than its vertex.
    """
    for number, stamp_s in enumerate(np.asarray(stamps, dtype=np.float64)):
        path = folder / "sweeps" / f"{number:06d}.npz"
        data = read_arrays(path, ("points", "stamp_s"))
        if data["points"].ndim != 2 or data["points"].shape[1] != 3 or data["stamp_s"].shape:
            raise ValueError(f"{path.name} has points {data['points'].shape} and stamp_s {data['stamp_s'].shape}, not (N, 3) and ()")
        if not abs(float(data["stamp_s"]) - stamp_s) <= _STAMP_TOLERANCE_S:
            raise ValueError(f"{path.name} is of {float(data['stamp_s']):.3f} s, its vertex in trajectory.txt of {stamp_s:.3f} s")
        yield data["points"]


def read_events(path: Path) -> tuple[Floats, Floats, tuple[str, ...]]:
    """(N,) simulated stamps, (N,) wall seconds and the N states of events.csv; half a last line of a killed run is left out."""
    if not path.is_file():
        raise ValueError(f"{path.name} is not there")
    text = path.read_text(encoding="utf-8")
    reader = csv.DictReader(text[: text.rfind("\n") + 1].splitlines())
    if list(reader.fieldnames or []) != _EVENT_COLUMNS:
        raise ValueError(f"{path.name} has the columns {reader.fieldnames}, not {','.join(_EVENT_COLUMNS)}")
    rows = list(reader)
    stamps, wall = (np.array([_number(row[key], path) for row in rows]) for key in ("stamp_s", "wall_s"))
    return stamps, wall, tuple(row["state"] or "" for row in rows)


def read_occupied(path: Path) -> tuple[Floats, Floats]:
    """(N, 3) centres and (N,) edge lengths of the octomap's occupied leaves, map frame, from occupied.npz."""
    data = read_arrays(path, ("centers", "sizes"))
    centres, sizes = data["centers"].astype(np.float64), data["sizes"].astype(np.float64)
    if centres.ndim != 2 or centres.shape[1] != 3 or sizes.shape != (len(centres),):
        raise ValueError(f"{path.name} has centers {centres.shape} and sizes {sizes.shape}, not (N, 3) and (N,)")
    return centres, sizes


def read_arrays(path: Path, names: tuple[str, ...]) -> dict[str, NDArray]:
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


def read_json(path: Path) -> JsonObject:
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


def write_json(path: Path, value: JsonObject) -> None:
    """Writes a JSON object so that a reader sees the old file or the whole new one; NaN becomes null."""
    write_whole(path, json.dumps(_plain(value), indent=2, allow_nan=False) + "\n")


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


def crop_half_m(reported: JsonObject) -> float:
    """How far around the robot the map took points of a sweep."""
    try:
        return float(reported["config"]["octomap_server_3dnav_node"]["crop_half_m"])
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError("run.json does not tell the crop_half_m of octomap_server_3dnav_node") from error


def resolution_m(reported: JsonObject) -> float:
    """Edge of a voxel of the map that a run reports; `_VOXEL_M` where it tells of none."""
    try:
        return float(reported["config"]["octomap_server_3dnav_node"]["resolution"])
    except (KeyError, TypeError, ValueError):
        return _VOXEL_M
