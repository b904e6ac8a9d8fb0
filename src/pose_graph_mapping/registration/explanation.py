"""How much of what two clouds compare a placement explains, by their own noise, in the direction of motion where that is least.

A floor lies on any floor. A placement that only looks right is one that floor explains, while what holds it sideways or in its heading
speaks against it; things that moved speak against a right one too, but not against all that holds a direction.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from pose_graph_mapping.registration.cloud import Array, PointCloud
from pose_graph_mapping.registration.gicp_surface import Surface

SAME_PLANE_COS = 0.5  # of normals; at edges and behind thin walls nearest points are of other surfaces
_NOISE_SHARE = 0.95  # of a cloud's own points that lie nearer to their neighbours' planes than its noise
_NOISE_POINTS = 2000  # enough to tell it
_DAMPING = 1e-9  # of a motion that no point feels


def own_noise(surface: Surface) -> float:
    """The distance (m) from their nearest neighbour's plane within which 95 % of a cloud's own points lie; 0 where none can be told."""
    step = max(1, len(surface.points) // _NOISE_POINTS)
    points, normals = surface.points[::step], surface.normals[::step]
    if len(surface.points) < 2:
        return 0.0
    index, squared = surface.tree.batch_knn_search(points, 2, num_threads=1)
    near = index[:, 1].astype(np.int64)
    off = np.einsum("ij,ij->i", surface.normals[near], points - surface.points[near])
    alike = np.einsum("ij,ij->i", surface.normals[near], normals) > SAME_PLANE_COS
    return float(np.quantile(np.abs(off[alike]), _NOISE_SHARE)) if alike.any() else 0.0


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
