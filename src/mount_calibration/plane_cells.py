"""How far hits lie off the planes that they share, and how the parameters move them: the sum that calibration makes small.

Space is cut into cells. A cell counts where hits of different kinds (rising or falling, in front of the laser or behind it, from one
place or another) each lie on a plane. The plane of a cell is unknown: hits and derivatives are freed of whatever another plane would
explain, so that the information is not overrated (plane adjustment: Liu and Zhang, BALM, 2021, with the planes eliminated).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]
_CELL_M = 0.5  # edge of the cells in which hits are compared with a plane
_LEAST_POINTS = 4  # hits of one kind from which they count in a cell: three make a plane
_LEAST_SPREAD_M = 0.05  # rms width of the hits of a cell that hold a plane
_PLANAR_SIGMAS = 2.0  # thicker than so many of the median thickness a cell is no plane
_MOST_CUT = 0.2  # share of the hits of a cell that may lie within the noise of a face
_ROBUST_SIGMAS = 2.0  # distance from the plane at which a hit weighs half (Cauchy)


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """information (P, P), gradient (P,) and the scatter of the gradient from cell to cell (P, P); `sigma_m` the noise that hits show.

    `thickness_m`: rms distance of hits from the planes; `cells`: how many planes.
    """

    information: FloatArray
    gradient: FloatArray
    scatter: FloatArray
    sigma_m: float
    thickness_m: float
    cells: int


@dataclass(frozen=True, eq=False)
class _Cells:
    """Hits of cells that count: (N,) cell numbers, (N, 3) offsets from the cell's centre, normals and axes per cell (C, 3, 3)."""

    chosen: IntArray
    cell: IntArray
    offsets: FloatArray
    axes: FloatArray
    count: int
    sigma_m: float


def plane_equations(points: FloatArray, jacobian: FloatArray, kinds: IntArray) -> NormalEquations | None:
    """Normal equations of (N, 3) hits with (N, 3, P) derivatives and (N,) kinds; None where no cell holds hits of two kinds on planes.

    Two grids of cells, half a cell apart, are averaged: a plane along the faces of one lies amid the cells of the other.
    """
    grids = [_planar_cells(points, kinds, shift * _CELL_M) for shift in (0.0, 0.5)]
    parts = [_equations(cells, jacobian) for cells in grids if cells is not None]
    if not parts:
        return None
    return NormalEquations(
        np.mean([part.information for part in parts], axis=0),
        np.mean([part.gradient for part in parts], axis=0),
        np.mean([part.scatter for part in parts], axis=0),
        float(np.mean([part.sigma_m for part in parts])),
        float(np.mean([part.thickness_m for part in parts])),
        sum(part.cells for part in parts) // len(parts),
    )


def _equations(cells: _Cells, jacobian: FloatArray) -> NormalEquations:
    local = np.einsum("nij,nj->ni", cells.axes[cells.cell], cells.offsets)
    normals = cells.axes[cells.cell, 0]
    by = np.einsum("ni,nip->np", normals, jacobian[cells.chosen])
    off = local[:, 0].copy()
    for _ in range(2):
        scale_m = max(cells.sigma_m, 1.4826 * float(np.median(np.abs(off))))
        weights = 1.0 / (1.0 + (off / (_ROBUST_SIGMAS * scale_m)) ** 2)
        off = _freed(local[:, :1], local[:, 1:], weights, cells)[:, 0]
    by = _freed(by, local[:, 1:], weights, cells)
    weighted = by * weights[:, None]
    pulls = weighted * off[:, None]
    by_cell: FloatArray = np.stack([np.bincount(cells.cell, pull, cells.count) for pull in pulls.T], axis=1)
    thickness_m = float(np.sqrt(np.average(off**2, weights=weights)))
    return NormalEquations(
        by.T @ weighted, np.asarray(pulls.sum(axis=0)), np.asarray(by_cell.T @ by_cell), cells.sigma_m, thickness_m, cells.count
    )


def _planar_cells(points: FloatArray, kinds: IntArray, shift_m: float) -> _Cells | None:
    """Cells whose kinds each lie on a plane, of one slope; where they lie to each other does not matter."""
    chosen, cell, count = _numbered(np.floor((points + shift_m) / _CELL_M).astype(np.int64), np.arange(len(points)))
    _, kind, kinds_count = _numbered(np.column_stack([cell, kinds[chosen]]), chosen)
    size = np.bincount(kind, minlength=kinds_count)
    enough = size[kind] >= _LEAST_POINTS
    chosen, cell, kind = chosen[enough], cell[enough], kind[enough]
    if len(chosen) == 0:
        return None
    owner = np.zeros(kinds_count, dtype=np.intp)
    owner[kind] = cell
    shared = np.bincount(owner[np.unique(kind)], minlength=count) >= 2
    kept = shared[cell]
    chosen, cell, kind = chosen[kept], cell[kept], kind[kept]
    if len(chosen) == 0:
        return None
    within = points[chosen] - _means(points[chosen], kind, kinds_count)[kind]
    values, vectors = np.linalg.eigh(_spreads(within, cell, count))
    rms = np.sqrt(np.maximum(values[:, 0], 0.0))
    used = np.bincount(cell, minlength=count) > 0
    wide = used & (np.sqrt(np.maximum(values[:, 1], 0.0)) >= _LEAST_SPREAD_M)
    if not wide.any():
        return None
    sigma_m = float(np.median(rms[wide]))
    planar = wide & (rms <= _PLANAR_SIGMAS * sigma_m)
    planar &= _cut_share(points[chosen] + shift_m, cell, vectors[:, :, 0], sigma_m, _CELL_M) <= _MOST_CUT
    if not planar.any():
        return None
    kept = planar[cell]
    chosen, cell, count = _numbered(cell[kept][:, None], chosen[kept])
    centre = _means(points[chosen], cell, count)
    axes = np.linalg.eigh(_spreads(points[chosen] - centre[cell], cell, count))[1].transpose(0, 2, 1)
    return _Cells(chosen, cell, points[chosen] - centre[cell], axes, count, sigma_m)


def _cut_share(points: FloatArray, cell: IntArray, normals: FloatArray, sigma_m: float, cell_m: float) -> FloatArray:
    """(C,) share of the hits of each cell that noise may have brought in over a face: a plane along the face is cut in two by it."""
    to_face = np.abs((points / cell_m + 0.5) % 1.0 - 0.5) * cell_m
    near = (to_face < 3.0 * sigma_m * np.abs(normals[cell])).any(axis=1)
    return np.bincount(cell, near, len(normals)) / np.maximum(np.bincount(cell, minlength=len(normals)), 1)


def _numbered(keys: NDArray[np.int64] | IntArray, carried: IntArray) -> tuple[IntArray, IntArray, int]:
    """What is carried with each of (N, K) keys, the number of its key from 0 on, and how many there are."""
    low = keys.min(axis=0) if len(keys) else np.zeros(keys.shape[1], dtype=np.int64)
    spans = (keys.max(axis=0) - low + 1) if len(keys) else low
    flat = np.zeros(len(keys), dtype=np.int64)
    for column, start, span in zip(keys.T, low, spans, strict=True):
        flat = flat * span + (column - start)
    unique, number = np.unique(flat, return_inverse=True)
    return carried, number.astype(np.intp), len(unique)


def _means(values: FloatArray, group: IntArray, count: int) -> FloatArray:
    """(count, K) mean of (N, K) values in each group; 0 for an empty one."""
    size = np.maximum(np.bincount(group, minlength=count), 1)
    return np.stack([np.bincount(group, column, count) for column in values.T], axis=1) / size[:, None]


def _spreads(offsets: FloatArray, group: IntArray, count: int) -> FloatArray:
    """(count, 3, 3) covariances of (N, 3) offsets from the centre of their group."""
    products = (offsets[:, :, None] * offsets[:, None, :]).reshape(len(offsets), 9)
    return _means(products, group, count).reshape(count, 3, 3)


def _freed(values: FloatArray, in_plane: FloatArray, weights: FloatArray, cells: _Cells) -> FloatArray:
    """(N, K) values less what a shift and two tilts of the cell's plane explain of them, by weighted least squares."""
    basis = np.column_stack([np.ones(len(in_plane)), in_plane])
    weighted = basis * weights[:, None]
    products = np.stack([np.bincount(cells.cell, weighted[:, i] * basis[:, j], cells.count) for i in range(3) for j in range(3)], axis=1)
    matrix = products.reshape(-1, 3, 3)
    matrix += 1e-9 * np.maximum(np.trace(matrix, axis1=1, axis2=2), 1e-12)[:, None, None] * np.eye(3)
    right = np.stack(
        [np.bincount(cells.cell, weighted[:, i] * column, cells.count) for i in range(3) for column in values.T], axis=1
    ).reshape(-1, 3, values.shape[1])
    explained = np.linalg.solve(matrix, right)
    return np.asarray(values - np.einsum("ni,nik->nk", basis, explained[cells.cell]))
