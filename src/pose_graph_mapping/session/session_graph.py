"""The pose graph as a session's index has told it so far: changes are folded in, and what a graph has become since is found."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.graph.pose_graph import Edge, PoseGraph
from pose_graph_mapping.session.session_record import GraphChange
from rigid_geometry import inverse, rotation_angle

Array = NDArray[np.float64]

_MOVED_M, _MOVED_RAD = 0.01, 0.002
"""A vertex that moved less is not written again: its edges put it back."""


class StoredGraph:
    """Poses and edges on disk. Of a sweep only what it changed is written, so that a line stays short however long a session is.

    Edges that the graph left out are kept too: it judges them anew when it is solved.
    """

    def __init__(self) -> None:
        self._poses: dict[int, Array] = {}
        self._edges: list[Edge] = []
        self._held: set[tuple[int, int, str, bytes]] = set()

    def apply(self, change: GraphChange) -> None:
        """Fold in the next change."""
        self._poses.update(change.poses)
        self._edges += change.added
        self._held.update(_key(edge) for edge in change.added)

    def change_to(self, graph: PoseGraph) -> GraphChange:
        """What leads from the graph on disk to `graph`, vertices that hardly moved aside."""
        poses = {vertex: T for vertex, T in enumerate(graph.poses()) if self._moved(vertex, T)}
        return GraphChange(poses, tuple(e for e in (*graph.measurements(), *graph.rejected()) if _key(e) not in self._held))

    def rebuilt(self, vertices: int, graph: PoseGraph) -> PoseGraph:
        """`graph`, which is empty, with the vertices and edges on disk, not optimised; ValueError names a vertex without a pose."""
        for vertex in range(vertices):
            if vertex not in self._poses:
                raise ValueError(f"the session has no pose of vertex {vertex}")
            graph.add_vertex(self._poses[vertex])
        for edge in self._edges:
            graph.add_edge(edge.i, edge.j, edge.T_i_j, edge.covariance, edge.kind)
        return graph

    def _moved(self, vertex: int, T: Array) -> bool:
        if vertex not in self._poses:
            return True
        motion = inverse(self._poses[vertex]) @ T
        return float(np.linalg.norm(motion[:3, 3])) > _MOVED_M or rotation_angle(motion) > _MOVED_RAD


def _key(edge: Edge) -> tuple[int, int, str, bytes]:
    return edge.i, edge.j, edge.kind.value, edge.T_i_j[:3].tobytes()
