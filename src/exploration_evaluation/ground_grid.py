"""Columns over a mesh and the surfaces in them: how surfaces are numbered, found by height, linked, and found near others.

The judge's own bookkeeping, beneath `ground_surfaces` and all that stands on it. Columns keep floors over floors apart.
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

STEPS = np.array([[1, 0], [-1, 0], [0, 1], [0, -1]])
"""+x, -x, +y, -y: opposite directions are neighbours."""
SAME_HEIGHT_M = 1e-4
_MAX_COLUMNS = 16_000_000
# Rays through cell centres would run along the edges of meshes with round coordinates, where a hit is a matter of luck.
_OFF_CENTRE = (0.0037, 0.0023)


@dataclass(frozen=True)
class Grid:
    """Columns over the mesh: column c has indices (c // ny, c % ny); cells are aligned to multiples of their size."""

    origin: Floats
    nx: int
    ny: int
    cell: float

    def centres(self) -> Floats:
        """(nx * ny, 2) where the columns' rays go down."""
        c = np.arange(self.nx * self.ny)
        return self.origin + (np.column_stack([c // self.ny, c % self.ny]) + 0.5) * self.cell + np.array(_OFF_CENTRE) * self.cell

    def columns_of(self, xy: Floats) -> Ints:
        """(N,) column of each (N, 2) point, -1 outside."""
        i, j = np.floor((xy - self.origin) / self.cell).astype(np.int64).T
        inside = (i >= 0) & (i < self.nx) & (j >= 0) & (j < self.ny)
        return np.where(inside, i * self.ny + j, -1)


@dataclass(frozen=True)
class Surfaces:
    """Surfaces with headroom, ordered by column and height; `first[c]:first[c + 1]` are those of column c.

    slope is that of the triangle, steepness what the robot feels of it: over its wheelbase, between faces that are none too steep, or in
    itself and beside itself. A pebble's flank, lower than a step, is steep in itself only; a rock's, from which
    no ground goes on, is steep.
    """

    xyz: Floats
    column: Ints
    first: Ints
    slope: Floats
    steepness: Floats

    @property
    def arrays(self) -> tuple[Ints, Floats, Floats, Floats]:
        """Column, height, slope and steepness, as `surfaces_of` takes them."""
        return self.column, self.xyz[:, 2], self.slope, self.steepness

    def some(self, kept: Mask) -> "Surfaces":
        """Those of them that are kept, numbered anew."""
        column = self.column[kept]
        return Surfaces(self.xyz[kept], column, first_of(column, len(self.first) - 1), self.slope[kept], self.steepness[kept])

    def some_of(self, index: Ints) -> "Surfaces":
        """The surfaces of these numbers; in ascending order, as `some` has them."""
        kept = np.zeros(len(self.column), dtype=np.bool_)
        kept[index] = True
        return self.some(kept)


def surfaces_of(grid: Grid, column: Ints, z: Floats, slope: Floats, steepness: Floats) -> Surfaces:
    """Surfaces at the places of their columns' rays."""
    xyz = np.column_stack([grid.centres()[column], z])
    return Surfaces(xyz, column, first_of(column, grid.nx * grid.ny), slope, steepness)


def grid_over(vertices: Floats, cell: float) -> Grid:
    """The grid over (V, 3) vertices; ValueError for a cell that has no size, and for more columns than are judged."""
    if not (math.isfinite(cell) and cell > 0):
        raise ValueError(f"a cell needs a positive size in metres, not {cell}")
    low = np.floor(vertices[:, :2].min(axis=0) / cell + 1e-6)
    nx, ny = np.maximum(1, np.ceil(vertices[:, :2].max(axis=0) / cell - 1e-6) - low).astype(int)
    if int(nx) * int(ny) > _MAX_COLUMNS:
        raise ValueError(f"the world has {nx} x {ny} columns of {cell} m; at most {_MAX_COLUMNS} are judged")
    return Grid(low * cell, int(nx), int(ny), cell)


def first_of(group: Ints, groups: int) -> Ints:
    """(G + 1,) where each of the groups begins in their ascending numbers."""
    return np.searchsorted(group, np.arange(groups + 1)).astype(np.int64)


def neighbour_columns(grid: Grid, column: Ints, direction: int) -> Ints:
    """(N,) the column beside each, -1 outside."""
    return columns_at(grid, column, STEPS[direction])


def columns_at(grid: Grid, column: Ints, step: Ints) -> Ints:
    """(N,) the column (di, dj) cells from each, -1 outside."""
    i, j = column // grid.ny + step[0], column % grid.ny + step[1]
    inside = (i >= 0) & (i < grid.nx) & (j >= 0) & (j < grid.ny)
    return np.where(inside, i * grid.ny + j, -1)


def links_between(grid: Grid, column: Ints, first: Ints, z: Floats, reach_m: float) -> Ints:
    """(M, 4) the surface nearest in height in each neighbouring column, -1 where that is farther than the reach."""
    beside = (neighbour_columns(grid, column, direction) for direction in range(4))
    return np.stack([nearest_in_height(first, z, neighbour, z, reach_m) for neighbour in beside], axis=1)


def nearest_in_height(first: Ints, z: Floats, group: Ints, level: Floats, reach_m: float) -> Ints:
    """(N,) index of the z of each of (N,) groups, -1 for none, that is nearest to a level, -1 where all are farther than the reach."""
    begin, end = first[group], np.where(group < 0, 0, first[group + 1])
    nearest, best = np.full(len(group), -1, dtype=np.int64), np.full(len(group), reach_m + SAME_HEIGHT_M)
    for layer in range(int(max(0, (end - begin).max(initial=0)))):
        there = np.flatnonzero(begin + layer < end)
        step = np.abs(z[begin[there] + layer] - level[there])
        nearer = step < best[there]
        best[there[nearer]] = step[nearer]
        nearest[there[nearer]] = begin[there[nearer]] + layer
    return nearest


def near(grid: Grid, nodes: Surfaces, seeds: Floats, radius_m: float, level_m: float) -> Mask:
    """(M,) nodes within a horizontal distance of any of the (S, 3) seeds that lies on about the same level."""
    return np.asarray(distances(grid, nodes, seeds, radius_m, level_m) <= radius_m)


def distances(grid: Grid, nodes: Surfaces, seeds: Floats, reach_m: float, level_m: float, head_start: Floats | None = None) -> Floats:
    """(M,) horizontal distance from each node to the nearest of the (S, 3) seeds on about its level, inf beyond the reach.

    A seed's distance is less by its head start, (S,) metres, up to a cell.
    """
    least = np.full(len(nodes.column), np.inf)
    shape = np.array([grid.nx, grid.ny], dtype=np.int64)
    ahead = np.zeros(len(seeds)) if head_start is None else np.clip(head_start, 0.0, grid.cell)
    _measure(nodes.xyz, nodes.first, np.ascontiguousarray(seeds), ahead, grid.origin, shape, np.array([grid.cell, reach_m, level_m]), least)
    return least


@njit(cache=True)
def _measure(xyz: Floats, first: Ints, seeds: Floats, ahead: Floats, origin: Floats, shape: Ints, limits: Floats, least: Floats) -> None:
    cell, reach_m, level = limits
    for s in range(seeds.shape[0]):
        radius = reach_m + ahead[s]
        reach = int(radius / cell) + 1
        i0 = int(math.floor((seeds[s, 0] - origin[0]) / cell))
        j0 = int(math.floor((seeds[s, 1] - origin[1]) / cell))
        for i in range(max(0, i0 - reach), min(shape[0], i0 + reach + 1)):
            for j in range(max(0, j0 - reach), min(shape[1], j0 + reach + 1)):
                for n in range(first[i * shape[1] + j], first[i * shape[1] + j + 1]):
                    dx, dy = xyz[n, 0] - seeds[s, 0], xyz[n, 1] - seeds[s, 1]
                    if dx * dx + dy * dy <= radius * radius and abs(xyz[n, 2] - seeds[s, 2]) <= level:
                        least[n] = min(least[n], math.sqrt(dx * dx + dy * dy) - ahead[s])


def components(links: Ints, usable: Mask) -> Ints:
    """(M,) number of the connected piece of each node, over links between usable ones."""
    a = np.repeat(np.arange(len(links)), 4)
    b = links.ravel()
    both = (b >= 0) & usable[a] & usable[b]
    graph = coo_array((np.ones(int(both.sum()), dtype=np.int8), (a[both], b[both])), shape=(len(links), len(links)))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)


def among(links: Ints, kept: Mask) -> Ints:
    """(K, 4) links between the K nodes that are kept, by their numbers among these."""
    number = np.where(kept, np.cumsum(kept) - 1, -1)
    return np.where(links[kept] >= 0, number[links[kept]], -1)
