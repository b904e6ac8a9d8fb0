"""The error of a pose graph as SE-Sync counts it, in which optima of standard graphs are published.

Rosen et al., "SE-Sync: A certifiably correct algorithm for synchronization over the special Euclidean group" (2019), equation 12, with one
weight an edge for its turn and one for its shift, of the blocks I_t and I_r of its information: tau = 3 / tr(I_t^-1) and
kappa = 3 / (2 tr(I_r^-1)). The error is the sum of kappa |R_j - R_i R_ij|^2 (Frobenius) + tau |t_j - t_i - R_i t_ij|^2. For small
residuals and weights that are alike in all directions it is twice gtsam's error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.graph.graph_measurements import Edge
from pose_graph_mapping.graph.graph_problem import GraphProblem

Array = NDArray[np.float64]

_LEAST_WEIGHT = 1e-12
"""Of the larger of both: less is nothing, and cannot be inverted."""


def sesync_error(edges: Sequence[Edge], poses: Array) -> float:
    """SE-Sync's error of edges at poses (V, 4, 4)."""
    if not edges:
        return 0.0
    kappa, tau = np.array([_weights(edge) for edge in edges]).T
    T_i, T_j = poses[[e.i for e in edges]], poses[[e.j for e in edges]]
    off = T_j - T_i @ np.array([e.T_i_j for e in edges])
    return float(kappa @ np.square(off[:, :3, :3]).sum(axis=(1, 2)) + tau @ np.square(off[:, :3, 3]).sum(axis=1))


def isotropic(problem: GraphProblem) -> GraphProblem:
    """The problem with SE-Sync's weights in place of the information matrices: half its least error is gtsam's of this."""
    return replace(problem, edges=[_isotropic(edge) for edge in problem.edges])


def is_isotropic(edges: Sequence[Edge]) -> bool:
    """Whether SE-Sync's weights are all that the information matrices say."""
    return all(e.information is None and np.allclose(e.covariance, _isotropic(e).covariance, rtol=1e-6, atol=0.0) for e in edges)


def _weights(edge: Edge) -> tuple[float, float]:
    """kappa and tau."""
    matrix = np.asarray(np.linalg.inv(edge.covariance) if edge.information is None else edge.information)
    return 0.5 * _harmonic(matrix[:3, :3]), _harmonic(matrix[3:, 3:])


def _harmonic(block: Array) -> float:
    """Harmonic mean of the eigenvalues, zero where one is."""
    values = np.linalg.eigvalsh(block)
    return float(len(values) / (1.0 / values).sum()) if values[0] > _LEAST_WEIGHT * values[-1] else 0.0


def _isotropic(edge: Edge) -> Edge:
    kappa, tau = _weights(edge)
    diagonal = np.repeat([2.0 * kappa, tau], 3)
    known = diagonal > _LEAST_WEIGHT * diagonal.max()
    if known.all():
        return replace(edge, covariance=np.diag(1.0 / diagonal), information=None)
    return replace(edge, information=np.diag(diagonal))
