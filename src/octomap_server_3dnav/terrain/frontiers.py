"""Frontier voxels: unknown floor beside ground (thesis 5.5, algorithm 3 line 21, figure 5.13).

Eighth step of `classify`. Everything is in voxels.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.columns import DX, DY, Columns
from octomap_server_3dnav.octree.lean_kernels import Index, lean_njit
from octomap_server_3dnav.terrain.beside import EDGE, UNKNOWN
from octomap_server_3dnav.terrain.classified_terrain import INFLATION, TRAVERSABLE, UNREACHED
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.surfaces import Surfaces, find_node


@lean_njit
def _is_reached(surfaces: Surfaces, label: NDArray[np.uint8], c: Index, level: Index, rise: Index) -> bool:
    """Whether the flood has reached ground at about this level some other way, in column c."""
    node = find_node(surfaces.start, surfaces.z, c, level, rise)
    return bool(node >= 0 and label[node] != UNREACHED)


@njit(cache=True)
def unknown_edges(
    columns: Columns, surfaces: Surfaces, label: NDArray[np.uint8], inside: NDArray[np.bool_], seen: NDArray[np.uint8], limits: Limits
) -> NDArray[np.int64]:
    """(M, 5) int64 (column, z, node it was seen from, direction, what was seen) of unknown floor beside drivable ground in columns that
    are `inside` (bool per column).

    The two-step test of thesis figure 5.13: no ground in a direction, and nothing that the flood has reached around one step further.
    Ground that it did not reach is what the look is for: a deck seen from below only, a slope behind a gap. No gap is passed over that is
    wider than those that are filled.
    """
    rise = limits.step + 1
    found: list[tuple[Index, Index, Index, Index, Index]] = [(0, 0, 0, 0, 0) for _ in range(0)]
    for s in range(surfaces.z.size):
        if (label[s] != TRAVERSABLE and label[s] != INFLATION) or not inside[surfaces.column[s]]:
            continue
        for k in range(4):
            if seen[s, k] != UNKNOWN and seen[s, k] != EDGE:
                continue
            c, level, stride = np.int64(surfaces.column[s]), np.int64(surfaces.z[s]), DX[k] * columns.ny + DY[k]
            ends = limits.fill >= 1 and _is_reached(surfaces, label, c + 2 * stride, level, rise)
            for side in range(4):
                beside = c + 2 * stride + DX[side] * columns.ny + DY[side]
                ends |= limits.fill >= (2 if side == k else 1) and _is_reached(surfaces, label, beside, level, rise)
            if not ends:
                found.append((c + stride, level, np.int64(s), np.int64(k), np.int64(seen[s, k])))
    out = np.empty((len(found), 5), np.int64)
    for i in range(len(found)):
        out[i, 0], out[i, 1], out[i, 2], out[i, 3], out[i, 4] = found[i]
    return out
