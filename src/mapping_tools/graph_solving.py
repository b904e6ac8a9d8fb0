"""A graph file solved: ids of any kind become vertices 0, 1, .., missing poses are grown along edges, and false edges are left out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import gtsam
import numpy as np
from numpy.typing import NDArray

from mapping_tools.graph_freedom import free_parts
from mapping_tools.graph_noise import excess, is_even, redundancy, tail_end, unlikelihood
from mapping_tools.graph_starts import likeliest
from pose_graph_mapping.graph.graph_consistency import consistent_edges, settled, trusted_edges
from pose_graph_mapping.graph.graph_files import GraphFile
from pose_graph_mapping.graph.graph_measurements import GraphNotSolvable, Prior
from pose_graph_mapping.graph.graph_problem import GraphProblem, parts, poses_of, prior_factor, tree_poses

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

    Where all agree within `outlier_chi2` of the noise that they claim, all are kept. Else the noise that the graph shows counts: more than
    is claimed where a graph of so much noise and fewer false edges is likelier, less where the edges that agree show less.
    """
    trusted, limit = trusted_edges(len(problem.poses), problem.edges), 0.5 * outlier_chi2

    def agree(end: gtsam.Values) -> bool:
        errors = problem.edge_errors(end)
        return bool((errors[~trusted] <= limit).all()) or is_even(errors)

    whole = likeliest(problem, agree)
    errors = problem.edge_errors(whole)
    everything = np.ones(len(errors), dtype=bool)
    if bool((errors[~trusted] <= limit * excess(errors, freedom, redundancy(everything, len(problem.poses)))).all()):
        return _solved(problem, everything, whole)
    judge = _Judge(replace(problem, poses=poses_of(whole, len(problem.poses))), trusted, limit, freedom, report)
    kept, values = consistent_edges(problem, trusted, limit, report, starts=(whole,))
    return _solved(problem, *judge.by_own_noise(*judge.likelier(whole, kept, values)))


@dataclass(frozen=True, eq=False)
class _Judge:
    """Which edges are kept by the noise that the graph shows. problem: with the poses to which all edges lead."""

    problem: GraphProblem
    trusted: Mask
    limit: float
    freedom: int
    report: Say

    def likelier(self, whole: gtsam.Values, kept: Mask, values: gtsam.Values) -> tuple[Mask, gtsam.Values]:
        """Of the edges kept by the noise they claim, and those kept by as much noise as all of them show, what is likelier."""
        own_kept, own_values, variance = self._from_above(whole)
        costs = [
            unlikelihood(self.problem, self.problem.edge_errors(end), mask, noise, self.freedom)
            for mask, end, noise in ((kept, values, 1.0), (own_kept, own_values, variance))
        ]
        if variance == 1.0 or costs[0] <= costs[1]:
            return kept, values
        self.report(f"its edges show more noise than they claim: {variance:.3g} times the variance, and are judged by it")
        return own_kept, own_values

    def by_own_noise(self, kept: Mask, values: gtsam.Values) -> tuple[Mask, gtsam.Values]:
        """Where edges were left out, those too that stand out of the rest by the noise it shows, though not by the noise claimed."""
        end = tail_end(self.problem.edge_errors(values)[kept & ~self.trusted])
        if bool(kept.all()) or end >= self.limit:
            return kept, values
        self.report(f"its edges show less noise than they claim: the limit is chi2 {2.0 * end:.3g} instead of {2.0 * self.limit:g}")
        return settled(self.problem, self.trusted, end, kept, values)

    def _from_above(self, whole: gtsam.Values) -> tuple[Mask, gtsam.Values, float]:
        """Edges within the limit of the noise shown, solved and judged again while that falls; the noise at the end."""
        kept, values = np.ones(len(self.trusted), dtype=bool), whole
        variance = self._shown(kept, values)
        for _ in range(_MOST_ROUNDS):
            kept, values = settled(self.problem, self.trusted, variance * self.limit, kept, values)
            before, variance = variance, self._shown(kept, values)
            if variance > 0.99 * before:
                break
        return kept, values, variance

    def _shown(self, kept: Mask, values: gtsam.Values) -> float:
        errors = self.problem.edge_errors(values)[kept & ~self.trusted]
        return excess(errors, self.freedom, redundancy(kept, len(self.problem.poses)))


def _solved(problem: GraphProblem, kept: Mask, values: gtsam.Values) -> SolvedGraph:
    poses, start = poses_of(values, len(problem.poses)), problem.values()
    end = replace(problem, poses=poses).values()
    errors = problem.edge_errors(end)
    priors = [prior_factor(p) for p in problem.priors]
    at_start, at_end = (sum(float(f.error(v)) for f in priors) for v in (start, end))
    if not np.isfinite(errors).all():
        raise GraphNotSolvable("the solution is not finite")
    return SolvedGraph(poses, kept, errors, float(problem.edge_errors(start).sum()) + at_start, at_end)


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
