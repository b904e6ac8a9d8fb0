"""./classify_map: an octree or a cloud is classified from a start, with its frontiers and a path to a goal. No ROS runs."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from explore_command.arguments import ArgumentProblem, OneLineParser
from mapping_tools.tool_errors import code_of, say
from octomap_server_3dnav.exploration import first_decision
from octomap_server_3dnav.terrain.classify import Terrain
from rigid_geometry import FARTHEST_M
from robot_body import robot_file
from terrain_tools import octree_survey
from terrain_tools.analysis import Analysis, analyse
from terrain_tools.criteria import Criteria, read_criteria
from terrain_tools.ground import Point
from terrain_tools.map_source import CLOUDS, OCTREES, ORIGINS, read_map
from terrain_tools.results import CLASSES, FILES, NUMBERS, PATH, PICTURE, csv_bytes, json_bytes, numbers, ply_bytes, write_results
from whole_files import check_folder

Array = NDArray[np.float64]

FOUND, NOT_FOUND = 0, 1
_USABLE_SHARE = 0.8  # of the memory that is free
_GOAL_TOLERANCE_M = 0.5
_DEFAULTS = Criteria()
_DESCRIPTION = f"""Tells the ground that a robot can drive on from obstacles, cliffs and what was not seen, in a map that is a file,
and finds a way over it. FILE is an octomap octree ({" ".join(OCTREES)}), or a cloud ({" ".join(CLOUDS)}) whose points are put into
voxels; z is up, in metres. The robot stands level at the start, and what it cannot reach from there is not classified. A cloud far from
0 0 0, as in UTM, is brought near: start and goal are in its coordinates, all that is written is relative to origin_m of {NUMBERS}."""
_EPILOG = f"""DIR then holds {CLASSES} (classes in colours), {PATH}, {NUMBERS} and {PICTURE} (from above, storey by storey).
Example: ./classify_map map.bt --start 0 0 0 --goal 12 3 4 --out found.
Exit code: 0 all was found, 1 there is no ground to start from or no path (it says why, and where the nearest ground is), 2 a file or
argument is wrong, or the map takes too much memory, 130 interrupted; after 2 and 130 DIR is as it was."""


def parser() -> argparse.ArgumentParser:
    usage = "./classify_map FILE --start X Y Z --out DIR [options]"
    p = OneLineParser(prog="./classify_map", usage=usage, description=_DESCRIPTION, epilog=_EPILOG)
    p.add_argument("map", type=Path, metavar="FILE", help="it is only read")
    point = ("X", "Y", "Z")
    p.add_argument(
        "--start",
        nargs=3,
        type=float,
        required=True,
        metavar=point,
        help=f"on the ground, or off it by up to {_DEFAULTS.robot.standing_tolerance_m:.2g} m in height and "
        f"half the robot's length, {_DEFAULTS.robot.half_length_m:.2g} m, aside",
    )
    p.add_argument("--goal", nargs=3, type=float, metavar=point, help="on the ground, as --start is, on any storey; without it, no path")
    p.add_argument(
        "--goal-tolerance", type=float, metavar="M", help=f"how far from the goal a path may end; default {_GOAL_TOLERANCE_M:g} m"
    )
    p.add_argument("--robot", type=robot_file, metavar="R", help="the robot, by name or FILE as in ./explore; default husky")
    p.add_argument(
        "--profile",
        metavar="P",
        help="parameters over their defaults: a profile as of ./explore, or a YAML FILE, by section (terrain, planner, frontier, "
        "sensor_model) as in config/octomap_server_3dnav.yaml; see docs/parameters.md",
    )
    p.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for what is found; made where it is not there")
    p.add_argument(
        "--resolution", type=float, metavar="M", help="edge of the voxels that a cloud is put into; default 0.08 m, or the profile's"
    )
    p.add_argument(
        "--origins",
        choices=ORIGINS,
        help="where a cloud's beams started, to tell free space: fields vp_x vp_y vp_z; sensor: one place, the VIEWPOINT of a PCD or else "
        "the origin of the cloud; none: not known, and then no drop is seen, and edges are frontiers. Default: fields where there are any, "
        "else none",
    )
    p.add_argument(
        "--max-memory",
        type=float,
        metavar="GB",
        help=f"refuse a map that takes more, before it is read; default: {_USABLE_SHARE:.0%} of what is free".replace("%", "%%"),
    )
    return p


def classify_map(options: argparse.Namespace) -> int:
    """Reads, classifies, plans, and only then writes and prints; the exit code.

    ArgumentProblem, ValueError and OSError for code 2: then the folder is as it was.
    """
    _check(options)
    by = read_criteria(options.robot, options.profile)
    for module in (octree_survey, first_decision):
        module.compile_kernels()  # loads them: the times are those of the map
    begun = time.perf_counter()
    found_map = read_map(options.map, by, options.resolution, options.origins, _allowed_bytes(options.max_memory), say)
    read_s = time.perf_counter() - begun
    start, goal = (_near(point, found_map.origin) for point in (options.start, options.goal))
    assert start is not None
    found = analyse(found_map.octree, by, start, goal, _GOAL_TOLERANCE_M if options.goal_tolerance is None else options.goal_tolerance)
    asked = Asked(start, goal, found_map.origin.tolist())
    write_results(options.out, _content(options, by, found, asked, {"reading": round(read_s, 4)}))
    if found.terrain is not None:
        print(summary(found, found.terrain))
    if found.problem:
        say(f"./classify_map: {found.problem}")
    return NOT_FOUND if found.problem else FOUND


@dataclass(frozen=True)
class Asked:
    """Start and goal relative to the map's origin, and that origin in the coordinates of the file."""

    start: Point
    goal: Point | None
    origin: list[float]


def _near(point: list[float] | None, origin: Array) -> Point | None:
    if point is None:
        return None
    x, y, z = (np.array(point) - origin).tolist()
    return x, y, z


def _check(options: argparse.Namespace) -> None:
    for name in ("start", "goal"):
        point = getattr(options, name)
        if point is not None and not all(abs(v) <= FARTHEST_M for v in point):
            raise ArgumentProblem(f"--{name} {' '.join(f'{v:g}' for v in point)}: expected three numbers of at most {FARTHEST_M:g} m")
    for name, value in (("goal-tolerance", options.goal_tolerance), ("max-memory", options.max_memory)):
        if value is not None and not (math.isfinite(value) and value > 0):
            raise ArgumentProblem(f"--{name} {value:g}: expected a positive number")
    if options.goal_tolerance is not None and options.goal is None:
        raise ArgumentProblem("--goal-tolerance: has no effect without --goal")
    named = (options.robot, options.profile and Path(options.profile))
    check_folder("--out", options.out, [options.map, *(path for path in named if path)], FILES)


def _allowed_bytes(max_memory_gb: float | None) -> float:
    """What a map may take, by default a share of the memory that is free; infinite where the system does not say."""
    if max_memory_gb is not None:
        return max_memory_gb * 1e9
    try:
        lines = Path("/proc/meminfo").read_text(encoding="ascii").splitlines()
        free_kib = next(int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, StopIteration, ValueError):
        return math.inf
    return _USABLE_SHARE * 1024 * free_kib


def _content(options: argparse.Namespace, by: Criteria, found: Analysis, asked: Asked, time_s: dict[str, float]) -> dict[str, bytes]:
    """What is written, by file."""
    files: dict[str, bytes] = {}
    if found.terrain is not None:
        from terrain_tools.picture import png_bytes  # loads matplotlib: only where there is something to draw

        files[CLASSES] = ply_bytes(found.terrain, asked.origin)
        begun = time.perf_counter()
        files[PICTURE] = png_bytes(found, found.terrain, options.map.name, asked.start, asked.goal)
        time_s["picture"] = round(time.perf_counter() - begun, 4)
    if found.path is not None:
        files[PATH] = csv_bytes(found.path)
    places = {"origin_m": asked.origin, "start_m": asked.start, "goal_m": asked.goal}
    content: dict[str, Any] = {"file": str(options.map), **places, **numbers(found, by)}
    content["time_s"] = {**time_s, **content["time_s"]}
    return files | {NUMBERS: json_bytes(content)}


def summary(found: Analysis, terrain: Terrain) -> str:
    """What is printed of a map with a start."""
    lines = [f"{terrain.traversable_area_m2:,.1f} m2 of ground in reach; frontiers: {len(found.frontiers)}; {_times(found)}"]
    if found.path is not None:
        rise = found.path.points[-1, 2] - found.path.points[0, 2]
        lines.append(f"path of {found.path.length_m:,.1f} m, its end {abs(rise):.1f} m {'above' if rise >= 0 else 'below'} its start")
    return "\n".join(lines)


def _times(found: Analysis) -> str:
    return ", ".join(f"{step.replace('_', ' ')} {1e3 * seconds:,.0f} ms" for step, seconds in found.time_s.items())


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code 0: all was found; 1: no start or no path; 2: a file or argument is wrong."""
    return code_of("classify_map", lambda: _classified(parser().parse_args(argv)))


def _classified(options: argparse.Namespace) -> int:
    try:
        return classify_map(options)
    except MemoryError as error:
        raise MemoryError("the memory does not suffice; --max-memory refuses such maps before they are read") from error


if __name__ == "__main__":
    sys.exit(main())
