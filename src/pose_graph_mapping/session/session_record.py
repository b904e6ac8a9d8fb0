"""What a session's index says of one sweep, as a line of JSON with a checksum: its file, what measured it, and what it did to the graph.

The same text, without the file, lies in the sweep's own file, so that a line that is lost can be had again.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.graph.pose_graph import Edge, EdgeKind, unit_up
from rigid_geometry import as_covariance, as_transform

Array = NDArray[np.float64]

_UPPER = np.triu_indices(6)
_CHECKSUM = ', "crc32": "'


@dataclass(frozen=True, eq=False)
class GraphChange:
    """What a sweep did to the graph: T_map_base (4, 4) of its own vertex and of those that moved, and the edges that it added."""

    poses: Mapping[int, Array] = field(default_factory=dict)
    added: tuple[Edge, ...] = ()


@dataclass(frozen=True, eq=False)
class Measured:
    """What is known of a sweep besides its points: T_odom_base (4, 4), and up in base_link (3,) with its sigma; None: not measured."""

    T_odom_base: Array
    gravity_base: Array | None = None
    gravity_sigma_rad: float | None = None

    def __post_init__(self) -> None:
        """ValueError for what is no transform, direction or sigma."""
        if self.gravity_sigma_rad is not None and not self.gravity_sigma_rad > 0.0:
            raise ValueError(f"gravity_sigma_rad must be positive, not {self.gravity_sigma_rad}")
        object.__setattr__(self, "T_odom_base", as_transform(self.T_odom_base))
        object.__setattr__(self, "gravity_base", None if self.gravity_base is None else unit_up(self.gravity_base))


@dataclass(frozen=True, eq=False)
class StoredSweep:
    """One line of the index: vertex, stamp, file below the session's folder, points, bytes and SHA-256 of it.

    measured and change are None in a session that was stored without its graph, which can be looked at but not gone on with.
    """

    vertex_id: int
    stamp_s: float
    file: str
    points: int
    bytes: int
    sha256: str
    measured: Measured | None = None
    change: GraphChange | None = None


class MeasuredEntry(TypedDict):
    """`Measured` as JSON has it; transforms are their upper three rows."""

    T_odom_base: list[float]
    gravity_base: list[float] | None
    gravity_sigma_rad: float | None


class EdgeEntry(TypedDict):
    """`Edge` as JSON has it; of the covariance the upper triangle."""

    i: int
    j: int
    kind: str
    T_i_j: list[float]
    covariance: list[float]


class ChangeEntry(TypedDict):
    """`GraphChange` as JSON has it."""

    poses: dict[str, list[float]]
    added: list[EdgeEntry]


class SweepEntry(TypedDict):
    """What a sweep's own file says of it, as JSON has it."""

    vertex_id: int
    stamp_s: float
    points: int
    measured: MeasuredEntry | None
    change: ChangeEntry | None


def payload_text(sweep: StoredSweep) -> str:
    """What a sweep's own file repeats of its line."""
    return json.dumps(_payload(sweep))


def index_line(sweep: StoredSweep) -> str:
    """The line of a sweep: a JSON object without newlines, its last value the CRC-32 of the text before."""
    entry = {**_payload(sweep), "file": sweep.file, "bytes": sweep.bytes, "sha256": sweep.sha256}
    text = json.dumps(entry)[:-1]
    return f'{text}{_CHECKSUM}{zlib.crc32(text.encode("ascii")):08x}"}}'


def sweep_of_line(line: str) -> StoredSweep:
    """The sweep that a line tells of; ValueError when a character of it has changed or something is missing."""
    text, found, rest = line.rpartition(_CHECKSUM)
    if not found:
        raise ValueError("it has no checksum")
    if rest != f'{zlib.crc32(text.encode("ascii", "replace")):08x}"}}':
        raise ValueError("its checksum is wrong")
    entry = json.loads(text + "}")
    return sweep_of_payload(entry, entry["file"], entry["bytes"], entry["sha256"])


def sweep_of_payload(entry: SweepEntry, file: str, size: int, sha256: str) -> StoredSweep:
    """The sweep that `payload_text` was made of, with its file; ValueError when something is missing or wrong."""
    try:
        measured, change = _measured_of(entry["measured"]), _change_of(entry["change"])
        return StoredSweep(int(entry["vertex_id"]), float(entry["stamp_s"]), file, int(entry["points"]), size, sha256, measured, change)
    except (KeyError, TypeError, IndexError) as error:
        raise ValueError(f"it lacks {error}") from error


def _payload(sweep: StoredSweep) -> SweepEntry:
    return {
        "vertex_id": sweep.vertex_id,
        "stamp_s": sweep.stamp_s,
        "points": sweep.points,
        "measured": None if sweep.measured is None else _measured_entry(sweep.measured),
        "change": None if sweep.change is None else _change_entry(sweep.change),
    }


def _measured_entry(measured: Measured) -> MeasuredEntry:
    return {
        "T_odom_base": _rows(measured.T_odom_base),
        "gravity_base": None if measured.gravity_base is None else measured.gravity_base.tolist(),
        "gravity_sigma_rad": measured.gravity_sigma_rad,
    }


def _measured_of(entry: MeasuredEntry | None) -> Measured | None:
    if entry is None:
        return None
    up = entry["gravity_base"]
    return Measured(_transform(entry["T_odom_base"]), None if up is None else np.array(up), entry["gravity_sigma_rad"])


def _change_entry(change: GraphChange) -> ChangeEntry:
    return {
        "poses": {str(vertex): _rows(T) for vertex, T in change.poses.items()},
        "added": [
            {"i": e.i, "j": e.j, "kind": e.kind.value, "T_i_j": _rows(e.T_i_j), "covariance": e.covariance[_UPPER].tolist()}
            for e in change.added
        ],
    }


def _change_of(entry: ChangeEntry | None) -> GraphChange | None:
    if entry is None:
        return None
    poses = {int(vertex): as_transform(_transform(rows)) for vertex, rows in entry["poses"].items()}
    return GraphChange(poses, tuple(_edge(e) for e in entry["added"]))


def _edge(entry: EdgeEntry) -> Edge:
    upper = np.zeros((6, 6))
    upper[_UPPER] = entry["covariance"]
    covariance = as_covariance(upper + np.triu(upper, 1).T)
    return Edge(int(entry["i"]), int(entry["j"]), as_transform(_transform(entry["T_i_j"])), covariance, EdgeKind(entry["kind"]))


def _rows(T: Array) -> list[float]:
    """The upper three rows of a transform, one after the other; numbers that JSON gives back bit by bit."""
    return [float(v) for v in T[:3].ravel()]


def _transform(rows: list[float]) -> Array:
    T = np.eye(4)
    T[:3] = np.array(rows, dtype=np.float64).reshape(3, 4)
    return T
