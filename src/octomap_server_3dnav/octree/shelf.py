"""What is seldom asked for again, in a file without a name instead of in memory: the beams of every sweep that the map was made of.

A robot that maps for hours has thousands of sweeps, and draws anew the few that the pose graph moves. The file goes with the process.
"""

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import IO, Generic, TypeVar

import numpy as np

V = TypeVar("V")

_SPARE = 1.2  # of a place: what a moved sweep hits is a few per cent more or less


@dataclass(frozen=True, eq=False)
class Shelved(Generic[V]):
    """A value that is in memory, or of which `read` knows the place in the file."""

    value: V | None
    read: Callable[[], V] | None = None
    begin: int | None = None
    room: int = 0

    def __call__(self) -> V:
        """The value, bit by bit; OSError when the disk does not give it."""
        if self.read is not None:
            return self.read()
        assert self.value is not None
        return self.value


class Shelf:
    """Puts dataclasses of arrays away. What the disk does not take stays in memory."""

    def __init__(self, folder: Path | None) -> None:
        """`folder`: on the disk that has room; None keeps all in memory, as does a folder that cannot be written."""
        self._folder, self._end = folder, 0
        try:
            self._file = tempfile.TemporaryFile(dir=folder, buffering=0) if folder else None
        except OSError:
            self._file = None

    def another(self) -> "Shelf":
        """An empty one beside it."""
        return Shelf(self._folder)

    def put(self, value: V, instead_of: Shelved[V] | None = None) -> Shelved[V]:
        """What gives the value again; it takes the place of one that is not asked for any more, where it fits."""
        if self._file is None:
            return Shelved(value)
        arrays = [np.ascontiguousarray(getattr(value, field.name)) for field in fields(value)]  # type: ignore[arg-type]
        data = b"".join(array.tobytes() for array in arrays)
        if instead_of is not None and instead_of.begin is not None and len(data) <= instead_of.room:
            begin, room = instead_of.begin, instead_of.room
        else:
            begin, room = self._end, int(len(data) * _SPARE)
        if not _is_written(self._file, data, begin):
            return Shelved(value)
        self._end = max(self._end, begin + room)
        return Shelved(None, partial(_read, self._file, type(value), begin, [(a.shape, a.dtype) for a in arrays]), begin, room)


def _is_written(file: IO[bytes], data: bytes, at: int) -> bool:
    left = memoryview(data)
    try:
        while left:
            written = os.pwrite(file.fileno(), left, at)
            left, at = left[written:], at + written
    except OSError:
        return False
    return True


def _read(file: IO[bytes], kind: type[V], at: int, forms: Sequence[tuple[tuple[int, ...], np.dtype[np.generic]]]) -> V:
    arrays = []
    for shape, dtype in forms:
        size = int(np.prod(shape)) * dtype.itemsize
        data = os.pread(file.fileno(), size, at)
        if len(data) != size:
            raise OSError(f"{len(data)} of {size} bytes could be read again")
        arrays.append(np.frombuffer(bytearray(data), dtype=dtype).reshape(shape))
        at += size
    return kind(*arrays)
