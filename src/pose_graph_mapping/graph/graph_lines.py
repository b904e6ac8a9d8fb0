"""The lines of graph files: which kinds there are, and how their numbers become poses and information matrices.

A pose stands as x y z and a quaternion (g2o), as x y z roll pitch yaw about fixed axes (TORO), or as x y yaw (2-D). An information matrix
stands as its upper triangle, translation first; here it is rotation first. A 2-D pose lies in the plane z = 0. Its information gets some
for z, roll and pitch, which no 2-D line contradicts.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rigid_geometry import transform_from_quat, transform_from_rpy

Array = NDArray[np.float64]

PLANE = np.ix_([3, 4, 2], [3, 4, 2])
"""x, y and yaw among six directions, rotation first."""
SWAPPED = np.ix_([3, 4, 5, 0, 1, 2], [3, 4, 5, 0, 1, 2])
"""Rotation first to translation first, and back."""
UPPER, UPPER_2D = np.triu_indices(6), np.triu_indices(3)
_TORO_2D = np.array([0, 1, 4, 2, 5, 3])
"""Where xx, xy, xt, yy, yt, tt stand in TORO's lines: xx xy yy tt xt yt."""
_ROUNDING = 1e-5
"""Share of the largest eigenvalue that numbers of six digits may make one negative by; what is nearer to zero than that says nothing."""
_SINGULAR = 1e-12
_UNKNOWN_VARIANCE = 1e9
"""Of a direction that is not known, over the largest of those that are."""
_LARGEST = 1e50
"""Numbers beyond cannot be squared and summed."""
_UNIT_WITHIN, _LEAST_LENGTH = 0.01, 1e-3
"""Of a quaternion: nearer to length one is rounding, and below the least it has no direction."""


@dataclass(frozen=True)
class PoseForm:
    """How a pose stands in a line: in how many numbers, whether in the plane, and how its information's triangle is ordered."""

    read: Callable[[Array], Array]
    length: int
    is_2d: bool = False
    is_toro_2d: bool = False

    @property
    def triangle(self) -> int:
        """Numbers of the upper triangle of its information."""
        return 6 if self.is_2d else 21


@dataclass(frozen=True)
class MeasuredForm:
    """What stands before the pose and its information in a measured line: ids of vertices and of sensor offsets, and words not used."""

    pose: PoseForm
    vertices: int = 2
    offsets: int = 0
    skipped: int = 0


def vertex_id(word: str) -> int:
    """The whole number from 0 that a word is."""
    if not re.fullmatch(r"[0-9]{1,19}", word) or int(word) >= 1 << 63:
        raise ValueError(f"an id is a whole number from 0, not {word[:40]}")
    return int(word)


def floats(words: Sequence[str], count: int) -> Array:
    """(count,) finite numbers."""
    if len(words) != count:
        raise ValueError(f"{len(words)} numbers where {count} are wanted")
    if not re.fullmatch(r"[-+.0-9eE ]*", " ".join(words)):
        wrong = next(word for word in words if not re.fullmatch(r"[-+.0-9eE]+", word))
        raise ValueError(f"{wrong[:40]} is no finite number")
    numbers = np.array([float(word) for word in words])
    if not bool((np.abs(numbers) <= _LARGEST).all()):
        raise ValueError(f"{words[int(np.argmax(np.abs(numbers)))][:40]} is no finite number that can be squared")
    return numbers


def is_stretched(numbers: Array) -> bool:
    """Whether the quaternion of x y z qx qy qz qw is far from length one."""
    return abs(float(np.linalg.norm(numbers[3:])) - 1.0) > _UNIT_WITHIN


@dataclass(frozen=True, eq=False)
class Information:
    """An information matrix of a line, rotation first: covariance (6, 6), wide in directions that are not known.

    known: of how many of the six directions it knows something.
    """

    matrix: Array
    covariance: Array
    known: int


_NOTHING = Information(np.zeros((6, 6)), np.eye(6), 0)


@functools.lru_cache(maxsize=256)
def information(text: str, is_2d: bool = False, is_toro_2d: bool = False) -> Information:
    """Of the numbers of an upper triangle; ValueError where they are none of a matrix that is positive, or zero in some directions."""
    triangle = floats(text.split(), 6 if is_2d else 21)
    size, places = (3, UPPER_2D) if is_2d else (6, UPPER)
    given = np.zeros((size, size))
    given[places] = triangle[_TORO_2D] if is_toro_2d else triangle
    given += np.triu(given, 1).T
    checked = _positive(given)
    if is_2d:
        return _of_matrix(_lifted(checked)) if checked.any() else _NOTHING
    return _of_matrix(checked[SWAPPED])


def moved(known: Information, adjoint: Array) -> Information:
    """The information about another frame: `adjoint` (6, 6) makes small motions of this frame of those of that one."""
    return _of_matrix(adjoint.T @ known.matrix @ adjoint)


def _positive(matrix: Array) -> Array:
    """The matrix with what is next to zero made zero."""
    values, vectors = np.linalg.eigh(matrix)
    largest = float(np.abs(values).max())
    if float(values[0]) < -_ROUNDING * largest:
        raise ValueError(f"the information matrix is indefinite; its smallest eigenvalue is {values[0]:.3g}")
    if float(values[0]) > _SINGULAR * largest:
        return matrix
    held = np.where(values > _SINGULAR * largest, values, 0.0)
    return np.asarray((vectors * held) @ vectors.T)


def _lifted(plane: Array) -> Array:
    across = float(plane[0, 0] + plane[1, 1]) or 1.0
    matrix = np.diag([float(plane[2, 2]) or across, float(plane[2, 2]) or across, 0.0, 0.0, 0.0, across])
    matrix[PLANE] = plane
    return matrix


def _of_matrix(matrix: Array) -> Information:
    values, vectors = np.linalg.eigh(matrix)
    is_known = values > _SINGULAR * float(values[-1])
    known = int(np.count_nonzero(is_known))
    if known == 0:
        return _NOTHING
    if known == 6:
        covariance = np.linalg.inv(matrix)
    else:
        least = float(values[is_known][0])
        covariance = (vectors * np.where(is_known, 1.0 / np.where(is_known, values, 1.0), _UNKNOWN_VARIANCE / least)) @ vectors.T
    return Information(matrix, np.asarray(0.5 * (covariance + covariance.T)), known)


def _of_quat(numbers: Array) -> Array:
    length = float(np.linalg.norm(numbers[3:]))
    if length < _LEAST_LENGTH:
        raise ValueError(f"not a unit quaternion: ({', '.join(f'{v:g}' for v in numbers[3:])})")
    x, y, z, qx, qy, qz, qw = np.concatenate([numbers[:3], numbers[3:] / length]).tolist()
    return transform_from_quat((x, y, z), (qx, qy, qz, qw))


def _of_rpy(numbers: Array) -> Array:
    roll, pitch, yaw = numbers[3:].tolist()
    return transform_from_rpy(numbers[:3], (roll, pitch, yaw))


def _of_plane(numbers: Array) -> Array:
    x, y, yaw = numbers.tolist()
    return transform_from_rpy((x, y, 0.0), (0.0, 0.0, yaw))


QUAT = PoseForm(_of_quat, 7)
_RPY = PoseForm(_of_rpy, 6)
_SE2 = PoseForm(_of_plane, 3, is_2d=True)
_TORO_SE2 = PoseForm(_of_plane, 3, is_2d=True, is_toro_2d=True)

VERTICES = {"VERTEX_SE3:QUAT": QUAT, "VERTEX_SE3:EULER": _RPY, "VERTEX3": _RPY, "VERTEX_SE2": _SE2, "VERTEX2": _SE2}
EDGES = {
    "EDGE_SE3:QUAT": MeasuredForm(QUAT),
    "EDGE_SE3:EULER": MeasuredForm(_RPY),
    "EDGE3": MeasuredForm(_RPY),
    "EDGE_SE2": MeasuredForm(_SE2),
    "EDGE2": MeasuredForm(_TORO_SE2),
    "EDGE_SE3_OFFSET": MeasuredForm(QUAT, offsets=2),
    "EDGE_SE3_SWITCHABLE": MeasuredForm(QUAT, skipped=1),
    "EDGE_SE2_SWITCHABLE": MeasuredForm(_SE2, skipped=1),
}
PRIORS = {
    "EDGE_SE3_PRIOR": MeasuredForm(QUAT, vertices=1, offsets=1),
    "EDGE_PRIOR_SE2": MeasuredForm(_SE2, vertices=1),
    "EDGE_SE2_PRIOR": MeasuredForm(_SE2, vertices=1),
}
"""By their tags. The switch of a switchable edge is not used: whether an edge is false is judged here."""
