"""A pose graph as gtsam solves it: factors of its measurements, errors of its edges, and the likeliest poses (Levenberg-Marquardt)."""

from __future__ import annotations

import dataclasses
import functools
import heapq
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import gtsam
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from pose_graph_mapping.graph.graph_measurements import Edge, EdgeKind, GraphNotSolvable, Gravity, Prior, orthonormal
from rigid_geometry import inverse

Array = NDArray[np.float64]

_PRIOR_SIGMA = 1e-3
_FREE_TILT_SIGMA_RAD = 0.2
_UP_MAP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True, eq=False)
class GraphProblem:
    """poses (V, 4, 4) to start from; edges and gravity between them; bias (3,) of the measured up directions, in every body frame.

    fixed: vertices that stay where `poses` has them. Where gravity is measured they hold position and heading only.
    priors: measured poses of single vertices.
    """

    poses: Array
    edges: Sequence[Edge]
    gravity: Sequence[Gravity] = ()
    bias: Array | None = None
    fixed: tuple[int, ...] = (0,)
    priors: Sequence[Prior] = ()

    def values(self) -> gtsam.Values:
        """The start, as gtsam has it."""
        values = gtsam.Values()
        for k, T in enumerate(self.poses):
            values.insert(k, gtsam.Pose3(T))
        return values

    def factors(self, weights: Array | None = None) -> gtsam.NonlinearFactorGraph:
        """Everything measured; `weights` (E,) of the information of the edges, those of weight zero are left out."""
        graph = gtsam.NonlinearFactorGraph()
        for factor in self.anchors():
            graph.add(factor)
        for k, edge in enumerate(self.edges):
            weight = 1.0 if weights is None else float(weights[k])
            if weight > 0.0:
                graph.add(self._edge_factors[k] if weight == 1.0 else edge_factor(edge, weight))
        for measured in self.gravity:
            graph.add(gravity_factor(measured, self.bias))
        for prior in self.priors:
            graph.add(prior_factor(prior))
        return graph

    def anchors(self) -> list[gtsam.PriorFactorPose3]:
        """What holds the fixed vertices."""
        tilt = _FREE_TILT_SIGMA_RAD if self.gravity else _PRIOR_SIGMA
        noise = gtsam.noiseModel.Diagonal.Sigmas(np.array([tilt, tilt, _PRIOR_SIGMA, _PRIOR_SIGMA, _PRIOR_SIGMA, _PRIOR_SIGMA]))
        return [gtsam.PriorFactorPose3(k, gtsam.Pose3(self.poses[k]), noise) for k in self.fixed]

    def edge_errors(self, values: gtsam.Values) -> Array:
        """(E,) half of the squared Mahalanobis distance of every edge, which is what gtsam sums up as error."""
        return np.array([factor.error(values) for factor in self._edge_factors], dtype=np.float64)

    @functools.cached_property
    def _edge_factors(self) -> list[gtsam.BetweenFactorPose3]:
        return [edge_factor(edge) for edge in self.edges]


def edge_factor(edge: Edge, weight: float = 1.0) -> gtsam.BetweenFactorPose3:
    """The factor of an edge, its information multiplied by `weight`."""
    if edge.information is None:
        noise = gtsam.noiseModel.Gaussian.Covariance(edge.covariance / weight)
    else:
        noise = _noise(weight * edge.information)
    return gtsam.BetweenFactorPose3(edge.i, edge.j, gtsam.Pose3(edge.T_i_j), noise)


def prior_factor(prior: Prior) -> gtsam.PriorFactorPose3:
    """The factor of a measured pose."""
    return gtsam.PriorFactorPose3(prior.vertex_id, gtsam.Pose3(prior.T_map_vertex), _noise(prior.information))


def _noise(information: Array) -> gtsam.noiseModel.Gaussian:
    """Of an information matrix that may be singular; gtsam wants its root to be upper triangular."""
    values, vectors = np.linalg.eigh(information)
    root = np.linalg.qr(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T, mode="r")
    return gtsam.noiseModel.Gaussian.SqrtInformation(np.where(np.diag(root) < 0.0, -1.0, 1.0)[:, None] * root, False)


def gravity_factor(measured: Gravity, bias: Array | None) -> gtsam.AttitudeFactorPose3:
    """The factor of a measured up direction, less the bias that turns with the body."""
    up = measured.up_body if bias is None else measured.up_body - bias
    sigma = gtsam.noiseModel.Isotropic.Sigma(2, measured.sigma_rad)
    return gtsam.AttitudeFactorPose3(measured.vertex_id, gtsam.Unit3(_UP_MAP), sigma, gtsam.Unit3(up))


def poses_of(values: gtsam.Values, count: int) -> Array:
    """(V, 4, 4) poses of vertices 0 to count - 1."""
    return orthonormal(np.array([values.atPose3(k).matrix() for k in range(count)], dtype=np.float64).reshape(-1, 4, 4))


def minimised(
    factors: gtsam.NonlinearFactorGraph,
    start: gtsam.Values,
    iterations: int = 100,
    relative_tolerance: float = 1e-9,
    absolute_tolerance: float = 1e-5,
) -> gtsam.Values:
    """The likeliest values (Levenberg-Marquardt); GraphNotSolvable when the equations are singular."""
    params = gtsam.LevenbergMarquardtParams()
    params.setMaxIterations(iterations)
    params.setRelativeErrorTol(relative_tolerance)
    params.setAbsoluteErrorTol(absolute_tolerance)
    with singular_is_told():
        return gtsam.LevenbergMarquardtOptimizer(factors, start, params).optimize()


@contextmanager
def singular_is_told() -> Iterator[None]:
    """gtsam's word for singular equations as GraphNotSolvable."""
    try:
        yield
    except RuntimeError as error:
        raise GraphNotSolvable(f"the equations of the graph are singular: {' '.join(str(error).split())[:200]}") from error


def tree_poses(vertices: int, edges: Sequence[Edge], roots: Mapping[int, Array]) -> Array:
    """(V, 4, 4) poses of a spanning tree, grown from `roots` along the surest edges, and along loops where nothing else leads.

    A vertex that no edge leads to from a root is GraphNotSolvable.
    """
    beside: list[list[tuple[bool, float, int]]] = [[] for _ in range(vertices)]
    for k, edge in enumerate(edges):
        rank = (edge.kind is EdgeKind.LOOP, float(np.trace(edge.covariance)), k)
        beside[edge.i].append(rank)
        beside[edge.j].append(rank)
    poses: dict[int, Array] = dict(roots)
    queue = [(rank, at) for at in sorted(poses) for rank in beside[at]]
    heapq.heapify(queue)
    while queue:
        rank, at = heapq.heappop(queue)
        edge = edges[rank[2]]
        to = edge.j if at == edge.i else edge.i
        if to not in poses:
            poses[to] = poses[at] @ (edge.T_i_j if at == edge.i else inverse(edge.T_i_j))
            for onward in beside[to]:
                heapq.heappush(queue, (onward, to))
    lost = [k for k in range(vertices) if k not in poses]
    if lost:
        raise GraphNotSolvable(f"no edge leads from vertex {min(poses)} to vertex {lost[0]}; {len(lost)} vertices hang apart")
    return orthonormal(np.array([poses[k] for k in range(vertices)]))


def grown(problem: GraphProblem) -> GraphProblem:
    """The problem with the poses that a spanning tree gives from the fixed vertices, and from the first of every part without one."""
    number = parts(problem)
    held = {int(number[k]): k for k in reversed(problem.fixed)}
    for k, part in enumerate(number):
        held.setdefault(int(part), k)
    roots = {k: problem.poses[k] for k in {*held.values(), *problem.fixed}}
    return dataclasses.replace(problem, poses=tree_poses(len(problem.poses), problem.edges, roots))


def parts(problem: GraphProblem) -> NDArray[np.int64]:
    """(V,) the number of the part that each vertex belongs to."""
    i, j = [e.i for e in problem.edges], [e.j for e in problem.edges]
    vertices = len(problem.poses)
    _, label = connected_components(coo_array((np.ones(len(i)), (i, j)), shape=(vertices, vertices)), directed=False)
    return np.asarray(label, dtype=np.int64)
