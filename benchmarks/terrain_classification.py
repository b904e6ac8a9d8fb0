"""Times of column runs, terrain classification, frontiers and a path, as medians in milliseconds; one version beside another.

    python benchmarks/terrain_classification.py [MAP.bt] [--session DIR] [--sweeps 20] [--runs 15] [--against SRC:BINDING]

With PYTHONPATH as ./check sets it. Always measured: a made two-level world of 20 x 20 m. MAP.bt adds an octree file, the robot on ground
near its middle. DIR adds the live map of a recorded run (sweeps/*.npz and trajectory.txt, as the pose graph saves them) after that many
sweeps; larger ones are terrain_timing.py's. A live tree was grown voxel by voxel and lies all over the memory; a file's is friendlier.
--against takes the PYTHONPATH of another version, which this file then measures in turns with this one.
"""

import argparse
import json
import math
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from map_rebuild import from_scratch, recorded
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.frontiers import FrontierConfig, find_frontiers
from octomap_server_3dnav.navigation.planner import PlannerConfig, plan_path
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.map_builder import RUNS_MARGIN_M
from octomap_server_3dnav.octree.octree import OctreeMap
from octomap_server_3dnav.terrain.classify import Terrain, TerrainClass, TerrainConfig, classify
from robot_body import RobotBody

LOCAL_RADIUS_M = 6.0
TURNS = 3  # of the versions that are compared
Array = NDArray[np.float64]
Times = dict[str, float]
Corner = tuple[float, float, float]
Box = tuple[Corner, Corner] | tuple[None, None]


def two_level_world(resolution: float = 0.08) -> ColumnRuns:
    """A floor of 20 x 20 m with a few walls and a deck at 1.6 m that a ramp leads to."""
    states = np.zeros((250, 250, 60), dtype=np.uint8)
    states[:, :, 8], states[:, :, 9:] = 2, 1
    x = (np.arange(70) + 0.5) * resolution
    for ix, level in enumerate(np.floor(x * math.tan(math.radians(18.0)) / resolution).astype(int)):
        states[100 + ix, 100:140, 8 : 8 + level], states[100 + ix, 100:140, 8 + level] = 0, 2
    states[170:230, 60:180, 28], states[170:230, 60:180, 29:] = 2, 1
    for wall in (np.s_[0], np.s_[-1], np.s_[:, 0], np.s_[:, -1], np.s_[60, 40:200], np.s_[20:100, 220]):
        states[wall][..., 8:40] = 2
    return ColumnRuns.from_dense(states, (0, 0, -8), resolution)


def pose_near_the_middle(runs: ColumnRuns, config: TerrainConfig, robot: RobotBody) -> Array:
    """A level pose on the surface nearest to the map's middle that has the most ground around it, of a few tried."""
    middle = np.array([runs.nx, runs.ny]) // 2
    tops = np.flatnonzero(runs.occupied)
    column = runs.columns[tops]
    gap = np.hypot(column // runs.ny - middle[0], column % runs.ny - middle[1])
    best: tuple[int, Array] | None = None
    for top in tops[np.argsort(gap, kind="stable")][:4000:100]:
        T_map_base = np.eye(4)
        key = np.array(
            [runs.columns[top] // runs.ny + runs.origin_key[0], runs.columns[top] % runs.ny + runs.origin_key[1], runs.z_hi[top]]
        )
        T_map_base[:3, 3] = (key + 0.5) * runs.resolution + [0.0, 0.0, robot.base_height_m]
        ground = int(np.count_nonzero(classify(runs, T_map_base, config, robot, LOCAL_RADIUS_M).label == TerrainClass.TRAVERSABLE))
        if best is None or ground > best[0]:
            best = ground, T_map_base
    if best is None or best[0] == 0:
        raise ValueError("no ground for the robot near the middle of the map")
    return best[1]


def median_ms(call: Callable[[], object], runs: int) -> float:
    """Median wall time of a call, after one that compiles."""
    call()
    times = []
    for _ in range(runs):
        begin = time.perf_counter()
        call()
        times.append(1e3 * (time.perf_counter() - begin))
    return statistics.median(times)


def farthest_node(terrain: Terrain) -> int:
    """The reached traversable node farthest from the robot."""
    nodes = np.flatnonzero(terrain.reached & (terrain.label == TerrainClass.TRAVERSABLE))
    return int(nodes[np.argmax(np.linalg.norm(terrain.centers(nodes) - np.asarray(terrain.robot_xyz), axis=1))])


def runs_rows(name: str, runs: ColumnRuns, T_map_base: Array, count: int) -> Iterator[tuple[str, float]]:
    """Classification, frontiers and a path of runs that are there."""
    planner = PlannerConfig()
    for scope, radius in (("local 6 m", LOCAL_RADIUS_M), ("whole map", None)):
        terrain = classify(runs, T_map_base, TerrainConfig(), RobotBody(), radius)
        what = f"{name}, {scope} ({terrain.label.size} voxels)"
        yield f"{what}: classify", median_ms(partial(classify, runs, T_map_base, TerrainConfig(), RobotBody(), radius), count)
        yield f"{what}: frontiers", median_ms(partial(find_frontiers, terrain, T_map_base, FrontierConfig(), planner), count)
        if terrain.departure is not None:
            yield f"{what}: path", median_ms(partial(plan_path, terrain, farthest_node(terrain), planner), count)


def classified(octree: OctreeMap, T_map_base: Array, radius_m: float | None, box: Box) -> Terrain:
    """Columns out of a box of the tree, and the terrain in them."""
    return classify(octree.column_runs(*box), T_map_base, TerrainConfig(), RobotBody(), radius_m)


def octree_rows(name: str, octree: OctreeMap, T_map_base: Array, count: int) -> Iterator[tuple[str, float]]:
    """Column runs and classification out of an octree, as after every sweep."""
    x, y = T_map_base[:2, 3]
    reach = LOCAL_RADIUS_M + RUNS_MARGIN_M
    around = (x - reach, y - reach, -np.inf), (x + reach, y + reach, np.inf)
    scopes: tuple[tuple[str, float | None, Box], ...] = (("local 6 m", LOCAL_RADIUS_M, around), ("whole map", None, (None, None)))
    for scope, radius, box in scopes:
        yield f"{name}, {scope}: column runs", median_ms(partial(octree.column_runs, *box), count)
        yield f"{name}, {scope}: column runs and classify", median_ms(partial(classified, octree, T_map_base, radius, box), count)


def measure(arguments: argparse.Namespace) -> Times:
    """Everything that was asked for."""
    made = two_level_world()
    rows = list(runs_rows("made world", made, pose_near_the_middle(made, TerrainConfig(), RobotBody()), arguments.runs))
    if arguments.map:
        octree = OctreeMap.read(arguments.map)
        rows += octree_rows(
            Path(arguments.map).name, octree, pose_near_the_middle(octree.column_runs(), TerrainConfig(), RobotBody()), arguments.runs
        )
    if arguments.session:
        beams, poses = recorded(arguments.session)
        beams, poses = beams[: arguments.sweeps], poses[: arguments.sweeps]
        rows += octree_rows(f"live map of {len(beams)} sweeps", from_scratch(beams, poses).tree, poses[-1], arguments.runs)
    return dict(rows)


def measure_in(python_path: str) -> Times:
    """The same in a process of its own, with that PYTHONPATH."""
    command = [sys.executable, os.path.abspath(__file__), *sys.argv[1:], "--json"]
    done = subprocess.run(command, env={**os.environ, "PYTHONPATH": python_path}, stdout=subprocess.PIPE, text=True, check=True)
    return {name: float(value) for name, value in json.loads(done.stdout).items()}


def compare(other: str) -> None:
    """Measure both versions in turns and print them side by side."""
    pairs = [(measure_in(other), measure_in(os.environ.get("PYTHONPATH", ""))) for _ in range(TURNS)]
    print("| what | other ms | this ms | ratio |\n|---|---|---|---|")
    for name in pairs[0][1]:
        before, now = (statistics.median(pair[i].get(name, math.nan) for pair in pairs) for i in (0, 1))
        print(f"| {name} | {before:.2f} | {now:.2f} | {now / before:.2f} |")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("map", nargs="?", help="a .bt or .ot file")
    parser.add_argument("--session", type=Path, help="folder of a recorded run")
    parser.add_argument("--sweeps", type=int, default=20, help="sweeps of it to insert")
    parser.add_argument("--runs", type=int, default=15, help="calls that a median is taken of")
    parser.add_argument("--against", help="PYTHONPATH of another version")
    parser.add_argument("--json", action="store_true", help="print one object of names and milliseconds")
    arguments = parser.parse_args()
    if arguments.against and not arguments.json:
        return compare(arguments.against)
    times = measure(arguments)
    if arguments.json:
        return print(json.dumps(times))
    print("| what | median ms |\n|---|---|")
    for name, milliseconds in times.items():
        print(f"| {name} | {milliseconds:.2f} |")


if __name__ == "__main__":
    main()
