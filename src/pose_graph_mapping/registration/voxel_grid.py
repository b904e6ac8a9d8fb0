"""Which voxel of a grid a point lies in: numbers without gaps, in the order of the points, so that the same input gives the same bits."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]


@njit(cache=True)
def voxel_index(points: Array, inverse_voxel: float, voxel_of: NDArray[np.int32]) -> int:
    """Number the occupied voxels in the order in which they first appear (open addressing, linear probing); how many there are."""
    size = 1024
    while size < 2 * len(points):
        size *= 2
    keys = np.full(size, -1, dtype=np.int64)
    slots = np.empty(size, dtype=np.int32)
    mask = np.uint64(size - 1)
    count = 0
    for i in range(len(points)):
        key = np.int64(0)
        for axis in range(3):
            key = (key << 21) | (np.int64(np.floor(points[i, axis] * inverse_voxel)) + 1048576)
        at = (np.uint64(key) * np.uint64(0x9E3779B97F4A7C15) >> np.uint64(32)) & mask
        while keys[at] != -1 and keys[at] != key:
            at = (at + np.uint64(1)) & mask
        if keys[at] == -1:
            keys[at] = key
            slots[at] = count
            count += 1
        voxel_of[i] = slots[at]
    return count


@njit(cache=True)
def voxel_mean(values: Array, voxel_of: NDArray[np.int32], count: int) -> Array:
    """(count, 3) means of values (N, 3) by voxel."""
    sums = np.zeros((count, 3))
    members = np.zeros(count)
    for i in range(len(values)):
        voxel = voxel_of[i]
        members[voxel] += 1.0
        for axis in range(3):
            sums[voxel, axis] += values[i, axis]
    for voxel in range(count):
        for axis in range(3):
            sums[voxel, axis] /= members[voxel]
    return sums


def first_in_voxels(points: Array, voxel_m: float) -> NDArray[np.intp]:
    """Indices of those of points (N, 3) that are the first in their voxel."""
    voxel_of = np.empty(len(points), dtype=np.int32)
    voxel_index(points, 1.0 / voxel_m, voxel_of)
    return np.flatnonzero(np.diff(np.maximum.accumulate(voxel_of), prepend=-1))
