"""Generalised ICP (Segal et al., RSS 2009): every point stands for a piece of plane, thin across its normal, and planes are laid on planes.

The two sides of a thin wall are two surfaces: points that were seen from opposite sides are never laid on each other.
Gauss-Newton over motions of the body frame (rotation, translation), in which the Hessian is given too. Sums are serial, so that the same
input gives the same bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pose_graph_mapping.registration.cloud import Array, PointCloud, moved_points
from pose_graph_mapping.registration.gicp_surface import Surface, nearest
from pose_graph_mapping.registration.match_quality import exp_motion

_FLATNESS = 0.999  # a plane's variance across is 1 - _FLATNESS of that along it
_DAMPING = 1e-3  # of a motion that no point feels
_Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Stage:
    """Points are matched up to `distance_m`; one that is `half_weight_m` off, across its plane, counts half.

    It ends when a step is shorter than `precision`, in metres and in radians, or after so many iterations (1 or more).
    """

    distance_m: float
    iterations: int
    precision: float
    half_weight_m: float = math.inf


@dataclass(frozen=True, eq=False)
class Alignment:
    """T_target_source (4, 4), and of the last iteration: hessian (6, 6), rotation before translation, in the body frame of the source;
    inliers: points that took part; weight: the sum of their weights.
    """

    T: Array
    hessian: Array
    inliers: int
    weight: float
    iterations: int


@njit(cache=True, inline="always")
def _dot(a: _Vector, b: _Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, inline="always")
def _cross(a: _Vector, b: _Vector) -> _Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@njit(cache=True, inline="always")
def _turned_back(R: Array, v: _Vector) -> _Vector:
    return (
        R[0, 0] * v[0] + R[1, 0] * v[1] + R[2, 0] * v[2],
        R[0, 1] * v[0] + R[1, 1] * v[1] + R[2, 1] * v[2],
        R[0, 2] * v[0] + R[1, 2] * v[1] + R[2, 2] * v[2],
    )


@njit(cache=True, inline="always")
def _information(n: _Vector, m: _Vector) -> tuple[_Vector, _Vector, _Vector]:
    """Columns of the inverse of both planes' covariances together, I - _FLATNESS n n' and the same of m (Woodbury)."""
    half = 0.5 * _FLATNESS
    own_n, own_m, both = 1.0 - half * _dot(n, n), 1.0 - half * _dot(m, m), half * _dot(n, m)
    k = 0.5 * half / (own_n * own_m - both * both)
    u = (k * (own_m * n[0] + both * m[0]), k * (own_m * n[1] + both * m[1]), k * (own_m * n[2] + both * m[2]))
    v = (k * (both * n[0] + own_n * m[0]), k * (both * n[1] + own_n * m[1]), k * (both * n[2] + own_n * m[2]))
    return (
        (0.5 + n[0] * u[0] + m[0] * v[0], n[1] * u[0] + m[1] * v[0], n[2] * u[0] + m[2] * v[0]),
        (n[0] * u[1] + m[0] * v[1], 0.5 + n[1] * u[1] + m[1] * v[1], n[2] * u[1] + m[2] * v[1]),
        (n[0] * u[2] + m[0] * v[2], n[1] * u[2] + m[1] * v[2], 0.5 + n[2] * u[2] + m[2] * v[2]),
    )


@njit(cache=True, nogil=True)
def _normal_equations(
    points: Array,
    normals: Array,
    target_points: Array,
    target_normals: Array,
    index: NDArray[np.uint64],
    squared: Array,
    most: float,
    doubt: float,
    least_cos: float,
    T: Array,
) -> tuple[Array, Array, int, float]:
    """Hessian (6, 6) and gradient (6,) of half the squared Mahalanobis distances d^2 of pairs nearer than the root of `most`.

    Of those whose normals make a cosine of `least_cos` or more, weighed by 1 / (1 + doubt d^2), as Cauchy's loss does; also the number of
    pairs, and the sum of their weights.
    """
    H, gradient, pairs, weight, R = np.zeros((6, 6)), np.zeros(6), 0, 0.0, T[:3, :3]
    for i in range(len(points)):
        if squared[i] > most:
            continue
        j = index[i]
        p = (points[i, 0], points[i, 1], points[i, 2])
        q = _turned_back(R, (target_points[j, 0] - T[0, 3], target_points[j, 1] - T[1, 3], target_points[j, 2] - T[2, 3]))
        n = _turned_back(R, (target_normals[j, 0], target_normals[j, 1], target_normals[j, 2]))
        m = (normals[i, 0], normals[i, 1], normals[i, 2])
        if _dot(n, m) < least_cos:
            continue
        pairs += 1
        W = _information(n, m)
        X = (_cross(p, W[0]), _cross(p, W[1]), _cross(p, W[2]))
        r = (q[0] - p[0], q[1] - p[1], q[2] - p[2])
        pull = (_dot(W[0], r), _dot(W[1], r), _dot(W[2], r))
        turn = _cross(p, pull)
        w = 1.0 / (1.0 + doubt * _dot(r, pull))
        weight += w
        for a in range(3):
            gradient[a] -= w * turn[a]
            gradient[3 + a] -= w * pull[a]
            row = _cross(p, (X[0][a], X[1][a], X[2][a]))
            for b in range(3):
                H[a, b] += w * row[b]
                H[a, 3 + b] += w * X[b][a]
                H[3 + a, 3 + b] += w * W[b][a]
    H[3:, :3] = H[:3, 3:].T
    return H, gradient, pairs, weight


def align(target: Surface, source: PointCloud, T_start: Array, stage: Stage) -> Alignment:
    """Lay `source`, which has normals, on `target` from `T_start` (4, 4)."""
    assert source.normals is not None
    T, done, doubt = T_start, 0, 2.0 * (1.0 - _FLATNESS) / stage.half_weight_m**2
    least_cos = 0.0 if target.is_sided and source.origins is not None else -math.inf
    ranges = np.linalg.norm(source.points, axis=1)
    to_go = np.zeros(len(source))  # metres that a point must move at least to come into reach
    turn = shift = math.inf
    while max(turn, shift) >= stage.precision and done < stage.iterations:
        near = np.flatnonzero(to_go <= 0.0)
        points, normals = source.points[near], source.normals[near]
        index, squared = nearest(target.tree, moved_points(T, points))
        H, gradient, inliers, weight = _normal_equations(
            points, normals, target.points, target.normals, index, squared, stage.distance_m**2, doubt, least_cos, T
        )
        H += _DAMPING * np.eye(6)
        step = -np.asarray(np.linalg.solve(H, gradient), dtype=np.float64)
        turn, shift = float(np.linalg.norm(step[:3])), float(np.linalg.norm(step[3:]))
        T, done = T @ exp_motion(step), done + 1
        to_go[near] = np.sqrt(squared) - stage.distance_m
        to_go -= turn * ranges + shift
    return Alignment(T, H, inliers, weight, done)


def compile_kernels() -> None:
    """Compiles the kernel of this module for the types that a match passes."""
    index, one = np.zeros(1, dtype=np.uint64), np.zeros((1, 3))
    _normal_equations(one, one, one, one, index, np.zeros(1), 1.0, 0.0, 0.0, np.eye(4))
