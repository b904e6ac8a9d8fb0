"""How much of what two clouds compare a placement explains, by their own noise, in the direction of motion where that is least.

A floor lies on any floor. A placement that only looks right is one that floor explains, while what holds it sideways or in its heading
speaks against it; things that moved speak against a right one too, but not against all that holds a direction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import eigh

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import Array, PointCloud
from pose_graph_mapping.registration.gicp_surface import Surface

SAME_PLANE_COS = 0.5  # of normals; at edges and behind thin walls nearest points are of other surfaces
_ONE_SURFACE_M, _ONE_SURFACE_COS = 0.1, 0.9  # points on one plane, as far as a voxel tells, are of one surface
_SURFACE_POINTS = 2000  # enough to tell surfaces
_NOISE_SHARE = 0.95  # of a cloud's own points that lie nearer to their neighbours' planes than its noise
_NOISE_POINTS = 2000  # enough to tell it
_DAMPING = 1e-9  # of a motion that no point feels
OVERLAP_DISTANCE_M = 0.2  # a reading point with a reference point this near overlaps


@dataclass(frozen=True)
class Noise:
    """What a cloud shows of itself, each point beside the plane of its nearest neighbour: 95 % lie within `within_m`, and `misfit` of
    them farther off than may be.
    """

    within_m: float
    misfit: float

    def or_worse(self, other: Noise) -> Noise:
        """The worse of both clouds, in each number."""
        return Noise(max(self.within_m, other.within_m), max(self.misfit, other.misfit))


def own_noise(surface: Surface, config: RegistrationConfig) -> Noise:
    """By the test that a match is put to, of a cloud beside itself; zeros where no two points can be compared."""
    step = max(1, len(surface.points) // _NOISE_POINTS)
    points, normals = surface.points[::step], surface.normals[::step]
    if len(surface.points) < 2:
        return Noise(0.0, 0.0)
    index, squared = surface.tree.batch_knn_search(points, 2, num_threads=1)
    beside = index[:, 1].astype(np.int64)
    off = np.abs(np.einsum("ij,ij->i", surface.normals[beside], points - surface.points[beside]))
    alike = np.einsum("ij,ij->i", surface.normals[beside], normals) > SAME_PLANE_COS
    off = off[alike & (squared[:, 1] <= OVERLAP_DISTANCE_M**2)]
    return Noise(float(np.quantile(off, _NOISE_SHARE)), float(np.mean(off > config.misfit_m))) if off.size else Noise(0.0, 0.0)


def least_explained(reading: PointCloud, agrees: NDArray[np.bool_], asked: NDArray[np.bool_]) -> float:
    """Share of the points asked for that agree, weighed by what each holds of a motion, in the motion where it is least; 0 of nothing.

    `agrees` (N,): points of the reading that lie on the reference's surface; `asked` (N,): those and others. The least eigenvalue of the
    Hessian of the former relative to that of the latter: no unit or choice of axes matters.
    """
    held, whole = _hessian(reading, agrees), _hessian(reading, asked)
    size = float(np.trace(whole))
    if not size > 0.0:
        return 0.0
    return float(np.clip(eigh(held, whole + _DAMPING * size * np.eye(6), eigvals_only=True)[0], 0.0, 1.0))


def _hessian(reading: PointCloud, which: NDArray[np.bool_]) -> Array:
    """(6, 6) of the distances from these points' planes, rotation before translation."""
    assert reading.normals is not None
    points, normals = reading.points[which], reading.normals[which]
    jacobian = np.hstack([np.cross(points, normals), normals])
    return np.asarray(jacobian.T @ jacobian)


def agreeing_surfaces(reading: PointCloud, agrees: NDArray[np.bool_]) -> float:
    """How many different surfaces agree: points `agrees` (N,), each divided by the number of points on its plane.

    This is the evidence that a match has. Two rooms of one size share six walls by chance, however many points lie on them.
    """
    assert reading.normals is not None
    step = max(1, -(-len(reading) // _SURFACE_POINTS))
    weights = _surface_weights(np.ascontiguousarray(reading.points[::step]), np.ascontiguousarray(reading.normals[::step]))
    return float(weights[agrees[::step]].sum())


@njit(cache=True)
def _surface_weights(points: Array, normals: Array) -> Array:
    """(N,) one over the number of points on the plane of each, itself included; 0 for those without a normal."""
    weights = np.zeros(len(points))
    for i in range(len(points)):
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        if nx * nx + ny * ny + nz * nz < 0.25:
            continue
        count = 0
        for j in range(len(points)):
            if nx * normals[j, 0] + ny * normals[j, 1] + nz * normals[j, 2] > _ONE_SURFACE_COS:
                x, y, z = points[j, 0] - points[i, 0], points[j, 1] - points[i, 1], points[j, 2] - points[i, 2]
                count += abs(nx * x + ny * y + nz * z) < _ONE_SURFACE_M
        weights[i] = 1.0 / max(1, count)
    return weights


def compile_kernels() -> None:
    """Compiles the kernel of this module for the types that a match passes."""
    _surface_weights(np.zeros((1, 3)), np.zeros((1, 3)))
