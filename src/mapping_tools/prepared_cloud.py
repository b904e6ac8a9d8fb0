"""A cloud of a file, made ready to be matched: near the origin, without beams that met nothing, as voxel means."""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from explore_command.arguments import ArgumentProblem
from mapping_tools.cloud_files import VIEWPOINT_FIELDS, CloudFile, brought_near, read_cloud
from mapping_tools.tool_errors import say
from mapping_tools.uos_scan import SUFFIX as UOS_SUFFIX
from mapping_tools.uos_scan import read_uos_scan
from pose_graph_mapping.registration.cloud import PointCloud, merged, viewpoints, voxel_downsample
from rigid_geometry import FAR_M

Array = NDArray[np.float64]

_ONE_RANGE_M = 0.02
_LEAST_SHARE, _LEAST_COUNT = 0.005, 20  # so many beams that end equally far, and farthest, met nothing


@dataclass(frozen=True, eq=False)
class Prepared:
    """A cloud to be matched, relative to `origin` (3,) of its file's coordinates, which is 0 0 0 unless these are far away."""

    cloud: PointCloud
    origin: Array


def prepared(path: Path, origins: str | None, min_range_m: float, voxel_m: float) -> Prepared:
    """The finite points of a file as voxel means, with origins as asked for; ValueError when there are none. Says what it did."""
    found, origin = _near(path)
    if origins is None and found.origins is None and np.abs(found.sensor).max() > FAR_M:
        origins = "none"
        say(f"{path}: lies far from 0 0 0 and does not say where its beams started: free space is not known")
    if origins == "fields" and found.origins is None:
        raise ArgumentProblem(f"--origins fields: {path} has no {', '.join(VIEWPOINT_FIELDS)}")
    cloud = PointCloud.of_finite(found.points, found.origins if origins in (None, "fields") else None)
    starts = cloud.origins if cloud.origins is not None else found.sensor
    ranges = np.linalg.norm(cloud.points - starts, axis=1)
    is_echo = met_something(ranges)
    if not is_echo.all():
        said = f"{np.count_nonzero(~is_echo):,} points, all {ranges.max():.2f} m away and none farther, left out: nothing was met there"
        print(f"{path}: {said}", file=sys.stderr, flush=True)
    cloud = cloud.selected(is_echo & (ranges >= min_range_m))
    if len(cloud) == 0:
        raise ArgumentProblem(f"{path}: none of its {len(found.points)} points is finite and at least {min_range_m:g} m away")
    try:
        means = _averaged(cloud, voxel_m)
    except ValueError as error:
        raise ArgumentProblem(f"{path}: {error}") from error
    dropped = f", {cloud.dropped:,} not finite left out" if cloud.dropped else ""
    zeros = f", {found.no_returns:,} beams without an echo left out" if found.no_returns else ""
    far = f"; matched around {' '.join(f'{v:.0f}' for v in origin)}" if origin.any() else ""
    say(f"{path}: {len(cloud):,} points{dropped}{zeros}; {len(means):,} means of voxels of {voxel_m:g} m{far}")
    return Prepared(_with_sensor(means, found) if means.origins is None and origins != "none" else means, origin)


def _near(path: Path) -> tuple[CloudFile, Array]:
    found = read_uos_scan(path) if path.suffix.lower() == UOS_SUFFIX else read_cloud(path)
    try:
        return brought_near(found)
    except ValueError as error:
        raise ArgumentProblem(f"{path}: {error}") from error


def met_something(ranges: Array) -> NDArray[np.bool_]:
    """(N,) which beams ended on something: many that end at one range, farther than all others, show the sensor's limit instead."""
    if not len(ranges):
        return np.ones(0, dtype=np.bool_)
    at_limit = ranges > ranges.max() - _ONE_RANGE_M
    is_limit = _LEAST_SHARE < np.mean(at_limit) < 1.0 and np.count_nonzero(at_limit) >= _LEAST_COUNT
    return ~at_limit if is_limit else np.ones(len(ranges), dtype=np.bool_)


def _averaged(cloud: PointCloud, voxel_m: float) -> PointCloud:
    """Voxel means, those of every standpoint on their own; the match averages in the same voxels, so nothing is lost."""
    if cloud.origins is None:
        return voxel_downsample(cloud, voxel_m)
    _, standpoint = viewpoints(cloud.origins)
    return merged([voxel_downsample(cloud.selected(standpoint == k), voxel_m) for k in np.unique(standpoint)])


def _with_sensor(means: PointCloud, found: CloudFile) -> PointCloud:
    return PointCloud(means.points, np.tile(found.sensor, (len(means), 1)), None, means.dropped)
