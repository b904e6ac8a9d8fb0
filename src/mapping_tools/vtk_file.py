"""VTK files of the legacy form, text and binary (which is big-endian): the points of a POLYDATA, as ParaView writes it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mapping_tools.number_rows import numbers_of

Array = NDArray[np.float64]

_HEADER_BYTES = 1 << 14
_TYPES = {"float": ">f4", "double": ">f8"}


def read_vtk(path: Path) -> dict[str, Array]:
    """x, y and z, each (N,) float64; ValueError says what is wrong with the file."""
    content = path.read_bytes()
    begin, line, form, count, kind = _points_line(content)
    if form == "BINARY":
        size = 3 * int(kind[-1])
        if (len(content) - begin) // size < count:
            raise ValueError(f"is cut off: {(len(content) - begin) // size} of {count} points")
        return _by_axis(np.frombuffer(content, kind, 3 * count, begin).astype(np.float64) if count else np.zeros(0))
    return _by_axis(_text_numbers(content[begin:], 3 * count, line))


def _by_axis(numbers: Array) -> dict[str, Array]:
    return dict(zip("xyz", numbers.reshape(-1, 3).T, strict=True))


def _points_line(content: bytes) -> tuple[int, int, str, int, str]:
    """Where the points begin, in bytes and in lines, the form, how many there are, and their numpy type."""
    if not content.startswith(b"# vtk DataFile Version"):
        raise ValueError("is no VTK file of the legacy form; ParaView saves others as one, or as PLY")
    head = content[:_HEADER_BYTES].split(b"\n")
    form = head[2].decode("ascii", "replace").strip() if len(head) > 2 else ""
    if form not in ("ASCII", "BINARY"):
        raise ValueError(f"line 3: {form[:40]!r} is neither ASCII nor BINARY")
    dataset = b"".join(head[3:4]).split()
    if dataset != [b"DATASET", b"POLYDATA"]:
        raise ValueError(f"line 4: {b' '.join(dataset)[:40].decode('ascii', 'replace')!r} where DATASET POLYDATA is wanted")
    for number in range(4, len(head) - 1):
        words = head[number].decode("ascii", "replace").split()
        if words[:1] == ["POINTS"]:
            if len(words) != 3 or not (words[1].isascii() and words[1].isdecimal() and len(words[1]) < 19) or words[2] not in _TYPES:
                raise ValueError(f"line {number + 1}: expected POINTS, a number, and float or double, not {' '.join(words)[:60]!r}")
            return len(b"\n".join(head[: number + 1])) + 1, number + 2, form, int(words[1]), _TYPES[words[2]]
    raise ValueError("has no line POINTS after DATASET POLYDATA")


def _text_numbers(data: bytes, count: int, first_line: int) -> Array:
    """The first `count` numbers, however many a line."""
    numbers: list[float] = []
    for number, line in enumerate(data.split(b"\n"), first_line):
        if len(numbers) >= count or (line[:1].isalpha() and line.split()[0].isupper()):  # a keyword
            break
        numbers += numbers_of(line, number)
    if len(numbers) < count:
        raise ValueError(f"is cut off: {len(numbers) // 3} of {count // 3} points")
    return np.array(numbers[:count])
