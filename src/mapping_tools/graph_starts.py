"""Where the solution of a pose graph starts: the poses given, chordal relaxation, and a spanning tree; and the best end of these.

Chordal relaxation (Carlone et al., "Initialization Techniques for 3D SLAM", 2015, as gtsam has it) solves for the rotations first, as for
free matrices: a linear problem, so that its end does not hang on any start.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import gtsam
import numpy as np

from pose_graph_mapping.graph.graph_problem import GraphProblem, grown, minimised, parts

_ROUGH_ITERATIONS, _ROUGH_TOLERANCE = 20, 1e-5


def likeliest(problem: GraphProblem, is_good: Callable[[gtsam.Values], bool]) -> gtsam.Values:
    """The end of least error over all starts, or the first that is good, with every edge believed."""
    factors, ends = problem.factors(), []
    for start in _starts(problem):
        ends.append(polished(factors, start))
        if is_good(ends[-1]):
            return ends[-1]
    return min(ends, key=factors.error)


def polished(factors: gtsam.NonlinearFactorGraph, values: gtsam.Values) -> gtsam.Values:
    """The end from some values, however small all errors are: files claim noise of any size."""
    return minimised(factors, values, absolute_tolerance=0.0)


def first_end(problem: GraphProblem) -> gtsam.Values:
    """Nearly the end from chordal relaxation, or from the poses given where there is none, with every edge believed."""
    return minimised(problem.factors(), next(_starts(problem)), _ROUGH_ITERATIONS, _ROUGH_TOLERANCE, 0.0)


def _starts(problem: GraphProblem) -> Iterator[gtsam.Values]:
    chordal = _chordal(problem)
    if chordal is not None:
        yield chordal
    yield problem.values()
    yield grown(problem).values()


def _chordal(problem: GraphProblem) -> gtsam.Values | None:
    """None where rotations do not follow from edges that know all directions."""
    whole = replace(
        problem,
        edges=[e for e in problem.edges if e.information is None],
        priors=[p for p in problem.priors if np.linalg.matrix_rank(p.information, hermitian=True) == 6],
    )
    held = {int(part) for part in parts(whole)[[*whole.fixed, *(p.vertex_id for p in whole.priors)]]}
    if len(held) < len(set(parts(whole).tolist())):
        return None
    try:
        values = gtsam.InitializePose3.initialize(whole.factors())
        return values if np.isfinite(problem.factors().error(values)) else None
    except (RuntimeError, ValueError):  # as gtsam says that its equations are singular
        return None
