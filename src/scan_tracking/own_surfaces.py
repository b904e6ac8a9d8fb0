"""Surfaces that the map does not have yet, from one bundle: so that the robot finds its way on where nothing is mapped.

A patch of points has a normal of its own. A single line has none: it is taken for an upright surface's, a wall's.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from scan_tracking.alignment import FACING_COS
from scan_tracking.config import ScanTrackingConfig

Array = NDArray[np.float64]

_NEIGHBOURS = 6
_LEVEL = 0.2  # sine of the angle up to which a line counts as level
_LINE = 0.2  # a patch so narrow, in proportion to its length, is a line


def surfaces_of(points: Array, origins: Array, config: ScanTrackingConfig) -> tuple[NDArray[np.intp], Array]:
    """Which of (N, 3) points lie on a surface, and its unit normals, turned to where the beams started; z is up."""
    if len(points) <= _NEIGHBOURS:
        return np.zeros(0, np.intp), np.zeros((0, 3))
    distances, near = cKDTree(points).query(points, k=_NEIGHBOURS + 1)
    offsets = points[near] - points[near].mean(axis=1, keepdims=True)
    variances, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", offsets, offsets) / near.shape[1])
    sigmas = np.sqrt(np.maximum(variances, 0.0))
    line = sigmas[:, 1] < np.maximum(_LINE * sigmas[:, 2], config.point_sigma_m)
    along, plane = axes[:, :, 2], axes[:, :, 0]
    across = np.column_stack([-along[:, 1], along[:, 0], np.zeros(len(points))])
    lengths = np.linalg.norm(across, axis=1)
    normals = np.where(line[:, None], across / np.maximum(lengths, 1e-9)[:, None], plane)
    thin = np.where(line, sigmas[:, 1], sigmas[:, 0]) < config.point_sigma_m
    dense = distances[:, -1] < _NEIGHBOURS * config.cell_m
    good = np.flatnonzero(thin & dense & (~line | (np.abs(along[:, 2]) < _LEVEL)))
    beams = origins[good] - points[good]
    towards = np.einsum("ij,ij->i", normals[good], beams)
    facing = np.abs(towards) > FACING_COS * np.linalg.norm(beams, axis=1)
    return good[facing], normals[good][facing] * np.sign(towards[facing])[:, None]
