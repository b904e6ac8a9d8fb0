"""A world from an SDF file (.sdf, .world) as triangles: the boxes, meshes and grounds of all its models, where they are.

`sdf_elements` reads the XML, `sdf_models` finds what is included, `sdf_frames` where it is, `sdf_shapes` what it looks like. Of a link the
collision shapes count; its visuals only where it has none. Everything stands still, as joints are at zero.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import transform_points
from world_files.closed_solids import OPEN
from world_files.model_paths import ModelPaths
from world_files.sdf_elements import Element
from world_files.sdf_frames import T_link_shape, T_model_element, T_world_model
from world_files.sdf_models import Model, ModelReader, Notes
from world_files.sdf_shapes import Endless, NotUnderstoodError, Shape, ShapeFiles, read_shape

Array = NDArray[np.float64]
Indices = NDArray[np.int32]
Transform = NDArray[np.float64]

SDF_SUFFIXES = (".sdf", ".world")
_LEVEL_Z = 0.9999  # of the normal of a plane that is a floor: within 0.8 deg


@dataclass(frozen=True)
class SdfWorld:
    """What stands in a world: vertices (V, 3) in m with z up, triangles (T, 3), and for each the closed solid that it bounds (T,) or OPEN.

    `floors`: heights of planes without an end; `left_out`: a line each, with file and line, on what is left out or coarser than there;
    `largest_mesh`: size (3,) and name of the largest mesh file, None where there is none.
    """

    vertices: Array
    triangles: Indices
    solid: Indices
    floors: tuple[float, ...]
    left_out: tuple[str, ...]
    largest_mesh: tuple[Array, str] | None


def read_sdf(path: Path, paths: ModelPaths) -> SdfWorld:
    """The first world of a file. ValueError names file, line and element of what is wrong, or says that nothing is left."""
    notes, files = Notes(), ShapeFiles(paths)
    try:
        world = ModelReader(paths, notes).world(path)
        placed = [
            found for model in _all_models(world) for link in model.element.findall("link") for found in _of_link(model, link, files, notes)
        ]
    except RecursionError as error:
        raise ValueError(f"{path}: its models or frames hang on themselves") from error
    floors = sorted({round(float(T[2, 3]), 6) for T, shape in placed if isinstance(shape, Endless)})
    shapes = [(T, shape) for T, shape in placed if isinstance(shape, Shape)]
    if not floors and not shapes:
        raise ValueError("; ".join((f"{path}: nothing to stand on is left of it", *notes.lines()[:3])))
    return _joined(shapes, tuple(floors), notes.lines())


def _all_models(model: Model) -> Iterator[Model]:
    yield model
    for nested in model.nested:
        yield from _all_models(nested)


def _of_link(model: Model, link: Element, files: ShapeFiles, notes: Notes) -> list[tuple[Transform, Shape | Endless]]:
    """The shapes of a link where they are in the world."""
    T_world_link = T_world_model(model) @ T_model_element(model, link)
    for kind in ("collision", "visual"):
        found = []
        for element in link.findall(kind):
            try:
                shape = _shape_of(element, model.folder, files)
                T_world_shape = T_world_link @ T_link_shape(link, model, element)
                if isinstance(shape, Endless) and (T_world_shape[:3, :3] @ shape.normal)[2] < _LEVEL_Z:
                    raise NotUnderstoodError("plane without an end that is not level")
            except NotUnderstoodError as error:
                notes.left_out(str(error), element)
                continue
            if isinstance(shape, Shape) and shape.remark:
                notes.told(shape.remark, element)
            if shape is not None:
                found.append((T_world_shape, shape))
        if found:
            return found
    return []


def _shape_of(element: Element, folder: Path, files: ShapeFiles) -> Shape | Endless | None:
    """The shape of a <collision> or <visual>."""
    geometry = element.find("geometry")
    if geometry is None:
        raise NotUnderstoodError(f"{element.tag} without <geometry>")
    return read_shape(geometry, folder, files, element.tag == "collision")


def _joined(shapes: list[tuple[Transform, Shape]], floors: tuple[float, ...], left_out: tuple[str, ...]) -> SdfWorld:
    vertices: list[Array] = [np.empty((0, 3))]
    triangles: list[Indices] = [np.empty((0, 3), np.int32)]
    solids: list[Indices] = [np.empty(0, np.int32)]
    first_vertex = first_solid = 0
    for T_world_shape, shape in shapes:
        vertices.append(np.asarray(transform_points(T_world_shape, shape.vertices), np.float64))
        triangles.append(shape.triangles + first_vertex)
        solids.append(np.where(shape.solid == OPEN, OPEN, shape.solid + first_solid).astype(np.int32))
        first_vertex += len(shape.vertices)
        first_solid += int(shape.solid.max(initial=-1)) + 1
    meshes = [(np.ptp(shape.vertices, axis=0), shape.mesh) for _, shape in shapes if shape.mesh]
    largest = max(meshes, key=lambda mesh: float(mesh[0].max()), default=None)
    return SdfWorld(
        np.vstack(vertices), np.vstack(triangles).astype(np.int32), np.concatenate(solids).astype(np.int32), floors, left_out, largest
    )
