"""Where the models and meshes are that an SDF file names: in the folders that were given, in Gazebo's own variables, beside the file."""

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

from mesh_files import package_folders, package_roots
from world_files.sdf_elements import Element, read_xml, text_of

VARIABLES = ("GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "GAZEBO_RESOURCE_PATH")
_SCHEME = re.compile(r"^([A-Za-z][A-Za-z0-9+.-]*)://(.*)$")

_ON_SERVER = re.compile(r"/models/([^/]+)(?:/(\d+))?(?:/tip)?(?:/files/(.+))?/*$")


@dataclass(frozen=True)
class ModelPaths:
    """Folders that hold models, in the order in which they are searched, and those below which ROS packages lie."""

    folders: tuple[Path, ...] = ()
    packages: tuple[Path, ...] = ()

    @classmethod
    def of(cls, given: Sequence[Path], environment: Mapping[str, str] = os.environ) -> "ModelPaths":
        """The given ones, those of Gazebo's variables, then its own folder. ValueError for a given one that is no folder."""
        missing = [str(path) for path in given if not path.is_dir()]
        if missing:
            raise ValueError(f"models: no such folder: {', '.join(missing)}")
        told = (path for name in VARIABLES for path in environment.get(name, "").split(os.pathsep) if path)
        own = [Path(environment["HOME"], ".gazebo", "models")] if environment.get("HOME") else []
        return cls((*given, *map(Path, told), *own), package_roots(environment))

    def found(self, uri: str, folder: Path) -> Path | None:
        """The file or folder of a URI that stands in a file of `folder`; None when there is none.

        Of a model on a server (https://) the name is looked for, also as Gazebo's cache and its older models are written.
        """
        match = _SCHEME.match(uri.strip())
        scheme, path = (match[1].lower(), unquote(match[2])) if match else ("", uri.strip())
        if not path:
            return None
        near = (folder, folder.parent, folder / "models", folder.parent / "models")
        if scheme in ("", "file"):
            candidates = [folder / path, *(base / path for base in self.folders)]
        elif scheme in ("http", "https"):
            candidates = [base / place for place in _on_disk(path) for base in (*self.folders, *near)]
        else:
            candidates = [base / path for base in (*self.folders, *near)]
            if scheme == "package":
                name, _, inner = path.partition("/")
                candidates = [*(place / inner for place in package_folders(name, folder, self.packages)), *candidates]
        return next((candidate for candidate in candidates if _exists(candidate)), None)


def _on_disk(path: str) -> list[Path]:
    """Where a model of a server, or a file of it, may lie in a folder of models: OWNER/models/NAME, /VERSION and /files/REST after it.

    Gazebo's cache has the name in lower case, and a folder a version; its older models have no spaces, as ground_plane.
    """
    match = _ON_SERVER.search(path)
    name, (version, rest) = model_name(path), (match[2], match[3]) if match else (None, None)
    names = dict.fromkeys((name, name.lower(), name.lower().replace(" ", "_")))
    return [Path(each, inner, rest or "") for each in names for inner in dict.fromkeys((version or "", ""))]


def model_name(uri: str) -> str:
    """The model's name in a URI: its last part, but for what a server has after that."""
    if match := _ON_SERVER.search(unquote(uri)):
        return match[1]
    return unquote(uri).rstrip("/").rpartition("/")[2]


def sdf_file_of(path: Path) -> Path | None:
    """The SDF file of a model: itself, or what model.config of its folder names, or model.sdf there; None when there is none.

    A folder of Gazebo's cache holds a folder a version; the newest counts.
    """
    if path.is_file():
        return path
    config = path / "model.config"
    if config.is_file() and (named := _newest(read_xml(config))) and (path / named).is_file():
        return path / named
    if (path / "model.sdf").is_file():
        return path / "model.sdf"
    versions = sorted((int(child.name) for child in path.iterdir() if child.name.isdigit()), reverse=True)
    return sdf_file_of(path / str(versions[0])) if versions else None


def _newest(config: Element) -> str:
    """The file that a model.config names for the newest version of SDF."""
    named = [([int(digits) for digits in re.findall(r"\d+", sdf.get("version", ""))], text_of(sdf)) for sdf in config.findall("sdf")]
    return max(named)[1] if named else ""


def _exists(path: Path) -> bool:
    try:
        return path.is_file() or path.is_dir()
    except (OSError, ValueError):  # a name that no file can have
        return False
