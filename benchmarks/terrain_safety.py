"""What this version would call wrongly safe and wrongly unsafe in the maps of finished runs, beside their true worlds; as a table.

    python benchmarks/terrain_safety.py RUN_DIR .. [--set slope_tolerance_rad=0.035 ..] [--way]

With PYTHONPATH as benchmarks/README.md sets it. A run's sweeps are put into a map at the poses that it ended with, the map is classified
as a whole and judged as in a run's summary. --set tries other values of `octomap_server_3dnav_node`'s ~terrain/ parameters. A few seconds
a run. --way judges the local map after every sweep instead, where a path may lead before the next one: as far around the robot as it
drives, and as far from floor that was not seen as paths keep. Half a minute a run.
"""

import argparse
from pathlib import Path

import numpy as np
import yaml
from map_rebuild import Array, from_scratch, recorded
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from exploration_evaluation import CELL_M, RobotShape, reachable_ground, read_mesh, read_trajectory, trajectory_errors
from exploration_evaluation.classification import EDGE, Classification, classification
from exploration_evaluation.true_classes import true_classes
from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.octree.map_builder import RUNS_MARGIN_M, MapBuilder, MapConfig
from octomap_server_3dnav.octree.octree import SensorModel
from octomap_server_3dnav.terrain.classify import Terrain, TerrainConfig, classify
from rigid_geometry import transform_points
from robot_body import RobotBody
from stage_config import load_config
from stop_scan_and_go import StopScanAndGoConfig

LOCAL_M, CLEARANCE_M = ExplorationConfig().local_radius_m, ExplorationConfig().unknown_clearance_m
DRIVEN_M = StopScanAndGoConfig().max_distance_m
END_HEAD = "| run | wrongly safe beyond the edge, m2 | within it | wrongly unsafe | of reachable |\n|---|---|---|---|---|"
WAY_HEAD = (
    f"| run | wrongly safe within {DRIVEN_M} m beyond the edge, most at once, m2 | within it | both, mean | sweeps |\n|---|---|---|---|---|"
)


class World:
    """What is true about a run, and its sweeps."""

    def __init__(self, run: Path) -> None:
        truth, estimate = read_trajectory(run / "trajectory_truth.txt"), read_trajectory(run / "trajectory.txt")
        mesh, robot, cell_m = read_mesh(run / "world.ply"), RobotShape(), CELL_M
        ground = reachable_ground(*mesh, truth[1][0, :3, 3], robot, cell_m)
        self.area_m2, self.true = ground.area_m2, true_classes(*mesh, ground, robot, cell_m)
        self.T_world_map = trajectory_errors(*estimate, *truth).T_world_map
        self.beams, self.poses = recorded(run)

    def judged(self, terrain: Terrain, near: NDArray[np.bool_] | slice = slice(None)) -> Classification:
        """The judgement of those voxels of a terrain."""
        centres = transform_points(self.T_world_map, terrain.centers().astype(np.float64))
        return classification(self.true, centres[near], terrain.label[near])


def at_the_end(world: World, config: TerrainConfig) -> tuple[float, float, float, float]:
    """m2 wrongly safe beyond one voxel's edge and within it, m2 wrongly unsafe, and m2 of all reachable places."""
    builder, T_map_base = from_scratch(world.beams, world.poses), world.poses[-1]
    found = world.judged(classify(builder.runs_around(T_map_base, None), T_map_base, config, RobotBody(), None, builder.heights))
    edge = found.false_safe_by_cause[EDGE]
    return found.false_safe_m2 - edge, edge, found.false_unsafe_m2, world.area_m2


def on_the_way(world: World, config: TerrainConfig) -> tuple[float, float, float, float]:
    """m2 wrongly safe around the robot beyond one voxel's edge and within it, where they are most; their mean; and the number of sweeps."""
    builder, found = MapBuilder(MapConfig(), SensorModel(), RobotBody()), []
    for i, sweep in enumerate(world.beams):
        builder.add_sweep(sweep, i, world.poses[: i + 1])
        T_map_base = world.poses[i]
        terrain = classify(
            builder.runs_around(T_map_base, LOCAL_M + RUNS_MARGIN_M), T_map_base, config, RobotBody(), LOCAL_M, builder.heights
        )
        judged = world.judged(terrain, _may_be_driven(terrain, T_map_base))
        edge = judged.false_safe_by_cause[EDGE]
        found.append((judged.false_safe_m2 - edge, edge))
    beyond, within = np.array(found).T
    return beyond.max(), within.max(), (beyond + within).mean(), len(found)


def _may_be_driven(terrain: Terrain, T_map_base: Array) -> NDArray[np.bool_]:
    """(N,) voxels to which a path may lead before the next sweep."""
    centres, unknown = terrain.centers(), terrain.frontiers()
    off = centres[:, :2] - T_map_base[:2, 3]
    gaps = cKDTree(centres[unknown]).query(centres)[0] if unknown.size else np.full(len(centres), np.inf)
    return np.asarray((np.hypot(off[:, 0], off[:, 1]) <= DRIVEN_M) & (gaps >= CLEARANCE_M))


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN_DIR", help="folders of finished runs in simulated worlds")
    parser.add_argument("--set", nargs="+", default=[], metavar="NAME=VALUE", help="other values of ~terrain/ parameters")
    parser.add_argument("--way", action="store_true", help="after every sweep, around the robot")
    arguments = parser.parse_args()
    values = {name: yaml.safe_load(text) for name, _, text in (item.partition("=") for item in arguments.set)}
    config = load_config(TerrainConfig, values)
    judge, row = (on_the_way, way_row) if arguments.way else (at_the_end, end_row)
    print(WAY_HEAD if arguments.way else END_HEAD)
    rows = []
    for run in arguments.runs:
        rows.append(judge(World(run), config))
        print(row(run.name, *rows[-1]), flush=True)
    print(row("**mean**", *np.mean(rows, axis=0)))


def end_row(name: str, beyond: float, edge: float, unsafe: float, area: float) -> str:
    """One line of the table."""
    return f"| {name} | {beyond:.3f} | {edge:.3f} | {unsafe:.1f} | {100 * unsafe / area:.1f} % |"


def way_row(name: str, beyond: float, edge: float, mean: float, sweeps: float) -> str:
    """The same of what was judged on the way."""
    return f"| {name} | {beyond:.3f} | {edge:.3f} | {mean:.4f} | {sweeps:.0f} |"


if __name__ == "__main__":
    main()
