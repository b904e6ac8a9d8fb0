"""Points of a sweep that hang alone in space: of beams that fell on two surfaces at once, or on none (radius outlier removal)."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from sweep_assembly.geometry import FloatArray

Mask = NDArray[np.bool_]
_FINENESS = 2.0**21  # cells to every side of the middle: three such indices fit into 64 bits


def stray_points(points: NDArray[np.floating], radius_m: FloatArray, neighbours: int) -> Mask:
    """(N,) whether fewer than `neighbours` others of the finite (N, 3) points lie within a point's `radius_m` (N,).

    A surface is met by beams side by side: a point without company is none, however thin the thing is.
    """
    if neighbours < 1 or not len(points):
        return np.zeros(len(points), dtype=np.bool_)
    asked = np.flatnonzero(_lonely(points, float(radius_m.min()), neighbours))
    distance = cKDTree(points, balanced_tree=False, compact_nodes=False).query(
        points[asked], k=[neighbours + 1], distance_upper_bound=float(radius_m.max()) + 1e-6
    )[0][:, 0]
    stray = np.zeros(len(points), dtype=np.bool_)
    stray[asked] = distance > radius_m[asked]
    return stray


def _lonely(points: NDArray[np.floating], radius_m: float, neighbours: int) -> Mask:
    """(N,) whether a point has not enough company in its own cell, in which all are within the radius: the others need not be asked."""
    cells = np.floor(points * (np.sqrt(3.0) / radius_m)).astype(np.int64)
    scale = int(2 * _FINENESS)
    _, index, count = np.unique((cells[:, 0] * scale + cells[:, 1]) * scale + cells[:, 2], return_inverse=True, return_counts=True)
    return np.asarray(count[index] <= neighbours)
