"""Which vertices of a pose graph no measurement holds in some direction, so that their poses would be made up.

Vertices that edges of six directions join make one rigid part. What edges and priors of fewer directions know of these parts is summed up
as an information matrix; where it is singular, a part is free to move.
"""

from __future__ import annotations

import gtsam
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csc_array, eye_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from pose_graph_mapping.graph.graph_problem import GraphProblem
from rigid_geometry import inverse

Array = NDArray[np.float64]

_NUDGE = 1e-10
"""Added to every direction, over what is known of it: a free one then answers to a push with the inverse of it."""
_FREE = 1e8
"""The answer to a push of size one above which a direction is free; that of a known one is the inverse of its information."""


def free_parts(problem: GraphProblem) -> list[list[int]]:
    """Vertices of every part that is free to move, in the order of their first."""
    part = _rigid_parts(problem)
    loose = sorted(set(part[:-1].tolist()) - {int(part[-1])})
    if not loose:
        return []
    known = _Sum(problem, part, loose)
    for edge in problem.edges:
        if edge.information is not None:
            known.add(edge.information, edge.j, edge.i)
    for prior in problem.priors:
        known.add(prior.information, prior.vertex_id)
    free = {loose[k] for k in _free_blocks(known.matrix())}
    members: dict[int, list[int]] = {}
    for vertex, number in enumerate(part[:-1].tolist()):
        if number in free:
            members.setdefault(number, []).append(vertex)
    return sorted(members.values())


def _rigid_parts(problem: GraphProblem) -> NDArray[np.int64]:
    """(V + 1,) number of the part of every vertex, and of the ground, to which fixed vertices and full priors belong."""
    vertices = len(problem.poses)
    joined = [(e.i, e.j) for e in problem.edges if e.information is None]
    joined += [(k, vertices) for k in problem.fixed]
    joined += [(p.vertex_id, vertices) for p in problem.priors if _rank(p.information) == 6]
    i, j = (np.array(joined, dtype=np.int64).reshape(-1, 2)).T
    _, label = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(vertices + 1, vertices + 1)), directed=False)
    return np.asarray(label, dtype=np.int64)


def _rank(matrix: Array) -> int:
    return int(np.linalg.matrix_rank(matrix, hermitian=True, tol=1e-12 * float(np.abs(matrix).max())))


class _Sum:
    """Information about small motions of the loose parts, each in the frame of its first vertex, as it comes in."""

    def __init__(self, problem: GraphProblem, part: NDArray[np.int64], loose: list[int]) -> None:
        self.poses, self.part = problem.poses, part
        self.place = {number: k for k, number in enumerate(loose)}
        self.root = {number: int(np.flatnonzero(part == number)[0]) for number in loose}
        self.blocks: list[tuple[int, int, Array]] = []

    def add(self, information: Array, vertex: int, to: int | None = None) -> None:
        """What is known of a vertex, in its frame, against `to` or the ground."""
        if to is not None and self.part[vertex] == self.part[to]:
            return
        jacobians = [
            (self.place[number], sign * J)
            for k, sign in ((vertex, 1.0), (to, -1.0))
            if k is not None
            for number, J in self._lever(k, vertex)
        ]
        for a, J_a in jacobians:
            for b, J_b in jacobians:
                self.blocks.append((a, b, J_a.T @ information @ J_b))

    def matrix(self) -> csc_array:
        """(6 L, 6 L)."""
        size, grid = 6 * len(self.place), np.indices((6, 6)).reshape(2, -1)
        at = np.array([(a, b) for a, b, _ in self.blocks], dtype=np.int64).reshape(-1, 2, 1)
        row, column = (6 * at[:, k] + grid[k] for k in (0, 1))
        entries = np.array([block for *_, block in self.blocks]).reshape(-1, 36)
        return coo_array((entries.ravel(), (row.ravel(), column.ravel())), shape=(size, size)).tocsc()

    def _lever(self, k: int, frame: int) -> list[tuple[int, Array]]:
        """The part of vertex k, where it is loose, and (6, 6) from its motions to what they do to k, in the frame of another vertex."""
        number = int(self.part[k])
        if number not in self.place:
            return []
        T = inverse(self.poses[frame]) @ self.poses[self.root[number]]
        return [(number, np.asarray(gtsam.Pose3(T).AdjointMap()))]


def _free_blocks(information: csc_array) -> set[int]:
    """The blocks of six that answer a push without limit."""
    diagonal = information.diagonal()
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = csc_array(information.multiply(scale[:, None]).multiply(scale[None, :])) + _NUDGE * eye_array(len(scale), format="csc")
    push = np.random.default_rng(0).normal(size=len(scale))
    answer = np.abs(splu(csc_array(scaled)).solve(push)).reshape(-1, 6).max(axis=1)
    return set(np.flatnonzero(answer > _FREE).tolist())
