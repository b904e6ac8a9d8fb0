"""Closed convex solids from which the built-in worlds are made: exact shapes for the physics, triangles for the rays."""

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from rigid_geometry import transform_from_rpy

Array = NDArray[np.float64]

BURIED_M = 0.05  # solids reach into the ground, so that no two faces coincide


@dataclass(frozen=True)
class BoxShape:
    """A box in its own frame: half extents (3,) in m and its pose; the physics handles boxes better than hulls."""

    half_extents: Array
    T_world_box: Array


@dataclass(frozen=True)
class Solid:
    """A closed convex body: vertices (V, 3) float64 in m, triangles (T, 3) int32 facing outwards, and the box if it is one."""

    name: str
    vertices: Array
    triangles: NDArray[np.int32]
    box: BoxShape | None = None


def _solid(name: str, mesh: trimesh.Trimesh, box: BoxShape | None = None) -> Solid:
    return Solid(name, np.asarray(mesh.vertices, np.float64), np.asarray(mesh.faces, np.int32), box)


def box(name: str, low: ArrayLike, high: ArrayLike) -> Solid:
    """An upright box between two corners (x, y, z)."""
    low, high = np.asarray(low, float), np.asarray(high, float)
    return turned_box(name, transform_from_rpy((low + high) / 2), high - low)


def turned_box(name: str, T_world_box: Array, size: ArrayLike) -> Solid:
    """A box of a size (x, y, z) whose centre and axes are those of `T_world_box`."""
    size = np.asarray(size, float)
    return _solid(name, trimesh.creation.box(size, T_world_box), BoxShape(size / 2, T_world_box))


def hull(name: str, corners: ArrayLike) -> Solid:
    """The convex hull of (N, 3) corners."""
    return _solid(name, trimesh.convex.convex_hull(np.asarray(corners, float)))


def cylinder(name: str, x: float, y: float, low_z: float, high_z: float, radius: float) -> Solid:
    """An upright cylinder, as a prism of 24 sides."""
    T_world_cylinder = transform_from_rpy((x, y, (low_z + high_z) / 2))
    return _solid(name, trimesh.creation.cylinder(radius, high_z - low_z, sections=24, transform=T_world_cylinder))


def walls_around(low_xy: ArrayLike, high_xy: ArrayLike, low_z: float, high_z: float, thickness: float = 0.2) -> list[Solid]:
    """Four walls just outside of a rectangle."""
    (x0, y0), (x1, y1), t = np.asarray(low_xy, float), np.asarray(high_xy, float), thickness
    return [
        box("wall_west", (x0 - t, y0 - t, low_z), (x0, y1 + t, high_z)),
        box("wall_east", (x1, y0 - t, low_z), (x1 + t, y1 + t, high_z)),
        box("wall_south", (x0, y0 - t, low_z), (x1, y0, high_z)),
        box("wall_north", (x0, y1, low_z), (x1, y1 + t, high_z)),
    ]
