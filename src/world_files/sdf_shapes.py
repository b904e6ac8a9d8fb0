"""Shapes of an SDF file as triangles in their own frame. Fourth step of `sdf_world`."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from mesh_files import MESH_SUFFIXES, MeshFrame, read_triangles
from world_files.closed_solids import OPEN, closed_solids
from world_files.height_map import FINEST_M, HeightMap, read_height_map, terrain_between
from world_files.model_paths import ModelPaths
from world_files.sdf_elements import Element, child_numbers, place, sizes, text_of, wrong
from world_files.surfaces import surface_from_heights

Array = NDArray[np.float64]
Indices = NDArray[np.int32]

_SECTIONS = 24  # sides of a round thing


class NotUnderstoodError(ValueError):
    """A shape that is left out, in words."""


@dataclass(frozen=True)
class Shape:
    """Vertices (V, 3) in m, triangles (T, 3), the number of the closed solid that each bounds (T,), OPEN where none.

    `mesh`: the file and place of what was a mesh, else "". `remark`: a sentence on what of its file is not in it.
    """

    vertices: Array
    triangles: Indices
    solid: Indices
    mesh: str = ""
    remark: str = ""


@dataclass(frozen=True)
class Endless:
    """A plane without an end: everything below it is solid; (3,) its unit normal."""

    normal: Array


class ShapeFiles:
    """Finds the files of meshes and height maps, and reads each mesh once, however often it stands in a world."""

    def __init__(self, paths: ModelPaths) -> None:
        self._paths = paths
        self._meshes: dict[tuple[Path, str, tuple[float, ...]], Shape] = {}

    def file(self, shape: Element, folder: Path) -> Path:
        """The file that a shape names. NotUnderstoodError when it is not there."""
        uri = text_of(shape, "uri") or text_of(shape, "filename")
        found = self._paths.found(uri, folder) if uri else None
        if found is None or not found.is_file():
            raise NotUnderstoodError(f"{shape.tag} {uri or 'without <uri>'}, which is not there")
        return found

    def mesh(self, file: Path, part: str, scale: tuple[float, ...]) -> Shape:
        """A mesh, or its part. NotUnderstoodError when it cannot be read."""
        key = (file, part, scale)
        if key not in self._meshes:
            try:
                read = read_triangles(file, MeshFrame(up="z"), part or None)
            except ValueError as error:
                raise NotUnderstoodError(str(error)) from error
            vertices = read.vertices * np.array(scale)
            solid = closed_solids(vertices, read.triangles)
            remark = f"{', '.join(read.missing)} of the mesh {file.name}, which cannot be read: left out" if read.missing else ""
            self._meshes[key] = Shape(vertices, read.triangles, solid, remark=remark)
        return self._meshes[key]


def read_shape(geometry: Element, folder: Path, files: ShapeFiles, is_collision: bool) -> Shape | Endless | None:
    """The shape of a <geometry> in a file of `folder`; None for one that says <empty>.

    NotUnderstoodError for what is left out; ValueError when a number is wrong or missing.
    """
    found = [child for child in geometry if child.tag != "empty"]
    if not len(geometry):
        raise NotUnderstoodError("geometry without a shape")
    if not found:
        return None
    shape = found[0]
    if shape.tag in _SOLIDS:
        return _SOLIDS[shape.tag](shape)
    if shape.tag == "plane":
        return _plane(shape, is_collision)
    if shape.tag == "mesh":
        return _mesh(shape, folder, files)
    if shape.tag == "heightmap":
        return _heightmap(shape, folder, files)
    raise NotUnderstoodError(f"geometry {shape.tag}")


def _box(shape: Element) -> Shape:
    return _solid(trimesh.creation.box(sizes(shape, "size", 3)))


def _cylinder(shape: Element) -> Shape:
    return _solid(trimesh.creation.cylinder(*_round(shape), sections=_SECTIONS))


def _capsule(shape: Element) -> Shape:
    radius, length = _round(shape)
    return _solid(trimesh.creation.capsule(length, radius, count=[_SECTIONS, _SECTIONS]))


def _cone(shape: Element) -> Shape:
    radius, length = _round(shape)
    standing = _solid(trimesh.creation.cone(radius, length, sections=_SECTIONS))
    return replace(standing, vertices=standing.vertices - (0.0, 0.0, length / 2))


def _sphere(shape: Element) -> Shape:
    return _solid(trimesh.creation.icosphere(3, *sizes(shape, "radius", 1)))


def _ellipsoid(shape: Element) -> Shape:
    return _solid(trimesh.creation.icosphere(3).apply_scale(sizes(shape, "radii", 3)))


_SOLIDS: dict[str, Callable[[Element], Shape]] = {
    "box": _box,
    "cylinder": _cylinder,
    "capsule": _capsule,
    "cone": _cone,
    "sphere": _sphere,
    "ellipsoid": _ellipsoid,
}


def _round(shape: Element) -> tuple[float, float]:
    return sizes(shape, "radius", 1)[0], sizes(shape, "length", 1)[0]


def _solid(mesh: trimesh.Trimesh) -> Shape:
    return Shape(np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int32), np.zeros(len(mesh.faces), np.int32))


def _open(vertices: ArrayLike, triangles: ArrayLike) -> Shape:
    faces = np.asarray(triangles, np.int32)
    return Shape(np.asarray(vertices, np.float64), faces, np.full(len(faces), OPEN, np.int32))


def _plane(shape: Element, is_collision: bool) -> Shape | Endless:
    """What is collided with has no end, as in Gazebo; what is seen has a size."""
    normal = np.array(child_numbers(shape, "normal", (0.0, 0.0, 1.0)))
    length = float(np.linalg.norm(normal))
    if length < 1e-6:
        raise wrong(shape, "its normal is 0")
    if is_collision:
        return Endless(normal / length)
    x, y = np.array(sizes(shape, "size", 2)) / 2
    turned = trimesh.geometry.align_vectors([0.0, 0.0, 1.0], normal / length)[:3, :3]
    return _open(np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]]) @ turned.T, [[0, 1, 2], [0, 2, 3]])


def _mesh(shape: Element, folder: Path, files: ShapeFiles) -> Shape:
    """In metres by the file's unit and its <scale>; an upward axis that the file names does not count, as in Gazebo."""
    file = files.file(shape, folder)
    if file.suffix.lower() not in MESH_SUFFIXES:
        raise NotUnderstoodError(f"mesh {file.name}, which is none of {', '.join(MESH_SUFFIXES)}")
    scale = child_numbers(shape, "scale", (1.0, 1.0, 1.0))
    if not all(scale):
        raise wrong(shape, f"scale {text_of(shape, 'scale')} is 0")
    part = text_of(shape, "submesh/name")
    found = files.mesh(file, part, scale)
    vertices = found.vertices
    if part and text_of(shape, "submesh/center") in ("true", "1"):
        vertices = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    return replace(found, vertices=vertices, mesh=f"{place(shape)}: mesh {file.name}")


def _heightmap(shape: Element, folder: Path, files: ShapeFiles) -> Shape:
    """Its brightest pixel is as high as its size says, and its first row lies at the highest y."""
    x, y, z = sizes(shape, "size", 3)
    at = child_numbers(shape, "pos", (0.0, 0.0, 0.0))
    file = files.file(shape, folder)
    try:
        read = read_height_map(file, (x, y, z))
    except ValueError as error:
        raise NotUnderstoodError(str(error)) from error
    top = float(read.heights.max())
    full = HeightMap(read.heights * (z / top if top > 0.0 else 1.0), read.size_xy)
    half = np.array(full.size_xy) / 2
    try:
        terrain = terrain_between(full, -half, half)
    except ValueError as error:
        raise wrong(shape, str(error)) from error
    surface, pixel_m = surface_from_heights(terrain), min(full.pixel_m)
    is_coarse = terrain.step > max(pixel_m, FINEST_M) + 1e-6
    remark = f"heightmap {file.name} has a point every {terrain.step:.2g} m, of pixels every {pixel_m:.2g} m" if is_coarse else ""
    return replace(_open(surface.vertices + at, surface.triangles), remark=remark)
