"""Storeys of a terrain: bands of height in which hardly any ground lies above other ground, so that each can be seen from above."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.terrain.classify import TerrainClass

_ROOM_M = 1.0  # ground this far above other ground is another storey's
_HIDDEN_SHARE = 0.01  # of the columns, that may have ground twice within a storey


class Classified(Protocol):
    """A Terrain, or what a file keeps of one: columns, layers and classes of its voxels."""

    @property
    def ix(self) -> NDArray[np.int32]: ...
    @property
    def iy(self) -> NDArray[np.int32]: ...
    @property
    def z(self) -> NDArray[np.int16] | NDArray[np.int32]: ...
    @property
    def label(self) -> NDArray[np.uint8]: ...
    @property
    def resolution(self) -> float: ...


def storeys(terrain: Classified) -> list[tuple[int, int]]:
    """(first, last) voxel layers of every storey, from below, that together hold all layers of the terrain; one if there is no ground.

    A border lies where there is least ground in the metre below ground that hides what lies under it.
    """
    if not terrain.z.size:
        return [(0, 0)]
    is_ground = np.isin(terrain.label, (TerrainClass.TRAVERSABLE, TerrainClass.INFLATION))
    column = terrain.ix[is_ground].astype(np.int64) * (1 << 32) + terrain.iy[is_ground]
    borders = _borders(column, terrain.z[is_ground].astype(np.int64), max(1, round(_ROOM_M / terrain.resolution)))
    ends = [int(terrain.z.min()), *borders, int(terrain.z.max()) + 1]
    return [(first, end - 1) for first, end in zip(ends[:-1], ends[1:], strict=True)]


def _borders(column: NDArray[np.int64], z: NDArray[np.int64], room: int) -> list[int]:
    """First layers of the second storey and of those above it."""
    borders: list[int] = []
    most_hidden = _HIDDEN_SHARE * np.unique(column).size
    while True:
        hiding = _lowest_hiding(column, z, room)
        if hiding.size <= most_hidden:
            return borders
        highest = int(np.sort(hiding)[int(most_hidden)])
        layers = np.arange(highest - room + 1, highest + 1)
        ground = np.bincount(np.clip(z - layers[0], -1, room) + 1, minlength=room + 2)[1:-1]
        borders.append(int(layers[room - 1 - np.argmin(ground[::-1])]))
        above = z >= borders[-1]
        column, z = column[above], z[above]


def _lowest_hiding(column: NDArray[np.int64], z: NDArray[np.int64], room: int) -> NDArray[np.int64]:
    """Of every column with ground at least `room` layers above its lowest, the lowest layer of such ground."""
    order = np.lexsort((z, column))
    column, z = column[order], z[order]
    first = np.flatnonzero(np.r_[True, np.diff(column) != 0]) if column.size else np.zeros(0, dtype=np.int64)
    lowest = np.repeat(z[first], np.diff(np.r_[first, column.size]))
    hides = np.flatnonzero(z - lowest >= room)
    return z[hides[np.unique(column[hides], return_index=True)[1]]]
