"""Collision shapes of a robot description: boxes, cylinders, spheres and meshes, and how far each reaches."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mesh_files import MeshFrame, package_folders, package_roots, read_triangles
from rigid_geometry import transform_from_rpy, transform_points

Array = NDArray[np.float64]
SOLIDS = ("box", "cylinder", "sphere", "mesh")


def box_around(reaches: Sequence[tuple[Array, Array]]) -> tuple[Array, Array] | None:
    """Lower and upper corner (3,) of the box around boxes, each by its own; None of none."""
    if not reaches:
        return None
    return np.min([low for low, _ in reaches], axis=0), np.max([high for _, high in reaches], axis=0)


@dataclass(frozen=True, eq=False)
class Shape:
    """A shape in its link: half its size along x, y and z of its own frame; of a mesh its file, None where it is missing, and scale."""

    kind: str
    T_link_shape: Array
    half_m: tuple[float, float, float]
    mesh: Path | None = None
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)

    @property
    def is_missing(self) -> bool:
        """A mesh whose file is not there."""
        return self.kind == "mesh" and self.mesh is None

    def reach(self, T_base_link: Array) -> tuple[Array, Array]:
        """The lower and the upper corner (3,) of the box around it in base_link, exactly. ValueError for a mesh that cannot be read."""
        T = T_base_link @ self.T_link_shape
        if self.mesh is not None:
            points = transform_points(T, mesh_surface(self.mesh, self.scale)[0])
            return points.min(axis=0), points.max(axis=0)
        half = self._half_in(T[:3, :3])
        return T[:3, 3] - half, T[:3, 3] + half

    def holds(self, T_base_link: Array, point: Array) -> bool:
        """Whether a point (3,) in base_link lies inside; of a mesh that is not closed, whether most directions from there meet it."""
        x, y, z = np.linalg.solve(T_base_link @ self.T_link_shape, [*point, 1.0])[:3]
        if self.mesh is not None:
            return _is_inside(np.array([x, y, z]), *mesh_surface(self.mesh, self.scale))
        if self.kind == "box":
            return bool((np.abs([x, y, z]) < self.half_m).all())
        if self.kind == "cylinder":
            return bool(np.hypot(x, y) < self.half_m[0] and abs(z) < self.half_m[2])
        return bool(np.linalg.norm([x, y, z]) < self.half_m[0])

    def _half_in(self, R: Array) -> Array:
        if self.kind == "sphere":
            return np.array(self.half_m)
        if self.kind == "cylinder":
            return np.asarray(self.half_m[0] * np.sqrt(np.clip(1.0 - R[:, 2] ** 2, 0.0, None)) + self.half_m[2] * np.abs(R[:, 2]))
        return np.asarray(np.abs(R) @ np.array(self.half_m))


def _is_inside(point: Array, vertices: Array, triangles: NDArray[np.int32]) -> bool:
    """Whether triangles around a point fill more than half of the directions (Van Oosterom and Strackee 1983)."""
    a, b, c = (vertices[triangles[:, i]] - point for i in range(3))
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    below = la * lb * lc + np.einsum("ij,ij->i", a, b) * lc + np.einsum("ij,ij->i", b, c) * la + np.einsum("ij,ij->i", c, a) * lb
    return bool(abs(np.arctan2(volume, below).sum()) > np.pi)


def shapes_of(link: ElementTree.Element, folder: Path | None) -> tuple[Shape, ...]:
    """The collision shapes of a link; a mesh is looked for from the `folder` of the description. ValueError when one cannot be read."""
    return tuple(_shape(collision, folder) for collision in link.findall("collision"))


def pictures_of(link: ElementTree.Element, folder: Path | None) -> tuple[Shape, ...]:
    """As `shapes_of`, the visual ones."""
    return tuple(_shape(visual, folder) for visual in link.findall("visual"))


def _shape(collision: ElementTree.Element, folder: Path | None) -> Shape:
    geometry = collision.find("geometry")
    solid = next((e for e in ([] if geometry is None else geometry) if e.tag in SOLIDS), None)
    if solid is None:
        kinds = "nothing" if geometry is None else ", ".join(e.tag for e in geometry) or "nothing"
        raise ValueError(f"a collision shape is {kinds}, expected one of {', '.join(SOLIDS)}")
    T = origin_of(collision)
    if solid.tag == "mesh":
        scale = triple(solid.get("scale"), "1 1 1")
        return Shape("mesh", T, (0.0, 0.0, 0.0), found_mesh(str(solid.get("filename")), folder), scale)
    half_m = _half_of(solid)
    if not min(half_m) >= 0.0:
        raise ValueError(f"a collision {solid.tag} is {' x '.join(f'{2 * half:g}' for half in half_m)} m: no size is below 0")
    return Shape(solid.tag, T, half_m)


def _half_of(solid: ElementTree.Element) -> tuple[float, float, float]:
    if solid.tag == "box":
        x, y, z = triple(_given(solid, "size"), "")
        return x / 2, y / 2, z / 2
    radius = float(_given(solid, "radius"))
    return radius, radius, radius if solid.tag == "sphere" else float(_given(solid, "length")) / 2


def _given(solid: ElementTree.Element, name: str) -> str:
    value = solid.get(name)
    if value is None:
        raise ValueError(f"a collision {solid.tag} has no {name}")
    return value


def triple(text: str | None, default: str) -> tuple[float, float, float]:
    """Three numbers of an attribute. ValueError when it has others."""
    values = [float(value) for value in (text or default).split()]
    if len(values) != 3 or not np.isfinite(values).all():
        raise ValueError(f"{text!r} is not three numbers")
    return values[0], values[1], values[2]


def origin_of(element: ElementTree.Element) -> Array:
    """(4, 4) the pose of an element's origin, the identity where it has none: so a URDF says it."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    return np.asarray(transform_from_rpy(triple(origin.get("xyz"), "0 0 0"), triple(origin.get("rpy"), "0 0 0")))


def found_mesh(name: str, folder: Path | None) -> Path | None:
    """The file of a mesh: `package://NAME/...` in a package that ROS finds or around the description, else a path; None where none is."""
    return next((path for path in _places(name, folder) if path.is_file()), None)


def _places(name: str, folder: Path | None) -> Iterator[Path]:
    scheme, _, rest = name.rpartition("://")
    if scheme != "package":
        yield Path(rest) if folder is None else folder / rest
        return
    package, _, inner = rest.partition("/")
    yield from (found / inner for found in package_folders(package, folder, package_roots()))


@lru_cache(maxsize=64)
def mesh_surface(path: Path, scale: tuple[float, float, float]) -> tuple[Array, NDArray[np.int32]]:
    """Vertices (N, 3) in m, scaled, and triangles (T, 3) of a mesh. ValueError when it cannot be read, or has none.

    The unit that the file names counts, its upward axis does not: so rviz and Gazebo read it.
    """
    mesh = read_triangles(path, MeshFrame(up="z"))
    if mesh.missing:
        raise ValueError(f"cannot read all of the mesh {path}: {', '.join(mesh.missing)} would be left out")
    return mesh.vertices * np.array(scale), mesh.triangles
