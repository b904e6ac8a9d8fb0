"""How much noise a pose graph shows, beside what its edges claim: where an edge stands out of the rest, and how likely a solution is."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.graph.graph_lines import PLANE
from pose_graph_mapping.graph.graph_problem import GraphProblem

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ENOUGH_EDGES = 50
_HALF_MEDIAN = {6: 2.674, 3: 1.183}
"""Half of the median of chi-square with so many degrees of freedom."""
_LEAST_REDUNDANCY = 0.1
"""Below it, errors hardly tell of noise."""
_QUARTILE = 0.6745
"""From the lower quartile of a normal distribution to its median, in sigmas."""
_TAIL_SIGMAS = 6.0


def shown_variance(errors: Array, freedom: int, redundancy: float) -> float:
    """The variance that edges show over the one they claim; one where they are too few to tell.

    freedom: directions of an edge; redundancy: the share of what was measured that the poses do not take up.
    """
    if len(errors) < ENOUGH_EDGES:
        return 1.0
    return float(np.median(errors)) / (_HALF_MEDIAN[freedom] * max(redundancy, _LEAST_REDUNDANCY))


def redundancy(kept: Mask, vertices: int) -> float:
    """The share of what was measured that the poses do not take up."""
    edges = int(np.count_nonzero(kept))
    return (edges - vertices + 1) / max(edges, 1)


def tail_end(errors: Array) -> float:
    """The error beyond which an edge stands out of the others, infinite where they are too few to tell.

    Errors of real graphs have long tails: their logarithm is nearly normal. So the end is six sigmas above the median of the logarithm,
    the sigma taken between lower quartile and median, where false edges hardly count.
    """
    positive = errors[errors > 0.0]
    if len(positive) < ENOUGH_EDGES:
        return math.inf
    lower, middle = np.quantile(np.log(positive), [0.25, 0.5])
    return float(np.exp(middle + _TAIL_SIGMAS * (middle - lower) / _QUARTILE))


def is_even(errors: Array) -> bool:
    """Whether there are enough edges to tell that none stands out."""
    return len(errors) >= ENOUGH_EDGES and float(errors.max()) <= tail_end(errors)


def unlikelihood(problem: GraphProblem, errors: Array, kept: Mask, variance: float, freedom: int) -> float:
    """Minus the logarithm of the likelihood, with noise of `variance` times what the edges claim.

    An edge that is left out may say any pose within the extent of the graph, one like the other. freedom: directions of an edge, 6 or 3.
    """
    axes, turns = (2, 2.0 * math.pi) if freedom == 3 else (3, 8.0 * math.pi**2)
    extent = float(np.ptp(problem.poses[:, :axes, 3], axis=0).max())
    anywhere = axes * math.log(max(extent, 1e-6)) + math.log(turns)
    used = PLANE if freedom == 3 else np.s_[:, :]
    spread = np.linalg.slogdet(np.array([edge.covariance[used] for edge in problem.edges]))[1]
    inside = 0.5 * (spread + freedom * math.log(2.0 * math.pi * variance)) + errors / variance
    return float(np.where(kept, inside, anywhere).sum())
