"""Meshes from files as one surface in metres with z up near the origin. It can be cut to a rectangle."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from mesh_files import MeshFrame, has_area, read_triangles
from rigid_geometry import origin_near
from world_files.closed_solids import closed_solids
from world_files.surfaces import Mesh, Surface

Array = NDArray[np.float64]
Indices = NDArray[np.int32]


def read_mesh(path: Path, frame: MeshFrame | None = None) -> Mesh:
    """All of a mesh file, brought near the origin where it lies far away.

    ValueError when it cannot be read, holds no triangle or is not finite.
    """
    read = read_triangles(path, frame)
    mesh = near_origin(read.vertices, read.triangles, closed_solids(read.vertices, read.triangles))
    if not len(mesh.triangles):
        raise ValueError(f"the mesh {path} is empty: none of its triangles has an area to speak of")
    return replace(mesh, missing=read.missing)


def near_origin(vertices: Array, triangles: Indices, solid: Indices) -> Mesh:
    """A mesh whose solids (T,) are known, brought near; slivers go, which may have closed a solid."""
    origin = origin_near((vertices.min(axis=0) + vertices.max(axis=0)) / 2)
    near = vertices - origin
    kept = has_area(near, triangles)
    return Mesh(near, triangles[kept], solid[kept], origin)


def cut_to(surface: Surface, low_xy: Array, high_xy: Array) -> Surface:
    """The part of a surface above a rectangle, its triangles cut at the border. ValueError when nothing is left."""
    vertices, triangles = surface.vertices, surface.triangles
    for axis in (0, 1):
        for sign, limit in ((1.0, low_xy[axis]), (-1.0, high_xy[axis])):
            normal, origin = np.zeros(3), np.zeros(3)
            normal[axis], origin[axis] = sign, limit
            if len(triangles):
                vertices, triangles, _ = trimesh.intersections.slice_faces_plane(vertices, triangles, normal, origin)  # type: ignore[no-untyped-call]
    if len(triangles) == 0:
        raise ValueError(f"the mesh has nothing between x, y {low_xy.tolist()} and {high_xy.tolist()}")
    whole = np.asarray(vertices, np.float64), np.asarray(triangles, np.int32)
    return Surface(whole[0], whole[1][has_area(*whole)])
