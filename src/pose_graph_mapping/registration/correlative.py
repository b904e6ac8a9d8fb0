"""Coarse placement of a reading in a reference from far off: correlation of voxels over x, y, z and yaw (after Olson, ICRA 2009).

Gravity is known, so roll and pitch stay those of the guess. Level and steep surfaces are correlated apart: a floor that lies on any floor
tells nothing of where its walls are. What comes out are starts for a registration, never results.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pose_graph_mapping.config import RegistrationConfig
from pose_graph_mapping.registration.cloud import Array, PointCloud, farthest, within
from pose_graph_mapping.registration.voxel_grid import first_in_voxels
from rigid_geometry import angle_difference, transform_from_rpy, yaw_of

_THREADS = 2
_LEVEL_COS = 0.75
_ON_SURFACE, _BESIDE = 3, 1
_LOOKED_AT = 3000
SEARCH_YAW_RAD = math.pi  # half angle of the search
SEARCH_LEAST_SHIFT_M = 1.0  # least half width of the search, after a direct match was refused
SEARCH_LEAST_YAW_RAD = math.radians(45.0)  # the same for the heading
SEARCH_CELL_M = 0.30  # edge of the cells of the search
SEARCH_YAW_STEP_RAD = math.radians(5.0)  # step of its headings
_SEARCH_POINTS = 600  # points of the reading that are placed
SEARCH_PEAKS = 10  # placements that are looked at closer; twice as many where free space allows none
_SEARCH_PEAKS_A_HEADING = 3  # most of them of one heading
SEARCH_APART_M = 0.6  # placements nearer than this are one
SEARCH_APART_RAD = math.radians(15.0)  # if they differ in heading by less than this, too


@dataclass(frozen=True)
class Window:
    """Half widths of a search around a guess: horizontal and vertical metres, radians of yaw."""

    shift_m: float
    height_m: float
    yaw_rad: float

    def is_wide(self) -> bool:
        """Whether a registration that starts at the guess may end in a wrong place."""
        return self.shift_m > SEARCH_LEAST_SHIFT_M or self.yaw_rad > SEARCH_LEAST_YAW_RAD

    def holds(self, T_guess: Array, T: Array) -> bool:
        """Whether `T` is a placement of the window around the guess, or the same place as one on its edge."""
        x, y, z = np.abs(T[:3, 3] - T_guess[:3, 3])
        yaw = abs(angle_difference(yaw_of(T), yaw_of(T_guess)))
        level_m, height_m = self.shift_m + SEARCH_APART_M, self.height_m + SEARCH_APART_M
        return bool(max(x, y) <= level_m and z <= height_m and yaw <= self.yaw_rad + SEARCH_APART_RAD)


@dataclass(frozen=True, eq=False)
class _Grid:
    """Level and steep surface cells (2, ny, nz, nx) uint8, with their lower corner (3,) in metres: x runs fastest."""

    cells: NDArray[np.uint8]
    corner: Array
    cell_m: float


def window_of(guess_covariance: Array | None, T_guess: Array, config: RegistrationConfig) -> Window:
    """Three sigmas of the guess, at least `SEARCH_LEAST_*` and at most the widest window; that one when nothing is known."""
    if guess_covariance is None:
        return Window(config.search_shift_m, config.search_height_m, SEARCH_YAW_RAD)
    R = T_guess[:3, :3]
    yaw = R[2] @ guess_covariance[:3, :3] @ R[2]
    shift = R @ guess_covariance[3:, 3:] @ R.T
    return Window(
        float(np.clip(3.0 * math.sqrt(np.linalg.eigvalsh(shift[:2, :2])[-1]), SEARCH_LEAST_SHIFT_M, config.search_shift_m)),
        float(np.clip(3.0 * math.sqrt(shift[2, 2]), SEARCH_LEAST_SHIFT_M, config.search_height_m)),
        float(np.clip(3.0 * math.sqrt(yaw), SEARCH_LEAST_YAW_RAD, SEARCH_YAW_RAD)),
    )


def coarse_placements(
    reference: PointCloud, reading: PointCloud, T_guess: Array, window: Window, config: RegistrationConfig
) -> tuple[Array, Array]:
    """(K, 4, 4) T_reference_reading within `window` of the guess where the surfaces agree best, best first, well apart.

    Then (L, 4, 4) more of them, for where those lead nowhere. Both clouds need normals; the same input gives the same placements. The guess
    alone where there is nothing to lay on anything.
    """
    cell = SEARCH_CELL_M
    steps = np.array([math.ceil(window.shift_m / cell - 1e-9), math.ceil(window.height_m / cell - 1e-9)])
    yaws = _yaws(window.yaw_rad, SEARCH_YAW_STEP_RAD)
    points, level = _balanced(reading, T_guess[:3, :3], config)
    if not len(points):
        return T_guess[None], np.zeros((0, 4, 4))
    near = within(reference.points, T_guess[:3, 3], farthest(points) + window.shift_m + cell)
    if not near.any():
        return T_guess[None], np.zeros((0, 4, 4))
    grid = _grid_of(reference.selected(near), cell, steps)
    offset = T_guess[:3, 3] - grid.corner
    with ThreadPoolExecutor(_THREADS) as pool:
        parts = pool.map(
            lambda part: _correlate(grid.cells, points, level, offset, 1.0 / cell, part, *steps), np.array_split(yaws, _THREADS)
        )
        scores = np.concatenate(list(parts))
    return _peaks(scores, yaws, T_guess, steps)


def _yaws(half_width: float, step: float) -> Array:
    if half_width >= math.pi - 0.5 * step:
        return np.linspace(-math.pi, math.pi, round(2.0 * math.pi / step), endpoint=False)
    side = max(1, math.ceil(half_width / step))
    return np.linspace(-half_width, half_width, 2 * side + 1)


def _balanced(reading: PointCloud, R_map_body: Array, config: RegistrationConfig) -> tuple[Array, NDArray[np.uint8]]:
    """Points of the reading in the map's directions, one a cell and as many of both kinds, and whether each is level (0) or steep (1)."""
    assert reading.normals is not None
    points = reading.points @ R_map_body.T
    level = (np.abs(reading.normals @ R_map_body[2]) < _LEVEL_COS).astype(np.uint8)
    inside = within(points, np.zeros(3), config.search_range_m)
    kept = []
    for kind in (0, 1):
        which = np.flatnonzero(inside & (level == kind))
        first = which[first_in_voxels(points[which], SEARCH_CELL_M)]
        kept.append(first[:: max(1, math.ceil(2 * len(first) / _SEARCH_POINTS))])
    chosen = np.concatenate(kept)
    return np.ascontiguousarray(points[chosen]), level[chosen]


def _grid_of(reference: PointCloud, cell_m: float, steps: NDArray[np.int64]) -> _Grid:
    """Cells of the reference with room for every shift around them."""
    assert reference.normals is not None
    margin = 2 * np.array([steps[0], steps[0], steps[1]]) + 1
    low = np.floor(reference.points.min(axis=0) / cell_m).astype(np.int64) - margin
    size = np.floor(reference.points.max(axis=0) / cell_m).astype(np.int64) + margin + 1 - low
    cells = np.zeros((2, size[1], size[2], size[0]), dtype=np.uint8)
    _fill(cells, reference.points, reference.normals, low, 1.0 / cell_m)
    return _Grid(cells, low * cell_m, cell_m)


@njit(cache=True)
def _fill(cells: NDArray[np.uint8], points: Array, normals: Array, low: NDArray[np.int64], per_metre: float) -> None:
    """Mark the cells that hold surface, and those that share a side with one; points without a normal are no surface."""
    for i in range(len(points)):
        nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
        if nx * nx + ny * ny + nz * nz < 0.25:
            continue
        plane = cells[1 if abs(nz) < _LEVEL_COS else 0]
        x = math.floor(points[i, 0] * per_metre) - low[0]
        y = math.floor(points[i, 1] * per_metre) - low[1]
        z = math.floor(points[i, 2] * per_metre) - low[2]
        if plane[y, z, x] == _ON_SURFACE:
            continue
        plane[y, z, x] = _ON_SURFACE
        for dx, dy, dz in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)):
            plane[y + dy, z + dz, x + dx] = max(plane[y + dy, z + dz, x + dx], _BESIDE)


@njit(cache=True, nogil=True)
def _correlate(
    cells: NDArray[np.uint8], points: Array, kind: NDArray[np.uint8], offset: Array, per_metre: float, yaws: Array, side: int, rise: int
) -> NDArray[np.uint16]:
    """(Y, 2 side + 1 (y), 2 rise + 1 (z), 2 side + 1 (x)) sums of the cells that the points fall on, for every yaw and shift."""
    wide, high = 2 * side + 1, 2 * rise + 1
    sums = np.zeros((len(yaws), wide, high, wide), dtype=np.uint16)
    _, ny, nz, nx = cells.shape
    for k in range(len(yaws)):
        c, s = math.cos(yaws[k]), math.sin(yaws[k])
        for i in range(len(points)):
            x = math.floor((c * points[i, 0] - s * points[i, 1] + offset[0]) * per_metre) - side
            y = math.floor((s * points[i, 0] + c * points[i, 1] + offset[1]) * per_metre) - side
            z = math.floor((points[i, 2] + offset[2]) * per_metre) - rise
            if x < 0 or y < 0 or z < 0 or x + wide > nx or y + wide > ny or z + high > nz:
                continue
            plane = cells[kind[i]]
            for dy in range(wide):
                for dz in range(high):
                    row, total = plane[y + dy, z + dz], sums[k, dy, dz]
                    for dx in range(wide):
                        total[dx] += row[x + dx]
    return sums


def _peaks(scores: NDArray[np.uint16], yaws: Array, T_guess: Array, steps: NDArray[np.int64]) -> tuple[Array, Array]:
    """The highest sums, best first, each well apart from those before in shift or in yaw, and at most so many of one heading.

    Then those that are left when twice as many are wanted, and of one heading.
    """
    flat = scores.ravel()
    as_high = np.cumsum(np.bincount(flat)[::-1])[::-1]  # how many sums are at least 0, 1, ..
    best = np.flatnonzero(flat >= np.flatnonzero(as_high >= min(_LOOKED_AT, flat.size))[-1])
    k, y, z, x = np.unravel_index(best[np.argsort(-flat[best].astype(np.int64), kind="stable")[:_LOOKED_AT]], scores.shape)
    shifts = np.stack([x - steps[0], y - steps[0], z - steps[1]], axis=1) * SEARCH_CELL_M
    apart, most = (SEARCH_APART_M, SEARCH_APART_RAD), (_SEARCH_PEAKS_A_HEADING, SEARCH_PEAKS)
    first = _well_apart(shifts, yaws[k], *apart, *most)
    more = np.setdiff1d(_well_apart(shifts, yaws[k], *apart, 2 * most[0], 2 * most[1]), first)
    placed = [np.array([_moved(T_guess, shifts[i], float(yaws[k[i]])) for i in chosen]).reshape(-1, 4, 4) for chosen in (first, more)]
    return placed[0], placed[1]


@njit(cache=True)
def _well_apart(shifts: Array, angles: Array, apart_m: float, apart_rad: float, most_a_heading: int, most: int) -> NDArray[np.int64]:
    """Indices of the first placements that are none of those before, at most so many of one heading, and in all."""
    chosen = np.empty(most, dtype=np.int64)
    count = 0
    for i in range(len(angles)):
        alike, same = 0, False
        for k in chosen[:count]:
            if abs((angles[k] - angles[i] + math.pi) % (2.0 * math.pi) - math.pi) <= apart_rad:
                alike += 1
                x, y, z = shifts[k, 0] - shifts[i, 0], shifts[k, 1] - shifts[i, 1], shifts[k, 2] - shifts[i, 2]
                same |= x * x + y * y + z * z <= apart_m * apart_m
        if not same and alike < most_a_heading:
            chosen[count] = i
            count += 1
        if count == most:
            break
    return chosen[:count]


def _moved(T_guess: Array, shift: Array, yaw: float) -> Array:
    """The guess turned about the map's vertical through its own origin, and shifted."""
    T = transform_from_rpy((0.0, 0.0, 0.0), (0.0, 0.0, yaw)) @ np.block([[T_guess[:3, :3], np.zeros((3, 1))], [np.zeros((1, 3)), 1.0]])
    T[:3, 3] = T_guess[:3, 3] + shift
    return np.asarray(T)


def compile_kernels() -> None:
    """Compiles the kernels of this module for the types that a match passes."""
    one = np.array([[0.0, 0.0, 1.0]])
    coarse_placements(PointCloud(one, None, one), PointCloud(one, None, one), np.eye(4), Window(0.3, 0.3, 0.1), RegistrationConfig())
