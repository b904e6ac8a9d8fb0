"""Voxels that lie together: the frontiers of one place (thesis 5.5)."""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

_REACH, _RISE = 2, 3  # voxels are linked when at most so far apart in x and y, and in z


@njit(cache=True)
def _cluster_labels(ix: Any, iy: Any, z: Any, order: Any) -> Any:
    """(F,) cluster of each voxel; `order` sorts by ix."""
    cluster = np.full(ix.size, -1, np.int64)
    stack = np.empty(ix.size, np.int64)
    rank = np.empty(ix.size, np.int64)
    for i in range(order.size):
        rank[order[i]] = i
    count = 0
    for seed in order:
        if cluster[seed] >= 0:
            continue
        cluster[seed], stack[0], top = count, seed, 1
        while top > 0:
            top -= 1
            a = stack[top]
            for way in (-1, 1):
                i = rank[a] + way
                while 0 <= i < order.size and abs(ix[order[i]] - ix[a]) <= _REACH:
                    b = order[i]
                    if cluster[b] < 0 and abs(iy[b] - iy[a]) <= _REACH and abs(z[b] - z[a]) <= _RISE:
                        cluster[b], stack[top] = count, b
                        top += 1
                    i += way
        count += 1
    return cluster


def cluster_voxels(voxels: NDArray[np.integer]) -> NDArray[np.int64]:
    """(F,) cluster number of (F, 3) voxel indices."""
    voxels = np.asarray(voxels, dtype=np.int64).reshape(-1, 3)
    order = np.lexsort((voxels[:, 2], voxels[:, 1], voxels[:, 0]))
    return np.asarray(_cluster_labels(voxels[:, 0].copy(), voxels[:, 1].copy(), voxels[:, 2].copy(), order))
