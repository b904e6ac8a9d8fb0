"""Why the reader of a mesh file gave up, in words: it is empty or damaged, or a file is missing that it names."""

import json
from pathlib import Path
from urllib.parse import unquote


def why_unreadable(path: Path, error: Exception) -> str:
    """What ends the sentence "cannot read the mesh FILE: ", by the file, and by the error where that does not tell. It is one line."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    if path.stat().st_size == 0:
        return "it is empty"
    if path.suffix.lower() == ".gltf" and (problem := _gltf_problem(path)):
        return problem
    said = " ".join(str(error).split())
    if isinstance(error, FileNotFoundError):
        return f"{said}, which it names, is missing"
    return f"it is damaged, or of a kind that is not known ({type(error).__name__}{said and ': '}{said})"


def _gltf_problem(path: Path) -> str | None:
    """What is wrong with its JSON or with the files of its buffers; None where that is not it."""
    try:
        tree = json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:
        return f"it is damaged: no JSON, {' '.join(str(error).split())}"
    try:
        buffers = [(str(buffer["uri"]), int(buffer["byteLength"])) for buffer in tree["buffers"] if "uri" in buffer]
    except (KeyError, TypeError, ValueError):
        return None
    return next(filter(None, (_buffer_problem(path.parent, uri, wanted) for uri, wanted in buffers)), None)


def _buffer_problem(folder: Path, uri: str, wanted_bytes: int) -> str | None:
    if uri.startswith("data:"):
        return None
    try:
        found_bytes = (folder / unquote(uri)).stat().st_size
    except (OSError, ValueError):
        return f"{uri}, which it names, is missing"
    return f"{uri}, which it names, is damaged: {found_bytes} bytes of {wanted_bytes}" if found_bytes < wanted_bytes else None
