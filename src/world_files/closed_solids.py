"""Which triangles of a mesh bound something that has an inside."""

import numpy as np
import trimesh
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int32]

OPEN = -1
_SAME_DIGITS = 6  # decimals of a metre: vertices nearer than a micrometre are one


def closed_solids(vertices: Array, triangles: Indices) -> Indices:
    """(T,) the number of the connected part of a mesh that a triangle belongs to, OPEN where that part is not closed.

    A part is closed where every edge of it is that of two of its triangles, whichever way they face. Vertices at the same place are one.
    """
    _, same = trimesh.grouping.unique_rows(vertices, digits=_SAME_DIGITS)
    corners = same[triangles]
    whole = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    solid = np.full(len(triangles), OPEN, np.int32)
    if whole.any():
        solid[whole] = _closed_parts(corners[whole].astype(np.int64))
    return solid


def _closed_parts(corners: NDArray[np.int64]) -> Indices:
    """(T,) the number of the part of each triangle (three different vertices), OPEN where the part is not closed."""
    ends = np.sort(corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, edge = np.unique(ends[:, 0] * (int(ends.max()) + 1) + ends[:, 1], return_inverse=True)
    mesh = trimesh.Trimesh(np.zeros((int(corners.max()) + 1, 3)), corners, process=False)
    part = trimesh.graph.connected_component_labels(mesh.face_adjacency, node_count=len(corners))
    parts = int(part.max()) + 1
    _, of_edge, times = np.unique(edge * parts + np.repeat(part, 3), return_inverse=True, return_counts=True)
    is_open = np.zeros(parts, bool)
    is_open[np.repeat(part, 3)[times[of_edge] != 2]] = True
    return np.where(is_open[part], OPEN, part).astype(np.int32)
