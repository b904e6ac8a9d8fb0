"""The pose graph of Algorithms 1 and 2: vertices are sweeps, edges what is known between them, gtsam finds the likeliest poses.

While the robot drives the solution grows with the graph (iSAM2). A loop that disagrees has the whole graph solved and every match and loop
judged again: what contradicts the rest is left out, and comes back when later edges agree with it. The thesis uses g2o; its file format
stays the exchange format. The same calls always give the same poses.
"""

from __future__ import annotations

import contextlib
import dataclasses
import heapq
import os
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.graph.graph_consistency import consistent_edges, settled, trusted_edges
from pose_graph_mapping.graph.graph_files import g2o_text, read_graph_file
from pose_graph_mapping.graph.graph_measurements import Edge, EdgeKind, GraphNotSolvable, Gravity, orthonormal, unit_up
from pose_graph_mapping.graph.graph_problem import GraphProblem, poses_of, tree_poses
from pose_graph_mapping.graph.gravity_bias import estimated_bias
from pose_graph_mapping.graph.incremental_graph import IncrementalGraph
from rigid_geometry import as_covariance, as_transform

Array = NDArray[np.float64]

_ODOMETRY_DOUBT = 2.0
"""A match is judged against odometry of this many times its sigmas: a slip is likelier than a wrong match."""
_BIAS_ROUNDS = 6
_BIAS_SETTLED_RAD = 2e-6

__all__ = ["Edge", "EdgeKind", "GraphNotSolvable", "PoseGraph", "orthonormal", "unit_up"]


class PoseGraph:
    """Vertices 0, 1, .. with poses T_map_base, edges of three kinds, and the up direction measured at vertices."""

    def __init__(self, outlier_chi2: float = 30.0, gravity_bias_sigma_rad: float = 0.0) -> None:
        """outlier_chi2: squared Mahalanobis distance of six degrees of freedom beyond which a match or loop contradicts the rest.

        gravity_bias_sigma_rad: how far measured up directions may be off in common, fixed in the body; 0: they are not.
        """
        if not outlier_chi2 > 0.0 or not gravity_bias_sigma_rad >= 0.0:
            raise ValueError(f"outlier_chi2 {outlier_chi2} must be positive, gravity_bias_sigma_rad {gravity_bias_sigma_rad} not negative")
        self._limit = 0.5 * outlier_chi2
        self._bias_sigma = gravity_bias_sigma_rad
        self._poses: list[Array] = []
        self._edges: list[Edge] = []
        self._kept: list[bool] = []
        self._gravity: list[Gravity] = []
        self._bias = np.zeros(3)
        self._running: IncrementalGraph | None = None
        self._solved_edges = self._solved_gravity = 0

    def __len__(self) -> int:
        return len(self._poses)

    def add_vertex(self, T_map_base: ArrayLike) -> int:
        """The id of a new vertex at `T_map_base` (4, 4)."""
        self._poses.append(orthonormal(as_transform(T_map_base)))
        return len(self._poses) - 1

    def add_edge(self, i: int, j: int, T_i_j: ArrayLike, covariance: ArrayLike, kind: EdgeKind) -> None:
        """Connect two vertices; ValueError for an unknown vertex, a loop onto itself, or no covariance."""
        if self._known(i) == self._known(j):
            raise ValueError(f"an edge connects two vertices, not {i} with itself")
        self._edges.append(Edge(i, j, as_transform(T_i_j), as_covariance(covariance), kind))
        self._kept.append(True)

    def add_gravity(self, vertex_id: int, up_body: ArrayLike, sigma_rad: float) -> None:
        """The direction (3,) that was up in the body frame of a vertex; the map's up is its z axis."""
        if not sigma_rad > 0.0:
            raise ValueError(f"sigma_rad must be positive, not {sigma_rad}")
        self._gravity.append(Gravity(self._known(vertex_id), unit_up(up_body), sigma_rad))

    @contextlib.contextmanager
    def whole(self) -> Iterator[None]:
        """What is done to the graph inside is done wholly; an error that leaves it leaves the graph as it was."""
        held = list(self._poses), list(self._edges), list(self._kept), list(self._gravity), self._bias
        solved = self._solved_edges, self._solved_gravity
        try:
            yield
        except BaseException:
            if (len(self._poses), len(self._edges), len(self._gravity)) != (len(held[0]), len(held[1]), len(held[3])):
                self._running = None  # it may have grown: the next solution starts anew
            self._poses, self._edges, self._kept, self._gravity, self._bias = held
            self._solved_edges, self._solved_gravity = solved
            raise

    def pose(self, vertex_id: int) -> Array:
        """(4, 4) current estimate T_map_base of a vertex."""
        return self._poses[self._known(vertex_id)]

    def poses(self) -> Array:
        """(V, 4, 4) current estimates."""
        return np.array(self._poses).reshape(-1, 4, 4)

    def edges(self) -> list[tuple[int, int, EdgeKind]]:
        """(i, j, kind) of every edge in the order of their arrival, for drawing; without those that were left out."""
        return [(edge.i, edge.j, edge.kind) for edge in self.measurements()]

    def measurements(self) -> list[Edge]:
        """Every edge with what it measured, without those that were left out."""
        return [edge for edge, kept in zip(self._edges, self._kept, strict=True) if kept]

    def rejected(self) -> list[Edge]:
        """The edges that contradict the others and have no part in the poses."""
        return [edge for edge, kept in zip(self._edges, self._kept, strict=True) if not kept]

    def neighbours(self, vertex_id: int) -> list[int]:
        """Ids of the vertices that share an edge with a vertex, in ascending order."""
        self._known(vertex_id)
        return sorted({e.j if e.i == vertex_id else e.i for e in self.measurements() if vertex_id in (e.i, e.j)})

    def distances_from(self, vertex_id: int) -> Array:
        """(V,) metres from a vertex along edges (Dijkstra); inf where no edge leads."""
        distance = np.full(len(self._poses), np.inf)
        distance[self._known(vertex_id)] = 0.0
        queue = [(0.0, vertex_id)]
        positions, neighbours = self.poses()[:, :3, 3], self._all_neighbours()
        while queue:
            travelled, at = heapq.heappop(queue)
            for to in neighbours[at]:
                there = travelled + float(np.linalg.norm(positions[to] - positions[at]))
                if there < distance[to]:
                    distance[to] = there
                    heapq.heappush(queue, (there, to))
        return distance

    def relative_covariance(self, i: int, j: int) -> Array:
        """(6, 6) covariance of T_i_j, rotation first, in the body frame of j, by the graph as `optimise` left it."""
        with self._anew_if_singular():
            return self._solved(i, j).relative_covariance(i, j)

    def relative_covariances(self, ids: Sequence[int], j: int) -> Array:
        """(N, 6, 6) the same of T_i_j for many i."""
        with self._anew_if_singular():
            return self._solved(*ids, j).relative_covariances(ids, j)

    def optimise(self) -> None:
        """Move all vertices to the likeliest poses; the first keeps position and heading.

        The last solution grows; where a new loop does not agree with it everything is solved and judged again, as by `solve`.
        """
        new = self._edges[self._solved_edges :]
        with self._anew_if_singular():
            agree = self._running is not None and self._all_agree(self._running, new)
        if self._running is None or not agree:
            self.solve()
            return
        old_vertices = self._running.vertices
        self._running.grow(self.poses()[old_vertices:], new, self._gravity[self._solved_gravity :])
        self._mark_solved(self._running.poses())
        for _ in range(_BIAS_ROUNDS):
            if not self._bias_moved():
                break
            self._running.relevel(self._bias)
            self._mark_solved(self._running.poses())

    def solve(self) -> tuple[Edge, ...]:
        """Solve the whole graph from what was measured, judge every match and loop, and return the edges that were left out by it.

        ValueError (GraphNotSolvable) when a part of the graph has no edge to the rest.
        """
        if not self._poses:
            return ()
        tree_poses(len(self), self._edges, {0: self._poses[0]})  # says what hangs apart
        before, kept = self._kept, self._consistent()
        kept = self._levelled(kept)
        self._kept = kept.tolist()
        self._running = IncrementalGraph(self._problem(self.measurements()))
        self._mark_solved(self._running.poses())
        return tuple(edge for edge, was, now in zip(self._edges, before, self._kept, strict=True) if was and not now)

    def g2o_text(self, vertices: int | None = None) -> str:
        """VERTEX_SE3:QUAT and EDGE_SE3:QUAT lines of the first `vertices`, or of all, and of the edges between them.

        Kinds of edges stand in comments; measured gravity is not part of the format.
        """
        count = len(self) if vertices is None else vertices
        return g2o_text(dict(enumerate(self._poses[:count])), [e for e in self.measurements() if max(e.i, e.j) < count])

    @classmethod
    def load_g2o(cls, path: str | os.PathLike[str]) -> PoseGraph:
        """A graph from a g2o file with SE3 vertices 0, 1, ..; ValueError names the line that cannot be read.

        Without comments that tell kinds, an edge to the next vertex is odometry and any other a loop.
        """
        file, graph = read_graph_file(path), cls()
        for number, (vertex_id, T) in enumerate(sorted(file.poses.items())):
            if vertex_id != number:
                raise ValueError(f"{path}: vertex {vertex_id} where {number} is next")
            graph.add_vertex(T)
        for edge, line in zip(file.edges, file.edge_lines, strict=True):
            if edge.information is not None:
                raise GraphNotSolvable(f"{path}, line {line}: the information matrix is singular")
            graph.add_edge(edge.i, edge.j, edge.T_i_j, edge.covariance, edge.kind)
        return graph

    @contextlib.contextmanager
    def _anew_if_singular(self) -> Iterator[None]:
        """A solution that was found to be singular is not grown on: the next one begins anew."""
        try:
            yield
        except GraphNotSolvable:
            self._running = None
            raise

    def _solved(self, *vertex_ids: int) -> IncrementalGraph:
        if self._running is None or self._running.vertices <= max(map(self._known, vertex_ids)):
            raise ValueError(f"vertices {' and '.join(map(str, vertex_ids))} are not optimised yet")
        return self._running

    def _known(self, vertex_id: int) -> int:
        if not 0 <= vertex_id < len(self._poses):
            raise ValueError(f"vertex {vertex_id} is unknown; there are {len(self._poses)}")
        return vertex_id

    def _all_neighbours(self) -> list[list[int]]:
        found: list[set[int]] = [set() for _ in self._poses]
        for edge in self.measurements():
            found[edge.i].add(edge.j)
            found[edge.j].add(edge.i)
        return [sorted(ids) for ids in found]

    def _problem(self, edges: Sequence[Edge]) -> GraphProblem:
        return GraphProblem(self.poses(), edges, self._gravity, self._bias)

    def _consistent(self) -> NDArray[np.bool_]:
        """Which edges agree, with odometry beside a match believed less than it says of itself."""
        matched = {(e.i, e.j) for e in self._edges if e.kind is EdgeKind.MATCH}
        doubted = [
            dataclasses.replace(e, covariance=e.covariance * _ODOMETRY_DOUBT**2)
            if e.kind is EdgeKind.ODOMETRY and (e.i, e.j) in matched
            else e
            for e in self._edges
        ]
        problem = self._problem(doubted)
        trusted, believed = trusted_edges(len(self), self._edges), np.array(self._kept, dtype=bool)
        kept, values = consistent_edges(problem, trusted, self._limit, believed=believed)
        self._poses = list(poses_of(values, len(self)))
        return kept

    def _levelled(self, kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """The edges that are kept with odometry at its word and the bias of gravity estimated; moves the poses there."""
        trusted = trusted_edges(len(self), self._edges)
        for _ in range(_BIAS_ROUNDS):
            problem = self._problem(self._edges)
            kept, values = settled(problem, trusted, self._limit, kept, problem.values())
            self._poses = list(poses_of(values, len(self)))
            if not self._bias_moved():
                break
        return kept

    def _all_agree(self, running: IncrementalGraph, new: Sequence[Edge]) -> bool:
        """Whether new edges may join the running solution: they lead to every new vertex, or say what is known already."""
        joined = {k for edge in new for k in (edge.i, edge.j)}
        reached = all(k in joined for k in range(running.vertices, len(self)))
        for number, edge in enumerate(new, self._solved_edges):
            leads_on = max(edge.i, edge.j) >= running.vertices
            self._kept[number] = edge.kind is not EdgeKind.LOOP if leads_on else running.disagreement(edge) <= self._limit
        return reached and all(self._kept[self._solved_edges :])

    def _bias_moved(self) -> bool:
        """Estimates the bias anew, and says whether that matters."""
        old, self._bias = self._bias, estimated_bias(self.poses(), self._gravity, self._bias_sigma)
        return bool(np.abs(self._bias - old).max() > _BIAS_SETTLED_RAD)

    def _mark_solved(self, poses: Array) -> None:
        self._poses = list(poses)
        self._solved_edges, self._solved_gravity = len(self._edges), len(self._gravity)
