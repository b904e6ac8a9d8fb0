"""Times of local and global terrain classification, of finding frontiers and of a path, as medians in milliseconds.

    PYTHONPATH=src:BINDING python benchmarks/terrain_classification.py [MAP.bt] [--runs 15]

Without a map: a made two-level world of 20 x 20 m. With one: an octree file, the robot on ground near its middle. BINDING is the folder
of the octree's extension module, needed for a map only.
"""

import argparse
import math
import statistics
import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.column_runs import ColumnRuns
from octomap_server_3dnav.frontiers import FrontierConfig, find_frontiers
from octomap_server_3dnav.planner import PlannerConfig, plan_path
from octomap_server_3dnav.terrain import Terrain, TerrainClass, TerrainConfig, classify

LOCAL_RADIUS_M = 6.0


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


def load_runs(path: str) -> ColumnRuns:
    """Column runs of an octree file."""
    from octomap_server_3dnav.octree import OctreeMap

    return OctreeMap.read(path).column_runs()


def pose_near_the_middle(runs: ColumnRuns, config: TerrainConfig) -> NDArray[np.float64]:
    """A level pose on the surface nearest to the map's middle that has the most ground around it, of a few tried."""
    middle = np.array([runs.nx, runs.ny]) // 2
    tops = np.flatnonzero(runs.occupied)
    column = runs.columns[tops]
    gap = np.hypot(column // runs.ny - middle[0], column % runs.ny - middle[1])
    best: tuple[int, NDArray[np.float64]] | None = None
    for top in tops[np.argsort(gap, kind="stable")][:4000:100]:
        T_map_base = np.eye(4)
        key = np.array(
            [runs.columns[top] // runs.ny + runs.origin_key[0], runs.columns[top] % runs.ny + runs.origin_key[1], runs.z_hi[top]]
        )
        T_map_base[:3, 3] = (key + 0.5) * runs.resolution + [0.0, 0.0, config.base_height_m]
        ground = int(np.count_nonzero(classify(runs, T_map_base, config, LOCAL_RADIUS_M).label == TerrainClass.TRAVERSABLE))
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


def main() -> None:
    """Print one line a step."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("map", nargs="?")
    parser.add_argument("--runs", type=int, default=15)
    arguments = parser.parse_args()
    config, planner = TerrainConfig(), PlannerConfig()
    runs = load_runs(arguments.map) if arguments.map else two_level_world()
    T_map_base = pose_near_the_middle(runs, config)
    print(f"{runs.nx} x {runs.ny} columns of {runs.resolution} m, {int(runs.occupied.sum())} occupied runs")
    print(f"robot at {T_map_base[:3, 3].round(2)}")
    for name, radius in ((f"local ({LOCAL_RADIUS_M} m)", LOCAL_RADIUS_M), ("global", None)):
        terrain = classify(runs, T_map_base, config, radius)
        print(f"{name}: classes {np.bincount(terrain.label, minlength=5).tolist()}")
        print(f"  classify  {median_ms(lambda r=radius: classify(runs, T_map_base, config, r), arguments.runs):8.2f} ms")
        print(
            f"  frontiers {median_ms(lambda t=terrain: find_frontiers(t, T_map_base, FrontierConfig(), planner), arguments.runs):8.2f} ms"
        )
        if terrain.departure is not None:
            goal = farthest_node(terrain)
            print(f"  path      {median_ms(lambda t=terrain, g=goal: plan_path(t, g, planner), arguments.runs):8.2f} ms")


if __name__ == "__main__":
    main()
