"""What a mapping session leaves on disk: every sweep as it comes, and at any time the graph, the trajectory and the merged cloud.

Nothing here can be half written: data reach the disk before the index that names them, and what is read again is checked first. With a disk
that is full or read-only, sweeps wait in memory until it takes them.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.config import MappingConfig
from pose_graph_mapping.graph.pose_graph import PoseGraph
from pose_graph_mapping.registration.cloud import PointCloud, voxel_downsample
from pose_graph_mapping.registration.seen_through import Gone
from pose_graph_mapping.session.session_files import (
    pcd_bytes,
    ply_bytes,
    sweep_bytes,
    sweep_clouds,
    tum_text,
)
from pose_graph_mapping.session.session_graph import StoredGraph
from pose_graph_mapping.session.session_index import SessionIndex, sweep_file
from pose_graph_mapping.session.session_record import GraphChange, Measured, StoredSweep, payload_text
from whole_files import refusal, sync_folder, write_whole

Array = NDArray[np.float64]

SAVED = ("graph.g2o", "trajectory.txt", "cloud.ply", "cloud.pcd")
"""What `SessionStore.save` writes beside the sweeps."""


class NotOnDiskError(OSError):
    """A sweep could not be written, and waits in memory; the text says why, in one line."""


class DamagedSweepError(ValueError):
    """A sweep's file is not what the index says of it; the text names it."""


@dataclass(frozen=True, eq=False)
class _Waiting:
    """A sweep that is not on disk yet."""

    vertex_id: int
    stamp_s: float
    cloud: PointCloud
    free: PointCloud | None
    measured: Measured | None
    change: GraphChange | None


class SessionStore:
    """A folder with sweeps/000000.npz, .., sweeps/index.json, and after `save` graph.g2o, trajectory.txt, cloud.ply, cloud.pcd."""

    def __init__(self, directory: str | os.PathLike[str]) -> None:
        """Open or create a session; ValueError when a sweep is lost that later ones stand on, OSError when there can be no folder."""
        self._directory = Path(directory)
        (self._directory / "sweeps").mkdir(parents=True, exist_ok=True)
        self._index = SessionIndex(self._directory)
        self._waiting: list[_Waiting] = []
        self._graph = StoredGraph()
        for stored in self._index.sweeps:
            if stored.change is not None:
                self._graph.apply(stored.change)

    @property
    def folder(self) -> Path:
        """Where all of it lies."""
        return self._directory

    @property
    def sweeps(self) -> tuple[StoredSweep, ...]:
        """The sweeps that are safely on disk, in the order they came."""
        return tuple(self._index.sweeps)

    @property
    def notes(self) -> tuple[str, ...]:
        """What was damaged when the session was opened, and what became of it, one sentence each."""
        return tuple(self._index.notes)

    @property
    def not_on_disk(self) -> int:
        """How many sweeps wait in memory, because the disk would not take them."""
        return len(self._waiting)

    def add_sweep(
        self,
        vertex_id: int,
        stamp_s: float,
        points_base: ArrayLike,
        origins_base: ArrayLike,
        graph: PoseGraph | None = None,
        measured: Measured | None = None,
        free: PointCloud | None = None,
    ) -> StoredSweep:
        """Write the (N, 3) finite points and origins of a vertex, what measured it, and what `graph` has become by it.

        free: ends and origins of its beams that met nothing, which a map of free space is made of again. Without `graph` and `measured`
        the session cannot be gone on with. ValueError for a vertex out of turn. NotOnDiskError when the disk does not take it: the
        session is as it was, and the next call, or `save`, tries again.
        """
        self._check_turn(vertex_id, graph, measured)
        cloud = PointCloud.of_finite(points_base, origins_base)
        if free is not None and free.origins is None:
            raise ValueError("beams that met nothing need their origins")
        change = None if graph is None else self._graph.change_to(graph)
        if change is not None:
            self._graph.apply(change)
        self._waiting.append(_Waiting(vertex_id, float(stamp_s), cloud, free, measured, change))
        self._write_waiting()
        return self._index.sweeps[vertex_id]

    def load_sweep(self, vertex_id: int) -> PointCloud:
        """Points and origins of a vertex, base_link at its stamp; ValueError when it is not stored, DamagedSweepError when not whole."""
        return self._loaded(vertex_id)[0]

    def load_free(self, vertex_id: int) -> PointCloud | None:
        """Ends and origins of the beams of a vertex that met nothing; None where they were not stored. Errors as of `load_sweep`."""
        return self._loaded(vertex_id)[1]

    def _loaded(self, vertex_id: int) -> tuple[PointCloud, PointCloud | None]:
        known = len(self._index.sweeps)
        if not 0 <= vertex_id < known + len(self._waiting):
            raise ValueError(f"no sweep of vertex {vertex_id}; there are {known}")
        if vertex_id >= known:
            waiting = self._waiting[vertex_id - known]
            return waiting.cloud, waiting.free
        stored = self._index.sweeps[vertex_id]
        try:
            data = (self._directory / stored.file).read_bytes()
        except OSError as error:
            raise DamagedSweepError(f"{stored.file} cannot be read: {error.strerror}") from error
        if hashlib.sha256(data).hexdigest() != stored.sha256:
            raise DamagedSweepError(f"{stored.file} is damaged: {len(data)} bytes of {stored.bytes}, and their checksum is wrong")
        return sweep_clouds(data)

    def graph_on_disk(self, empty: PoseGraph | None = None) -> PoseGraph:
        """`empty`, or a graph with defaults, as the session left it, not optimised yet; ValueError when it was stored without one."""
        return self._graph.rebuilt(len(self._index.sweeps) + len(self._waiting), PoseGraph() if empty is None else empty)

    def save(self, graph: PoseGraph, map_voxel_m: float = MappingConfig.map_voxel_m, gone: Gone | None = None) -> tuple[str, ...]:
        """Write graph.g2o, trajectory.txt (TUM), cloud.ply and cloud.pcd (map frame, voxel means, without what has `gone`).

        What it returns names the sweeps that are damaged and not in the clouds. Where there are more vertices than sweeps, or fewer, the
        sweeps that are there are saved with the vertices that belong to them, and it says so.
        """
        stamps_s = [s.stamp_s for s in self._index.sweeps] + [s.stamp_s for s in self._waiting]
        count = min(len(graph), len(stamps_s))
        left_out: list[str] = []
        if len(graph) != len(stamps_s):
            left_out.append(f"{len(graph)} vertices for {len(stamps_s)} stored sweeps: the first {count} are saved")
        self._write_waiting()
        poses = graph.poses()[:count]
        write_whole(self._directory / "graph.g2o", graph.g2o_text(count).encode("ascii"))
        write_whole(self._directory / "trajectory.txt", tum_text(stamps_s[:count], poses).encode("ascii"))
        points = self.merged_points(poses, map_voxel_m, left_out, gone)
        write_whole(self._directory / "cloud.ply", ply_bytes(points))
        write_whole(self._directory / "cloud.pcd", pcd_bytes(points))
        return tuple(left_out)

    def merged_points(self, vertex_poses: Array, voxel_m: float, left_out: list[str] | None = None, gone: Gone | None = None) -> Array:
        """(M, 3) voxel means of all stored sweeps at `vertex_poses` (V, 4, 4), in the map frame, without what has `gone`.

        Sweeps that are damaged are named in `left_out`; without such a list they are a DamagedSweepError.
        """
        means = [voxel_downsample(cloud, voxel_m).points for cloud in self._in_map(vertex_poses, left_out, gone)]
        return voxel_downsample(PointCloud(np.concatenate([np.zeros((0, 3)), *means])), voxel_m).points

    def _in_map(self, vertex_poses: Array, left_out: list[str] | None, gone: Gone | None) -> Iterator[PointCloud]:
        for vertex_id, T in enumerate(vertex_poses):
            try:
                points = self.load_sweep(vertex_id).points
                yield PointCloud(points if gone is None else gone.left_of(vertex_id, points)).transformed(T)
            except DamagedSweepError as error:
                if left_out is None:
                    raise
                left_out.append(str(error))

    def _check_turn(self, vertex_id: int, graph: PoseGraph | None, measured: Measured | None) -> None:
        following = len(self._index.sweeps) + len(self._waiting)
        if vertex_id != following:
            raise ValueError(f"vertex {vertex_id} where {following} is next")
        if (graph is None) != (measured is None):
            raise ValueError("graph and what measured the sweep go together: one without the other cannot be gone on with")
        if graph is not None and len(graph) != vertex_id + 1:
            raise ValueError(f"a graph of {len(graph)} vertices with sweep {vertex_id}")

    def _write_waiting(self) -> None:
        """Writes, in their order, the sweeps that are not on disk."""
        while self._waiting:
            try:
                self._write(self._waiting[0])
            except OSError as error:
                first, last = self._waiting[0].vertex_id, self._waiting[-1].vertex_id
                which = f"sweep {last} is" if first == last else f"sweeps {first} to {last} are"
                raise NotOnDiskError(f"{which} not on disk: {refusal(error, self._directory / 'sweeps')}") from error
            del self._waiting[0]

    def _write(self, sweep: _Waiting) -> None:
        """Data first, then the index."""
        file, count = sweep_file(sweep.vertex_id), len(sweep.cloud)
        stored = StoredSweep(sweep.vertex_id, sweep.stamp_s, file, count, 0, "", sweep.measured, sweep.change)
        data = sweep_bytes(sweep.cloud, sweep.stamp_s, payload_text(stored), sweep.free)
        write_whole(self._directory / file, data)
        digest = hashlib.sha256(data).hexdigest()
        self._index.append(StoredSweep(sweep.vertex_id, sweep.stamp_s, file, count, len(data), digest, sweep.measured, sweep.change))


def copy_session(source: str | os.PathLike[str], target: str | os.PathLike[str]) -> SessionStore:
    """A new session in `target` with the sweeps of `source`, which stays as it is; ValueError when `target` holds one already.

    Files are shared where the file system can: a sweep's file is never changed, only replaced.
    """
    origin, store = SessionStore(source), SessionStore(target)
    if store.sweeps:
        raise ValueError(f"{target} holds a session of {len(store.sweeps)} sweeps already")
    for stored in origin.sweeps:
        path, copy = Path(source) / stored.file, Path(target) / stored.file
        copy.unlink(missing_ok=True)
        with contextlib.suppress(FileNotFoundError):  # a sweep that is gone stays one in the copy
            _link_or_copy(path, copy)
    sync_folder(Path(target) / "sweeps")
    store._index.rewrite(origin.sweeps)
    return SessionStore(target)


def _link_or_copy(path: Path, copy: Path) -> None:
    try:
        os.link(path, copy)
    except FileNotFoundError:
        raise
    except OSError:
        write_whole(copy, path.read_bytes())


__all__ = [
    "DamagedSweepError",
    "NotOnDiskError",
    "SessionStore",
    "StoredSweep",
    "copy_session",
    "ply_bytes",
    "tum_text",
]
