"""sweeps/index.json: the list of a session's sweeps, a JSON array with one line a sweep, appended to and never half believed.

A new line goes over the closing bracket at the end, with a new bracket behind it, so a sweep costs the same however many there are, and no
byte of an older line is written again. What a crash leaves of a line fails its checksum.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pose_graph_mapping.session.session_files import recorded_entry
from pose_graph_mapping.session.session_record import StoredSweep, index_line, sweep_of_line, sweep_of_payload
from whole_files import write_whole

INDEX = "sweeps/index.json"
_OPEN, _NEXT, _CLOSE = "[\n", ",", "]\n"


def sweep_file(vertex_id: int) -> str:
    """Name of the file of a sweep below the session's folder."""
    return f"sweeps/{vertex_id:06d}.npz"


@dataclass(frozen=True)
class _Lines:
    """Sweeps of the lines that are whole, by vertex; what is wrong with the others; and whether a line may be appended as it is."""

    sweeps: dict[int, StoredSweep]
    problems: list[str]
    whole: bool


class SessionIndex:
    """The index of one session's folder; `notes` says what was damaged and what became of it."""

    def __init__(self, directory: Path) -> None:
        """Read the index, and from the sweeps' own files what it lacks; ValueError when a sweep is lost that later ones stand on."""
        self._directory, self._path = directory, directory / INDEX
        data = self._path.read_bytes() if self._path.exists() else b""
        lines = _read_lines(data)
        self._end = len(data) - len(_CLOSE) if lines.whole else None
        self.notes = list(lines.problems)
        self.sweeps: list[StoredSweep] = []
        while (found := self._next(lines)) is not None:
            self.sweeps.append(found)

    def append(self, sweep: StoredSweep) -> None:
        """Returns when the sweep's line is on disk; OSError leaves the index as it was, ValueError says that another program writes it."""
        if self._end is None:
            self.rewrite([*self.sweeps, sweep])
        else:
            self._write_at_end(self._end, f"{_NEXT}{index_line(sweep)}\n{_CLOSE}".encode("ascii"))
        self.sweeps.append(sweep)

    def rewrite(self, sweeps: Sequence[StoredSweep]) -> None:
        """Replaces the file by an index of `sweeps`, in one step."""
        text = _OPEN + f"\n{_NEXT}".join(index_line(s) for s in sweeps) + "\n" + _CLOSE
        write_whole(self._path, text.encode("ascii"))
        self._end = len(text) - len(_CLOSE)

    def _next(self, lines: _Lines) -> StoredSweep | None:
        """The sweep after those that are known: of its line, or else of its own file, when that is whole."""
        vertex = len(self.sweeps)
        if vertex in lines.sweeps:
            found = lines.sweeps[vertex]
            problem = _size_problem(self._directory / found.file, found.bytes)
            self.notes += [f"{found.file} is damaged: {problem}"] if problem else []
            return found
        path = self._directory / sweep_file(vertex)
        recovered, problem = _recovered(path, vertex) if path.exists() else (None, "it is not there")
        if recovered is not None:
            self.notes.append(f"sweep {vertex} has no line in {INDEX}; {sweep_file(vertex)} is whole and tells of it")
            self._end = None
        elif vertex < max(lines.sweeps, default=-1):
            wrong = "; ".join(lines.problems) or f"{INDEX} has no line of sweep {vertex}"
            raise ValueError(f"{self._directory}: {wrong}, and {sweep_file(vertex)} cannot stand in: {problem}")
        return recovered

    def _write_at_end(self, end: int, data: bytes) -> None:
        descriptor = os.open(self._path, os.O_WRONLY)
        try:
            if os.fstat(descriptor).st_size != end + len(_CLOSE):
                raise ValueError(f"{self._path} was changed by another program while this one writes it")
            _write(descriptor, data, end)
            self._end = end + len(data) - len(_CLOSE)
        except OSError:
            with contextlib.suppress(OSError):  # a torn line would be known by its checksum, too
                os.ftruncate(descriptor, end)
                _write(descriptor, _CLOSE.encode("ascii"), end)
            raise
        finally:
            os.close(descriptor)


def _write(descriptor: int, data: bytes, offset: int) -> None:
    while data:
        written = os.pwrite(descriptor, data, offset)
        data, offset = data[written:], offset + written
    os.fsync(descriptor)


def _read_lines(data: bytes) -> _Lines:
    text = data.decode("ascii", "replace")
    sweeps, problems = {}, []
    for number, line in enumerate(text.split("\n"), 1):
        if line in ("", _OPEN.strip(), _CLOSE.strip()):
            continue
        try:
            sweep = sweep_of_line(line.removeprefix(_NEXT))
            sweeps[sweep.vertex_id] = sweep
        except ValueError as error:
            problems.append(f"line {number} of {INDEX} is damaged: {error}")
    framed = text.startswith(_OPEN) and text.endswith("\n" + _CLOSE)
    return _Lines(sweeps, problems, framed and not problems and bool(sweeps))


def _size_problem(path: Path, size: int) -> str | None:
    if not path.is_file():
        return "it is not there"
    return None if path.stat().st_size == size else f"{path.stat().st_size} bytes of {size}"


def _recovered(path: Path, vertex: int) -> tuple[StoredSweep | None, str]:
    """The sweep that a file of its own tells of, or None and why not."""
    data = path.read_bytes()
    try:
        entry = recorded_entry(data, vertex)
        if entry["vertex_id"] != vertex:
            raise ValueError(f"it is of vertex {entry['vertex_id']}")
        return sweep_of_payload(entry, sweep_file(vertex), len(data), hashlib.sha256(data).hexdigest()), ""
    except (ValueError, KeyError, TypeError) as error:
        return None, f"{path.name} is damaged: {error}"
