"""Triangles of mesh files (.dae, .obj, .stl, .ply, .glb, .gltf), in metres with z up, where the file has them.

Textures are not looked for.
"""

import logging
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mesh_files.dae_parts import parts_of_node, unread_geometries
from mesh_files.gltf_file import undecoded_extensions
from mesh_files.unreadable import why_unreadable
from rigid_geometry import lost_digits_m

Array = NDArray[np.float64]
Indices = NDArray[np.int32]

MESH_SUFFIXES = (".dae", ".obj", ".stl", ".ply", ".glb", ".gltf")
UPS = {
    "x": np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]),
    "y": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "z": np.eye(3),
}
_WHOLE = (".stl", ".ply")  # what has no parts with names
_NAMED = 5  # parts, as many as a line holds
_HEADER_BYTES = 1 << 14
_SLIVER_M2 = 1e-9
_FARTHEST_M = 1e9  # what no place on earth is away
logging.getLogger("trimesh").addHandler(logging.NullHandler())  # it prints tracebacks of what it then raises


@dataclass(frozen=True)
class MeshTriangles:
    """Vertices (V, 3) in metres with z up, where the file has them, and triangles (T, 3).

    `missing`: names of what a file shows, too, and that could not be read.
    """

    vertices: Array
    triangles: Indices
    missing: tuple[str, ...] = ()


class NoPartError(ValueError):
    """A mesh file has no part of a name."""


@dataclass(frozen=True)
class MeshFrame:
    """How a mesh is to be read: metres a unit, and the axis that points up ("x", "y", "z"); None: as the file says, else 1 and z."""

    scale: float | None = None
    up: str | None = None

    def checked(self) -> "MeshFrame":
        """Itself; ValueError when it makes no sense."""
        if self.scale is not None and not 0.0 < self.scale < np.inf:
            raise ValueError(f"scale {self.scale:g} is not a positive number of metres a unit")
        if self.up is not None and self.up not in UPS:
            raise ValueError(f"up {self.up!r} is none of {', '.join(UPS)}")
        return self


def read_triangles(path: Path, frame: MeshFrame | None = None, part: str | None = None) -> MeshTriangles:
    """The triangles of a mesh file, or of the `part` of it of this name.

    ValueError when it cannot be read, holds no triangle or is not finite, and when there is no such part.
    """
    given = (frame or MeshFrame()).checked()
    if path.suffix.lower() in (".glb", ".gltf") and (needed := undecoded_extensions(path)):
        raise ValueError(f"cannot read the mesh {path}: it needs {', '.join(needed)}, which is not known: export it without")
    try:
        with np.errstate(all="ignore"):
            corners, faces, names = _loaded(path) if part is None else _loaded_part(path, part)
        scale, up = _own_frame(path)
        missing = unread_geometries(path, names, part) if path.suffix.lower() == ".dae" else ()
    except NoPartError:
        raise
    except Exception as error:  # the readers raise whatever they stumble over
        raise ValueError(f"cannot read the mesh {path}: {why_unreadable(path, error)}") from error
    if not len(faces):
        unread = f": {', '.join(missing)} cannot be read" if missing else ""
        raise ValueError(f"the mesh {path} is empty: it has no triangles{unread}")
    given_scale = given.scale or scale
    triangles = _checked(path, corners, faces)
    with np.errstate(all="ignore"):
        vertices = corners @ (given_scale * UPS[given.up or up]).T
    if not (np.abs(vertices) < _FARTHEST_M).all():
        raise ValueError(f"the mesh {path} has vertices that are not finite")
    if not has_area(vertices, triangles, 0.0).any():
        raise ValueError(f"the mesh {path} is empty: none of its triangles has an area")
    if _is_float32(path) and (apart := lost_digits_m(corners, given_scale)) is not None:
        raise ValueError(f"the mesh {path} is far from 0 0 0 in float32, told apart to {apart:g} m only: write it relative, or as .obj")
    return MeshTriangles(vertices, triangles, missing)


def _loaded(path: Path) -> tuple[Array, NDArray[np.int64], list[str]]:
    """Vertices and triangles of a file, as trimesh reads it, and the names of its geometries."""
    import trimesh  # only where there is a mesh

    loaded = trimesh.load(path, process=False, skip_materials=True)
    if isinstance(loaded, trimesh.Scene):
        return *_arrays(loaded.to_mesh()), list(loaded.geometry)
    return *_arrays(loaded), []


def _loaded_part(path: Path, part: str) -> tuple[Array, NDArray[np.int64], list[str]]:
    """Those of the part of a file. NoPartError when there is none of this name."""
    import trimesh

    if path.suffix.lower() in _WHOLE:
        raise NoPartError(f"the mesh {path} has no part {part!r}: files of this kind have no parts")
    by_object: dict[str, Any] = {"split_objects": True, "group_material": False} if path.suffix.lower() == ".obj" else {}
    scene = trimesh.load_scene(path, process=False, skip_materials=True, **by_object)
    wanted = parts_of_node(path, part, list(scene.geometry))
    if not wanted:
        names, more = sorted(scene.geometry)[:_NAMED], len(scene.geometry) - _NAMED
        raise NoPartError(f"the mesh {path} has no part {part!r}; it has {', '.join(names)}" + (f" and {more} more" if more > 0 else ""))
    scene.delete_geometry(set(scene.geometry) - wanted)
    return *_arrays(scene.to_mesh()), list(wanted)


def _arrays(mesh: object) -> tuple[Array, NDArray[np.int64]]:
    """Empty ones of what has no triangles, as a cloud of points."""
    vertices, faces = getattr(mesh, "vertices", ()), getattr(mesh, "faces", ())
    if not len(faces):
        return np.empty((0, 3)), np.empty((0, 3), np.int64)
    return np.asarray(vertices, np.float64), np.asarray(faces, np.int64)


def _checked(path: Path, corners: Array, triangles: NDArray[np.int64]) -> Indices:
    """The triangles, when both are a mesh."""
    if corners.ndim != 2 or corners.shape[1] != 3 or triangles.shape[1:] != (3,):
        raise ValueError(f"the mesh {path} has vertices of {corners.shape[-1]} coordinates, or faces that are no triangles")
    if triangles.min() < 0 or triangles.max() >= len(corners):
        raise ValueError(f"the mesh {path} has triangles of vertices that it does not have")
    return triangles.astype(np.int32)


def _is_float32(path: Path) -> bool:
    """Whether a file keeps its coordinates so: STL always does, PLY unless it says double."""
    with path.open("rb") as file:
        head = file.read(_HEADER_BYTES)
    return path.suffix.lower() == ".stl" or (path.suffix.lower() == ".ply" and b"property double x" not in head)


def has_area(vertices: Array, triangles: Indices, least_m2: float = _SLIVER_M2) -> NDArray[np.bool_]:
    """(T,) whether a triangle has more than an area; false by default for those on which physics engines choke."""
    corners = vertices[triangles]
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return np.asarray(doubled / 2 > least_m2)


def _own_frame(path: Path) -> tuple[float, str]:
    """Metres a unit and the axis upwards, by what the file or its format says, else 1 and z."""
    if path.suffix.lower() == ".dae":
        return _dae_frame(path)
    return (1.0, "y") if path.suffix.lower() in (".glb", ".gltf") else (1.0, "z")


def _dae_frame(path: Path) -> tuple[float, str]:
    """Metres a unit and the axis upwards, by the asset block of a COLLADA file; its defaults are metres and y up."""
    asset = ElementTree.parse(path).getroot().find("{*}asset")
    unit = None if asset is None else asset.find("{*}unit")
    axis = None if asset is None else asset.findtext("{*}up_axis")
    scale = 1.0 if unit is None else float(unit.get("meter", "1"))
    up = (axis or "Y_UP").strip().removesuffix("_UP").lower()
    if up not in UPS or not 0.0 < scale < np.inf:
        raise ValueError(f"up_axis {axis!r} with {scale:g} m a unit")
    return scale, up
