"""The map of a file: an octree as it is, or a cloud made into one. Each is measured before anything large is made of it.

A cloud that lies far away, as in map coordinates, is brought near the origin of the map that is made of it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from explore_command.arguments import ArgumentProblem
from mapping_tools.cloud_files import SUFFIXES, VIEWPOINT_FIELDS, brought_near, no_return_text, read_cloud
from octomap_server_3dnav.octree.column_runs import KEY_OFFSET
from octomap_server_3dnav.octree.map_builder import MapConfig
from octomap_server_3dnav.octree.octree import OctreeMap
from octomap_server_3dnav.octree.octree_files import parsed_file
from rigid_geometry import FAR_M, origin_text
from terrain_tools.criteria import Criteria
from terrain_tools.octree_survey import Survey, survey

Array = NDArray[np.float64]
Say = Callable[[str], None]

OCTREES = (".bt", ".ot")
CLOUDS = SUFFIXES
ORIGINS = ("fields", "sensor", "none")
_FILE_BYTES_A_BYTE = 12  # of a compressed cloud: packed to a third, and four copies of its points on the way
_POINT_BYTES = 200  # of the octree, a point and voxel
_BLOCK_BYTES = 1500  # of the octree, 8^3 voxels that beams passed
_REGION_BYTES, _REGION_VOXELS = 1 << 16, 64


@dataclass(frozen=True, eq=False)
class FileMap:
    """A map, and where its origin (3,) lies in the coordinates of its file: 0 0 0 unless these are far away."""

    octree: OctreeMap
    origin: Array = field(default_factory=lambda: np.zeros(3))


def read_map(path: Path, by: Criteria, resolution: float | None, origins: str | None, max_bytes: float, say: Say) -> FileMap:
    """The map in a file of OCTREES or CLOUDS.

    `resolution` in metres and `origins`, one of ORIGINS, are for clouds only. ValueError names the file and what is wrong with it, or
    that it takes more than `max_bytes`; OSError when it cannot be read.
    """
    if path.suffix.lower() in CLOUDS:
        return _map_of_cloud(path, by, by.octree.resolution if resolution is None else resolution, origins, max_bytes, say)
    if path.suffix.lower() not in OCTREES:
        raise ArgumentProblem(f"{path}: expected a file that ends in {', '.join(OCTREES + CLOUDS)}")
    if resolution is not None or origins is not None:
        raise ArgumentProblem(f"--resolution and --origins are for clouds: {path} has voxels of its own")
    size = path.stat().st_size
    _allow(path, size, "bytes of an octree", 2 * size, max_bytes)
    try:
        header, data = parsed_file(path.read_bytes())
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    found = survey(data, full=header.kind == ".ot")
    if found.nodes == header.nodes:  # else it is refused by its reader, which builds nothing
        _allow_map(path, found, max_bytes, say)
    return FileMap(_with_usable_voxels(path, OctreeMap.read(path, by.sensor_model)))


def _allow(path: Path, count: int, what: str, need: float, max_bytes: float) -> None:
    if need > max_bytes:
        raise ValueError(f"{path}: {count:,} {what} take up to {in_words(need)}, more than the {in_words(max_bytes)} of --max-memory")


def _allow_map(path: Path, found: Survey, max_bytes: float, say: Say) -> None:
    columns = f"{found.columns[0]:,} x {found.columns[1]:,} columns"
    say(f"{path}: {found.leaves:,} leaves over {columns}, up to {in_words(found.memory_bytes)} of the {in_words(max_bytes)} allowed")
    _allow(path, found.leaves, f"leaves over {columns}", found.memory_bytes, max_bytes)


def in_words(size: float) -> str:
    """A number of bytes as one reads it."""
    return f"{size / 1e9:,.1f} GB" if size >= 1e9 else f"{math.ceil(size / 1e6)} MB"


def _with_usable_voxels(path: Path, octree: OctreeMap) -> OctreeMap:
    if problems := MapConfig(resolution=octree.resolution).validate():
        raise ValueError(f"{path}: {'; '.join(problems)}; the ground that a robot drives on cannot be told in such voxels")
    return octree


def _map_of_cloud(path: Path, by: Criteria, resolution: float, origins: str | None, max_bytes: float, say: Say) -> FileMap:
    if problems := MapConfig(resolution=resolution).validate():
        raise ArgumentProblem(f"--resolution: {'; '.join(problems)}")
    size = path.stat().st_size
    _allow(path, size, "bytes of a cloud", _FILE_BYTES_A_BYTE * size, max_bytes)
    points, starts, origin = _beams(path, resolution, origins, say)
    need = cloud_bytes(points, starts, resolution)
    rays = "occupied voxels only, free space is not known" if starts is None else "with free space along the beams"
    say(
        f"{path}: {len(points):,} points to voxels of {resolution:g} m, {rays}; up to {in_words(need)} of the {in_words(max_bytes)} allowed"
    )
    _allow(path, len(points), "points", need, max_bytes)
    octree = OctreeMap(resolution, by.sensor_model)
    octree.insert_sweep(points.astype(np.float32), (points if starts is None else starts).astype(np.float32))
    _allow_map(path, survey(octree.to_binary()), max_bytes, say)
    return FileMap(octree, origin)


def _beams(path: Path, resolution: float, origins: str | None, say: Say) -> tuple[Array, Array | None, Array]:
    """Points (N, 3) that the octree can hold, where their beams started, None when that is not known, and what both are relative to."""
    found = read_cloud(path)
    try:
        cloud, origin = brought_near(found)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error
    if found.no_returns:
        say(f"{path}: {no_return_text(found.no_returns)}")
    if origin.any():
        say(f"{path}: {origin_text(origin)}")
    if origins == "fields" and cloud.origins is None:
        raise ArgumentProblem(f"--origins fields: {path} has no {', '.join(VIEWPOINT_FIELDS)}")
    starts = cloud.origins if origins in (None, "fields") else None
    if origins == "sensor":
        if np.abs(cloud.sensor).max() > FAR_M:
            raise ArgumentProblem(f"--origins sensor: {path} does not say where its beams started, and its points lie far from 0 0 0")
        starts = np.broadcast_to(cloud.sensor, cloud.points.shape)
    reach = (KEY_OFFSET - 1) * resolution
    is_finite = np.asarray(np.isfinite(cloud.points if starts is None else np.hstack([cloud.points, starts])).all(axis=1))
    usable = is_finite & (np.abs(cloud.points) < reach).all(axis=1)
    reasons = (
        f"{np.count_nonzero(~is_finite):,} not finite, {np.count_nonzero(is_finite & ~usable):,} beyond the {reach:,.0f} m of an octree"
    )
    if not usable.any():
        raise ValueError(f"{path}: none of its {len(usable):,} points can be used: {reasons}")
    if not usable.all():
        say(f"{path}: points left out: {reasons}")
    return cloud.points[usable], None if starts is None else starts[usable], origin


def cloud_bytes(points: Array, starts: Array | None, resolution: float) -> float:
    """What an octree of N points with beams from `starts` takes at most, roughly: the less of what they touch and of their box."""
    ends = points if starts is None else np.concatenate([points, starts])
    span = np.ptp(ends, axis=0) / resolution
    length = np.zeros(len(points)) if starts is None else np.linalg.norm(points - starts, axis=1) / resolution
    regions = min(np.sum(1 + 3 * length / _REGION_VOXELS), np.prod(span / _REGION_VOXELS + 2))
    blocks = min(np.sum(3 * length / 8), np.prod(span / 8 + 2)) if starts is not None else 0.0
    return float(len(points) * _POINT_BYTES + blocks * _BLOCK_BYTES + regions * _REGION_BYTES)
