"""Pose graphs as text: g2o's VERTEX_SE3:QUAT, EDGE_SE3:QUAT and FIX, and TORO's 3-D VERTEX3 and EDGE3.

TORO writes a pose as x y z roll pitch yaw, fixed axes, and the upper triangle of the information in that order. A comment "# KIND i j kind"
an edge tells odometry, match and loop apart; other readers skip it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.graph.graph_measurements import Edge, EdgeKind, GraphNotSolvable
from rigid_geometry import quat_xyzw_from_transform, transform_from_quat, transform_from_rpy

Array = NDArray[np.float64]

_TRANSLATION_FIRST = np.array([3, 4, 5, 0, 1, 2])
_UPPER = np.triu_indices(6)
_SINGULAR = 1e-12


@dataclass(eq=False)
class GraphFile:
    """What a file says: poses (4, 4) of the vertices it has, edges between ids, their lines, and which vertices are fixed."""

    poses: dict[int, Array] = field(default_factory=dict)
    edges: list[Edge] = field(default_factory=list)
    edge_lines: list[int] = field(default_factory=list)
    fixed: list[int] = field(default_factory=list)


def read_graph_file(path: str | os.PathLike[str]) -> GraphFile:
    """A graph from a file; ValueError names the line that cannot be read, OSError as the system gives it.

    GraphNotSolvable for a singular information matrix. Without comments that tell kinds, an edge between ids that follow each other
    among those of the file is odometry and any other a loop.
    """
    file, kinds = GraphFile(), []
    for number, line in enumerate(Path(path).read_text(encoding="utf-8", errors="replace").splitlines(), 1):
        words = line.split()
        try:
            if words[:2] == ["#", "KIND"]:
                kinds.append(EdgeKind(words[4]))
            elif words and not words[0].startswith("#"):
                _read_line(file, words, number)
        except GraphNotSolvable as error:
            raise GraphNotSolvable(f"{path}, line {number}: {error}") from error
        except (ValueError, IndexError) as error:
            raise ValueError(f"{path}, line {number}: {error}") from error
    told = kinds if len(kinds) == len(file.edges) else _kinds_by_number(file)
    file.edges = [Edge(e.i, e.j, e.T_i_j, e.covariance, kind) for e, kind in zip(file.edges, told, strict=True)]
    return file


def g2o_text(poses: Mapping[int, Array], edges: Sequence[Edge], fixed: Sequence[int] = ()) -> str:
    """The lines of a g2o file with the vertices `poses` (4, 4) by id; kinds of edges as comments."""
    lines = [f"VERTEX_SE3:QUAT {k} {_pose_text(T)}" for k, T in poses.items()]
    lines += [f"FIX {k}" for k in fixed]
    for edge in edges:
        information = np.linalg.inv(edge.covariance)[np.ix_(_TRANSLATION_FIRST, _TRANSLATION_FIRST)]
        lines.append(f"EDGE_SE3:QUAT {edge.i} {edge.j} {_pose_text(edge.T_i_j)} {_numbers(information[_UPPER])}")
    lines += [f"# KIND {edge.i} {edge.j} {edge.kind.value}" for edge in edges]
    return "".join(line + "\n" for line in lines)


def _read_line(file: GraphFile, words: list[str], number: int) -> None:
    tag = words[0]
    if tag in _POSES and tag.startswith("VERTEX"):
        read, length = _POSES[tag]
        _add_vertex(file, _id(words[1]), read(_floats(words[2:], length)))
    elif tag in _POSES:
        read, length = _POSES[tag]
        i, j = _id(words[1]), _id(words[2])
        if i == j:
            raise ValueError(f"an edge connects two vertices, not {i} with itself")
        numbers = _floats(words[3:], length + 21)
        file.edges.append(Edge(i, j, read(numbers[:length]), _covariance(numbers[length:]), EdgeKind.LOOP))
        file.edge_lines.append(number)
    elif tag == "FIX":
        file.fixed += [_id(word) for word in words[1:]]
    elif tag != "PARAMS_SE3OFFSET":
        raise ValueError(f"{tag[:40]!r} is none of {', '.join(_POSES)}, FIX")


def _add_vertex(file: GraphFile, vertex_id: int, T: Array) -> None:
    if vertex_id in file.poses:
        raise ValueError(f"vertex {vertex_id} is there twice")
    file.poses[vertex_id] = T


def _kinds_by_number(file: GraphFile) -> list[EdgeKind]:
    ids = sorted({*file.poses, *(k for e in file.edges for k in (e.i, e.j))})
    place = {vertex_id: number for number, vertex_id in enumerate(ids)}
    return [EdgeKind.ODOMETRY if abs(place[e.i] - place[e.j]) == 1 else EdgeKind.LOOP for e in file.edges]


def _id(word: str) -> int:
    vertex_id = int(word)
    if not 0 <= vertex_id < 1 << 63:
        raise ValueError(f"an id is a whole number from 0, not {word}")
    return vertex_id


def _floats(words: Sequence[str], count: int) -> Array:
    if len(words) != count:
        raise ValueError(f"{len(words)} numbers where {count} are wanted")
    numbers = np.array([float(word) for word in words])
    if not np.isfinite(numbers).all():
        raise ValueError(f"{words[int(np.argmin(np.isfinite(numbers)))]} is no finite number")
    return numbers


def _pose_of_quat(numbers: Array) -> Array:
    x, y, z, qx, qy, qz, qw = numbers.tolist()
    return transform_from_quat((x, y, z), (qx, qy, qz, qw))


def _pose_of_rpy(numbers: Array) -> Array:
    roll, pitch, yaw = numbers[3:].tolist()
    return transform_from_rpy(numbers[:3], (roll, pitch, yaw))


def _covariance(upper: Array) -> Array:
    """(6, 6), rotation first, of the upper triangle of an information matrix, translation first."""
    triangle = np.zeros((6, 6))
    triangle[_UPPER] = upper
    information = triangle + np.triu(triangle, 1).T
    eigenvalues = np.linalg.eigvalsh(information)
    smallest, largest = float(eigenvalues[0]), float(np.abs(eigenvalues).max())
    if smallest < -_SINGULAR * largest:
        raise ValueError(f"the information matrix is indefinite; its smallest eigenvalue is {smallest:.3g}")
    if smallest <= _SINGULAR * largest:
        raise GraphNotSolvable(f"the information matrix is singular; its eigenvalues are {smallest:.3g} to {largest:.3g}")
    covariance = np.linalg.inv(information[np.ix_(_TRANSLATION_FIRST, _TRANSLATION_FIRST)])
    return np.asarray(0.5 * (covariance + covariance.T))


_POSES: dict[str, tuple[Callable[[Array], Array], int]] = {
    "VERTEX_SE3:QUAT": (_pose_of_quat, 7),
    "EDGE_SE3:QUAT": (_pose_of_quat, 7),
    "VERTEX3": (_pose_of_rpy, 6),
    "EDGE3": (_pose_of_rpy, 6),
}


def _numbers(values: ArrayLike) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _pose_text(T: Array) -> str:
    return f"{_numbers(T[:3, 3])} {_numbers(quat_xyzw_from_transform(T))}"
