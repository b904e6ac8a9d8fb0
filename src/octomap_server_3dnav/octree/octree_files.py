"""octomap's files: what stands before the data of a .bt or .ot file."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_EXTRA_BYTES = {"OcTree": (0,), "OcTreeStamped": (0, 4), "ColorOcTree": (0, 3)}
"""What a node of an .ot file holds between its log-odds and its children, by kind of tree: nothing, a stamp, or a colour."""
_FORMATS = {b"# Octomap OcTree binary file": ".bt", b"# Octomap OcTree file": ".ot"}
_DECIMAL = rb"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?"
_LONGEST_LINE = 200
_COMMENT = b"# (feel free to add / change comments, but leave the first line as it is!)\n#\n"


@dataclass(frozen=True)
class FileHeader:
    """What a file says of its tree: ".bt" or ".ot", number of nodes, and edge of a voxel in metres."""

    kind: str
    nodes: int
    resolution: float


def file_header(kind: str, nodes: int, resolution: float) -> bytes:
    """What a file of a kind (".bt", ".ot") begins with, up to its data."""
    first_line = next(line for line, named in _FORMATS.items() if named == kind)
    return first_line + b"\n" + _COMMENT + f"id OcTree\nsize {nodes}\nres {resolution!r}\ndata\n".encode()


def _field(lines: Sequence[bytes], name: bytes, form: bytes = rb"\S.*") -> bytes:
    """The value of a line of the header; ValueError where there is not one, or it is not of a form."""
    found = [line.split(None, 1)[1].strip() for line in lines if re.match(name + rb"\s+\S", line)]
    if len(found) != 1:
        raise ValueError(f"its header needs one line '{name.decode()} VALUE', it has {len(found)}")
    if not re.fullmatch(form, found[0]):
        raise ValueError(f"its header's '{name.decode()}' is no such number: {found[0][:40].decode(errors='replace')}")
    return found[0]


def parsed_file(content: bytes) -> tuple[FileHeader, bytes]:
    """Header and data of a file; stamps and colours of nodes are left out of the data, so that they are those of an OcTree.

    ValueError for a first line of another format, and where the header is cut off, of an unknown kind of tree, or not of these data.
    """
    kind = _FORMATS.get(content[:_LONGEST_LINE].split(b"\n", 1)[0].rstrip())
    if kind is None:
        raise ValueError("no octomap file: it must begin with one of " + ", ".join(f"'{line.decode()}'" for line in _FORMATS))
    mark = re.search(rb"\ndata[ \t]*\r?\n", content)
    if not mark:
        raise ValueError("its header ends without a line 'data'")
    lines = [line.strip() for line in content[: mark.start()].split(b"\n") if not line.startswith(b"#")]
    tree = _field(lines, b"id").decode(errors="replace")
    if tree not in _EXTRA_BYTES:
        raise ValueError(f"its trees are of type '{tree[:40]}', expected one of {', '.join(_EXTRA_BYTES)}")
    header = FileHeader(kind, int(_field(lines, b"size", rb"[0-9]{1,18}")), float(_field(lines, b"res", _DECIMAL)))
    data = content[mark.end() :]
    return header, _plain_nodes(header, tree, data) if kind == ".ot" else data


def _plain_nodes(header: FileHeader, tree: str, data: bytes) -> bytes:
    """Full data with each node's log-odds and children only: all nodes are as long, so the number of nodes tells how long."""
    if header.nodes < 1:
        return data
    extra, rest = divmod(len(data) - 5 * header.nodes, header.nodes)
    if extra == 0 and rest == 0 and 0 in _EXTRA_BYTES[tree]:
        return data
    if rest or extra not in _EXTRA_BYTES[tree]:
        wanted = " or ".join(f"{5 + more:d}" for more in _EXTRA_BYTES[tree])
        raise ValueError(f"its header says {header.nodes} nodes of {wanted} bytes ({tree}), its data are {len(data)} bytes")
    nodes = np.frombuffer(data, dtype=np.uint8).reshape(header.nodes, 5 + extra)
    return nodes[:, [0, 1, 2, 3, -1]].tobytes()
