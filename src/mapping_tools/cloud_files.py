"""Point clouds of PLY, PCD and sweep (.npz) files, with where their beams started if the file says so.

A file that is cut off or damaged is an error that names it, never a cloud of part of it: PLY is read here, for open3d's reader returns
whatever lay in memory; of PCD, which it reads well, the number of points is checked.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

Array = NDArray[np.float64]
Properties = list[tuple[str, str]]

VIEWPOINT_FIELDS = ("vp_x", "vp_y", "vp_z")
SUFFIXES = (".ply", ".pcd", ".npz")
_HEADER_BYTES = 1 << 16
_PLY_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4", "double": "f8"}
_PLY_TYPES |= {f"{kind}{8 * int(size)}": f"{kind[0]}{size}" for kind in ("int", "uint") for size in "124"}
_PLY_TYPES |= {"float32": "f4", "float64": "f8"}
_PLY_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}


class CloudFileError(ValueError):
    """A file that is no cloud, or not all of one; the text names it."""


@dataclass(frozen=True, eq=False)
class CloudFile:
    """What a file holds: points (N, 3) float64 m, not finite ones included; origins (N, 3) of the beams where it has them; and the place
    (3,) from which all was seen, in the frame of the points: the VIEWPOINT of a PCD, else its origin.
    """

    points: Array
    origins: Array | None
    sensor: Array


def read_cloud(path: Path) -> CloudFile:
    """The cloud of a file, by its suffix; CloudFileError when it cannot be read, is damaged, or has no points at all."""
    readers = {".ply": _read_ply, ".pcd": _read_pcd, ".npz": _read_sweep}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise CloudFileError(f"{path}: expected a file that ends in {', '.join(SUFFIXES)}")
    try:
        cloud = reader(path)
    except OSError as error:
        raise CloudFileError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, KeyError, zipfile.BadZipFile) as error:
        raise CloudFileError(f"{path}: {' '.join(str(error).split())}") from error
    if len(cloud.points) == 0:
        raise CloudFileError(f"{path}: holds no points")
    return cloud


def _columns(fields: dict[str, Array], names: tuple[str, ...]) -> Array:
    return np.column_stack([np.asarray(fields[name], dtype=np.float64) for name in names])


def _from_fields(fields: dict[str, Array], sensor: Array) -> CloudFile:
    missing = [name for name in "xyz" if name not in fields]
    if missing:
        raise ValueError(f"its points have no {', '.join(missing)}; there are {', '.join(fields) or 'no fields'}")
    seen_from = _columns(fields, VIEWPOINT_FIELDS) if all(name in fields for name in VIEWPOINT_FIELDS) else None
    return CloudFile(_columns(fields, ("x", "y", "z")), seen_from, sensor)


def _read_sweep(path: Path) -> CloudFile:
    """A sweep of a session folder."""
    with np.load(path, allow_pickle=False) as arrays:
        points, origins = (np.asarray(arrays[name], dtype=np.float64) for name in ("points", "origins"))
    if points.ndim != 2 or points.shape[1] != 3 or origins.shape != points.shape:
        raise ValueError(f"points and origins must both have shape (N, 3), not {points.shape} and {origins.shape}")
    return CloudFile(points, origins, np.zeros(3))


def _read_pcd(path: Path) -> CloudFile:
    header = _pcd_header(path)
    count = int(header["POINTS"])
    if header["DATA"] == "ascii":
        with path.open("rb") as file:
            lines = sum(1 for line in file if line.strip() and not line.startswith(b"#")) - len(header)
        if lines < count:
            raise ValueError(f"is cut off: {lines} of {count} points")
    with o3d.utility.VerbosityContextManager(o3d.utility.VerbosityLevel.Error):
        found = o3d.t.io.read_point_cloud(path).point
    fields = {name: found[name].numpy()[:, 0] for name in found if name != "positions"}
    if "positions" not in found or len(found["positions"]) != count:
        raise ValueError(f"is damaged or cut off: its {count} points cannot be read, or have no x, y, z")
    viewpoint = np.array(header.get("VIEWPOINT", "0 0 0").split()[:3], dtype=np.float64)
    if viewpoint.shape != (3,) or not np.isfinite(viewpoint).all():
        raise ValueError(f"its VIEWPOINT {header['VIEWPOINT']!r} does not start with three finite numbers")
    return _from_fields(fields | dict(zip("xyz", found["positions"].numpy().T, strict=True)), viewpoint)


def _pcd_header(path: Path) -> dict[str, str]:
    """The lines of the header by their first word."""
    with path.open("rb") as file:
        lines = file.read(_HEADER_BYTES).split(b"\n")
    header: dict[str, str] = {}
    for line in lines:
        key, _, value = line.decode("ascii", "replace").strip().partition(" ")
        if key and not key.startswith("#"):
            header[key] = value.strip()
        if key == "DATA":
            break
    if "DATA" not in header or not header.get("POINTS", "").isdecimal():
        raise ValueError("is no PCD file: its header lacks POINTS or DATA")
    return header


def _read_ply(path: Path) -> CloudFile:
    """The vertices of a PLY file; faces and whatever else follows them are left alone."""
    with path.open("rb") as file:
        form, count, properties = _ply_header(file.read(_HEADER_BYTES).partition(b"end_header"))
        file.seek(0)
        while file.readline().strip() != b"end_header":
            pass
        rows = _ascii_rows(file, count, properties) if form == "ascii" else _binary_rows(file, count, properties, _PLY_ORDERS[form])
    read = len(next(iter(rows.values()), ()))
    if read < count:
        raise ValueError(f"is cut off: {read} of {count} points")
    return _from_fields(rows, np.zeros(3))


def _ascii_rows(file: BinaryIO, count: int, properties: Properties) -> dict[str, Array]:
    if count == 0:
        return {name: np.zeros(0) for name, _ in properties}
    table = np.loadtxt(islice(file, count), ndmin=2, comments=None, usecols=range(len(properties)))
    return {name: table[:, k] for k, (name, _) in enumerate(properties)}


def _binary_rows(file: BinaryIO, count: int, properties: Properties, order: str) -> dict[str, Array]:
    layout = np.dtype([(name, order + kind) for name, kind in properties])
    data = file.read(count * layout.itemsize)
    table: Any = np.frombuffer(data, layout, len(data) // layout.itemsize)
    return {name: table[name] for name, _ in properties}


def _ply_header(parts: tuple[bytes, bytes, bytes]) -> tuple[str, int, Properties]:
    """Format, number of vertices, and their properties (name, numpy type); ValueError unless the vertices come first."""
    lines = [line.split() for line in parts[0].decode("ascii", "replace").splitlines()]
    words = [line for line in lines if line and line[0] not in ("comment", "obj_info")]
    if not parts[1] or words[0] != ["ply"] or len(words) < 3 or words[1][0] != "format":
        raise ValueError("is no PLY file")
    form, element = words[1][1], words[2]
    if form not in (*_PLY_ORDERS, "ascii"):
        raise ValueError(f"its format {form} is not known")
    if element[:2] != ["element", "vertex"] or len(element) != 3 or not element[2].isdecimal():
        raise ValueError(f"its first element is not vertex but {' '.join(element[1:])}")
    properties: Properties = []
    for line in words[3:]:
        if line[0] != "property":
            break
        if len(line) != 3 or line[1] not in _PLY_TYPES:
            raise ValueError(f"its vertices have a {' '.join(line)}, which is not known")
        properties.append((line[2], _PLY_TYPES[line[1]]))
    if not properties:
        raise ValueError("its vertices have no properties")
    return form, int(element[2]), properties
