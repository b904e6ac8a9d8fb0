"""The terrain analysis on maps of 3 to 50 million voxels: classification, one more sweep, paths and memory; medians, as a table.

    python benchmarks/terrain_timing.py RUN_DIR [--map FILE.bt] [--tiles 1 4 16] [--sweeps 20] [--calls 15]

With PYTHONPATH as benchmarks/README.md sets it. RUN_DIR is the folder of a finished run (sweeps/, trajectory.txt): its first sweeps make a
live map as the node makes it, with the heights of the hits, put down so many times side by side. Paths lead through a made field of
pillars, as nothing leads from tile to tile. 16 tiles of `ramp` take 4 GB.
"""

import argparse
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from map_rebuild import Array, from_scratch, recorded, tiled
from terrain_classification import LOCAL_RADIUS_M, farthest_node, median_ms, pose_near_the_middle

from octomap_server_3dnav.navigation.planner import PlannerConfig, plan_path
from octomap_server_3dnav.octree.column_runs import ColumnRuns, VoxelState
from octomap_server_3dnav.octree.map_builder import RUNS_MARGIN_M, Beams, MapBuilder
from octomap_server_3dnav.octree.octree import OctreeMap
from octomap_server_3dnav.terrain.classify import Terrain, TerrainConfig, classify
from rigid_geometry.transforms import Transform
from robot_body import RobotBody

FIELD_M, PILLARS_EVERY_M, RESOLUTION_M = 72.0, 4.0, 0.08
Row = tuple[str, str]


def classified(builder: MapBuilder, T_map_base: Transform, radius_m: float | None) -> Terrain:
    """As the node does after a sweep: columns out of the tree, and the terrain in them."""
    runs = builder.runs_around(T_map_base, None if radius_m is None else radius_m + RUNS_MARGIN_M)
    return classify(runs, T_map_base, TerrainConfig(), RobotBody(), radius_m, builder.heights)


def one_more(builder: MapBuilder, sweep: Beams, poses: Array, calls: int) -> float:
    """Median milliseconds to insert the last sweep again and classify around it."""
    placed = list(poses)

    def add() -> None:
        placed.append(poses[-1])
        builder.add_sweep(sweep, len(placed) - 1, np.array(placed))
        classified(builder, poses[-1], LOCAL_RADIUS_M)

    return median_ms(add, calls)


def bytes_of(*parts: object) -> int:
    """What the arrays of some objects take."""
    return sum(int(array.nbytes) for part in parts for array in vars(part).values() if isinstance(array, np.ndarray))


def map_rows(beams: list[Beams], poses: Array, tiles: int, calls: int) -> Iterator[Row]:
    """One size of map."""
    all_beams, all_poses = tiled(beams, poses, tiles * len(beams))
    builder = from_scratch(all_beams, all_poses)
    T_map_base, runs = all_poses[-1], builder.runs_around(all_poses[-1], None)
    millions = float((runs.z_hi.astype(np.int64) - runs.z_lo + 1).sum()) / 1e6
    name = f"{millions:.1f} M voxels"
    yield f"{name}: local 6 m", f"{median_ms(lambda: classified(builder, T_map_base, LOCAL_RADIUS_M), calls):.1f} ms"
    whole = median_ms(lambda: classified(builder, T_map_base, None), calls)
    yield f"{name}: whole map; for a million voxels", f"{whole:.1f} ms; {whole / millions:.1f} ms"
    terrain = classified(builder, T_map_base, None)
    ours, tree = (bytes_of(runs, terrain) + builder.heights.memory_bytes) / 1e6, builder.tree.memory_bytes / 1e6
    yield f"{name}: column runs, heights and terrain; octree", f"{ours:.1f} MB; {tree:.1f} MB"
    yield f"{name}: one more sweep inserted, local 6 m", f"{one_more(builder, all_beams[-1], all_poses, calls):.1f} ms"


def pillar_field() -> tuple[ColumnRuns, Transform]:
    """A level field with pillars of 0.4 m at random places, and a pose in its corner."""
    cells = round(FIELD_M / RESOLUTION_M)
    states = np.full((cells, cells, 18), VoxelState.FREE, dtype=np.uint8)
    states[:, :, 0] = VoxelState.OCCUPIED
    rng = np.random.default_rng(1)
    for x, y in rng.integers(40, cells - 40, (int((FIELD_M / PILLARS_EVERY_M) ** 2), 2)):
        states[x : x + 5, y : y + 5] = VoxelState.OCCUPIED
    T_map_base = np.eye(4)
    T_map_base[:3, 3] = 1.0, 1.0, RESOLUTION_M + RobotBody().base_height_m
    return ColumnRuns.from_dense(states, (0, 0, 0), RESOLUTION_M), T_map_base


def path_rows(calls: int) -> Iterator[Row]:
    """To the farthest node, in the surroundings and in the whole field."""
    runs, T_map_base = pillar_field()
    for name, radius_m in (("local 6 m", LOCAL_RADIUS_M), ("whole field", None)):
        terrain = classify(runs, T_map_base, TerrainConfig(), RobotBody(), radius_m)
        goal = farthest_node(terrain)
        path = plan_path(terrain, goal, PlannerConfig())
        assert path is not None
        milliseconds = median_ms(partial(plan_path, terrain, goal, PlannerConfig()), calls)
        yield f"path of {path.length_m:.0f} m among pillars, {name} ({terrain.label.size} nodes)", f"{milliseconds:.2f} ms"


def file_row(path: Path, calls: int) -> Row:
    """A map from a file, as a whole."""
    octree = OctreeMap.read(path)
    T_map_base = pose_near_the_middle(octree.column_runs(), TerrainConfig(), RobotBody())
    return (
        f"{path.name}: whole map",
        f"{median_ms(lambda: classify(octree.column_runs(), T_map_base, TerrainConfig(), RobotBody(), None), calls):.1f} ms",
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, help="folder of a finished run")
    parser.add_argument("--map", type=Path, help="a .bt or .ot file")
    parser.add_argument("--sweeps", type=int, default=20, help="sweeps of the run that make a tile")
    parser.add_argument("--tiles", type=int, nargs="+", default=[1, 4, 16], help="how many of them lie side by side")
    parser.add_argument("--calls", type=int, default=15, help="calls that a median is taken of")
    options = parser.parse_args()
    beams, poses = recorded(options.run)
    beams, poses = beams[: options.sweeps], poses[: options.sweeps]
    rows = [file_row(options.map, options.calls)] if options.map else []
    rows += path_rows(options.calls)
    print("| what | median |\n|---|---|")
    for row in rows:
        print("| {} | {} |".format(*row))
    for tiles in options.tiles:
        for row in map_rows(beams, poses, tiles, options.calls):
            print("| {} | {} |".format(*row), flush=True)


if __name__ == "__main__":
    main()
