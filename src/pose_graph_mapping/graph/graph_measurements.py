"""What a pose graph is made of: edges between vertices and directions of gravity, each checked where it comes in."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class EdgeKind(enum.Enum):
    """Where an edge comes from."""

    ODOMETRY = "odometry"
    MATCH = "match"
    LOOP = "loop"


@dataclass(frozen=True, eq=False)
class Edge:
    """A measured transform between two vertices; covariance (6, 6) rotation first, in the body frame of `j`.

    information (6, 6): what the edge knows where that is not all six directions; None: all of them, as the covariance says. Where it is
    given, the covariance is that of the directions known, and wide in the others.
    """

    i: int
    j: int
    T_i_j: Array
    covariance: Array
    kind: EdgeKind
    information: Array | None = None


@dataclass(frozen=True, eq=False)
class Prior:
    """A measured pose of one vertex; information (6, 6) rotation first, in its body frame, singular where not all is known."""

    vertex_id: int
    T_map_vertex: Array
    information: Array


@dataclass(frozen=True, eq=False)
class Gravity:
    """The direction that was up in the body frame of a vertex, unit (3,), with the sigma of an axis across it."""

    vertex_id: int
    up_body: Array
    sigma_rad: float


class GraphNotSolvable(ValueError):
    """A graph that has no solution, or more than one."""


def unit_up(up_body: ArrayLike) -> Array:
    """(3,) unit vector of a measured up direction; ValueError when it has no direction."""
    up = np.asarray(up_body, dtype=np.float64)
    if up.shape != (3,) or not np.isfinite(up).all() or np.linalg.norm(up) < 1e-6:
        raise ValueError(f"an up direction is a finite vector of three, not zero: {up_body!r}")
    return np.asarray(up / np.linalg.norm(up))


def orthonormal(T: Array) -> Array:
    """(.., 4, 4) transforms with the nearest rotations (SVD): composing each pose from the last one triples any error of the one before."""
    U, _, Vt = np.linalg.svd(T[..., :3, :3])
    clean = T.copy()
    clean[..., :3, :3] = U @ Vt
    return clean
