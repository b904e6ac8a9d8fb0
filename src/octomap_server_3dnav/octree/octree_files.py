"""octomap's files: what stands before the data of a .bt or .ot file, and files that are never half there."""

import contextlib
import os
import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

_FORMATS = {b"# Octomap OcTree binary file": ".bt", b"# Octomap OcTree file": ".ot"}
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


def _field(lines: Sequence[bytes], name: bytes) -> bytes:
    found = [line.split(None, 1)[1].strip() for line in lines if re.match(name + rb"\s+\S", line)]
    if len(found) != 1:
        raise ValueError(f"its header needs one line '{name.decode()} VALUE', it has {len(found)}")
    return found[0]


def parsed_file(content: bytes) -> tuple[FileHeader, bytes]:
    """Header and data of a file; ValueError for a first line of another format, and where the header is cut off or of another tree."""
    kind = _FORMATS.get(content.split(b"\n", 1)[0].rstrip())
    if kind is None:
        raise ValueError("no octomap file: it must begin with one of " + ", ".join(f"'{line.decode()}'" for line in _FORMATS))
    head, mark, data = content.partition(b"\ndata\n")
    if not mark:
        raise ValueError("its header ends without a line 'data'")
    lines = [line for line in head.split(b"\n") if not line.startswith(b"#")]
    tree = _field(lines, b"id")
    if tree != b"OcTree":
        raise ValueError(f"its trees are of type '{tree.decode(errors='replace')}', expected OcTree")
    return FileHeader(kind, int(_field(lines, b"size")), float(_field(lines, b"res"))), data


def replace_file(path: Path, content: bytes) -> None:
    """Write beside `path` and rename, so that there is never half a file; OSError as the system gives it."""
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(temporary, 0o644)  # mkstemp's 0600 would hide the map from others
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(OSError):
            os.unlink(temporary)
        raise
