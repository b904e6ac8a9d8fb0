"""What bounds and no-go zones close of a window of columns: ground in voxels, and its border.

Between the zones, which are in map, and the terrain, which works in voxels. Ground on which the robot may not be is an obstacle to it; the
border lies in the middle of the last open column, so that it is at most a voxel within the zone's own.
"""

import numpy as np
from numpy.typing import NDArray

from map_zones.zones import Zones

_BESIDE = (1, 0), (0, 1), (-1, 0), (0, -1)


class ClosedColumns:
    """The columns of a window `ny` wide from index `key` on, of voxels of `resolution` metres, as zones close them; column ix * ny + iy."""

    def __init__(self, zones: Zones, ny: int, key: tuple[int, int], resolution: float) -> None:
        self._zones, self._ny, self._key, self._resolution = zones, ny, key, resolution

    def at(self, column: NDArray[np.integer], z: NDArray[np.integer], step: tuple[int, int] = (0, 0)) -> NDArray[np.bool_]:
        """(N,) whether ground of voxel `z` (N,) in a column (N,), or `step` columns from it, is closed."""
        if not self._zones.are_set:
            return np.zeros(len(column), dtype=bool)
        x, y = np.divmod(column.astype(np.int64), self._ny)
        voxels = np.stack([x + self._key[0] + step[0], y + self._key[1] + step[1], z.astype(np.int64)], axis=1)
        return self._zones.closed((voxels + 0.5) * self._resolution, self._resolution)

    def left_of(self, places: NDArray[np.int64]) -> NDArray[np.int64]:
        """Of (M, ...) column, voxel and more those that are open."""
        return places[~self.at(places[:, 0], places[:, 1])]

    def with_borders(
        self, barriers: tuple[NDArray, ...], column: NDArray[np.integer], z: NDArray[np.integer], is_ground: NDArray[np.bool_]
    ) -> tuple[NDArray, ...]:
        """The fields of terrain's barriers with one more for each node of ground that is beside what is closed."""
        if not self._zones.are_set:
            return barriers
        ground = np.flatnonzero(is_ground)
        beside = np.any([self.at(column[ground], z[ground], step) for step in _BESIDE], axis=0)
        node = ground[beside]
        x, y = np.divmod(column[node].astype(np.int64), self._ny)
        none = np.full(node.size, -1, dtype=np.int64)
        border = node, x + 0.5, y + 0.5, z[node].astype(np.int64), none, none, np.zeros(node.size, dtype=bool)
        return tuple(np.concatenate(pair) for pair in zip(barriers, border, strict=True))
