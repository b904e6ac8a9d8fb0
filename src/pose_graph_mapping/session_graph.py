"""The pose graph as a session's index has told it so far: changes are folded in, and what a graph has become since is found."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.pose_graph import Edge, PoseGraph
from pose_graph_mapping.session_record import GraphChange
from rigid_geometry import inverse, rotation_angle

Array = NDArray[np.float64]

_MOVED_M, _MOVED_RAD = 0.01, 0.002
"""A vertex that moved less is not written again: its edges put it back."""


class StoredGraph:
    """Poses and edges on disk. Of a sweep only what it changed is written, so that a line stays short however long a session is."""

    def __init__(self) -> None:
        self._poses: dict[int, Array] = {}
        self._edges: dict[int, Edge] = {}
        self._numbered = 0

    def apply(self, change: GraphChange) -> None:
        """Fold in the next change; ValueError when it removes an edge that is not there."""
        unknown = [number for number in change.removed if number not in self._edges]
        if unknown:
            raise ValueError(f"edge {unknown[0]} is removed, but there is none")
        self._poses.update(change.poses)
        for number in change.removed:
            del self._edges[number]
        for edge in change.added:
            self._edges[self._numbered] = edge
            self._numbered += 1

    def change_to(self, graph: PoseGraph) -> GraphChange:
        """What leads from the graph on disk to `graph`, vertices that hardly moved aside."""
        held = {_key(edge): number for number, edge in self._edges.items()}
        now = {_key(edge): edge for edge in graph.measurements()}
        poses = {vertex: T for vertex, T in enumerate(graph.poses()) if self._moved(vertex, T)}
        added = tuple(edge for key, edge in now.items() if key not in held)
        return GraphChange(poses, added, tuple(number for key, number in held.items() if key not in now))

    def rebuilt(self, vertices: int, graph: PoseGraph) -> PoseGraph:
        """`graph`, which is empty, with the vertices and edges on disk, not optimised; ValueError names a vertex without a pose."""
        for vertex in range(vertices):
            if vertex not in self._poses:
                raise ValueError(f"the session has no pose of vertex {vertex}")
            graph.add_vertex(self._poses[vertex])
        for _, edge in sorted(self._edges.items()):
            graph.add_edge(edge.i, edge.j, edge.T_i_j, edge.covariance, edge.kind)
        return graph

    def _moved(self, vertex: int, T: Array) -> bool:
        if vertex not in self._poses:
            return True
        motion = inverse(self._poses[vertex]) @ T
        return float(np.linalg.norm(motion[:3, 3])) > _MOVED_M or rotation_angle(motion) > _MOVED_RAD


def _key(edge: Edge) -> tuple[int, int, str, bytes]:
    return edge.i, edge.j, edge.kind.value, edge.T_i_j[:3].tobytes()
