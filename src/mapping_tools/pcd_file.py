"""PCD files: header checked against itself and against the data, before anything is read by it.

The libraries that read PCD take the header's word: open3d and pypcd overrun their memory, or give numbers of another field.
Of all fields only those that are asked for are looked at; others may have any type, size and name, as padding has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mapping_tools.lzf import unpacked
from mapping_tools.number_rows import number_rows

Array = NDArray[np.float64]

PADDING = "_"
_HEADER_BYTES = 1 << 16
_KEYS = ("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS", "DATA")
_KINDS = {"F": "f", "I": "i", "U": "u"}
_SIZES = {"F": (2, 4, 8), "I": (1, 2, 4, 8), "U": (1, 2, 4, 8)}
_FORMS = ("ascii", "binary", "binary_compressed")


@dataclass(frozen=True)
class PcdField:
    """A column, or `count` of them, of `size` bytes each."""

    name: str
    size: int
    kind: str
    count: int

    @property
    def width(self) -> int:
        """Bytes a point."""
        return self.size * self.count

    def numpy_type(self) -> str:
        """Of a single number; ValueError when there is none of this type and size."""
        if self.count != 1 or self.size not in _SIZES.get(self.kind, ()):
            raise ValueError(f"its field {self.name} has TYPE {self.kind}, SIZE {self.size}, COUNT {self.count}, which is no number")
        return f"<{_KINDS[self.kind]}{self.size}"


@dataclass(frozen=True)
class PcdHeader:
    """What stands before the data; `data_at` is the byte, and `data_line` the line, at which these begin."""

    fields: tuple[PcdField, ...]
    count: int
    viewpoint: tuple[float, float, float]
    form: str
    data_at: int
    data_line: int


def read_pcd(path: Path, wanted: Sequence[str]) -> tuple[dict[str, Array], Array]:
    """The `wanted` fields that are there, each (N,) float64, and where all was seen from (3,), the VIEWPOINT.

    ValueError says what is wrong with the file, OSError as the system gives it.
    """
    content = path.read_bytes()
    header = pcd_header(content)
    fields = [f for f in header.fields if f.name in wanted]
    twice = sorted({f.name for f in fields if sum(g.name == f.name for g in fields) > 1})
    if twice:
        raise ValueError(f"its field {twice[0]} is there more than once")
    for field in fields:
        field.numpy_type()
    columns = _ascii if header.form == "ascii" else _binary if header.form == "binary" else _compressed
    return columns(content, header, fields) if header.count else {f.name: np.zeros(0) for f in fields}, np.array(header.viewpoint)


def pcd_header(content: bytes) -> PcdHeader:
    """ValueError when it is none, or contradicts itself."""
    values: dict[str, list[str]] = {}
    at, number = 0, 0
    while "DATA" not in values:
        end = content.find(b"\n", at, _HEADER_BYTES)
        if end < 0:
            raise ValueError("is no PCD file: no line DATA ends its header")
        line, at, number = content[at:end].decode("ascii", "replace").strip(), end + 1, number + 1
        key, *words = line.split() or ("#",)
        if key.startswith("#"):
            continue
        if key not in _KEYS:
            raise ValueError(f"line {number}: {key[:40]!r} is none of {', '.join(_KEYS)}")
        if key in values:
            raise ValueError(f"line {number}: a second {key}")
        values[key] = words
    form = " ".join(values["DATA"])
    if form not in _FORMS:
        raise ValueError(f"its DATA {form[:40]!r} is none of {', '.join(_FORMS)}")
    return PcdHeader(_fields(values), _count(values), _viewpoint(values), form, at, number + 1)


def _fields(values: dict[str, list[str]]) -> tuple[PcdField, ...]:
    names = values.get("FIELDS", [])
    if not names:
        raise ValueError("its header has no FIELDS")
    sizes, counts = _whole(values, "SIZE"), _whole(values, "COUNT") if "COUNT" in values else [1] * len(names)
    kinds = values.get("TYPE", [])
    for key, given in (("SIZE", sizes), ("TYPE", kinds), ("COUNT", counts)):
        if len(given) != len(names):
            raise ValueError(f"its {key} has {len(given)} entries for {len(names)} FIELDS")
    if min(sizes) < 1 or min(counts) < 1:
        raise ValueError("its SIZE and COUNT are wanted from 1 up")
    return tuple(PcdField(*entry) for entry in zip(names, sizes, kinds, counts, strict=True))


def _whole(values: dict[str, list[str]], key: str) -> list[int]:
    words = values.get(key, [])
    if not words or not all(word.isascii() and word.isdecimal() and len(word) < 19 for word in words):
        raise ValueError(f"its {key} is {' '.join(words)[:60]!r}, expected whole numbers")
    return [int(word) for word in words]


def _count(values: dict[str, list[str]]) -> int:
    """Points; by WIDTH and HEIGHT where POINTS is missing, as in old files."""
    found = {key: _whole(values, key) for key in ("WIDTH", "HEIGHT", "POINTS") if key in values}
    for key, numbers in found.items():
        if len(numbers) != 1:
            raise ValueError(f"its {key} has {len(numbers)} numbers, expected one")
    raster = found["WIDTH"][0] * found.get("HEIGHT", [1])[0] if "WIDTH" in found else None
    points = found["POINTS"][0] if "POINTS" in found else raster
    if points is None:
        raise ValueError("its header has neither POINTS nor WIDTH")
    if raster is not None and raster != points:
        raise ValueError(f"its WIDTH and HEIGHT make {raster} points, its POINTS say {points}")
    return points


def _viewpoint(values: dict[str, list[str]]) -> tuple[float, float, float]:
    words = values.get("VIEWPOINT", ["0", "0", "0"])
    try:
        x, y, z = (float(word) for word in words[:3])
    except ValueError:
        x = y = z = np.nan
    if not np.isfinite([x, y, z]).all():
        raise ValueError(f"its VIEWPOINT {' '.join(words)[:60]!r} does not start with three finite numbers")
    return x, y, z


def _ascii(content: bytes, header: PcdHeader, fields: list[PcdField]) -> dict[str, Array]:
    ends = np.cumsum([0, *(f.count for f in header.fields)]).tolist()
    lines = content[header.data_at :].split(b"\n")
    if header.count > len(lines):
        raise ValueError(f"is cut off: {len(lines)} lines for {header.count} points")
    table = number_rows(lines, ends[-1], header.data_line)
    if len(table) != header.count:
        raise ValueError(f"{'is cut off: ' if len(table) < header.count else ''}has {len(table)} lines for {header.count} points")
    return {f.name: table[:, ends[header.fields.index(f)]] for f in fields}


def _binary(content: bytes, header: PcdHeader, fields: list[PcdField]) -> dict[str, Array]:
    offsets = np.cumsum([0, *(f.width for f in header.fields)], dtype=object).tolist()
    step, there = offsets[-1], len(content) - header.data_at
    if there < step * header.count:
        raise ValueError(f"is cut off: {there} bytes for {header.count} points of {step} bytes")
    if content[header.data_at + step * header.count :].strip(b"\0\r\n"):
        raise ValueError(f"has {there} bytes for {header.count} points of {step} bytes: its header does not fit its data")
    rows = np.frombuffer(content, np.uint8, step * header.count, header.data_at).reshape(header.count, step)
    return {f.name: _column(rows[:, (at := offsets[header.fields.index(f)]) : at + f.width], f) for f in fields}


def _compressed(content: bytes, header: PcdHeader, fields: list[PcdField]) -> dict[str, Array]:
    """Field after field, each with all its points; PCL leaves padding out of these."""
    if len(content) < header.data_at + 8:
        raise ValueError("is cut off: its compressed data are missing")
    packed, size = (int(n) for n in np.frombuffer(content, "<u4", 2, header.data_at))
    begin = header.data_at + 8
    if begin + packed > len(content):
        raise ValueError(f"is cut off: {len(content) - begin} of {packed} compressed bytes")
    stored = [f for f in header.fields if f.name != PADDING]
    if size == header.count * sum(f.width for f in header.fields):
        stored = list(header.fields)
    if size != header.count * sum(f.width for f in stored):
        raise ValueError(f"has {size} bytes for {header.count} points of {sum(f.width for f in stored)} bytes")
    plain = unpacked(content[begin : begin + packed], size)
    offsets = np.cumsum([0, *(f.width * header.count for f in stored)]).tolist()
    blocks = ((f, np.frombuffer(plain, np.uint8, f.width * header.count, offsets[stored.index(f)])) for f in fields)
    return {f.name: _column(block.reshape(header.count, f.width), f) for f, block in blocks}


def _column(rows: NDArray[np.uint8], field: PcdField) -> Array:
    return np.ascontiguousarray(rows).view(field.numpy_type())[:, 0].astype(np.float64)
