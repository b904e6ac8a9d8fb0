"""Sweeps of a tilting laser in worlds made of boxes, for the tests of this package."""

from collections.abc import Iterable

import numpy as np
import open3d as o3d
from numpy.typing import ArrayLike, NDArray

from rigid_geometry import transform_from_rpy, transform_points

Array = NDArray[np.float64]
Triple = tuple[float, float, float]
Boxes = list[tuple[Triple, Triple]]

T_BASE_MOUNT = transform_from_rpy((0.20, 0.0, 0.75))
T_TILT_LASER = transform_from_rpy((0.03, 0.0, 0.04))


def box(centre: ArrayLike, size: Triple) -> o3d.geometry.TriangleMesh:
    """A triangle mesh of a box, `size` metres along x, y, z."""
    mesh = o3d.geometry.TriangleMesh.create_box(*size)
    mesh.translate(np.asarray(centre) - 0.5 * np.asarray(size))
    return mesh


def world_of(boxes: Iterable[tuple[ArrayLike, Triple]]) -> o3d.t.geometry.RaycastingScene:
    """A scene to cast rays in, of (centre, size) boxes."""
    scene = o3d.t.geometry.RaycastingScene()
    for centre, size in boxes:
        scene.add_triangles(o3d.t.geometry.TriangleMesh.from_legacy(box(centre, size)))
    return scene


def furnished_room(length: float = 9.0, width: float = 7.0) -> Boxes:
    """Floor, four walls 2.5 m high and furniture without symmetry."""
    walls: Boxes = [
        ((0, 0, -0.05), (length + 1, width + 1, 0.1)),
        ((length / 2, 0, 1.25), (0.1, width, 2.5)),
        ((-length / 2, 0, 1.25), (0.1, width, 2.5)),
        ((0, width / 2, 1.25), (length, 0.1, 2.5)),
        ((0, -width / 2, 1.25), (length, 0.1, 2.5)),
    ]
    furniture: Boxes = [
        ((2.5, 2.0, 0.4), (1.0, 0.6, 0.8)),
        ((-3.0, 1.0, 0.6), (0.5, 1.5, 1.2)),
        ((1.0, -2.5, 0.9), (0.4, 0.4, 1.8)),
        ((-1.5, -2.8, 0.3), (2.0, 0.5, 0.6)),
    ]
    return walls + furniture


def corridor(length: float = 80.0, width: float = 2.4) -> Boxes:
    """Floor, ceiling and two smooth walls along x; nothing within sight holds a position along it."""
    return [
        ((0, 0, -0.05), (length, width + 1, 0.1)),
        ((0, 0, 2.55), (length, width + 1, 0.1)),
        ((0, width / 2, 1.25), (length, 0.1, 2.5)),
        ((0, -width / 2, 1.25), (length, 0.1, 2.5)),
    ]


def divided_corridor(thickness: float) -> Boxes:
    """Floor and two smooth walls along x, and a wall across that ends at y = 0.2: nothing but its two sides holds a position along x."""
    return [
        ((0, 0, -0.05), (80, 7, 0.1)),
        ((0, 3, 1.25), (80, 0.1, 2.5)),
        ((0, -3, 1.25), (80, 0.1, 2.5)),
        ((0, -1.4, 1.25), (thickness, 3.2, 2.5)),
    ]


def sweep(
    scene: o3d.t.geometry.RaycastingScene,
    T_map_base: Array,
    rng: np.random.Generator,
    lines: int = 120,
    beams: int = 361,
    sigma_m: float = 0.01,
    max_range_m: float = 30.0,
) -> tuple[Array, Array]:
    """(points (N, 3), origins (N, 3)) in base_link of one sweep of the laser from +165 to -35 degrees of tilt."""
    angles = np.radians(np.linspace(-135, 135, beams))
    fan = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(beams)])
    of_lines = []
    for tilt in np.radians(np.linspace(165, -35, lines)):
        T_base_laser = T_BASE_MOUNT @ transform_from_rpy((0, 0, 0), (0.0, tilt, 0.0)) @ T_TILT_LASER
        of_lines.append((np.tile(T_base_laser[:3, 3], (beams, 1)), fan @ T_base_laser[:3, :3].T))
    starts, directions = (np.concatenate(part) for part in zip(*of_lines, strict=True))
    rays = np.hstack([transform_points(T_map_base, starts), directions @ T_map_base[:3, :3].T]).astype(np.float32)
    ranges = scene.cast_rays(o3d.core.Tensor.from_numpy(rays))["t_hit"].numpy().astype(float)
    hit = np.isfinite(ranges) & (ranges > 0.1) & (ranges < max_range_m)
    ranges = ranges[hit] + rng.normal(0.0, sigma_m, np.count_nonzero(hit))
    return starts[hit] + directions[hit] * ranges[:, None], starts[hit]


def pose(x: float, y: float, yaw: float = 0.0, z: float = 0.132, roll: float = 0.0, pitch: float = 0.0) -> Array:
    """T_map_base of a robot on a floor at height 0."""
    return transform_from_rpy((x, y, z), (roll, pitch, yaw))
