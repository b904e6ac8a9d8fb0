"""Pose graphs as text: g2o's and TORO's files, 3-D and 2-D, read for what they say of poses, and written in g2o's format.

Poses, edges between them, priors and sensor offsets are used. What else a file holds, landmarks and planes for example, is counted and
left out. A comment "# KIND i j kind" an edge tells odometry, match and loop apart, in whatever order; other readers skip it.
"""

from __future__ import annotations

import dataclasses
import os
import re
from collections import Counter, defaultdict, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import gtsam
import numpy as np
from numpy.typing import ArrayLike, NDArray

from pose_graph_mapping.graph.graph_lines import (
    EDGES,
    PLANE,
    PRIORS,
    QUAT,
    SWAPPED,
    UPPER,
    UPPER_2D,
    VERTICES,
    Information,
    MeasuredForm,
    PoseForm,
    floats,
    information,
    is_stretched,
    moved,
    vertex_id,
)
from pose_graph_mapping.graph.graph_measurements import Edge, EdgeKind, Prior
from rigid_geometry import inverse, quat_xyzw_from_transform, yaw_of

Array = NDArray[np.float64]

_OFFSET = "PARAMS_SE3OFFSET"
_KIND_COMMENT = re.compile(r"# KIND (\d+) (\d+) (odometry|match|loop)")


@dataclass(eq=False)
class GraphFile:
    """What a file says: poses (4, 4) of the vertices it has, edges between ids, their lines, priors, and which vertices are fixed.

    left_out: kinds of lines that are not used, with their count; other_vertices: ids of vertices that are no poses; is_2d: all lies in
    the plane z = 0; empty_edges: lines of edges and priors whose information is zero; stretched: quaternions that were not of length one.
    """

    poses: dict[int, Array] = field(default_factory=dict)
    edges: list[Edge] = field(default_factory=list)
    edge_lines: list[int] = field(default_factory=list)
    priors: list[Prior] = field(default_factory=list)
    fixed: list[int] = field(default_factory=list)
    left_out: Counter[str] = field(default_factory=Counter)
    other_vertices: set[int] = field(default_factory=set)
    is_2d: bool = False
    empty_edges: list[int] = field(default_factory=list)
    stretched: int = 0


def read_graph_file(path: str | os.PathLike[str]) -> GraphFile:
    """A graph from a file; ValueError names the line that cannot be read, OSError as the system gives it.

    Without comments that tell kinds, an edge between ids that follow each other among those of the file is odometry and any other a loop.
    """
    try:
        return graph_of_text(Path(path).read_text(encoding="utf-8-sig", errors="replace"))
    except ValueError as error:
        raise ValueError(f"{os.fspath(path)}, {error}") from error


def graph_of_text(text: str) -> GraphFile:
    """A graph from the text of a file; ValueError names the line."""
    reader = _Reader()
    lines = list(enumerate(text.splitlines(), 1))
    for is_offset in (True, False):  # they may be used before they are given
        for number, line in lines:
            if line.startswith(_OFFSET) is is_offset:
                try:
                    reader.read(number, line)
                except ValueError as error:
                    raise ValueError(f"line {number}: {error}") from error
    return reader.finished()


class _Reader:
    """Lines in, a GraphFile out."""

    def __init__(self) -> None:
        self.file = GraphFile()
        self.offsets: dict[int, Array] = {}
        self.told: defaultdict[tuple[int, int], deque[tuple[int, EdgeKind]]] = defaultdict(deque)
        self.is_empty: list[bool] = []

    def read(self, number: int, line: str) -> None:
        """What one line says; comments are skipped, but for kinds of edges."""
        if kind := _KIND_COMMENT.fullmatch(line.strip()):
            self.told[int(kind[1]), int(kind[2])].append((number, EdgeKind(kind[3])))
        words = line.split("#", 1)[0].split()
        if not words:
            return
        tag, rest = words[0], words[1:]
        if tag in VERTICES:
            self._vertex(VERTICES[tag], rest)
        elif tag in EDGES:
            self._edge(EDGES[tag], rest, number)
        elif tag in PRIORS:
            self._prior(PRIORS[tag], rest, number)
        elif tag == _OFFSET:
            self.offsets[vertex_id(_at(rest, 0))] = self._pose(QUAT, rest[1:])
        elif tag == "FIX":
            self.file.fixed += [vertex_id(word) for word in rest]
        else:
            self._unused(tag, rest)

    def finished(self) -> GraphFile:
        """What was read, with the kinds of its edges; edges without information are left out."""
        file = self.file
        told = self._kinds_by_comment() if self.told else _kinds_by_number(file)
        rows = zip(file.edges, told, file.edge_lines, self.is_empty, strict=True)
        kept = [(dataclasses.replace(edge, kind=kind), line) for edge, kind, line, is_empty in rows if not is_empty]
        file.edges, file.edge_lines = [edge for edge, _ in kept], [line for _, line in kept]
        return file

    def _kinds_by_comment(self) -> list[EdgeKind]:
        """Comments and edges between the same vertices belong together in their order; ValueError where one is left over."""
        kinds = []
        for edge, line in zip(self.file.edges, self.file.edge_lines, strict=True):
            told = self.told[edge.i, edge.j]
            if not told:
                raise ValueError(f"line {line}: the edge from {edge.i} to {edge.j} has no comment # KIND, though others have")
            kinds.append(told.popleft()[1])
        for (i, j), left in self.told.items():
            if left:
                raise ValueError(f"line {left[0][0]}: no edge goes from {i} to {j}, of which this comment # KIND tells")
        return kinds

    def _vertex(self, form: PoseForm, words: list[str]) -> None:
        k, T = vertex_id(_at(words, 0)), self._pose(form, words[1:])
        if k in self.file.poses and not np.allclose(self.file.poses[k], T, rtol=0.0, atol=1e-6):
            raise ValueError(f"vertex {k} is there twice, with another pose")
        self.file.poses[k] = T

    def _edge(self, form: MeasuredForm, words: list[str], number: int) -> None:
        (i, j), T, known = self._measured(form, words)
        if i == j:
            raise ValueError(f"an edge connects two vertices, not {i} with itself")
        partly = known.matrix if known.known < 6 else None
        self.file.edges.append(Edge(i, j, T, known.covariance, EdgeKind.LOOP, partly))
        self.file.edge_lines.append(number)
        self._note_empty(known, number)
        self.is_empty.append(known.known == 0)

    def _prior(self, form: MeasuredForm, words: list[str], number: int) -> None:
        (k,), T, known = self._measured(form, words)
        self._note_empty(known, number)
        if known.known:
            self.file.priors.append(Prior(k, T, known.matrix))

    def _note_empty(self, known: Information, number: int) -> None:
        if known.known == 0:
            self.file.empty_edges.append(number)

    def _measured(self, form: MeasuredForm, words: list[str]) -> tuple[list[int], Array, Information]:
        """Ids, transform between the vertices themselves, and its information."""
        ids = [vertex_id(_at(words, k)) for k in range(form.vertices + form.offsets)]
        numbers = words[len(ids) + form.skipped :]
        pose, length = form.pose, form.pose.length
        if len(numbers) != length + pose.triangle:
            raise ValueError(f"{len(numbers)} numbers where {length + pose.triangle} are wanted")
        T = self._pose(pose, numbers[:length])
        known = information(" ".join(numbers[length:]), pose.is_2d, pose.is_toro_2d)
        offsets = [self._offset(k) for k in ids[form.vertices :]]
        if any(not np.array_equal(offset, np.eye(4)) for offset in offsets):
            back = inverse(offsets[-1])
            T = (offsets[0] if len(offsets) == 2 else np.eye(4)) @ T @ back
            known = moved(known, np.asarray(gtsam.Pose3(back).AdjointMap()))
        return ids[: form.vertices], T, known

    def _offset(self, number: int) -> Array:
        if number not in self.offsets:
            raise ValueError(f"there is no line {_OFFSET} {number}")
        return self.offsets[number]

    def _pose(self, form: PoseForm, words: list[str]) -> Array:
        numbers = floats(words, form.length)
        if self.file.is_2d != form.is_2d and (self.file.poses or self.file.edges or self.file.priors):
            raise ValueError("2-D and 3-D poses are in one file")
        self.file.is_2d = form.is_2d
        self.file.stretched += form is QUAT and is_stretched(numbers)
        return form.read(numbers)

    def _unused(self, tag: str, words: list[str]) -> None:
        if not re.fullmatch(r"[A-Z][A-Z0-9_]*(:[A-Z0-9_]+)?", tag):
            raise ValueError(f"{tag[:40]!r} is none of {', '.join([*VERTICES, *EDGES, *PRIORS])}, FIX")
        if tag.startswith("VERTEX") and words and words[0].isdecimal():
            self.file.other_vertices.add(int(words[0]))
        if not tag.startswith("PARAMS"):
            self.file.left_out[tag] += 1


def g2o_text(
    poses: Mapping[int, Array], edges: Sequence[Edge], fixed: Sequence[int] = (), priors: Sequence[Prior] = (), is_2d: bool = False
) -> str:
    """The lines of a g2o file with the vertices `poses` (4, 4) by id; kinds of edges as comments."""
    pose, vertex, measured, prior_tag = (
        (_text_2d, "VERTEX_SE2", "EDGE_SE2", "EDGE_PRIOR_SE2")
        if is_2d
        else (_text_3d, "VERTEX_SE3:QUAT", "EDGE_SE3:QUAT", "EDGE_SE3_PRIOR")
    )
    lines = [f"{_OFFSET} 0 0 0 0 0 0 0 1"] if priors and not is_2d else []
    lines += [f"{vertex} {k} {pose(T)}" for k, T in poses.items()]
    lines += [f"FIX {k}" for k in fixed]
    for prior in priors:
        lines.append(
            f"{prior_tag} {prior.vertex_id}{'' if is_2d else ' 0'} {pose(prior.T_map_vertex)} {_triangle(prior.information, is_2d)}"
        )
    for edge in edges:
        matrix = np.asarray(np.linalg.inv(edge.covariance) if edge.information is None else edge.information)
        lines.append(f"{measured} {edge.i} {edge.j} {pose(edge.T_i_j)} {_triangle(matrix, is_2d)}")
    lines += [f"# KIND {edge.i} {edge.j} {edge.kind.value}" for edge in edges]
    return "".join(line + "\n" for line in lines)


def _at(words: Sequence[str], place: int) -> str:
    if place >= len(words):
        raise ValueError(f"the line ends after {len(words) + 1} words")
    return words[place]


def _kinds_by_number(file: GraphFile) -> list[EdgeKind]:
    ids = sorted({*file.poses, *(k for e in file.edges for k in (e.i, e.j))})
    place = {name: number for number, name in enumerate(ids)}
    return [EdgeKind.ODOMETRY if abs(place[e.i] - place[e.j]) == 1 else EdgeKind.LOOP for e in file.edges]


def _triangle(matrix: Array, is_2d: bool) -> str:
    return _numbers(matrix[PLANE][UPPER_2D] if is_2d else matrix[SWAPPED][UPPER])


def _numbers(values: ArrayLike) -> str:
    return " ".join(repr(float(v)) for v in np.ravel(values))


def _text_3d(T: Array) -> str:
    return f"{_numbers(T[:3, 3])} {_numbers(quat_xyzw_from_transform(T))}"


def _text_2d(T: Array) -> str:
    return _numbers((T[0, 3], T[1, 3], yaw_of(T)))
