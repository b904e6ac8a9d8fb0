"""A graph file solved: ids of any kind become vertices 0, 1, .., missing poses are grown along edges, and false edges are left out."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import gtsam
import numpy as np
from numpy.typing import NDArray

from mapping_tools.graph_freedom import free_parts
from mapping_tools.graph_noise import is_even, redundancy, shown_variance, tail_end, unlikelihood
from mapping_tools.graph_starts import first_end, likeliest, polished
from pose_graph_mapping.graph.graph_consistency import consistent_edges, settled, trusted_edges
from pose_graph_mapping.graph.graph_files import GraphFile
from pose_graph_mapping.graph.graph_measurements import GraphNotSolvable, Prior, orthonormal
from pose_graph_mapping.graph.graph_problem import GraphProblem, parts, poses_of, prior_factor, tree_poses
from rigid_geometry import inverse

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Say = Callable[[str], None]

_MOST_ROUNDS = 10
_LOOSE_INFORMATION = 1e-6
"""Of the lowest vertex, where priors leave open where the whole lies: too little to move anything that is known."""


@dataclass(frozen=True, eq=False)
class NumberedGraph:
    """A file's graph with vertices 0, 1, ..: `ids` are their names in the file, `problem` has a pose for each; initialised: had none.

    freedom: directions of an edge, 6, or 3 where the graph is 2-D.
    """

    ids: tuple[int, ...]
    problem: GraphProblem
    initialised: int
    freedom: int = 6


@dataclass(frozen=True, eq=False)
class SolvedGraph:
    """poses (V, 4, 4); kept (E,) the edges that take part; edge_errors (E,) half of the squared Mahalanobis distances at the end.

    initial_error: of all edges at the start, final_error: of the kept ones at the end; prior_error: of the priors at the end.
    """

    poses: Array
    kept: Mask
    edge_errors: Array
    initial_error: float
    prior_error: float = 0.0

    @property
    def final_error(self) -> float:
        return float(self.edge_errors[self.kept].sum()) + self.prior_error


def numbered(file: GraphFile, strict: bool = False) -> NumberedGraph:
    """The graph of a file; the vertex of the lowest id is fixed where neither FIX nor priors say where the graph lies.

    ValueError for a file without vertices, for FIX of an unknown vertex and, when strict, for an edge to a vertex without a line;
    GraphNotSolvable when some of its poses do not follow from what was measured.
    """
    ids = sorted({*file.poses, *(k for e in file.edges for k in (e.i, e.j)), *(p.vertex_id for p in file.priors)})
    place = {vertex_id: number for number, vertex_id in enumerate(ids)}
    if not ids:
        raise ValueError("there is neither a vertex nor an edge of a pose graph in it")
    fixed_ids = [k for k in file.fixed if k not in file.other_vertices - set(ids)]
    if unknown := [k for k in fixed_ids if k not in place]:
        raise ValueError(f"FIX {unknown[0]}: there is no such vertex")
    if strict:
        _check_complete(file)
    edges = [replace(edge, i=place[edge.i], j=place[edge.j]) for edge in file.edges]
    priors = [replace(prior, vertex_id=place[prior.vertex_id]) for prior in file.priors]
    fixed = tuple(sorted({place[k] for k in fixed_ids})) or (() if priors else (0,))
    roots = {place[k]: T for k, T in file.poses.items()} or {p.vertex_id: p.T_map_vertex for p in priors} or {fixed[0]: np.eye(4)}
    unplaced = GraphProblem(np.tile(np.eye(4), (len(ids), 1, 1)), edges, fixed=fixed, priors=priors)
    _check_connected(ids, unplaced)
    problem = _held(replace(unplaced, poses=tree_poses(len(ids), edges, roots)))
    _check_determined(ids, problem)
    return NumberedGraph(tuple(ids), problem, len(set(ids) - set(file.poses)), 3 if file.is_2d else 6)


def solve_plain(problem: GraphProblem) -> SolvedGraph:
    """Every edge is believed; of the ends of several starts the best counts."""
    whole = likeliest(problem, lambda end: is_even(problem.edge_errors(end)))
    return _solved(problem, np.ones(len(problem.edges), dtype=bool), whole)


def solve_robust(problem: GraphProblem, outlier_chi2: float, report: Say, freedom: int = 6) -> SolvedGraph:
    """Edges but odometry are left out where they contradict the rest; `report` hears of progress. freedom: directions of an edge, 6 or 3.

    An edge contradicts the rest beyond `outlier_chi2` of the noise that the graph shows, or of the noise claimed where edges are too few
    to tell. Where its errors have a longer tail than a normal distribution, the tail is kept up to `outlier_chi2` of the noise claimed.
    """
    whole, everything = first_end(problem), np.ones(len(problem.edges), dtype=bool)
    placed = replace(problem, poses=poses_of(whole, len(problem.poses)))
    judge = _Judge(placed, trusted_edges(len(problem.poses), problem.edges), 0.5 * outlier_chi2, freedom)
    if judge.none_stands_out(everything, whole):
        return _solved(problem, everything, polished(problem.factors(), whole))
    kept, values = judge.settle(*consistent_edges(problem, judge.trusted, judge.limit, report, starts=(whole,)))
    if not judge.is_as_claimed(kept, values):
        kept, values = judge.likelier((kept, values), judge.settle(everything, whole))
    report(f"its edges show {judge.variance(kept, values):.3g} times the variance that they claim")
    return _solved(problem, kept, polished(problem.factors(kept.astype(np.float64)), values))


@dataclass(frozen=True, eq=False)
class _Judge:
    """Which edges are kept by the noise that the graph shows. problem: with the poses that all edges lead to; limit: as they claim it."""

    problem: GraphProblem
    trusted: Mask
    limit: float
    freedom: int

    def variance(self, kept: Mask, values: gtsam.Values) -> float:
        """That the kept edges show, over the one that they claim."""
        errors = self.problem.edge_errors(values)[kept & ~self.trusted]
        return shown_variance(errors, self.freedom, redundancy(kept, len(self.problem.poses)))

    def none_stands_out(self, kept: Mask, values: gtsam.Values) -> bool:
        """Whether all errors are those of one noise, no more than is claimed: much noise may be what false edges have bent."""
        within = self.limit * min(1.0, self.variance(kept, values))
        return bool((self.problem.edge_errors(values)[kept & ~self.trusted] <= within).all())

    def is_as_claimed(self, kept: Mask, values: gtsam.Values) -> bool:
        """Whether most edges are kept, and show no more noise than they claim."""
        few = np.count_nonzero(~kept) <= 0.5 * np.count_nonzero(~self.trusted)
        return bool(few) and self.variance(kept, values) <= 1.0

    def settle(self, kept: Mask, values: gtsam.Values) -> tuple[Mask, gtsam.Values]:
        """Edges are judged by the noise that the kept ones show, while that falls; then the tail of their errors is taken back."""
        within = math.inf
        for _ in range(_MOST_ROUNDS):
            before, within = within, self.limit * self.variance(kept, values)
            if within > 0.9 * before:
                break
            kept, values = settled(self.problem, self.trusted, within, kept, values)
        for _ in range(_MOST_ROUNDS):
            before, within = within, self._tail(kept, values)
            if abs(within - before) <= 0.1 * before:
                break
            kept, values = settled(self.problem, self.trusted, within, kept, values)
        return kept, values

    def likelier(self, *ends: tuple[Mask, gtsam.Values]) -> tuple[Mask, gtsam.Values]:
        """The likeliest of some ends, each by the noise that it shows."""

        def cost(end: tuple[Mask, gtsam.Values]) -> float:
            return unlikelihood(self.problem, self.problem.edge_errors(end[1]), end[0], self.variance(*end), self.freedom)

        return min(ends, key=cost)

    def _tail(self, kept: Mask, values: gtsam.Values) -> float:
        """Where the errors of all edges end."""
        variance = self.variance(kept, values)
        tail = tail_end(self.problem.edge_errors(values)[~self.trusted])
        return min(self.limit * max(1.0, variance), max(self.limit * variance, tail))


def _solved(problem: GraphProblem, kept: Mask, values: gtsam.Values) -> SolvedGraph:
    poses, start = _at_fixed(problem, poses_of(values, len(problem.poses))), problem.values()
    end = replace(problem, poses=poses).values()
    errors = problem.edge_errors(end)
    priors = [prior_factor(p) for p in problem.priors]
    at_start, at_end = (sum(float(f.error(v)) for f in priors) for v in (start, end))
    if not np.isfinite(errors).all():
        raise GraphNotSolvable("the solution is not finite")
    return SolvedGraph(poses, kept, errors, float(problem.edge_errors(start).sum()) + at_start, at_end)


def _at_fixed(problem: GraphProblem, poses: Array) -> Array:
    """The poses, moved as a whole to where the one fixed vertex is, if it is all that says where they lie."""
    if len(problem.fixed) != 1 or problem.priors:
        return poses
    (k,) = problem.fixed
    return orthonormal(problem.poses[k] @ inverse(poses[k]) @ poses)


def _held(problem: GraphProblem) -> GraphProblem:
    """Where priors leave open where the whole graph lies, its lowest vertex holds it, too loosely to move anything that is known."""
    if problem.fixed or not free_parts(problem):
        return problem
    loosely = Prior(0, problem.poses[0], _LOOSE_INFORMATION * np.eye(6))
    return replace(problem, priors=[*problem.priors, loosely])


def _check_complete(file: GraphFile) -> None:
    for edge, line in zip(file.edges, file.edge_lines, strict=True):
        for vertex_id in (edge.i, edge.j):
            if vertex_id not in file.poses:
                raise ValueError(f"line {line}: vertex {vertex_id} has no line of its own")


def _check_connected(ids: list[int], problem: GraphProblem) -> None:
    """Every part without an edge to the others needs a vertex that is fixed, or a prior."""
    part = parts(problem)
    held = {int(part[k]) for k in (*problem.fixed, *(p.vertex_id for p in problem.priors))}
    found = {int(number): [k for k, p in zip(ids, part, strict=True) if p == number] for number in dict.fromkeys(part.tolist())}
    if set(found) - held:
        raise GraphNotSolvable(
            f"it falls into {len(found)} parts without an edge between them: vertices {_told(list(found.values()), len(ids))}"
        )


def _check_determined(ids: list[int], problem: GraphProblem) -> None:
    if free := free_parts(problem):
        names = [[ids[k] for k in part] for part in free]
        raise GraphNotSolvable(
            f"edges and priors whose information matrices are singular do not say where all lie: vertices {_told(names, len(ids))}"
        )


def _told(parts_of_ids: list[list[int]], total: int) -> str:
    told = "; ".join(f"{_range(part)} ({len(part)} of {total})" for part in parts_of_ids[:3])
    return told + "; .." * (len(parts_of_ids) > 3)


def _range(ids: list[int]) -> str:
    return f"{ids[0]}" if len(ids) == 1 else f"{ids[0]} to {ids[-1]}"
