"""PLY files: the vertices of text and of binary ones in either byte order. Faces and whatever else follows them are left alone."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mapping_tools.number_rows import number_rows

Array = NDArray[np.float64]
Properties = list[tuple[str, str]]

_HEADER_BYTES = 1 << 16
_END = b"end_header"
_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8"}
_TYPES |= {f"{kind}{8 * int(size)}": f"{kind[0]}{size}" for kind in ("int", "uint") for size in "124"}
_TYPES |= {"float32": "f4", "float64": "f8"}
_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


def read_ply(path: Path, wanted: Sequence[str]) -> dict[str, Array]:
    """The `wanted` properties of the vertices that are there, each (N,) float64; ValueError says what is wrong with the file."""
    content = path.read_bytes()
    head, mark, _ = content[:_HEADER_BYTES].partition(_END)
    begin = content.find(b"\n", len(head) + len(_END)) + 1
    if not mark or not begin or content[len(head) + len(_END) : begin].strip():
        raise ValueError("is no PLY file: no line end_header ends its header")
    form, count, properties = _header(head)
    if form == "ascii":
        return _ascii(content[begin:], count, properties, head.count(b"\n") + 2, wanted)
    return _binary(content, begin, count, np.dtype([(name, _ORDERS[form] + kind) for name, kind in properties]), wanted)


def _ascii(data: bytes, count: int, properties: Properties, first_line: int, wanted: Sequence[str]) -> dict[str, Array]:
    lines = data.split(b"\n", min(count, len(data)))[:count]
    table = number_rows(lines, len(properties), first_line)
    if len(table) < count:
        raise ValueError(f"is cut off: {len(table)} of {count} points")
    return {name: table[:, k] for k, (name, _) in enumerate(properties) if name in wanted}


def _binary(content: bytes, begin: int, count: int, layout: np.dtype[Any], wanted: Sequence[str]) -> dict[str, Array]:
    there = (len(content) - begin) // layout.itemsize
    if there < count:
        raise ValueError(f"is cut off: {there} of {count} points")
    table: Any = np.frombuffer(content, layout, count, begin) if count else np.zeros(0, layout)
    return {name: table[name].astype(np.float64) for name in layout.names or () if name in wanted}


def _header(head: bytes) -> tuple[str, int, Properties]:
    """Format, number of vertices, and their properties (name, numpy type); ValueError unless the vertices come first."""
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    words = [line for line in lines if line and line[0] not in ("comment", "obj_info")]
    if len(words) < 3 or words[0] != ["ply"] or words[1][0] != "format" or len(words[1]) < 2:
        raise ValueError("is no PLY file")
    form, element = words[1][1], words[2]
    if form not in (*_ORDERS, "ascii"):
        raise ValueError(f"its format {form[:40]!r} is not known")
    if element[:2] != ["element", "vertex"] or len(element) != 3 or not (element[2].isascii() and element[2].isdecimal()):
        raise ValueError(f"its first element is not vertex but {' '.join(element[1:])[:60]!r}")
    if len(element[2]) > 18:
        raise ValueError(f"its number of vertices, {element[2][:40]}, is none")
    return form, int(element[2]), _properties(words[3:])


def _properties(lines: Sequence[Sequence[str]]) -> Properties:
    properties: Properties = []
    for line in lines:
        if line[0] != "property":
            break
        if len(line) != 3 or line[1] not in _TYPES:
            raise ValueError(f"its vertices have a {' '.join(line)[:60]!r}, which is not known")
        if line[2] in dict(properties):
            raise ValueError(f"its property {line[2][:40]} is there more than once")
        properties.append((line[2], _TYPES[line[1]]))
    if not properties:
        raise ValueError("its vertices have no properties")
    return properties
