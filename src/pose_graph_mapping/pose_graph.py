"""The pose graph of Algorithms 1 and 2: vertices are sweeps, edges what is known between them, gtsam finds the likeliest poses.

The thesis uses g2o; its file format stays the exchange format. Below a few hundred vertices a batch optimisation takes milliseconds,
so nothing is kept between two of them and the same edges always give the same poses.
"""

from __future__ import annotations

import enum
import heapq
import os
from dataclasses import dataclass
from pathlib import Path

import gtsam
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rigid_geometry import as_transform, quat_xyzw_from_transform, transform_from_quat

Array = NDArray[np.float64]

_PRIOR_SIGMA = 1e-3
_FREE_TILT_SIGMA_RAD = 0.2
_TRANSLATION_FIRST = np.array([3, 4, 5, 0, 1, 2])
_UPPER = np.triu_indices(6)


class EdgeKind(enum.Enum):
    """Where an edge comes from."""

    ODOMETRY = "odometry"
    MATCH = "match"
    LOOP = "loop"


@dataclass(frozen=True, eq=False)
class Edge:
    """A measured transform between two vertices; covariance (6, 6) rotation first, in the body frame of `j`."""

    i: int
    j: int
    T_i_j: Array
    covariance: Array
    kind: EdgeKind


@dataclass(frozen=True, eq=False)
class _Gravity:
    vertex_id: int
    up_body: Array
    sigma_rad: float


def as_covariance(matrix: ArrayLike) -> Array:
    """A checked (6, 6) covariance; ValueError when it is not finite, symmetric and positive definite."""
    covariance = np.asarray(matrix, dtype=np.float64)
    if covariance.shape != (6, 6) or not np.isfinite(covariance).all():
        raise ValueError(f"a covariance is a finite 6x6 matrix, not shape {covariance.shape}: {matrix!r}")
    smallest = float(np.linalg.eigvalsh(covariance)[0])
    if not np.allclose(covariance, covariance.T, rtol=1e-6, atol=1e-12) or smallest <= 0.0:
        raise ValueError(f"a covariance is symmetric and positive definite; smallest eigenvalue {smallest:.3g}")
    return covariance


class PoseGraph:
    """Vertices 0, 1, .. with poses T_map_base, edges of three kinds, and the up direction measured at vertices."""

    def __init__(self, loop_cauchy_k: float = 1.0) -> None:
        self._cauchy_k = loop_cauchy_k
        self._poses: list[Array] = []
        self._edges: list[Edge] = []
        self._gravity: list[_Gravity] = []

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

    def add_gravity(self, vertex_id: int, up_body: ArrayLike, sigma_rad: float) -> None:
        """The direction (3,) that was up in the body frame of a vertex; the map's up is its z axis."""
        if not sigma_rad > 0.0:
            raise ValueError(f"sigma_rad must be positive, not {sigma_rad}")
        self._gravity.append(_Gravity(self._known(vertex_id), unit_up(up_body), sigma_rad))

    def pose(self, vertex_id: int) -> Array:
        """(4, 4) current estimate T_map_base of a vertex."""
        return self._poses[self._known(vertex_id)]

    def poses(self) -> Array:
        """(V, 4, 4) current estimates."""
        return np.array(self._poses).reshape(-1, 4, 4)

    def edges(self) -> list[tuple[int, int, EdgeKind]]:
        """(i, j, kind) of every edge in the order of their arrival, for drawing."""
        return [(edge.i, edge.j, edge.kind) for edge in self._edges]

    def measurements(self) -> list[Edge]:
        """Every edge with what it measured."""
        return list(self._edges)

    def neighbours(self, vertex_id: int) -> list[int]:
        """Ids of the vertices that share an edge with a vertex, in ascending order."""
        self._known(vertex_id)
        return sorted({e.j if e.i == vertex_id else e.i for e in self._edges if vertex_id in (e.i, e.j)})

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

    def optimise(self) -> None:
        """Move all vertices to the likeliest poses (Levenberg-Marquardt, batch); the first keeps position and heading.

        A loop after much drift starts so far out that a robust loss hardly feels it. So with loops a second start is the solution that
        trusts them, and the better of both ends stays: a true loop closes, a false one, dearer to follow than to ignore, does not.
        """
        if len(self._poses) < 2 and not self._gravity:
            return
        values, factors = self._values(), self._factors(robust=True)
        ends = [_minimised(factors, values)]
        if any(edge.kind is EdgeKind.LOOP for edge in self._edges):
            ends.append(_minimised(factors, _minimised(self._factors(robust=False), values)))
        best = min(ends, key=factors.error)
        self._poses = [orthonormal(np.asarray(best.atPose3(k).matrix())) for k in range(len(self._poses))]

    def g2o_text(self) -> str:
        """VERTEX_SE3:QUAT and EDGE_SE3:QUAT lines; kinds of edges as comments, measured gravity is not part of the format."""
        lines = [f"VERTEX_SE3:QUAT {k} {_pose_text(T)}" for k, T in enumerate(self._poses)]
        for edge in self._edges:
            information = np.linalg.inv(edge.covariance)[np.ix_(_TRANSLATION_FIRST, _TRANSLATION_FIRST)]
            lines.append(f"EDGE_SE3:QUAT {edge.i} {edge.j} {_pose_text(edge.T_i_j)} {_numbers(information[_UPPER])}")
        lines += [f"# KIND {edge.i} {edge.j} {edge.kind.value}" for edge in self._edges]
        return "".join(line + "\n" for line in lines)

    def save_g2o(self, path: str | os.PathLike[str]) -> None:
        """Write `g2o_text` to a file."""
        Path(path).write_text(self.g2o_text(), encoding="ascii")

    @classmethod
    def load_g2o(cls, path: str | os.PathLike[str], loop_cauchy_k: float = 1.0) -> PoseGraph:
        """A graph from a g2o file with SE3 vertices 0, 1, ..; ValueError names the line that cannot be read.

        Without comments that tell kinds, an edge to the next vertex is odometry and any other a loop.
        """
        graph, kinds = cls(loop_cauchy_k), []
        for number, line in enumerate(Path(path).read_text(encoding="ascii").splitlines(), 1):
            try:
                kinds += graph._read_line(line.split())
            except (ValueError, IndexError) as error:
                raise ValueError(f"{path}, line {number}: {error}") from error
        if len(kinds) == len(graph._edges):
            graph._edges = [Edge(e.i, e.j, e.T_i_j, e.covariance, kind) for e, kind in zip(graph._edges, kinds, strict=True)]
        return graph

    def _read_line(self, words: list[str]) -> list[EdgeKind]:
        if words[:2] == ["#", "KIND"]:
            return [EdgeKind(words[4])]
        if words[:1] == ["VERTEX_SE3:QUAT"]:
            if int(words[1]) != len(self._poses):
                raise ValueError(f"vertex {words[1]} where {len(self._poses)} is next")
            self.add_vertex(_pose_of(words[2:9]))
        elif words[:1] == ["EDGE_SE3:QUAT"]:
            i, j = int(words[1]), int(words[2])
            kind = EdgeKind.ODOMETRY if abs(i - j) == 1 else EdgeKind.LOOP
            self.add_edge(i, j, _pose_of(words[3:10]), _covariance_of(words[10:31]), kind)
        return []

    def _known(self, vertex_id: int) -> int:
        if not 0 <= vertex_id < len(self._poses):
            raise ValueError(f"vertex {vertex_id} is unknown; there are {len(self._poses)}")
        return vertex_id

    def _all_neighbours(self) -> list[list[int]]:
        found: list[set[int]] = [set() for _ in self._poses]
        for edge in self._edges:
            found[edge.i].add(edge.j)
            found[edge.j].add(edge.i)
        return [sorted(ids) for ids in found]

    def _values(self) -> gtsam.Values:
        values = gtsam.Values()
        for k, T in enumerate(self._poses):
            values.insert(k, gtsam.Pose3(T))
        return values

    def _factors(self, robust: bool) -> gtsam.NonlinearFactorGraph:
        factors = gtsam.NonlinearFactorGraph()
        factors.add(gtsam.PriorFactorPose3(0, gtsam.Pose3(self._poses[0]), self._prior_noise()))
        for edge in self._edges:
            factors.add(gtsam.BetweenFactorPose3(edge.i, edge.j, gtsam.Pose3(edge.T_i_j), self._edge_noise(edge, robust)))
        up_map = gtsam.Unit3(np.array([0.0, 0.0, 1.0]))
        for measured in self._gravity:
            sigma = gtsam.noiseModel.Isotropic.Sigma(2, measured.sigma_rad)
            factors.add(gtsam.AttitudeFactorPose3(measured.vertex_id, up_map, sigma, gtsam.Unit3(measured.up_body)))
        return factors

    def _edge_noise(self, edge: Edge, robust: bool) -> gtsam.noiseModel.Base:
        """Gaussian; for a loop under Cauchy's loss, which one false edge among true ones cannot bend."""
        gaussian = gtsam.noiseModel.Gaussian.Covariance(edge.covariance)
        if edge.kind is not EdgeKind.LOOP or not robust:
            return gaussian
        return gtsam.noiseModel.Robust.Create(gtsam.noiseModel.mEstimator.Cauchy.Create(self._cauchy_k), gaussian)

    def _prior_noise(self) -> gtsam.noiseModel.Base:
        """The first vertex holds position and heading; its tilt is left to the measured gravity, where there is any."""
        tilt = _FREE_TILT_SIGMA_RAD if self._gravity else _PRIOR_SIGMA
        return gtsam.noiseModel.Diagonal.Sigmas(np.array([tilt, tilt, _PRIOR_SIGMA, _PRIOR_SIGMA, _PRIOR_SIGMA, _PRIOR_SIGMA]))


def _minimised(factors: gtsam.NonlinearFactorGraph, start: gtsam.Values) -> gtsam.Values:
    params = gtsam.LevenbergMarquardtParams()
    params.setMaxIterations(100)
    params.setRelativeErrorTol(1e-9)
    return gtsam.LevenbergMarquardtOptimizer(factors, start, params).optimize()


def orthonormal(T: Array) -> Array:
    """The transform with the nearest rotation (SVD): composing each pose from the last one triples any error of the one before."""
    U, _, Vt = np.linalg.svd(T[:3, :3])
    clean = T.copy()
    clean[:3, :3] = U @ Vt
    return clean


def unit_up(up_body: ArrayLike) -> Array:
    """(3,) unit vector of a measured up direction; ValueError when it has no direction."""
    up = np.asarray(up_body, dtype=np.float64)
    if up.shape != (3,) or not np.isfinite(up).all() or np.linalg.norm(up) < 1e-6:
        raise ValueError(f"an up direction is a finite vector of three, not zero: {up_body!r}")
    return np.asarray(up / np.linalg.norm(up))


def _numbers(values: ArrayLike) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _pose_text(T: Array) -> str:
    return f"{_numbers(T[:3, 3])} {_numbers(quat_xyzw_from_transform(T))}"


def _pose_of(words: list[str]) -> Array:
    x, y, z, qx, qy, qz, qw = (float(w) for w in words)
    return transform_from_quat((x, y, z), (qx, qy, qz, qw))


def _covariance_of(words: list[str]) -> Array:
    if len(words) != 21:
        raise ValueError(f"{len(words)} numbers of an information matrix, 21 wanted")
    upper = np.zeros((6, 6))
    upper[_UPPER] = [float(w) for w in words]
    information = upper + np.triu(upper, 1).T
    return np.asarray(np.linalg.inv(information[np.ix_(_TRANSLATION_FIRST, _TRANSLATION_FIRST)]))
