"""Where a ROS package lies that a URI `package://NAME/...` names: by its package.xml, on ROS_PACKAGE_PATH or around the file."""

import os
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path

_FILE = "package.xml"
_NOT_BELOW = ("CATKIN_IGNORE", "rospack_nosubdirs")  # a folder with one of these holds no packages, as rospack has it


def package_roots(environment: Mapping[str, str] = os.environ) -> tuple[Path, ...]:
    """The folders of ROS_PACKAGE_PATH."""
    return tuple(map(Path, filter(None, environment.get("ROS_PACKAGE_PATH", "").split(os.pathsep))))


def package_folders(name: str, around: Path | None, roots: Sequence[Path]) -> Iterator[Path]:
    """Where a package of a name lies: at any depth below the roots, then around a folder: above it, or beside one that is.

    Its name is what its package.xml says, or that of a folder without one.
    """
    for root in roots:
        yield from (folder for folder in (root, root / name) if _is_package(folder, name))
        yield from _packages_below(root).get(name, ())
    if around is not None:
        here = around.absolute()
        yield from (place for above in (here, *here.parents) for place in (above, above / name) if _is_package(place, name))


def _is_package(folder: Path, name: str) -> bool:
    return _name_of(folder) == name if (folder / _FILE).is_file() else folder.name == name and folder.is_dir()


def _name_of(folder: Path) -> str:
    """What its package.xml says, "" where that cannot be read."""
    try:
        return (ElementTree.parse(folder / _FILE).getroot().findtext("name") or "").strip()
    except (OSError, ElementTree.ParseError):
        return ""


@lru_cache(maxsize=64)
def _packages_below(root: Path) -> dict[str, list[Path]]:
    found, seen = dict[str, list[Path]](), set[str]()
    for folder, folders, files in os.walk(root, followlinks=True):
        if _FILE in files:
            found.setdefault(_name_of(Path(folder)), []).append(Path(folder))
        real = os.path.realpath(folder)
        if _FILE in files or real in seen or any(marker in files for marker in _NOT_BELOW):
            folders.clear()
        seen.add(real)
        folders[:] = sorted(each for each in folders if not each.startswith("."))
    return found
