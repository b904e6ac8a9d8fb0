"""The pose graph while the robot drives: what a new vertex changes is solved for, the rest is kept (gtsam's iSAM2)."""

from __future__ import annotations

from collections.abc import Sequence

import gtsam
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array
from scipy.sparse.linalg import SuperLU, splu

from pose_graph_mapping.graph.graph_measurements import Edge, Gravity
from pose_graph_mapping.graph.graph_problem import GraphProblem, edge_factor, gravity_factor, poses_of, singular_is_told

Array = NDArray[np.float64]

_RELINEARISED_BEYOND = 1e-3
_MOST_UPDATES = 20


class IncrementalGraph:
    """Poses of a growing graph; the same calls give the same bits."""

    def __init__(self, problem: GraphProblem) -> None:
        """Start with `problem`, whose poses are its solution."""
        params = gtsam.ISAM2Params()
        params.setRelinearizeThreshold(_RELINEARISED_BEYOND)
        params.relinearizeSkip = 1
        self._isam = gtsam.ISAM2(params)
        self._bias = problem.bias
        self._gravity = list(problem.gravity)
        self._vertices = len(problem.poses)
        self._equations: SuperLU | None = None  # this and the next: of the present solution, once somebody asked
        self._covariances: dict[int, Array] = {}
        places = self._update(problem.factors(), problem.values())
        self._places = places[len(places) - len(self._gravity) :]  # of the factors of gravity, which come last

    @property
    def vertices(self) -> int:
        """How many vertices it has."""
        return self._vertices

    def grow(self, new_poses: Array, edges: Sequence[Edge], gravity: Sequence[Gravity]) -> None:
        """Add vertices (K, 4, 4), which take the next numbers, with what was measured of them. Nothing new changes nothing."""
        if not (len(new_poses) or edges or gravity):
            return
        factors, values = gtsam.NonlinearFactorGraph(), gtsam.Values()
        for k, T in enumerate(new_poses, self._vertices):
            values.insert(k, gtsam.Pose3(T))
        for edge in edges:
            factors.add(edge_factor(edge))
        for measured in gravity:
            factors.add(gravity_factor(measured, self._bias))
        self._vertices += len(new_poses)
        self._gravity += gravity
        self._places += self._update(factors, values)[len(edges) :]

    def relevel(self, bias: Array) -> None:
        """Take the bias (3,) of all measured up directions for another one."""
        self._bias = bias
        factors = gtsam.NonlinearFactorGraph()
        for measured in self._gravity:
            factors.add(gravity_factor(measured, bias))
        self._places = self._update(factors, gtsam.Values(), self._places)

    def poses(self) -> Array:
        """(V, 4, 4) present estimates."""
        return poses_of(self._estimate, self._vertices)

    def relative_covariance(self, i: int, j: int) -> Array:
        """(6, 6) covariance of T_i_j, rotation first, in the body frame of j, of everything measured."""
        with singular_is_told():
            joint = self._isam.jointMarginalCovariance([i, j])
        return self._relative(i, j, (joint.at(i, i), joint.at(i, j), joint.at(j, j)))

    def relative_covariances(self, ids: Sequence[int], j: int) -> Array:
        """(N, 6, 6) the same of T_i_j for many i: with one solution for j in place of one for each pair."""
        if not ids:
            return np.empty((0, 6, 6))
        if self._equations is None:
            with singular_is_told():
                self._equations = self._factorised()
        unit = np.zeros((6 * self._vertices, 6))
        unit[6 * j : 6 * j + 6] = np.eye(6)
        to_j = self._equations.solve(unit).reshape(-1, 6, 6)
        found = [self._relative(i, j, (self._covariance(i), to_j[i], to_j[j])) for i in ids]
        return np.array(found)

    def disagreement(self, edge: Edge) -> float:
        """Half of the squared Mahalanobis distance between an edge that is not part of it yet and what it holds of its two vertices."""
        held = self._estimate.atPose3(edge.i).between(self._estimate.atPose3(edge.j))
        residual = gtsam.Pose3.Logmap(gtsam.Pose3(edge.T_i_j).between(held))
        return 0.5 * float(residual @ np.linalg.solve(edge.covariance + self.relative_covariance(edge.i, edge.j), residual))

    def _covariance(self, i: int) -> Array:
        if i not in self._covariances:
            with singular_is_told():
                self._covariances[i] = self._isam.marginalCovariance(i)
        return self._covariances[i]

    def _relative(self, i: int, j: int, joint: tuple[Array, Array, Array]) -> Array:
        """From the covariances of i, of i with j, and of j."""
        ii, ij, jj = joint
        adjoint = self._estimate.atPose3(j).between(self._estimate.atPose3(i)).AdjointMap()
        covariance = jj - adjoint @ ij - (adjoint @ ij).T + adjoint @ ii @ adjoint.T
        return np.asarray(0.5 * (covariance + covariance.T))

    def _factorised(self) -> SuperLU:
        """The normal equations, of six rows a vertex, in factors."""
        linear = self._isam.getFactorsUnsafe().linearize(self._isam.getLinearizationPoint())
        rows, columns, entries = np.asarray(linear.sparseJacobian_())  # counted from 1; the last column is the right side
        size, is_left = 6 * self._vertices, columns <= 6 * self._vertices
        places = rows[is_left].astype(np.intp) - 1, columns[is_left].astype(np.intp) - 1
        jacobian = csc_array((entries[is_left], places), shape=(int(rows.max()), size))
        return splu((jacobian.T @ jacobian).tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})

    def _update(self, factors: gtsam.NonlinearFactorGraph, values: gtsam.Values, replaced: Sequence[int] = ()) -> list[int]:
        """Where the new factors are kept, for whoever replaces them."""
        self._equations, self._covariances = None, {}
        with singular_is_told():
            places = list(self._isam.update(factors, values, list(replaced)).getNewFactorsIndices())
            for _ in range(_MOST_UPDATES):
                if self._isam.update().getVariablesRelinearized() == 0:
                    break
            self._estimate = self._isam.calculateEstimate()
        return places
