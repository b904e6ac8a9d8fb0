"""Meshes from files (.dae, .obj, .stl, .ply) as one surface in metres with z up, and cutting one to a rectangle."""

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

from pybullet_simulation.world import Surface

Array = NDArray[np.float64]

MESH_SUFFIXES = (".dae", ".obj", ".stl", ".ply")
UP_FROM_AXIS = {
    "X_UP": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "Y_UP": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "Z_UP": np.eye(3),
}


def read_mesh(path: Path) -> Surface:
    """All of a mesh file; a .dae by its own unit and up axis, other formats as metres with z up.

    ValueError when it cannot be read, holds no triangle or is not finite.
    """
    try:
        loaded = trimesh.load(path, process=False)
        mesh = loaded.to_mesh() if isinstance(loaded, trimesh.Scene) else loaded
        R_metres = _dae_to_metres(path) if path.suffix.lower() == ".dae" else np.eye(3)
    except Exception as error:  # the readers raise whatever they stumble over
        raise ValueError(f"cannot read the mesh {path}: {type(error).__name__}: {error}") from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise ValueError(f"the mesh {path} is empty: it has no triangles")
    vertices = np.asarray(mesh.vertices, np.float64) @ R_metres.T
    if not np.isfinite(vertices).all():
        raise ValueError(f"the mesh {path} has vertices that are not finite")
    return without_slivers(vertices, np.asarray(mesh.faces, np.int32))


def _dae_to_metres(path: Path) -> Array:
    """(3, 3) scale and rotation to metres with z up, by the asset block of a COLLADA file; its defaults are metres and y up."""
    asset = ElementTree.parse(path).getroot().find("{*}asset")
    unit = None if asset is None else asset.find("{*}unit")
    axis = None if asset is None else asset.findtext("{*}up_axis")
    scale = 1.0 if unit is None else float(unit.get("meter", "1"))
    return np.asarray(scale * UP_FROM_AXIS[(axis or "Y_UP").strip()])


def without_slivers(vertices: Array, triangles: NDArray[np.int32]) -> Surface:
    """The surface without triangles that have no area, on which physics engines choke."""
    corners = vertices[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    return Surface(vertices, triangles[area > 1e-9])


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
    return without_slivers(np.asarray(vertices, np.float64), np.asarray(triangles, np.int32))
