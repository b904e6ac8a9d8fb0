"""A graph file solved: ids of any kind become vertices 0, 1, .., missing poses are grown along edges, and false edges are left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pose_graph_mapping.graph.graph_consistency import consistent_edges, settled, trusted_edges
from pose_graph_mapping.graph.graph_files import GraphFile
from pose_graph_mapping.graph.graph_measurements import Edge, GraphNotSolvable
from pose_graph_mapping.graph.graph_problem import GraphProblem, minimised, poses_of, tree_poses

Array = NDArray[np.float64]

_ENOUGH_EDGES = 50
_MEDIAN_ERROR = 2.674
"""Half of the median of chi-square with six degrees of freedom."""
_NOISE_MARGIN = 4.0
"""Part of an edge's noise goes into the poses, a quarter of its variance may be left: with this an honest file keeps its limit."""


@dataclass(frozen=True, eq=False)
class NumberedGraph:
    """A file's graph with vertices 0, 1, ..: `ids` are their names in the file, `problem` has a pose for each; initialised: had none."""

    ids: tuple[int, ...]
    problem: GraphProblem
    initialised: int


@dataclass(frozen=True, eq=False)
class SolvedGraph:
    """poses (V, 4, 4); kept (E,) the edges that take part; edge_errors (E,) half of the squared Mahalanobis distances at the end.

    initial_error: of all edges at the start, final_error: of the kept ones at the end.
    """

    poses: Array
    kept: NDArray[np.bool_]
    edge_errors: Array
    initial_error: float

    @property
    def final_error(self) -> float:
        return float(self.edge_errors[self.kept].sum())


def numbered(file: GraphFile, strict: bool = False) -> NumberedGraph:
    """The graph of a file; the vertex of the lowest id is fixed where no other is.

    ValueError for a file without vertices, for FIX of an unknown vertex and, when strict, for an edge to a vertex without a line;
    GraphNotSolvable when it falls into parts.
    """
    ids = sorted({*file.poses, *(k for edge in file.edges for k in (edge.i, edge.j))})
    place = {vertex_id: number for number, vertex_id in enumerate(ids)}
    if not ids:
        raise ValueError("there is neither a vertex nor an edge in it")
    unknown = [k for k in file.fixed if k not in place]
    if unknown:
        raise ValueError(f"FIX {unknown[0]}: there is no such vertex")
    if strict:
        _check_complete(file)
    edges = [replace(edge, i=place[edge.i], j=place[edge.j]) for edge in file.edges]
    fixed = tuple(sorted({place[k] for k in file.fixed})) or (0,)
    _check_connected(ids, edges)
    roots = {place[k]: T for k, T in file.poses.items()} or {fixed[0]: np.eye(4)}
    return NumberedGraph(tuple(ids), GraphProblem(tree_poses(len(ids), edges, roots), edges, fixed=fixed), len(ids) - len(file.poses))


def solve_plain(problem: GraphProblem) -> SolvedGraph:
    """Every edge is believed; started from the poses given and from a spanning tree, the better end counts."""
    factors = problem.factors()
    ends = [minimised(factors, start.values()) for start in (problem, _from_tree(problem))]
    best = min(ends, key=factors.error)
    return _solved(problem, np.ones(len(problem.edges), dtype=bool), poses_of(best, len(problem.poses)))


def solve_robust(problem: GraphProblem, outlier_chi2: float, report: Callable[[str], None]) -> SolvedGraph:
    """Edges but odometry are left out where they contradict the rest by more than `outlier_chi2`; `report` hears of progress."""
    trusted = trusted_edges(len(problem.poses), problem.edges)
    limit = 0.5 * outlier_chi2
    kept, values = consistent_edges(problem, trusted, limit, report)
    shown = _noise_shown(problem.edge_errors(values)[kept & ~trusted])
    if shown < 1.0:
        report(f"its edges show less noise than they claim: the limit is chi2 {outlier_chi2 * shown:.3g} instead of {outlier_chi2:g}")
        kept, values = settled(problem, trusted, limit * shown, kept, values)
    return _solved(problem, kept, poses_of(values, len(problem.poses)))


def _noise_shown(errors: Array) -> float:
    """The share of the claimed variance that edges of six degrees of freedom show, with a margin; one where they are too few to tell."""
    if len(errors) < _ENOUGH_EDGES:
        return 1.0
    return min(1.0, _NOISE_MARGIN * float(np.median(errors)) / _MEDIAN_ERROR)


def _from_tree(problem: GraphProblem) -> GraphProblem:
    roots = {k: problem.poses[k] for k in problem.fixed}
    return replace(problem, poses=tree_poses(len(problem.poses), problem.edges, roots))


def _solved(problem: GraphProblem, kept: NDArray[np.bool_], poses: Array) -> SolvedGraph:
    errors = problem.edge_errors(replace(problem, poses=poses).values())
    if not np.isfinite(errors).all():
        raise GraphNotSolvable("the solution is not finite")
    return SolvedGraph(poses, kept, errors, float(problem.edge_errors(problem.values()).sum()))


def _check_complete(file: GraphFile) -> None:
    for edge, line in zip(file.edges, file.edge_lines, strict=True):
        for vertex_id in (edge.i, edge.j):
            if vertex_id not in file.poses:
                raise ValueError(f"line {line}: vertex {vertex_id} has no line of its own")


def _check_connected(ids: list[int], edges: list[Edge]) -> None:
    part = _parts(len(ids), edges)
    names = [[vertex_id for vertex_id, p in zip(ids, part, strict=True) if p == number] for number in sorted(set(part))]
    if len(names) > 1:
        told = "; ".join(f"{_range(name)} ({len(name)} of {len(ids)})" for name in names[:3])
        raise GraphNotSolvable(f"it falls into {len(names)} parts without an edge between them: vertices {told}{'; ..' * (len(names) > 3)}")


def _parts(vertices: int, edges: list[Edge]) -> list[int]:
    """The number of the part that each vertex belongs to."""
    i, j = [e.i for e in edges], [e.j for e in edges]
    _, label = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(vertices, vertices)), directed=False)
    return [int(k) for k in label]


def _range(ids: list[int]) -> str:
    return f"{ids[0]}" if len(ids) == 1 else f"{ids[0]} to {ids[-1]}"
