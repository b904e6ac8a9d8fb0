"""How large a map is, from the bytes of its file, before any of it is built: voxels, columns, and the memory that classifying it takes.

A small file may stand for a huge map, for octomap writes 2^45 equal voxels as two bits. So its bytes are walked, and nothing is made of
them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

_DEPTH = 16  # levels of an octomap tree
_REGION_DEPTH = 10  # nodes of 64^3 voxels, whose states the octree keeps beside its nodes
_REGION_BYTES = 1 << 16
# Measured on a building storey laid out side by side, 0.4 to 62 million leaves, and on a garage that is all ground; rounded up.
_NODE_BYTES, _COLUMN_BYTES, _RUN_BYTES, _SURFACE_BYTES, _FILE_COPIES = 60, 40, 12, 150, 5
INNER = 3  # octomap's code of a child that has children; 1 is a free, 2 an occupied leaf


@dataclass(frozen=True)
class Survey:
    """What the data of an octree hold; `columns` (X, Y) of their bounding box, `runs` and `surfaces` at most so many."""

    data_bytes: int
    nodes: int
    leaves: int
    regions: int
    columns: tuple[int, int]
    runs: int
    surfaces: int

    @property
    def memory_bytes(self) -> int:
        """What reading and classifying such a map takes at most, roughly."""
        columns = self.columns[0] * self.columns[1]
        tree = self.nodes * _NODE_BYTES + self.regions * _REGION_BYTES + self.data_bytes * _FILE_COPIES
        return tree + columns * _COLUMN_BYTES + self.runs * _RUN_BYTES + self.surfaces * _SURFACE_BYTES


@njit(cache=True)
def _children(data: Any, at: Any, full: Any) -> Any:
    """Two bits for each child of the node whose record begins at `at`; of a full record all children must be looked at: INNER."""
    if not full:
        return np.int64(data[at]) | np.int64(data[at + 1]) << 8
    codes = 0
    for i in range(8):
        if data[at + 4] >> i & 1:
            codes |= INNER << 2 * i
    return codes


@njit(cache=True)
def _add_leaf(counts: Any, box: Any, x: Any, y: Any, edge: Any, is_occupied: Any) -> None:
    """A cube covers edge^2 columns: as many runs, and if it is occupied surfaces, at most."""
    counts[1] += 1
    counts[3] += edge * edge
    if is_occupied:
        counts[4] += edge * edge
    box[0], box[1] = min(box[0], x), min(box[1], y)
    box[2], box[3] = max(box[2], x + edge), max(box[3], y + edge)


@njit(cache=True)
def _walk(data: Any, full: Any) -> Any:
    """(nodes, leaves, regions, runs, surfaces) and (x_lo, y_lo, x_end, y_end) of the leaves; ends where the data do."""
    counts, box = np.zeros(5, np.int64), np.array([1 << _DEPTH, 1 << _DEPTH, 0, 0])
    codes, child = np.zeros(_DEPTH + 1, np.int64), np.zeros(_DEPTH + 1, np.int64)
    x, y = np.zeros(_DEPTH + 1, np.int64), np.zeros(_DEPTH + 1, np.int64)
    length = 5 if full else 2
    if data.size < length:
        return counts, box
    codes[0], at, depth = _children(data, 0, full), length, 0
    counts[0] = 1
    while depth >= 0:
        i = child[depth]
        if i == 8:
            depth -= 1
            continue
        child[depth] += 1
        code = codes[depth] >> 2 * i & 3
        edge = 1 << max(_DEPTH - depth - 1, 0)
        cx, cy = x[depth] + (i & 1) * edge, y[depth] + (i >> 1 & 1) * edge
        if code == 0:
            continue
        counts[0] += 1
        if code == INNER:
            if at + length > data.size:
                break
            below = _children(data, at, full)
            at += length
            if below != 0 and depth + 1 < _DEPTH:
                depth += 1
                codes[depth], child[depth], x[depth], y[depth] = below, 0, cx, cy
                counts[2] += depth == _REGION_DEPTH
                continue
            code = 1 if full and data[at - 2] >> 7 else 2  # the sign of its log-odds
        _add_leaf(counts, box, cx, cy, edge, code == 2)
    return counts, box


def survey(data: bytes | memoryview, full: bool = False) -> Survey:
    """What stands in a .bt file after its header, or with `full` in an .ot file; of damaged data the part before the damage."""
    values: NDArray[np.uint8] = np.frombuffer(data, dtype=np.uint8)
    counts, box = _walk(values, full)
    nodes, leaves, regions, runs, surfaces = (int(v) for v in counts)
    x, y = (max(0, int(box[k + 2] - box[k])) for k in (0, 1))
    return Survey(values.size, nodes, leaves, regions, (x, y), runs, surfaces)


def compile_kernels() -> None:
    """Compiles the walk for the types that `survey` passes."""
    survey(bytes(2))
