"""Are the edges of the final pose graph true? Every match and loop that it holds beside the true motion between the two sweeps.

A good trajectory does not tell: a robust optimiser bends around a wrong edge until there are two of them.
"""

import math
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]

WRONG_M, WRONG_RAD = 0.20, math.radians(3.0)
_CHI_SQUARED = 27.9  # six degrees of freedom, 99.99 %: beyond it the edge's own covariance does not explain the error
_UPPER = np.triu_indices(6)


@dataclass(frozen=True, eq=False)
class GraphEdges:
    """Edges of a g2o file: (E, 2) vertices, (E, 4, 4) T_i_j, (E, 6, 6) information (translation, rotation), and their kinds."""

    vertices: NDArray[np.int64]
    T_i_j: Floats
    information: Floats
    kinds: tuple[str, ...]


def read_edges(path: Path) -> GraphEdges:
    """The EDGE_SE3:QUAT lines with the kinds that comments name, "unknown" without. ValueError for a file that is absent or malformed."""
    if not path.is_file():
        raise ValueError(f"{path.name} is not there")
    lines = [line.split() for line in path.read_text(encoding="utf-8").splitlines()]
    rows = [line[1:] for line in lines if line[:1] == ["EDGE_SE3:QUAT"]]
    named = Counter((line[2], line[3], line[4]) for line in lines if line[:2] == ["#", "KIND"] and len(line) == 5)
    try:
        numbers = np.array([[float(word) for word in row] for row in rows]).reshape(len(rows), 30)
    except ValueError as error:
        raise ValueError(f"{path.name}: an edge is two vertices and 28 numbers: {error}") from error
    kinds = []
    for i, j, *_ in rows:
        kind = next((k for a, b, k in named if (a, b) == (i, j) and named[a, b, k] > 0), "unknown")
        named[i, j, kind] -= 1
        kinds.append(kind)
    T = np.tile(np.eye(4), (len(rows), 1, 1))
    T[:, :3, 3], T[:, :3, :3] = numbers[:, 2:5], Rotation.from_quat(numbers[:, 5:9]).as_matrix() if rows else 0.0
    information = np.zeros((len(rows), 6, 6))
    information[:, _UPPER[0], _UPPER[1]] = information[:, _UPPER[1], _UPPER[0]] = numbers[:, 9:]
    return GraphEdges(numbers[:, :2].astype(np.int64), T, information, tuple(kinds))


def wrong_edges(edges: GraphEdges, T_truth: ArrayLike) -> list[tuple[int, int, str]]:
    """(i, j, kind) of the matches and loops further from the truth than a wrong match is, and than their covariance allows.

    T_truth (V, 4, 4) true poses of all vertices, NaN where there is none: such edges are not judged. An edge that leaves a direction open
    is not wrong for what it says there. Nor are edges judged of vertices beyond these, which were mapped after the run's end.
    """
    truth = np.asarray(T_truth, dtype=np.float64)
    judged = [
        k
        for k, kind in enumerate(edges.kinds)
        if kind != "odometry" and edges.vertices[k].max() < len(truth) and np.isfinite(truth[edges.vertices[k]]).all()
    ]
    return [(int(edges.vertices[k, 0]), int(edges.vertices[k, 1]), edges.kinds[k]) for k in judged if _is_wrong(edges, k, truth)]


def _is_wrong(edges: GraphEdges, k: int, truth: Floats) -> bool:
    i, j = edges.vertices[k]
    error = np.linalg.inv(np.linalg.inv(truth[i]) @ truth[j]) @ edges.T_i_j[k]
    turned = Rotation.from_matrix(error[:3, :3]).as_rotvec()
    offset = np.concatenate([error[:3, 3], turned])
    is_far = np.linalg.norm(error[:3, 3]) > WRONG_M or np.linalg.norm(turned) > WRONG_RAD
    return bool(is_far and offset @ edges.information[k] @ offset > _CHI_SQUARED)
