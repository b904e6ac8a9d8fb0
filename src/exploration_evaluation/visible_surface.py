"""The true surface that the robot's laser could ever see, and how completely a map shows it.

Beside `truth` in the judge, and from the same mesh: `visible_surface` needs no run, `completeness` holds a run's map against it.
The mesh is cut into small pieces, each piece is looked at from places all over the reachable ground, and those that any
place sees are what a perfect exploration would have mapped. It is an approximation from below: places lie on a coarse grid and
carry the laser above the robot's centre, and a sweep sees every direction up to its highest.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from exploration_evaluation.mesh import RayScene, checked_mesh
from exploration_evaluation.truth import ReachableGround
from stage_config import check_ranges, parameter

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_MAX_PIECES = 2_000_000
_SAME_SURFACE_M = 0.01
_STANDPOINT_M = 1.5  # distance between the places from which the surface is looked at
_SEEN_WITHIN_M = 0.10  # a piece is mapped when the map has a point this near


@dataclass(frozen=True)
class VisibilityConfig:
    """What counts as a surface that the sensor could see."""

    piece_m: float = parameter(0.40, "m", "longest edge of the triangles by whose centroids the surface is sampled", low=0.01, high=5.0)
    sensor_height_m: float = parameter(0.92, "m", "height of the laser above the ground; that of the run's robot", low=0.0, high=5.0)
    max_range_m: float = parameter(12.0, "m", "farthest surface that gets into the map", low=0.5, high=100.0)
    max_incidence_rad: float = parameter(
        1.40, "rad", "largest angle between a beam and the normal of what it hits; more is a graze", low=0.1, high=1.57
    )
    max_elevation_rad: float = parameter(
        0.785,
        "rad",
        "highest direction of a sweep: a plane of 270 deg that stands upright looks up 45 deg to both sides",
        low=-1.57,
        high=1.57,
    )

    def validate(self) -> list[str]:
        """All violations of ranges."""
        return check_ranges(self)


@dataclass(frozen=True)
class VisibleSurface:
    """Pieces of the true surface that can be seen: points (N, 3) world frame, each standing for areas_m2 (N,)."""

    points: Floats
    areas_m2: Floats

    @property
    def area_m2(self) -> float:
        """Area of all that can be seen."""
        return float(self.areas_m2.sum())


@dataclass(frozen=True)
class Completeness:
    """Distances from the visible surface to the map, weighted by area, and the share of the area that the map shows."""

    rms_m: float
    p95_m: float
    seen_share: float


def visible_surface(
    vertices: ArrayLike, triangles: ArrayLike, ground: ReachableGround, config: VisibilityConfig | None = None
) -> VisibleSurface:
    """The part of a mesh, (V, 3) metres and (T, 3) indices, that a laser sees from somewhere on the reachable ground.

    Both sides of a triangle count, because the winding of meshes found in the wild cannot be relied upon. Deterministic.
    ValueError for a mesh that is none or is too large, ground without points, or a configuration out of its ranges.
    """
    config = config or VisibilityConfig()
    if problems := config.validate():
        raise ValueError("; ".join(problems))
    if not len(ground.points):
        raise ValueError("nothing can be seen from reachable ground without points")
    mesh = checked_mesh(vertices, triangles)
    centroids, normals, areas = _pieces(*mesh, config.piece_m)
    eyes = ground.points[standpoints(ground.points, _STANDPOINT_M)] + [0.0, 0.0, config.sensor_height_m]
    seen = _seen_from_any(RayScene(*mesh), eyes, centroids, normals, config)
    return VisibleSurface(centroids[seen], areas[seen])


def completeness(surface: VisibleSurface, map_points_world: ArrayLike) -> Completeness:
    """How near the (K, 3) points of a map, in the world frame, come to every visible piece of the true surface.

    ValueError without visible surface, or without finite points of the map.
    """
    points = np.asarray(map_points_world, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.isfinite(points).all():
        raise ValueError(f"the points of a map are finite and of shape (K, 3) with K > 0, not {points.shape}")
    if not len(surface.points):
        raise ValueError("completeness needs visible surface, and there is none")
    away, _ = cKDTree(points).query(surface.points)
    share = surface.areas_m2 / surface.area_m2
    return Completeness(
        rms_m=math.sqrt(float(share @ away**2)),
        p95_m=_weighted_percentile(away, share, 0.95),
        seen_share=float(share[away <= _SEEN_WITHIN_M + 1e-9].sum()),
    )


def _weighted_percentile(values: Floats, share: Floats, part: float) -> float:
    """The smallest value that `part` of all shares do not exceed."""
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(share[order])
    return float(values[order[min(int(np.searchsorted(reached, part - 1e-12)), len(values) - 1)]])


def _pieces(vertices: Floats, triangles: Ints, longest_m: float) -> tuple[Floats, Floats, Floats]:
    """Centroids (N, 3), unit normals (N, 3) and areas (N,) of the mesh, its triangles halved until no edge is longer.

    Halving at the longest edge keeps pieces of one triangle alike in size and never makes slivers of what was none.
    """
    todo, done = vertices[triangles], []
    doubled = np.linalg.norm(_normals(todo), axis=1)
    fewest = doubled.sum() / (math.sqrt(3.0) / 2.0 * longest_m**2)  # if all were as large as may be
    while len(todo):
        edges = np.linalg.norm(todo[:, [1, 2, 0]] - todo, axis=2)  # edge k goes from corner k to the next one
        long = edges.max(axis=1) > longest_m
        done.append(todo[~long])
        todo = _halved(todo[long], edges[long].argmax(axis=1))
        if max(fewest, len(todo) + sum(len(part) for part in done)) > _MAX_PIECES:
            raise ValueError(f"the surface has more than {_MAX_PIECES} pieces of {longest_m} m")
    corners = np.concatenate(done)
    normals = _normals(corners)
    doubled = np.linalg.norm(normals, axis=1)
    solid = doubled > 0
    return corners[solid].mean(axis=1), normals[solid] / doubled[solid, None], 0.5 * doubled[solid]


def _normals(corners: Floats) -> Floats:
    """(T, 3) normals of (T, 3, 3) triangles, twice as long as their areas."""
    return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))


def _halved(corners: Floats, edge: Ints) -> Floats:
    row = np.arange(len(corners))
    a, b, c = (corners[row, (edge + k) % 3] for k in range(3))
    middle = 0.5 * (a + b)
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def standpoints(points: Floats, step_m: float) -> Ints:
    """(S,) indices of some of (N, 3) points: in every cube of a coarse grid the one that is nearest to its middle."""
    cubes = np.floor(points / step_m)
    off = np.linalg.norm(points / step_m - cubes - 0.5, axis=1)
    order = np.lexsort((off, *cubes.T))
    _, first = np.unique(cubes[order], axis=0, return_index=True)
    return np.asarray(order[first])


def _seen_from_any(scene: RayScene, eyes: Floats, points: Floats, normals: Floats, config: VisibilityConfig) -> Mask:
    """(N,) pieces that at least one of the (S, 3) eyes sees; what was seen is not looked at again."""
    seen = np.zeros(len(points), dtype=np.bool_)
    for eye in _spread(eyes):
        left = np.flatnonzero(~seen)
        inside = left[_within_reach(points[left] - eye, normals[left], config)]
        if len(inside):
            beams = points[inside] - eye
            rays = np.column_stack([np.broadcast_to(eye, beams.shape), beams])
            hidden_m = (1.0 - scene.first_hits(rays)) * np.linalg.norm(beams, axis=1)  # from what stands in the way to the piece
            seen[inside] = hidden_m <= _SAME_SURFACE_M
    return seen


def _within_reach(beams: Floats, normals: Floats, config: VisibilityConfig) -> Mask:
    """(N,) whether beams (N, 3) from the eye to a piece are short, low and steep enough upon it."""
    length = np.maximum(np.linalg.norm(beams, axis=1), 1e-9)
    towards = np.abs(np.einsum("ni,ni->n", beams, normals)) >= math.cos(config.max_incidence_rad) * length
    low = beams[:, 2] <= math.sin(config.max_elevation_rad) * length
    return np.asarray((length <= config.max_range_m) & low & towards)


def _spread(eyes: Floats) -> Floats:
    """The same eyes, neighbours apart: the first few then see most of what there is to see, and the others have little left to test."""
    return eyes[np.argsort(np.modf(np.arange(len(eyes)) * 0.5 * (math.sqrt(5.0) - 1.0))[0], kind="stable")]
