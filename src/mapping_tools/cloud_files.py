"""Point clouds of files, with where their beams started if the file says so: what is read, and what of it is a hit.

A file that is cut off, damaged or contradicts itself is an error that names it, never a cloud of part of it.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mapping_tools.number_rows import number_rows
from mapping_tools.pcd_file import read_pcd
from mapping_tools.ply_file import read_ply
from mapping_tools.vtk_file import read_vtk
from rigid_geometry import lost_digits_m, origin_near

Array = NDArray[np.float64]

POINT_FIELDS = ("x", "y", "z")
VIEWPOINT_FIELDS = ("vp_x", "vp_y", "vp_z")
FORMATS = {
    ".ply": "text or binary, x y z and perhaps vp_x vp_y vp_z of its vertices",
    ".pcd": "ascii, binary or binary_compressed, the same fields, and VIEWPOINT",
    ".vtk": "legacy POLYDATA, text or binary, its POINTS",
    ".xyz": "text, x y z first in every line",
    ".npz": "a sweep of a session folder",
}
SUFFIXES = tuple(FORMATS)
_SAME_PLACE = 1e-6  # of the distance: what is left of equal numbers after a transform in float32
_CONVERTERS = dict.fromkeys((".las", ".laz", ".e57", ".pts", ".ptx"), "pdal translate FILE scan.ply")
_CONVERTERS |= dict.fromkeys((".vtp", ".vtu"), "ParaView, or meshio convert FILE scan.vtk")


class CloudFileError(ValueError):
    """A file that is no cloud, or not all of one; the text names it."""


@dataclass(frozen=True, eq=False)
class CloudFile:
    """What a file holds: points (N, 3) float64 m, not finite ones included; origins (N, 3) of the beams where it has them; and the place
    (3,) from which all was seen, in the frame of the points: the VIEWPOINT of a PCD, else its origin.

    Points without an echo are not among them; `no_returns` says how many there were.
    """

    points: Array
    origins: Array | None
    sensor: Array
    no_returns: int = 0


def read_cloud(path: Path, sensor: Array | None = None) -> CloudFile:
    """The cloud of a file, by its suffix; CloudFileError when it cannot be read, is damaged, or has no hits at all.

    sensor (3,): from where all was seen, in place of what the file says.
    """
    suffix = path.suffix.lower()
    if path.exists() and not path.is_file():
        raise CloudFileError(f"{path}: is no file")
    if suffix not in _READERS:
        how = f"; convert it, as by {_CONVERTERS[suffix]}" if suffix in _CONVERTERS else ""
        raise CloudFileError(f"{path}: expected a file that ends in {', '.join(SUFFIXES)}{how}")
    try:
        with np.errstate(all="ignore"):  # numbers that are none, or too large for their type, are not finite
            found = _READERS[suffix](path)
    except OSError as error:
        raise CloudFileError(f"{path}: cannot be read: {error.strerror or error}") from error
    except (ValueError, KeyError, EOFError, NotImplementedError, zipfile.BadZipFile) as error:
        raise CloudFileError(f"{path}: {' '.join(str(error).split())}") from error
    cloud = _hits_of(found if sensor is None else CloudFile(found.points, found.origins, sensor))
    if len(cloud.points) == 0:
        zeros = f": all {cloud.no_returns} are beams without an echo, x y z where they began" if cloud.no_returns else ""
        raise CloudFileError(f"{path}: holds no points{zeros}")
    return cloud


def are_echoes(points: Array, starts: Array) -> NDArray[np.bool_]:
    """(N,) false for points without an echo: drivers write them as 0 0 0, or as the place that their beam started from (N or 1, 3)."""
    size = np.maximum(1.0, np.abs(starts).max(axis=1, initial=0.0))[:, None]
    return np.asarray((points != 0.0).any(axis=1) & ~(np.abs(points - starts) <= _SAME_PLACE * size).all(axis=1))


def no_return_text(count: int) -> str:
    """What is said of points without an echo."""
    return f"{count:,} points at 0 0 0, or where their beam starts, are beams without an echo, and were left out"


def brought_near(cloud: CloudFile) -> tuple[CloudFile, Array]:
    """A cloud relative to an origin (3,) near its points, and that origin: 0 0 0 unless they lie far away.

    ValueError when float32 has rounded far points before they were written.
    """
    finite = cloud.points[np.isfinite(cloud.points).all(axis=1)]
    origin = origin_near(np.median(finite, axis=0)) if len(finite) else np.zeros(3)
    if not origin.any():
        return cloud, origin
    if (apart := lost_digits_m(finite)) is not None:
        raise ValueError(f"its points, far from 0 0 0 in float32, are told apart to {apart:g} m only: write them as double, or relative")
    origins = None if cloud.origins is None else cloud.origins - origin
    return CloudFile(cloud.points - origin, origins, cloud.sensor - origin, cloud.no_returns), origin


def _hits_of(cloud: CloudFile) -> CloudFile:
    hits = are_echoes(cloud.points, cloud.sensor[None] if cloud.origins is None else cloud.origins)
    if hits.all():
        return cloud
    origins = None if cloud.origins is None else cloud.origins[hits]
    return CloudFile(cloud.points[hits], origins, cloud.sensor, int(np.count_nonzero(~hits)))


def _from_fields(fields: dict[str, Array], sensor: Array) -> CloudFile:
    missing = [name for name in POINT_FIELDS if name not in fields]
    if missing:
        raise ValueError(f"its points have no {', '.join(missing)}")
    has_origins = all(name in fields for name in VIEWPOINT_FIELDS)
    origins = np.column_stack([fields[name] for name in VIEWPOINT_FIELDS]) if has_origins else None
    return CloudFile(np.column_stack([fields[name] for name in POINT_FIELDS]), origins, sensor)


def _pcd_cloud(path: Path) -> CloudFile:
    return _from_fields(*read_pcd(path, POINT_FIELDS + VIEWPOINT_FIELDS))


def _ply_cloud(path: Path) -> CloudFile:
    return _from_fields(read_ply(path, POINT_FIELDS + VIEWPOINT_FIELDS), np.zeros(3))


def _vtk_cloud(path: Path) -> CloudFile:
    return _from_fields(read_vtk(path), np.zeros(3))


def _xyz_cloud(path: Path) -> CloudFile:
    """Three numbers a line or more, of which the others are left alone."""
    lines = path.read_bytes().split(b"\n")
    first = next((line for line in lines if line.strip() and not line.lstrip().startswith(b"#")), b"")
    table = number_rows(lines, max(3, len(first.split())), 1)
    return CloudFile(table[:, :3], None, np.zeros(3))


def _sweep_cloud(path: Path) -> CloudFile:
    """A sweep of a session folder."""
    with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
        points, origins = (np.asarray(arrays[name], dtype=np.float64) for name in ("points", "origins"))
    if points.ndim != 2 or points.shape[1] != 3 or origins.shape != points.shape:
        raise ValueError(f"points and origins must both have shape (N, 3), not {points.shape} and {origins.shape}")
    return CloudFile(points, origins, np.zeros(3))


_READERS: dict[str, Callable[[Path], CloudFile]] = {
    ".ply": _ply_cloud,
    ".pcd": _pcd_cloud,
    ".vtk": _vtk_cloud,
    ".xyz": _xyz_cloud,
    ".npz": _sweep_cloud,
}
