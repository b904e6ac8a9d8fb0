"""What is seldom asked for again, in a file without a name instead of in memory: the beams of every sweep that the map was made of.

A robot that maps for hours has thousands of sweeps, and draws anew the few that the pose graph moves. The file goes with the process.
"""

import os
import tempfile
from collections.abc import Callable
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

V = TypeVar("V")


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

    def put(self, value: V) -> Callable[[], V]:
        """What gives the value again, bit by bit; OSError when the disk does not."""
        arrays = [np.ascontiguousarray(getattr(value, field.name)) for field in fields(value)]  # type: ignore[arg-type]
        if self._file is None:
            return lambda: value
        begin, at = self._end, self._end
        try:
            for array in arrays:
                at = self._write(array, at)
        except OSError:
            return lambda: value
        self._end = at
        return partial(self._read, type(value), begin, [(array.shape, array.dtype) for array in arrays])

    def _write(self, array: NDArray[np.generic], at: int) -> int:
        assert self._file is not None
        left = memoryview(array.tobytes())
        while left:
            written = os.pwrite(self._file.fileno(), left, at)
            left, at = left[written:], at + written
        return at

    def _read(self, kind: type[V], at: int, forms: list[tuple[tuple[int, ...], np.dtype[np.generic]]]) -> V:
        assert self._file is not None
        arrays = []
        for shape, dtype in forms:
            size = int(np.prod(shape)) * dtype.itemsize
            data = os.pread(self._file.fileno(), size, at)
            if len(data) != size:
                raise OSError(f"{len(data)} of {size} bytes could be read again")
            arrays.append(np.frombuffer(data, dtype=dtype).reshape(shape))
            at += size
        return kind(*arrays)
