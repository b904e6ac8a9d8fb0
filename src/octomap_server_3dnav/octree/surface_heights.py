"""Where in its voxel a surface lies, and how far it extends: mean place and spread of the beams that ended there.

Beside the octree, whose voxels tell a floor's height to 8 cm only: a kerb of 5 cm and one of 15 cm may look alike in them. And where the
laser's lines lie far apart a slope is hit beside the middle of its columns, up to 2 cm higher or lower. The sums are whole numbers, so that
what a sweep has added can be taken out again, bit by bit, when the sweep moves.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.column_runs import KEY_OFFSET
from octomap_server_3dnav.octree.lean_kernels import lean_njit

_FINE = 1024  # parts of a voxel in which places are summed
_ONE_SLOPE = 0.6  # voxels between what was hit in a voxel and in that below on a slope; more is an edge, and the face below it
_STRAY = 0.25  # of the hits below: fewer above are the tail of their noise
_NO_TAIL = 1.25  # voxels; what was hit so much higher is something else, however rarely it was hit
_SLAB_BITS = 32 + 5  # of a key: a slab is 32 voxels wide


@dataclass(frozen=True, eq=False)
class HitHeights:
    """Hits by voxel, int64: ascending `key` (K,) of x, y, z; `total` (K, 3) of their places in the voxel; `count` (K,); `squares` (K, 3)
    of x * x, y * y and x * y of these places."""

    key: NDArray[np.int64]
    total: NDArray[np.int64]
    count: NDArray[np.int64]
    squares: NDArray[np.int64]

    @property
    def arrays(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
        """Key, total, count and squares, as the kernels take them."""
        return self.key, self.total, self.count, self.squares

    @classmethod
    def of(cls, points_map: NDArray[np.floating], resolution: float) -> "HitHeights":
        """Of the finite points (N, 3) in metres within octomap's range."""
        scaled = np.asarray(points_map, dtype=np.float64) * (1.0 / resolution)
        scaled = scaled[(np.abs(scaled) < KEY_OFFSET - 1).all(axis=1)]
        floor = np.floor(scaled)
        keys = _keys(*floor.astype(np.int64).T.copy())
        places = ((scaled - floor) * _FINE).astype(np.int64)
        squares = places[:, [0, 1, 0]] * places[:, [0, 1, 1]]
        return cls.together([cls(keys, places, np.ones_like(keys), squares)])

    @classmethod
    def together(cls, parts: Sequence["HitHeights"]) -> "HitHeights":
        """The hits of one or more sweeps."""
        keys, *sums = (np.concatenate([getattr(part, name) for part in parts]) for name in ("key", "total", "count", "squares"))
        order = np.argsort(keys)
        keys = keys[order]
        first = np.flatnonzero(np.r_[True, keys[1:] != keys[:-1]]) if keys.size else np.zeros(0, dtype=np.int64)
        return cls(keys[first], *(np.add.reduceat(part[order], first, axis=0) if keys.size else part for part in sums))


@njit(cache=True)
def _keys(x: Any, y: Any, z: Any) -> Any:
    """(N,) int64 keys of voxels of index x, y, z."""
    out = np.empty(x.size, np.int64)
    for i in range(x.size):
        out[i] = (np.int64(x[i]) + KEY_OFFSET) << 32 | (np.int64(y[i]) + KEY_OFFSET) << 16 | (np.int64(z[i]) + KEY_OFFSET)
    return out


_NO_HITS = HitHeights(*(np.zeros(shape, dtype=np.int64) for shape in (0, (0, 3), 0, (0, 3))))


@njit(cache=True)
def _merged(old: Any, more: Any, sign: Any) -> Any:
    """Two tables (key, total, count, squares) as one, the second counted `sign` times; voxels without a hit left are left out."""
    (key, total, count, squares), (more_key, more_total, more_count, more_squares) = old, more
    size = key.size + more_key.size
    out_key, out_count = np.empty(size, np.int64), np.empty(size, np.int64)
    out_total, out_squares = np.empty((size, 3), np.int64), np.empty((size, 3), np.int64)
    n, a, b = 0, 0, 0
    while a < key.size or b < more_key.size:
        has_old = b == more_key.size or (a < key.size and key[a] <= more_key[b])
        has_more = a == key.size or (b < more_key.size and more_key[b] <= key[a])
        out_key[n] = key[a] if has_old else more_key[b]
        out_count[n] = (count[a] if has_old else 0) + (sign * more_count[b] if has_more else 0)
        for i in range(3):
            out_total[n, i] = (total[a, i] if has_old else 0) + (sign * more_total[b, i] if has_more else 0)
            out_squares[n, i] = (squares[a, i] if has_old else 0) + (sign * more_squares[b, i] if has_more else 0)
        a, b = a + has_old, b + has_more
        n += out_count[n] != 0
    return out_key[:n].copy(), out_total[:n].copy(), out_count[:n].copy(), out_squares[:n].copy()


@lean_njit
def _place_from(key: Any, wanted: Any, place: Any) -> Any:
    """First index from `place` on whose key is not below `wanted`: steps that double, then halves; near places are found soonest."""
    step = 1
    while place + step < key.size and key[place + step] < wanted:
        step *= 2
    low, high = place + step // 2, min(place + step, key.size)
    while low < high:
        middle = (low + high) // 2
        if key[middle] < wanted:
            low = middle + 1
        else:
            high = middle
    return low


@njit(cache=True)
def _indices(key: Any, wanted: Any) -> Any:
    """(N,) first index whose key is not below each of the `wanted` ones; ascending ones are found fastest."""
    out, place = np.empty(wanted.size, np.int64), 0
    for i in range(wanted.size):
        if i and wanted[i] < wanted[i - 1]:
            place = 0
        if place < key.size and key[place] < wanted[i]:
            place = _place_from(key, wanted[i], place)
        out[i] = place
    return out


@njit(cache=True)
def _heights(key: Any, total: Any, count: Any, wanted: Any, z: Any, out: Any) -> None:
    """Writes of the voxels with the `wanted` keys and levels z into `out` (N, 4): mean height of the hits in the voxel and, if these are of
    one slope, in the one below; their mean place along x and y; and their number."""
    for i, place in enumerate(_indices(key, wanted)):
        if place == key.size or key[place] != wanted[i]:
            continue
        hits, x, y, height = count[place], total[place, 0], total[place, 1], total[place, 2]
        if place > 0 and key[place - 1] == key[place] - 1:
            more, deep = count[place - 1], total[place - 1, 2] - _FINE * count[place - 1]
            rise = height / hits - deep / more
            is_edge = rise > _ONE_SLOPE * _FINE and (hits > _STRAY * more or rise > _NO_TAIL * _FINE)
            if not is_edge:
                hits, height = hits + more, height + deep
                x, y = x + total[place - 1, 0], y + total[place - 1, 1]
        out[i, 0] = z[i] + height / (_FINE * hits)
        out[i, 1], out[i, 2], out[i, 3] = x / (_FINE * hits) - 0.5, y / (_FINE * hits) - 0.5, hits


@njit(cache=True)
def _spreads(hits: Any, low: Any, high: Any, out: Any) -> None:
    """Writes of the hits in the voxels with keys from `low` to `high` (N,) into `out` (N, 6): how many, mean x and y from the middle of the
    column, and their variances along x and y and covariance."""
    key, total, count, squares = hits
    for i, place in enumerate(_indices(key, low)):
        n, x, y, xx, yy, xy, j = 0, 0, 0, 0, 0, 0, place
        while j < key.size and key[j] <= high[i]:
            n, x, y = n + count[j], x + total[j, 0], y + total[j, 1]
            xx, yy, xy = xx + squares[j, 0], yy + squares[j, 1], xy + squares[j, 2]
            j += 1
        if n:
            mean_x, mean_y, unit = x / (_FINE * n), y / (_FINE * n), 1.0 / (_FINE**2 * n)
            out[i, 0], out[i, 1], out[i, 2] = n, mean_x - 0.5, mean_y - 0.5
            out[i, 3], out[i, 4], out[i, 5] = xx * unit - mean_x**2, yy * unit - mean_y**2, xy * unit - mean_x * mean_y


class SurfaceHeights:
    """The hits of all sweeps of a map, by voxel.

    Kept in slabs along x, so that what a sweep adds costs as much in a large map as in a small one.
    """

    def __init__(self, resolution: float) -> None:
        self._resolution = resolution
        self.reset()

    def __len__(self) -> int:
        return sum(slab.key.size for slab in self._slabs.values())

    @property
    def memory_bytes(self) -> int:
        """What the hits take."""
        return sum(array.nbytes for slab in self._slabs.values() for array in slab.arrays)

    def reset(self) -> None:
        """Forget everything."""
        self._slabs: dict[int, HitHeights] = {}

    def add(self, hits: HitHeights) -> None:
        """Count the hits of a sweep."""
        self._merge(hits, 1)

    def remove(self, hits: HitHeights) -> None:
        """Take out what was added before."""
        self._merge(hits, -1)

    def _merge(self, hits: HitHeights, sign: int) -> None:
        for number, part in _stretches(hits.key >> _SLAB_BITS):
            old = self._slabs.get(number, _NO_HITS)
            merged = HitHeights(*_merged(old.arrays, tuple(array[part] for array in hits.arrays), sign))
            self._slabs[number] = merged
            if not merged.key.size:
                del self._slabs[number]

    def at(self, x: NDArray[np.integer], y: NDArray[np.integer], z: NDArray[np.integer]) -> NDArray[np.float32]:
        """(N, 4) of the surfaces in voxels (N,) of index x, y, z, in voxels, NaN where no beam ended.

        Mean height of the hits in the voxel and, where both are of one slope, in the one below; their mean place along x and y from the
        middle of the column; and their number.
        """
        wanted = _keys(x, y, z)
        out = np.full((wanted.size, 4), np.nan, dtype=np.float32)
        for slab, part in self._slabs_of(wanted):
            _heights(slab.key, slab.total, slab.count, wanted[part], z[part], out[part])
        return out

    def spread(
        self, x: NDArray[np.integer], y: NDArray[np.integer], low: NDArray[np.integer], high: NDArray[np.integer]
    ) -> NDArray[np.float64]:
        """(N, 6) of the beams that ended in columns (N,) from voxel `low` to `high`, in voxels, zeros where none did: how many, their mean
        place along x and y from the middle of the column, their variances along x and y, and their covariance."""
        first, last = (_keys(x, y, z) for z in (low, high))
        out = np.zeros((first.size, 6))
        for slab, part in self._slabs_of(first):
            _spreads(slab.arrays, first[part], last[part], out[part])
        return out

    def _slabs_of(self, wanted: NDArray[np.int64]) -> Iterator[tuple[HitHeights, slice]]:
        for number, part in _stretches(wanted >> _SLAB_BITS):
            if number in self._slabs:
                yield self._slabs[number], part


def _stretches(numbers: NDArray[np.int64]) -> Iterator[tuple[int, slice]]:
    """Every stretch of equal numbers, and where it lies."""
    ends = np.flatnonzero(numbers[1:] != numbers[:-1]) + 1
    for begin, end in pairwise([0, *ends.tolist(), numbers.size] if numbers.size else []):
        yield int(numbers[begin]), slice(begin, end)
