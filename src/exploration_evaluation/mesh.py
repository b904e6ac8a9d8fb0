"""The true world as a checked triangle mesh and as a scene for rays, the only home of open3d; both halves of the judge start from it.

open3d takes a second and 170 MB to load, and is loaded where it is used: the monitor needs it only when a run is over.
"""

from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def _open3d() -> ModuleType:
    import open3d

    return open3d


def checked_mesh(vertices: ArrayLike, triangles: ArrayLike) -> tuple[Floats, Ints]:
    """(V, 3) finite vertices in metres and (T, 3) indices into them; ValueError for anything else, or an empty mesh."""
    points, corners = np.asarray(vertices, dtype=np.float64), np.asarray(triangles)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.isfinite(points).all():
        raise ValueError(f"vertices are finite and of shape (V, 3) with V > 0, not {points.shape}")
    if corners.ndim != 2 or corners.shape[1] != 3 or not len(corners) or not np.issubdtype(corners.dtype, np.integer):
        raise ValueError(f"triangles are integers of shape (T, 3) with T > 0, not {corners.dtype} {corners.shape}")
    if corners.min() < 0 or corners.max() >= len(points):
        raise ValueError(f"triangles index {corners.min()}..{corners.max()} of {len(points)} vertices")
    return points, corners.astype(np.int64)


class RayScene:
    """A mesh for ray and distance queries; all of them compute in float32."""

    def __init__(self, vertices: Floats, triangles: Ints) -> None:
        self._scene = _open3d().t.geometry.RaycastingScene()
        self._scene.add_triangles(_tensor(vertices, np.float32), _tensor(triangles, np.uint32))

    def crossings(self, rays: Floats) -> tuple[Ints, Floats, Ints]:
        """Ray number, distance (in lengths of the ray's direction) and triangle of every hit of (N, 6) rays, in no order."""
        hits = self._scene.list_intersections(_tensor(rays, np.float32))
        return (
            hits["ray_ids"].numpy().astype(np.int64),
            hits["t_hit"].numpy().astype(np.float64),
            hits["primitive_ids"].numpy().astype(np.int64),
        )

    def first_hits(self, rays: Floats) -> Floats:
        """(N,) distance, in lengths of the ray's direction, to the first hit of each of (N, 6) rays; inf for none."""
        hits: Floats = self._scene.cast_rays(_tensor(rays, np.float32))["t_hit"].numpy().astype(np.float64)
        return hits

    def distances(self, points: Floats) -> Floats:
        """(N,) distance in metres from each of (N, 3) points to the surface."""
        away: Floats = self._scene.compute_distance(_tensor(points, np.float32)).numpy().astype(np.float64)
        return away


def _tensor(values: NDArray[Any], dtype: type[np.generic]) -> Any:
    return _open3d().core.Tensor.from_numpy(np.ascontiguousarray(values, dtype=dtype))


def read_mesh(path: Path) -> tuple[Floats, Ints]:
    """Vertices and triangles of a mesh file (.ply, .obj, .stl); ValueError when it is missing, unreadable or empty."""
    if not path.is_file():
        raise ValueError(f"no mesh at {path}")
    o3d = _open3d()
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        mesh = o3d.io.read_triangle_mesh(path)
    if not len(mesh.triangles):
        raise ValueError(f"no triangles could be read from {path}")
    return checked_mesh(np.asarray(mesh.vertices), np.asarray(mesh.triangles))


def read_cloud(path: Path) -> Floats:
    """(N, 3) finite points of a .ply or .pcd file; ValueError when it is missing, unreadable or empty."""
    if not path.is_file():
        raise ValueError(f"no cloud at {path}")
    o3d = _open3d()
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        points = np.asarray(o3d.io.read_point_cloud(path).points, dtype=np.float64)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        raise ValueError(f"no points could be read from {path}")
    return points
