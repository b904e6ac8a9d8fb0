"""Which edges of a pose graph tell of one world: truncated least squares by graduated non-convexity.

An edge that contradicts the others by more than a limit is left out, and has no influence at all then. The method is that of Yang et al.,
"Graduated Non-Convexity for Robust Spatial Perception" (2020): a surrogate of the truncated cost, nearly convex at first, is sharpened step
by step. Two things differ: it starts from the residuals of the trusted chain and not from a solution in which false edges take part, and a
few iterations a step suffice, for the next step is near. On sphere2500 with a tenth of the loops replaced the first keeps true loops that
gtsam's own start loses, and both together take a tenth of its time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import gtsam
import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.graph.graph_measurements import Edge, EdgeKind
from pose_graph_mapping.graph.graph_problem import GraphProblem, grown, minimised

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_SHARPENED_BY = 1.4
_MOST_STEPS = 120
_ITERATIONS_A_STEP = 3
_MOST_ROUNDS = 10
_TIE = 0.5
"""Solutions whose costs differ by less, in limits, are alike."""
_BELIEVED_CREDIT = 0.2
"""What has been believed may cost so much more, in limits, than what would replace it."""


def trusted_edges(vertices: int, edges: Sequence[Edge]) -> Mask:
    """(E,) odometry, and in the order of their arrival the edges without which a part of the graph would hang on nothing."""
    part = list(range(vertices))

    def root(k: int) -> int:
        while part[k] != k:
            part[k] = part[part[k]]
            k = part[k]
        return k

    trusted = np.array([edge.kind is EdgeKind.ODOMETRY for edge in edges], dtype=bool)
    for k in [*np.flatnonzero(trusted), *np.flatnonzero(~trusted)]:
        a, b = root(edges[k].i), root(edges[k].j)
        if a != b:
            part[a] = b
            trusted[k] = True
    return trusted


def _unheard(_: str) -> None:
    pass


def consistent_edges(
    problem: GraphProblem,
    trusted: Mask,
    limit: float,
    report: Callable[[str], None] = _unheard,
    believed: Mask | None = None,
    starts: Sequence[gtsam.Values] = (),
) -> tuple[Mask, gtsam.Values]:
    """(E,) which edges are kept, and the values that the kept ones give.

    Edges in `trusted` are never left out; `limit`: half of the squared Mahalanobis distance beyond which any other edge is; `report`
    hears of progress.
    problem.poses are the start. Where they lead to edges left out, others are tried, for poses that a false edge has bent may not find
    back: `starts`, what a spanning tree of the trusted edges gives, and for a graph that grows the compromise between all edges, and just
    those `believed` until now. The cheapest end counts, and of those that cost nearly the same the one that leaves out least. Where the
    rest does not tell an old edge from a new one that contradicts it, the old one stays.
    """

    def end_from(start: gtsam.Values) -> tuple[Mask, gtsam.Values]:
        return settled(problem, trusted, limit, *_annealed(problem, trusted, limit, start, report))

    ends = [end_from(problem.values())]
    if bool(ends[0][0].all()):
        return ends[0]
    ends += [end_from(start) for start in starts]
    tree = grown(problem)
    if not np.allclose(tree.poses, problem.poses, rtol=0.0, atol=1e-6):
        ends.append(end_from(tree.values()))
    credit = [0.0] * len(ends)
    if believed is not None:
        ends.append(end_from(minimised(problem.factors(), problem.values())))
        ends.append(settled(problem, trusted, limit, believed | trusted, problem.values()))
        credit += [0.0, _BELIEVED_CREDIT * limit]
    costs = [truncated_cost(problem, *end, limit) - less for end, less in zip(ends, credit, strict=True)]
    return ends[_best([int(np.count_nonzero(~kept)) for kept, _ in ends], costs, _TIE * limit)]


def _best(left_out: Sequence[int], costs: Sequence[float], alike: float) -> int:
    """Of those that cost nearly as little as the cheapest, the one that leaves out least; of several, the cheapest."""
    nearly_best = [k for k, cost in enumerate(costs) if cost <= min(costs) + alike]
    return min(nearly_best, key=lambda k: (left_out[k], costs[k]))


def settled(problem: GraphProblem, trusted: Mask, limit: float, kept: Mask, values: gtsam.Values) -> tuple[Mask, gtsam.Values]:
    """Solve, leave out what is beyond the limit then and take back what is within it, until nothing changes.

    In the second half of the rounds edges are only left out, so that it ends with no kept edge beyond the limit.
    """
    for round_number in range(_MOST_ROUNDS):
        values = minimised(problem.factors(kept.astype(np.float64)), values)
        again = trusted | (problem.edge_errors(values) <= limit)
        if round_number >= _MOST_ROUNDS // 2:
            again &= kept
        if bool((again == kept).all()):
            return kept, values
        kept = again
    return kept, minimised(problem.factors(kept.astype(np.float64)), values)


def truncated_cost(problem: GraphProblem, kept: Mask, values: gtsam.Values, limit: float) -> float:
    """What truncated least squares minimises: the error of the kept edges, and the limit for each that was left out."""
    return float(problem.factors(kept.astype(np.float64)).error(values)) + limit * float(np.count_nonzero(~kept))


def _annealed(
    problem: GraphProblem, trusted: Mask, limit: float, values: gtsam.Values, report: Callable[[str], None]
) -> tuple[Mask, gtsam.Values]:
    errors = problem.edge_errors(values)
    largest = float(errors[~trusted].max(initial=0.0))
    weights = np.ones(len(errors))
    if largest <= limit:
        return np.ones(len(errors), dtype=bool), values
    mu = limit / (2.0 * largest - limit)
    for step in range(1, _MOST_STEPS + 1):
        weights = np.where(trusted, 1.0, _surrogate_weights(errors, mu, limit))
        values = minimised(problem.factors(weights), values, _ITERATIONS_A_STEP, 1e-3)
        errors = problem.edge_errors(values)
        report(f"step {step}: {np.count_nonzero(weights == 0.0)} of {len(errors)} edges left out")
        mu *= _SHARPENED_BY
        if mu > 1e-3 and bool(((weights == 0.0) | (weights == 1.0)).all()):
            break
    return weights > 0.5, values


def _surrogate_weights(errors: Array, mu: float, limit: float) -> Array:
    """Equation 14 of the paper: one below mu / (mu + 1) of the limit, zero above (mu + 1) / mu of it."""
    between = np.sqrt(limit * mu * (mu + 1.0) / np.maximum(errors, 1e-300)) - mu
    return np.where(errors >= (mu + 1.0) / mu * limit, 0.0, np.clip(between, 0.0, 1.0))
