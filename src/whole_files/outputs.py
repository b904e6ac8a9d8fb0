"""What a tool is told to write, looked at before it works: no output is an input, another output, or where nothing can be written."""

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

Output = tuple[str, Path]
"""The option that names it, and the path."""


def check_files(outputs: Sequence[Output], inputs: Sequence[Path] = ()) -> None:
    """ValueError, one line, for the first output that would replace an input, or cannot be written as a file. Touches nothing.

    inputs: files, and folders, of which no file may be replaced.
    """
    for k, (option, path) in enumerate(outputs):
        _check_place(option, path)
        for other, taken in outputs[:k]:
            if is_same(path, taken):
                raise ValueError(f"{option} {path}: the same file as {other} {taken}: name two files")
        check_not_read(option, path, inputs)


def check_not_read(option: str, path: Path, inputs: Iterable[Path]) -> None:
    """ValueError, one line, for a file to be written that is a folder, an input, or a file of a folder that is one."""
    if path.is_dir():
        raise ValueError(f"{option} {path}: is a folder, expected a file")
    for source in inputs:
        _check_not_of(option, path, source)


def check_folder(option: str, folder: Path, inputs: Sequence[Path] = (), names: Sequence[str] = ()) -> None:
    """ValueError, one line, for a folder that is none or cannot be made, or in which a file of these names is an input."""
    _check_can_be_folder(option, folder)
    for source in inputs:
        for name in names:
            if is_same(folder / name, source):
                raise ValueError(f"{option} {folder}: its {name} is the input {source} itself, which is only read: name another folder")


def is_same(path: Path, other: Path) -> bool:
    """Whether two paths are one file or folder, be it there or not, through whatever links."""
    try:
        return os.path.samefile(path, other)
    except OSError:
        return os.path.realpath(path) == os.path.realpath(other)


def lies_in(path: Path, folder: Path) -> bool:
    """Whether a path is a folder or below it, be it there or not."""
    return any(is_same(place, folder) for place in _places(path))


def _places(path: Path) -> Iterator[Path]:
    real = Path(os.path.realpath(path))
    yield real
    yield from real.parents


def _check_place(option: str, path: Path) -> None:
    check_not_read(option, path, ())
    folder = path.absolute().parent
    if not folder.is_dir():
        raise ValueError(f"{option} {path}: cannot be written: no such folder: {path.parent}")
    if path.exists() and not path.is_file():
        raise ValueError(f"{option} {path}: is a device or pipe, expected a file")
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ValueError(f"{option} {path}: cannot be written: {path.parent} may not be written to")


def _check_not_of(option: str, path: Path, source: Path) -> None:
    if is_same(path, source):
        raise ValueError(f"{option} {path}: is the input {source} itself, which is only read: name another file")
    if source.is_dir() and path.exists() and lies_in(path, source):
        raise ValueError(f"{option} {path}: is a file of {source}, which is only read: name another file")


def _check_can_be_folder(option: str, folder: Path) -> None:
    there = next(place for place in (folder.absolute(), *folder.absolute().parents) if os.path.lexists(place))
    if not there.is_dir():
        raise ValueError(f"{option} {folder}: {there} is a file, expected a folder, or a name for a new one")
    if not os.access(there, os.W_OK | os.X_OK):
        raise ValueError(f"{option} {folder}: cannot be written: {there} may not be written to")
