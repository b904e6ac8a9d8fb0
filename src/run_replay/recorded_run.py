"""A finished run as its folder tells it, all in its map frame. What is not there is None, and said in `notes`."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from exploration_evaluation import read_arrays, read_occupied, read_sweep_poses, read_trajectory, trajectory_errors
from octomap_server_3dnav.terrain.classify import TerrainClass
from pose_graph_mapping.graph.pose_graph import PoseGraph
from pose_graph_mapping.session.session_store import SessionStore
from rigid_geometry import inverse
from rigid_geometry.transforms import Transform
from run_replay.timeline import ShownTime

Floats = NDArray[np.float64]
Edges = list[tuple[int, int, str]]
V = TypeVar("V")

_STAMP_TOLERANCE_S = 1e-3
_SET_BACK_S = 1.0  # between two sweeps, as they are shown, where the robot's clock was set back


@dataclass(frozen=True, eq=False)
class ClassifiedVoxels:
    """terrain.npz: surface voxels of edge `resolution` with their classes, to be asked as a `Terrain` is."""

    resolution: float
    points: NDArray[np.float32]
    label: NDArray[np.uint8]

    def centers(self, nodes: NDArray[np.integer] | slice | None = None) -> NDArray[np.float32]:
        """(N, 3) centres in map, in metres, of all voxels or those given by index."""
        return self.points if nodes is None else self.points[nodes]

    def nodes_of(self, terrain_class: TerrainClass) -> NDArray[np.int64]:
        """Indices of the voxels of one class."""
        return np.flatnonzero(self.label == terrain_class)


@dataclass(frozen=True, eq=False)
class OccupiedVoxels:
    """occupied.npz: the octree's occupied leaves, to be asked as an `OctreeMap` is."""

    centers: Floats
    sizes: Floats

    def occupied_voxels(self) -> tuple[Floats, Floats]:
        """(N, 3) centres in map and (N,) edges, in metres."""
        return self.centers, self.sizes


@dataclass(frozen=True, eq=False)
class DrivenPath:
    """The robot's way: (P,) stamps, (P, 4, 4) T_map_base, and T_world_map when it is the true one; else `why_not_true` says why."""

    stamps_s: Floats
    poses: Floats
    T_world_map: Transform | None
    why_not_true: str = ""


@dataclass(frozen=True, eq=False)
class RecordedRun:
    """Sweeps at the graph's final (V, 4, 4) poses, the way between them, and the map of the end; their stamps as of `shown_time`."""

    sweep_stamps_s: Floats
    vertex_poses: Floats
    sweeps: SessionStore
    path: DrivenPath
    edges: Edges
    terrain: ClassifiedVoxels | None
    occupied: OccupiedVoxels | None
    shown_time: ShownTime
    notes: tuple[str, ...]


def read_run(folder: Path) -> RecordedRun:
    """A run folder as ./explore leaves it; ValueError when the sweeps or their poses cannot be read."""
    recorded_s, poses = read_sweep_poses(folder / "trajectory.txt")
    sweeps, stamps = SessionStore(folder), _going_on(recorded_s)
    _check_sweeps(recorded_s, sweeps)
    path = _way(folder, stamps, poses)
    shown_time = ShownTime.of(stamps, path.stamps_s)
    stamps, path = shown_time.at(stamps), replace(path, stamps_s=shown_time.at(path.stamps_s))
    notes = [f"the path is drawn straight from sweep to sweep: {path.why_not_true}"] if path.why_not_true else []
    edges = _optional(notes, "pose graph without its edges", lambda: _edges(folder / "graph.g2o", len(poses)))
    terrain = _optional(notes, "no classified map at the end", lambda: _terrain(folder / "terrain.npz"))
    occupied = _optional(notes, "no occupied voxels at the end", lambda: OccupiedVoxels(*read_occupied(folder / "occupied.npz")))
    return RecordedRun(stamps, poses, sweeps, path, edges or [], terrain, occupied, shown_time, tuple(notes))


def driven_path(folder: Path) -> DrivenPath:
    """The true way in the map frame (trajectory_truth.txt), or the sweeps' poses (trajectory.txt) where there is no truth."""
    stamps, poses = read_sweep_poses(folder / "trajectory.txt")
    return _way(folder, _going_on(stamps), poses)


def _going_on(stamps: Floats) -> Floats:
    """The (V,) stamps as of a clock that was never set back."""
    steps = np.diff(stamps)
    if (steps > 0.0).all():
        return stamps
    return np.cumsum([stamps[0], *np.where(steps > 0.0, steps, _SET_BACK_S)])


def _way(folder: Path, stamps: Floats, poses: Floats) -> DrivenPath:
    try:
        true_stamps, true_poses = read_trajectory(folder / "trajectory_truth.txt")
        T_world_map = trajectory_errors(stamps, poses, true_stamps, true_poses).T_world_map
    except ValueError as error:
        return DrivenPath(stamps, poses, None, str(error))
    return DrivenPath(true_stamps, inverse(T_world_map) @ true_poses, T_world_map)


def _check_sweeps(stamps: Floats, sweeps: SessionStore) -> None:
    """A run that was killed has sweeps that no trajectory was saved of; the other way round something is lost."""
    stored = np.array([s.stamp_s for s in sweeps.sweeps[: len(stamps)]])
    if len(stored) < len(stamps) or (np.abs(stored - stamps) > _STAMP_TOLERANCE_S).any():
        raise ValueError(f"the {len(sweeps.sweeps)} sweeps of sweeps/index.json are not those of the {len(stamps)} poses of trajectory.txt")


def _optional(notes: list[str], what: str, get: Callable[[], V]) -> V | None:
    try:
        return get()
    except ValueError as error:
        notes.append(f"{what}: {error}")
        return None


def _edges(path: Path, vertices: int) -> Edges:
    if not path.is_file():
        raise ValueError(f"{path.name} is not there")
    edges = [(i, j, kind.value) for i, j, kind in PoseGraph.load_g2o(path).edges()]
    return [edge for edge in edges if max(edge[:2]) < vertices]


def _terrain(path: Path) -> ClassifiedVoxels:
    arrays = read_arrays(path, ("x", "y", "z", "label"))
    if len({arrays[name].shape for name in ("x", "y", "z", "label")}) != 1 or arrays["x"].ndim != 1:
        raise ValueError(f"{path.name} has arrays of different lengths")
    points = np.stack([arrays[axis] for axis in "xyz"], axis=1).astype(np.float32)
    return ClassifiedVoxels(_spacing(points), points, arrays["label"].astype(np.uint8))


def _spacing(centers: NDArray[np.float32]) -> float:
    """The edge of voxels, from the centres of at least two neighbouring ones."""
    gaps = np.concatenate([np.diff(np.unique(np.round(column.astype(np.float64), 4))) for column in centers.T])
    if not len(gaps):
        raise ValueError("fewer than two voxels do not tell their size")
    return float(gaps.min())
