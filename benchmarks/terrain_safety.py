"""What this version would call wrongly safe and wrongly unsafe in the maps of finished runs, beside their true worlds; as a table.

    python benchmarks/terrain_safety.py RUN_DIR .. [--set slope_margin_rad=0.035 ..]

With PYTHONPATH as benchmarks/README.md sets it. A run's sweeps are put into a map at the poses that it ended with, the map is classified
as a whole and judged as in a run's summary. --set tries other values of `octomap_server_3dnav_node`'s ~terrain/ parameters. A few seconds
a run.
"""

import argparse
from pathlib import Path

import numpy as np
import yaml
from map_rebuild import from_scratch, recorded

from exploration_evaluation import EvaluationConfig, RobotShape, reachable_ground, read_mesh, read_trajectory, trajectory_errors
from exploration_evaluation.classification import EDGE, classification, true_classes
from octomap_server_3dnav.terrain import TerrainConfig, classify
from rigid_geometry import transform_points
from stage_config import load_config


def judged(run: Path, config: TerrainConfig) -> tuple[float, float, float, float]:
    """m2 wrongly safe beyond one voxel's edge and within it, m2 wrongly unsafe, and m2 of all reachable places."""
    truth, estimate = read_trajectory(run / "trajectory_truth.txt"), read_trajectory(run / "trajectory.txt")
    mesh, robot, cell_m = read_mesh(run / "world.ply"), RobotShape(), EvaluationConfig().cell_m
    ground = reachable_ground(*mesh, truth[1][0, :3, 3], robot, cell_m)
    beams, poses = recorded(run)
    builder = from_scratch(beams, poses)
    terrain = classify(builder.runs_around(poses[-1], None), poses[-1], config, None, builder.heights)
    centres = transform_points(trajectory_errors(*estimate, *truth).T_world_map, terrain.centers().astype(np.float64))
    found = classification(true_classes(*mesh, ground, robot, cell_m), centres, terrain.label)
    edge = found.false_safe_by_cause[EDGE]
    return found.false_safe_m2 - edge, edge, found.false_unsafe_m2, ground.area_m2


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN_DIR", help="folders of finished runs in simulated worlds")
    parser.add_argument("--set", nargs="+", default=[], metavar="NAME=VALUE", help="other values of ~terrain/ parameters")
    arguments = parser.parse_args()
    values = {name: yaml.safe_load(text) for name, _, text in (item.partition("=") for item in arguments.set)}
    config = load_config(TerrainConfig, values)
    print("| run | wrongly safe beyond the edge, m2 | within it | wrongly unsafe | of reachable |\n|---|---|---|---|---|")
    rows = []
    for run in arguments.runs:
        rows.append(judged(run, config))
        print(row(run.name, *rows[-1]), flush=True)
    print(row("**mean**", *np.mean(rows, axis=0)))


def row(name: str, beyond: float, edge: float, unsafe: float, area: float) -> str:
    """One line of the table."""
    return f"| {name} | {beyond:.3f} | {edge:.2f} | {unsafe:.1f} | {100 * unsafe / area:.1f} % |"


if __name__ == "__main__":
    main()
