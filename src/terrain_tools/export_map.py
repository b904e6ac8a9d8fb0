"""./export_map: a finished map in the formats that other programs read. No ROS runs, and nothing of the run is changed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from explore_command.arguments import ArgumentProblem, OneLineParser
from mapping_tools.cloud_files import read_cloud
from octomap_server_3dnav.octree.octree import OctreeMap
from octomap_server_3dnav.octree.octree_files import replace_file
from pose_graph_mapping.session.session_files import pcd_bytes, ply_bytes
from rigid_geometry import read_origin
from terrain_tools.storey_maps import StoreyMap, pgm_bytes, read_classified, storey_maps, tif_bytes, yaml_bytes

OCTREES, CLASSES, CLOUD, ORIGIN = ("map.ot", "map.bt"), "terrain.npz", "cloud.pcd", "world_origin.json"
FORMATS = {
    ".ot": "the octree with its log-odds",
    ".bt": "the octree, free and occupied",
    ".pcd": "the merged cloud; of an octree's file, or with --voxels, the centres of its occupied voxels",
    ".ply": "the same",
    ".pgm": "a 2-D map for map_server, with its .yaml",
    ".tif": "the ground's height as a GeoTIFF of float32, in the world's coordinates",
}
_DESCRIPTION = """Writes a finished map as other programs read it. MAP is a run's folder, or an octomap octree (.bt .ot) for .bt, .ot, .pcd
and .ply. 2-D maps and heights are of classified ground, one a storey: where there are several they are FILE-1, FILE-2, .. from below."""
_EPILOG = f"""Formats: {"; ".join(f"{suffix} {what}" for suffix, what in FORMATS.items())}.
Example: ./export_map runs/ramp-1 --out ramp.pgm ramp.tif. Exit code: 0 all is written, 2 a file or argument is wrong, and nothing is."""

Files = list[tuple[Path, bytes, str]]


@dataclass(frozen=True)
class FinishedMap:
    """A run's folder, or an octree's file; what is not there is a ValueError that names it."""

    path: Path

    @cached_property
    def octree(self) -> OctreeMap:
        """Of the file, or of the folder's map.ot, else its map.bt."""
        path = self._first(OCTREES) if self.path.is_dir() else self.path
        try:
            return OctreeMap.read(path)
        except OSError as error:
            raise ValueError(f"{path}: {error.strerror or error}") from error

    def points(self, *, voxels: bool) -> NDArray[np.float64]:
        """(N, 3) in map: the merged cloud of a run, or the centres of occupied voxels."""
        if voxels or not self.path.is_dir():
            return self.octree.occupied_voxels()[0].astype(np.float64)
        return read_cloud(self._first((CLOUD,))).points

    @cached_property
    def storeys(self) -> list[StoreyMap]:
        """2-D maps of the classified ground."""
        if not self.path.is_dir():
            raise ValueError(f"{self.path}: an octree is not classified: give a run's folder, with its {CLASSES}")
        return storey_maps(read_classified(self._first((CLASSES,)), self.octree.resolution))

    @property
    def origin(self) -> NDArray[np.float64]:
        """(3,) where the map's origin lies in the world."""
        return read_origin(self.path / ORIGIN) if (self.path / ORIGIN).is_file() else np.zeros(3)

    def _first(self, names: Sequence[str]) -> Path:
        for name in names:
            if (self.path / name).is_file():
                return self.path / name
        raise ValueError(f"{self.path}: no finished map there: {' or '.join(names)} is missing")


def parser() -> argparse.ArgumentParser:
    """The command line."""
    usage = "./export_map MAP --out FILE [FILE ...] [--voxels]"
    p = OneLineParser(prog="./export_map", usage=usage, description=_DESCRIPTION, epilog=_EPILOG)
    p.add_argument("map", type=Path, metavar="MAP", help="a run's folder, or a .bt or .ot file; it is only read")
    p.add_argument(
        "--out", type=Path, nargs="+", required=True, metavar="FILE", help=f"the suffix tells the format: {' '.join(FORMATS)}; replaced"
    )
    p.add_argument("--voxels", action="store_true", help="as a cloud, the centres of occupied voxels in place of the run's merged cloud")
    return p


def exported(source: FinishedMap, target: Path, *, voxels: bool) -> Files:
    """Files, their content and what they are in words. ValueError for a suffix that is none of FORMATS."""
    suffix = target.suffix.lower()
    if suffix == ".ot":
        return [(target, source.octree.ot_bytes(), f"{source.octree.leaf_count:,} leaves")]
    if suffix == ".bt":
        return [(target, source.octree.bt_bytes(), f"{source.octree.leaf_count:,} leaves")]
    if suffix in (".pcd", ".ply"):
        points = source.points(voxels=voxels)
        return [(target, (pcd_bytes if suffix == ".pcd" else ply_bytes)(points), f"{len(points):,} points")]
    if suffix in (".pgm", ".tif"):
        return [file for number, storey in enumerate(source.storeys) for file in _drawn(source, storey, _named(source, target, number))]
    raise ArgumentProblem(f"--out {target}: expected a file that ends in {', '.join(FORMATS)}")


def _named(source: FinishedMap, target: Path, number: int) -> Path:
    return target.with_stem(f"{target.stem}-{number + 1}") if len(source.storeys) > 1 else target


def _drawn(source: FinishedMap, storey: StoreyMap, target: Path) -> Files:
    rows, columns = storey.grey.shape
    known = storey.height[np.isfinite(storey.height)]
    ground = f"ground from {known.min():.2f} to {known.max():.2f} m" if known.size else "no ground"
    what = f"{columns * storey.resolution:.1f} x {rows * storey.resolution:.1f} m, {ground}"
    if target.suffix.lower() == ".tif":
        return [(target, tif_bytes(storey, source.origin), what)]
    description = target.with_suffix(".yaml")
    return [(target, pgm_bytes(storey), what), (description, yaml_bytes(storey, target.name), f"for map_server, of {target.name}")]


def export_map(options: argparse.Namespace) -> None:
    """Makes all files before it writes the first."""
    if not options.map.exists():
        raise ArgumentProblem(f"{options.map}: no such file or folder")
    if not options.map.is_dir() and options.map.suffix.lower() not in (".bt", ".ot"):
        raise ArgumentProblem(f"{options.map}: expected a run's folder, or a file that ends in .bt or .ot")
    for target in options.out:
        if not target.parent.is_dir():
            raise ArgumentProblem(f"--out {target}: no such folder: {target.parent}")
    source = FinishedMap(options.map)
    files = [file for target in options.out for file in exported(source, target, voxels=options.voxels)]
    for path, content, what in files:
        replace_file(path, content)
        print(f"{path}: {what}")


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code 0: all is written; 2: a file or argument is wrong."""
    try:
        export_map(parser().parse_args(argv))
        return 0
    except OSError as error:
        problem = f"{error.filename}: {error.strerror or error}" if error.filename else str(error)
    except ValueError as error:  # ArgumentProblem among them
        problem = " ".join(str(error).split())
    print(f"./export_map: {problem}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    sys.exit(main())
