"""The surfaces that bundles are matched to: points with normals around the robot, and their search tree."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from rigid_geometry import transform_points

Array = NDArray[np.float64]

_UNIT = 0.1  # how far from one a normal's length may be
_FACES = 8  # more than there are
_ENOUGH = 5  # normals of a patch tell their mean
_CELLS = 1 << 20  # of a coordinate's key, either side of zero


@dataclass(frozen=True, eq=False)
class Partners:
    """What bundle points met: `which` (K,) of the points have a partner, with its `points` (K, 3) and `normals` (K, 3)."""

    which: NDArray[np.intp]
    points: Array
    normals: Array


class LocalMap:
    """(N, 3) points and unit normals, turned to where they were seen from, thinned to one a cell and face."""

    def __init__(self, points: ArrayLike, normals: ArrayLike, cell_m: float) -> None:
        """Points without a normal, (0, 0, 0), are left out. ValueError for wrong shapes, what is not finite or no unit normal."""
        rows, directions = np.asarray(points, np.float64), np.asarray(normals, np.float64)
        _check(rows, directions)
        known = np.abs(directions).sum(axis=1) > 0.0
        rows, directions = rows[known], directions[known]
        self._cell_m = cell_m
        kept = _one_a_cell(rows, cell_m, _faces(directions))
        self.points, self.normals = rows[kept], directions[kept]
        self._tree = cKDTree(self.points, balanced_tree=False, compact_nodes=False)

    def __len__(self) -> int:
        return len(self.points)

    @classmethod
    def empty(cls, cell_m: float) -> "LocalMap":
        """No surface at all."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), cell_m)

    def chosen(self, which: NDArray[np.bool_]) -> "LocalMap":
        """Some of the points."""
        return LocalMap(self.points[which], self.normals[which], self._cell_m)

    def joined(self, points: Array, normals: Array) -> "LocalMap":
        """With more of them; what stands in a cell already stays."""
        return LocalMap(np.vstack([self.points, points]), np.vstack([self.normals, normals]), self._cell_m)

    def move(self, T: Array) -> None:
        """Moves points and normals by a (4, 4) motion."""
        self.points = np.asarray(transform_points(T, self.points), np.float64)
        self.normals = self.normals @ T[:3, :3].T
        self._tree = cKDTree(self.points, balanced_tree=False, compact_nodes=False)

    def partners(self, points: Array, reach_m: float) -> Partners:
        """The nearest point of the map to each of (M, 3) points, where it is nearer than `reach_m`."""
        distances, nearest = self._tree.query(points, distance_upper_bound=reach_m)
        which = np.flatnonzero(np.isfinite(distances))
        return Partners(which, self.points[nearest[which]], self.normals[nearest[which]])


def thinned(points: Array, cell_m: float, most: int) -> NDArray[np.intp]:
    """Indices of one of (N, 3) points in each cell, and of these every so manieth, at most `most`."""
    kept = _one_a_cell(points, cell_m, np.zeros(len(points), np.int64))
    return kept[:: -(-len(kept) // most)] if len(kept) > most else kept


def supported(points: Array, normals: Array, patch_m: float, most_rad: float) -> NDArray[np.bool_]:
    """(N,) whether enough others of the patch face the same way, and a point's normal is within `most_rad` of their mean.

    Where a map is sparse, and at edges, normals are of no surface: along a corridor a few of those would tell more than all others.
    """
    _, patch, counts = np.unique(cell_keys(points, patch_m) * _FACES + _faces(normals), return_inverse=True, return_counts=True)
    sums = np.column_stack([np.bincount(patch, normals[:, axis], len(counts)) for axis in range(3)])
    means = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-9)
    along = np.einsum("ij,ij->i", normals, means[patch])
    return np.asarray((counts[patch] >= _ENOUGH) & (along > math.cos(most_rad)))


def cell_keys(points: Array, cell_m: float) -> NDArray[np.int64]:
    """(N,) a number for the cell that each of (N, 3) points lies in."""
    x, y, z = (np.floor(points / cell_m).astype(np.int64) + _CELLS).T
    return np.asarray(((x * 2 * _CELLS) + y) * 2 * _CELLS + z)


def _one_a_cell(points: Array, cell_m: float, kinds: NDArray[np.int64]) -> NDArray[np.intp]:
    _, first = np.unique(cell_keys(points, cell_m) * _FACES + kinds, return_index=True)
    return np.sort(first)


def _faces(normals: Array) -> NDArray[np.int64]:
    """(N,) 0 to 5: the axis that a normal is nearest to, and its side."""
    axis = np.abs(normals).argmax(axis=1) if len(normals) else np.zeros(0, np.int64)
    return np.asarray(axis * 2 + (normals[np.arange(len(normals)), axis] > 0.0), np.int64)


def _check(points: Array, normals: Array) -> None:
    if points.ndim != 2 or points.shape[1] != 3 or normals.shape != points.shape:
        raise ValueError(f"a map has (N, 3) points and as many normals, not {points.shape} and {normals.shape}")
    if not (np.isfinite(points).all() and np.isfinite(normals).all()):
        bad = int((~np.isfinite(np.hstack([points, normals])).all(axis=1)).sum())
        raise ValueError(f"{bad} of {len(points)} points of a map, or their normals, are not finite")
    lengths = np.linalg.norm(normals, axis=1)
    wrong = (np.abs(lengths - 1.0) > _UNIT) & (lengths > 0.0)
    if wrong.any():
        raise ValueError(f"{int(wrong.sum())} of {len(points)} normals of a map are not of length one, nor zero")
    if len(points) and not lengths.any():
        raise ValueError(f"none of {len(points)} points of a map has a normal: estimate them first")
