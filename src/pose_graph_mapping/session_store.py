"""What a mapping session leaves on disk: every sweep as it comes, and at any time the graph, the trajectory and the merged cloud.

Nothing here can be half written: data reach the disk before the index that names them, and each file replaces its predecessor in one step.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.cloud import PointCloud, voxel_downsample
from pose_graph_mapping.pose_graph import PoseGraph
from rigid_geometry import quat_xyzw_from_transform

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StoredSweep:
    """One line of the index: vertex, stamp, file below the session's folder, points and bytes in it."""

    vertex_id: int
    stamp_s: float
    file: str
    points: int
    bytes: int


def _sync_folder(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def write_atomically(path: Path, data: bytes) -> None:
    """Replace `path` by `data` so that a reader, or a crash, sees the old file or the new one; OSError as the system gives it."""
    temporary = path.with_name(f".{path.name}.part")
    try:
        with open(temporary, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    _sync_folder(path.parent)


def ply_bytes(points: ArrayLike) -> bytes:
    """A binary PLY of (N, 3) points in metres, as every viewer opens it."""
    rows = np.ascontiguousarray(points, dtype="<f4")
    columns = "".join(f"property float {axis}\n" for axis in "xyz")
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{columns}end_header\n"
    return header.encode("ascii") + rows.tobytes()


def tum_text(stamps_s: ArrayLike, poses: Array) -> str:
    """A TUM trajectory: one line "stamp x y z qx qy qz qw" a pose (V, 4, 4)."""
    lines = []
    for stamp, T in zip(np.asarray(stamps_s, dtype=np.float64), poses, strict=True):
        numbers = [*T[:3, 3], *quat_xyzw_from_transform(T)]
        lines.append(f"{stamp:.6f} " + " ".join(f"{v:.9f}" for v in numbers))
    return "".join(line + "\n" for line in lines)


class SessionStore:
    """A folder with sweeps/000000.npz, .., sweeps/index.json, and after `save` graph.g2o, trajectory.txt, cloud.ply."""

    def __init__(self, directory: str | os.PathLike[str]) -> None:
        """Open or create a session; ValueError when the index there cannot be read or names a file that is not whole."""
        self._directory = Path(directory)
        self._folder = self._directory / "sweeps"
        self._folder.mkdir(parents=True, exist_ok=True)
        self._index = self._folder / "index.json"
        self._sweeps = self._read_index()

    @property
    def sweeps(self) -> tuple[StoredSweep, ...]:
        """The sweeps that are safely on disk, in the order they came."""
        return tuple(self._sweeps)

    def add_sweep(self, vertex_id: int, stamp_s: float, points_base: ArrayLike, origins_base: ArrayLike) -> StoredSweep:
        """Write the (N, 3) finite points and origins of a vertex; ValueError for a vertex out of turn."""
        if vertex_id != len(self._sweeps):
            raise ValueError(f"vertex {vertex_id} where {len(self._sweeps)} is next")
        cloud = PointCloud.of_finite(points_base, origins_base)
        assert cloud.origins is not None
        path = self._folder / f"{vertex_id:06d}.npz"
        packed = io.BytesIO()
        np.savez(packed, points=cloud.points.astype(np.float32), origins=cloud.origins.astype(np.float32), stamp_s=np.float64(stamp_s))
        write_atomically(path, packed.getvalue())
        stored = StoredSweep(vertex_id, float(stamp_s), f"sweeps/{path.name}", len(cloud), path.stat().st_size)
        index = [asdict(s) for s in (*self._sweeps, stored)]
        write_atomically(self._index, (json.dumps(index, indent=1) + "\n").encode("ascii"))
        self._sweeps.append(stored)
        return stored

    def load_sweep(self, vertex_id: int) -> PointCloud:
        """The points and origins of a vertex, base_link at its stamp; ValueError when it is not stored."""
        if not 0 <= vertex_id < len(self._sweeps):
            raise ValueError(f"no sweep of vertex {vertex_id}; there are {len(self._sweeps)}")
        with np.load(self._directory / self._sweeps[vertex_id].file) as data:
            return PointCloud(data["points"], data["origins"])

    def save(self, graph: PoseGraph, map_voxel_m: float = 0.04) -> None:
        """Write graph.g2o, trajectory.txt (TUM) and cloud.ply (map frame, voxel means); ValueError when not every vertex has a sweep."""
        if len(graph) != len(self._sweeps):
            raise ValueError(f"{len(graph)} vertices for {len(self._sweeps)} stored sweeps")
        write_atomically(self._directory / "graph.g2o", graph.g2o_text().encode("ascii"))
        trajectory = tum_text([s.stamp_s for s in self._sweeps], graph.poses())
        write_atomically(self._directory / "trajectory.txt", trajectory.encode("ascii"))
        write_atomically(self._directory / "cloud.ply", ply_bytes(self.merged_points(graph.poses(), map_voxel_m)))

    def merged_points(self, vertex_poses: Array, voxel_m: float) -> Array:
        """(M, 3) voxel means of all stored sweeps at `vertex_poses` (V, 4, 4), in the map frame."""
        means = [voxel_downsample(PointCloud(c.points), voxel_m).points for c in self._in_map(vertex_poses)]
        return voxel_downsample(PointCloud(np.concatenate([np.zeros((0, 3)), *means])), voxel_m).points

    def _in_map(self, vertex_poses: Array) -> Iterator[PointCloud]:
        for stored, T in zip(self._sweeps, vertex_poses, strict=True):
            yield self.load_sweep(stored.vertex_id).transformed(T)

    def _read_index(self) -> list[StoredSweep]:
        if not self._index.exists():
            return []
        try:
            sweeps = [StoredSweep(**entry) for entry in json.loads(self._index.read_text(encoding="ascii"))]
        except (ValueError, TypeError) as error:
            raise ValueError(f"{self._index} cannot be read: {error}") from error
        for stored in sweeps:
            path = self._directory / stored.file
            if not path.is_file() or path.stat().st_size != stored.bytes:
                raise ValueError(f"{path} is not the file of {stored.bytes} bytes that {self._index.name} names")
        return sweeps
