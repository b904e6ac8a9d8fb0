"""./export_map: a finished map in the formats that other programs read. No ROS runs, and nothing of the run is changed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from exploration_evaluation import read_sweep_poses, read_trajectory, trajectory_errors
from explore_command.arguments import ArgumentProblem, OneLineParser
from finished_maps import SWEEPS, LoadedMap, load_map
from mapping_tools.cloud_files import read_cloud
from mapping_tools.map_origin import ORIGIN as MAP_ORIGIN
from mapping_tools.tool_errors import code_of
from octomap_server_3dnav.navigation.passages import navigable_terrain
from octomap_server_3dnav.octree.column_runs import VoxelState
from octomap_server_3dnav.octree.map_builder import MapBuilder
from octomap_server_3dnav.octree.octree import OctreeMap
from pose_graph_mapping.session.session_files import pcd_bytes, ply_bytes
from rigid_geometry import read_origin
from robot_body import robot_file
from terrain_tools.criteria import Criteria, read_criteria
from terrain_tools.storey_maps import StoreyMap, pgm_bytes, read_classified, storey_maps, tif_bytes, yaml_bytes
from whole_files import check_files, write_all

OCTREES, CLASSES, CLOUD, ORIGIN = ("map.ot", "map.bt"), "terrain.npz", "cloud.pcd", "world_origin.json"
_ROBOT, _CLOUDS = "robot.yaml", (".pcd", ".ply")
FORMATS = {
    ".ot": "the octree with its log-odds",
    ".bt": "the octree, free and occupied",
    ".pcd": "the merged cloud, without points in free space; of an octree's file, or with --voxels, the centres of its occupied voxels",
    ".ply": "the same",
    ".pgm": "a 2-D map for map_server, with its .yaml",
    ".tif": "the ground's height as a GeoTIFF of float32, in the world's coordinates where the run has true poses, else in map's",
}
_DESCRIPTION = """Writes a finished map as other programs read it. MAP is the folder of a run, or of a session, whose octree and ground are
made anew of its sweeps; or an octomap octree (.bt .ot) for .bt, .ot, .pcd and .ply. 2-D maps and heights are of classified ground, one a
storey: where there are several they are FILE-1, FILE-2, .. from below."""
_EPILOG = f"""Formats: {"; ".join(f"{suffix} {what}" for suffix, what in FORMATS.items())}.
Example: ./export_map runs/ramp-1 --out ramp.pgm ramp.tif. Exit code: 0 all is written, 2 a file or argument is wrong, and nothing is, 130
interrupted, nor is it then."""

Files = list[tuple[Path, bytes, str]]


@dataclass(frozen=True)
class FinishedMap:
    """A run's or session's folder, or an octree's file; what is not there is a ValueError that names it.

    `by`: what an octree is made by of a session's sweeps, and its ground classified by, where the folder does not have them already.
    """

    path: Path
    by: Criteria = field(default_factory=Criteria)

    @cached_property
    def octree(self) -> OctreeMap:
        """Of the file, or of the folder's map.ot, else its map.bt, else its sweeps."""
        path = self._first(OCTREES) if self.path.is_dir() else self.path
        if path is None:
            return self._session.builder.tree
        try:
            return OctreeMap.read(path)
        except OSError as error:
            raise ValueError(f"{path}: {error.strerror or error}") from error

    def points(self, *, voxels: bool) -> tuple[NDArray[np.float64], int]:
        """(N, 3) in map: the merged cloud of a run, or the centres of occupied voxels; how many points the octree says are none."""
        if voxels or not self.path.is_dir():
            return self.octree.occupied_voxels()[0].astype(np.float64), 0
        path = self._first((CLOUD,))
        if path is None:
            raise ValueError(f"{self.path}: {CLOUD} is missing; with --voxels the centres of occupied voxels are written")
        points = read_cloud(path).points
        if self._first(OCTREES) is None:
            return points, 0
        has_gone = in_free_space(self.octree, points)
        return points[~has_gone], int(has_gone.sum())

    @cached_property
    def storeys(self) -> list[StoreyMap]:
        """2-D maps of the classified ground."""
        if not self.path.is_dir():
            raise ValueError(f"{self.path}: an octree is not classified: give a run's folder, with its {CLASSES}")
        path = self._first((CLASSES,))
        if path is not None:
            return storey_maps(read_classified(path, self.octree.resolution))
        if self._first((SWEEPS,)) is None:
            raise ValueError(f"{self.path}: no classified ground there: {CLASSES} is missing, and {SWEEPS}, of which it is made")
        builder, T_map_base = self._session.builder, self._session.T_map_base
        assert T_map_base is not None
        return storey_maps(navigable_terrain(builder.tree.column_runs(), T_map_base, self.by.settings, None, builder.heights))

    @property
    def is_made_anew(self) -> bool:
        """Whether something of it that was asked for was made of its sweeps, by `by`."""
        return "_session" in self.__dict__

    @cached_property
    def place(self) -> tuple[NDArray[np.float64], str]:
        """T_world_map (4, 4), by a run's true poses, and whose coordinates these are; a session without them keeps its own."""
        try:
            estimate, truth = read_sweep_poses(self.path / "trajectory.txt"), read_trajectory(self.path / "trajectory_truth.txt")
            T, origin, whose = trajectory_errors(*estimate, *truth).T_world_map.copy(), ORIGIN, "the world's"
        except ValueError:
            T, origin, whose = np.eye(4), MAP_ORIGIN, "the session's own"
        if (self.path / origin).is_file():
            T[:3, 3] += read_origin(self.path / origin)
        return T, whose

    @cached_property
    def _session(self) -> LoadedMap:
        return load_map(self.path, MapBuilder(self.by.octree, self.by.sensor_model, self.by.robot))

    def _first(self, names: Sequence[str]) -> Path | None:
        return next((self.path / name for name in names if (self.path / name).is_file()), None)


def in_free_space(octree: OctreeMap, points: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(N,) whether a point (N, 3) lies in a voxel that is free, with no occupied one beside it: somebody stood there, and has gone."""
    is_free = octree.states_at(points) == VoxelState.FREE
    for step in np.ndindex(3, 3, 3):
        at = np.flatnonzero(is_free)
        is_free[at] = octree.states_at(points[at] + (np.array(step) - 1) * octree.resolution) != VoxelState.OCCUPIED
    return np.asarray(is_free)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    usage = "./export_map MAP --out FILE [FILE ...] [--voxels]"
    p = OneLineParser(prog="./export_map", usage=usage, description=_DESCRIPTION, epilog=_EPILOG)
    p.add_argument("map", type=Path, metavar="MAP", help="a run's or session's folder, or a .bt or .ot file; it is only read")
    p.add_argument(
        "--out", type=Path, nargs="+", required=True, metavar="FILE", help=f"the suffix tells the format: {' '.join(FORMATS)}; replaced"
    )
    p.add_argument("--voxels", action="store_true", help="as a cloud, the centres of occupied voxels in place of the run's merged cloud")
    p.add_argument(
        "--robot",
        type=robot_file,
        metavar="R",
        help=f"of what is made of sweeps, as in ./explore; default {_ROBOT} of the folder, else husky",
    )
    p.add_argument("--profile", metavar="P", help="parameters of a session's octree and ground, as in ./classify_map")
    return p


def exported(source: FinishedMap, target: Path, *, voxels: bool) -> Files:
    """Files, their content and what they are in words. target: its suffix is one of FORMATS."""
    suffix = target.suffix.lower()
    if suffix == ".ot":
        return [(target, source.octree.ot_bytes(), f"{source.octree.leaf_count:,} leaves")]
    if suffix == ".bt":
        return [(target, source.octree.bt_bytes(), f"{source.octree.leaf_count:,} leaves")]
    if suffix in _CLOUDS:
        points, left_out = source.points(voxels=voxels)
        told = f"{len(points):,} points" + (f"; {left_out:,} in free space are left out" if left_out else "")
        return [(target, (pcd_bytes if suffix == ".pcd" else ply_bytes)(points), told)]
    return [file for number, storey in enumerate(source.storeys) for file in _drawn(source, storey, _named(source, target, number))]


def _named(source: FinishedMap, target: Path, number: int) -> Path:
    return target.with_stem(f"{target.stem}-{number + 1}") if len(source.storeys) > 1 else target


def _drawn(source: FinishedMap, storey: StoreyMap, target: Path) -> Files:
    rows, columns = storey.grey.shape
    known = storey.height[np.isfinite(storey.height)]
    ground = f"ground from {known.min():.2f} to {known.max():.2f} m" if known.size else "no ground"
    what = f"{columns * storey.resolution:.1f} x {rows * storey.resolution:.1f} m, {ground}"
    if target.suffix.lower() == ".tif":
        T_world_map, whose = source.place
        return [(target, tif_bytes(storey, T_world_map), f"{what} in map; its coordinates are {whose}")]
    description = target.with_suffix(".yaml")
    return [(target, pgm_bytes(storey), what), (description, yaml_bytes(storey, target.name), f"for map_server, of {target.name}")]


def export_map(options: argparse.Namespace) -> int:
    """Makes all files before it writes the first; exit code 0. ArgumentProblem, ValueError and OSError as the main tells them."""
    if not options.map.exists():
        raise ArgumentProblem(f"{options.map}: no such file or folder")
    if not options.map.is_dir() and options.map.suffix.lower() not in (".bt", ".ot"):
        raise ArgumentProblem(f"{options.map}: expected a run's folder, or a file that ends in .bt or .ot")
    if options.map.is_dir() and not any((options.map / name).is_file() for name in (*OCTREES, CLASSES, CLOUD, SWEEPS)):
        raise ArgumentProblem(f"{options.map}: no run or session there: none of {', '.join((*OCTREES, CLASSES, CLOUD, SWEEPS))}")
    for target in options.out:
        if target.suffix.lower() not in FORMATS:
            raise ArgumentProblem(f"--out {target}: expected a file that ends in {', '.join(FORMATS)}")
    if options.voxels and not any(target.suffix.lower() in _CLOUDS for target in options.out):
        raise ArgumentProblem(f"--voxels: has no effect on {options.out[0]}; it is for {' and '.join(_CLOUDS)}")
    _check_outputs(options, options.out)
    beside = options.map / _ROBOT
    source = FinishedMap(
        options.map, read_criteria(beside if options.robot is None and beside.is_file() else options.robot, options.profile)
    )
    files = [file for target in options.out for file in exported(source, target, voxels=options.voxels)]
    for option, value in (("--robot", options.robot), ("--profile", options.profile)):
        if value is not None and not source.is_made_anew:
            raise ArgumentProblem(f"{option}: has no effect: what is written of {options.map} is there, and not made anew of its sweeps")
    _check_outputs(options, [path for path, _, _ in files])
    write_all({path: content for path, content, _ in files})
    for path, _, what in files:
        print(f"{path}: {what}")
    return 0


def _check_outputs(options: argparse.Namespace, paths: Sequence[Path]) -> None:
    named = (options.robot, options.profile and Path(options.profile))
    check_files([("--out", path) for path in paths], [options.map, *(path for path in named if path)])


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code 0: all is written; 2: a file or argument is wrong."""
    return code_of("export_map", lambda: export_map(parser().parse_args(argv)))


if __name__ == "__main__":
    sys.exit(main())
