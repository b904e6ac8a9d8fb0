"""What each principle of the terrain is worth: maps of finished runs, with worse ranges and poses, and with parts switched off.

    python benchmarks/terrain_ablation.py RUN_DIR .. [--off NAME ..] [--set NAME=VALUE ..] [--noise NAME ..] [--each]

With PYTHONPATH as benchmarks/README.md sets it. A run's sweeps are put into a map at the poses that it ended with: as they are, with 1 and
2 cm more noise of the ranges, and with errors of 1 cm and 0.1 degrees of every pose. The whole map is classified and held against the true
world. `--off` switches one or more of `VARIANTS` off, a row each ("all": every one by itself). A part lives as long as switching it off
moves a figure by more than the spread between seeds. Maps are kept in the cache: 30 s a run the first time, then 0.1 s.
"""

import argparse
import pickle
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from unittest import mock

import numpy as np
import yaml
from map_rebuild import Array, from_scratch, recorded
from numpy.typing import NDArray

from exploration_evaluation import CELL_M, RobotShape, reachable_ground, read_mesh, read_trajectory, trajectory_errors
from exploration_evaluation.classification import EDGE, classification
from exploration_evaluation.true_classes import TrueClasses, true_classes
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.map_builder import Beams
from octomap_server_3dnav.octree.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain import classify as classification_stage
from octomap_server_3dnav.terrain import scene
from octomap_server_3dnav.terrain.classify import TerrainConfig, classify
from octomap_server_3dnav.terrain.config import Limits
from octomap_server_3dnav.terrain.surfaces import Surfaces
from rigid_geometry import transform_from_rpy, transform_points
from robot_body import RobotBody
from stage_config import load_config

NOISES = {"as it is": (0.0, 0.0, 0.0), "+1 cm": (0.01, 0.0, 0.0), "+2 cm": (0.02, 0.0, 0.0), "poses": (0.0, 0.01, np.deg2rad(0.1))}
"""Name -> sigma of ranges in m, of a pose's place in m along each axis, of its angles in rad about each."""


def as_configured(limits: Limits) -> Limits:
    """Nothing is changed."""
    return limits


@dataclass(frozen=True)
class Off:
    """What is to be changed to switch a part off: values of `TerrainConfig`, functions that `terrain.scene` calls, or limits."""

    config: dict[str, object] = field(default_factory=dict)
    scene: dict[str, Callable[..., object]] = field(default_factory=dict)
    limits: Callable[[Limits], Limits] = as_configured


def raw_steps(near: NDArray[np.int32], surfaces: Surfaces, limits: Limits) -> NDArray[np.int32]:
    """`near` without the edges between columns that differ by more than the highest step, as each was measured alone."""
    rise = np.abs(surfaces.height[near] - surfaces.height[:, None])
    return np.where(rise > limits.max_step, -1, near).astype(np.int32)


VARIANTS = {
    "measured heights": Off({"step_heights": "voxels"}),
    "filled gaps": Off({"fill_columns": 0}),
    "sigmas": Off({"confidence": 0.0}),
    "tolerances": Off({"slope_tolerance_rad": 0.0, "step_tolerance_m": 0.0}),
    "margin": Off({"margin_m": 0.0}),
    "look beyond edges": Off({"look_m": 0.1}),
    "centred heights": Off(scene={"centred_heights": lambda near, surfaces: surfaces.height}),
    "jumps of planes": Off(scene={"steppable_neighbours": raw_steps}),
    "planes of the robot": Off(limits=lambda limits: limits._replace(max_plane_slope=0.0)),
    "slopes": Off(limits=lambda limits: limits._replace(max_slope=10.0, max_plane_slope=10.0)),
}
HEAD = "| variant | noise | maps | beyond one voxel m2, most | maps with any | within it m2, mean | wrongly unsafe %, mean | spread |"


@dataclass(frozen=True, eq=False)
class Case:
    """A map with its truth."""

    name: str
    runs: ColumnRuns
    heights: SurfaceHeights
    T_map_base: Array
    T_world_map: Array
    true: TrueClasses
    area_m2: float


@dataclass(frozen=True)
class Judged:
    """Of one map: m2 wrongly safe beyond one voxel of the border and within it, and % of the reachable ground wrongly unsafe."""

    beyond_m2: float
    within_m2: float
    unsafe_percent: float


def disturbed(beams: list[Beams], poses: Array, noise: str, seed: int) -> tuple[list[Beams], Array]:
    """The sweeps with noise added along their beams, and the poses with errors; the last pose, where the robot stands, has none."""
    range_m, place_m, angle_rad = NOISES[noise]
    rng = np.random.default_rng(seed)
    out = []
    for sweep in beams:
        way = sweep.points - sweep.origins
        length = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-6)
        longer = rng.normal(0.0, range_m, length.shape) if range_m else np.zeros(length.shape)
        out.append(replace(sweep, points=(sweep.origins + way * (1.0 + longer / length)).astype(np.float32)))
    moved = poses.copy()
    for i in range(len(poses) - 1):
        moved[i] = poses[i] @ transform_from_rpy(rng.normal(0.0, place_m, 3), tuple(rng.normal(0.0, angle_rad, 3))) if place_m else poses[i]
    return out, moved


def made(run: Path, noises: Sequence[str]) -> Iterator[tuple[str, Case]]:
    """The maps of a run with the true world."""
    truth, estimate = read_trajectory(run / "trajectory_truth.txt"), read_trajectory(run / "trajectory.txt")
    mesh, robot, cell_m = read_mesh(run / "world.ply"), RobotShape(), CELL_M
    ground = reachable_ground(*mesh, truth[1][0, :3, 3], robot, cell_m)
    true, T_world_map = true_classes(*mesh, ground, robot, cell_m), trajectory_errors(*estimate, *truth).T_world_map
    sweeps, poses = recorded(run)
    for noise in noises:
        builder = from_scratch(*disturbed(sweeps, poses, noise, zlib.crc32(f"{run.name} {noise}".encode())))
        yield noise, Case(run.name, builder.runs_around(poses[-1], None), builder.heights, poses[-1], T_world_map, true, ground.area_m2)


def cases(run: Path, noises: Sequence[str], cache: Path) -> dict[str, Case]:
    """The same out of the cache, which is filled."""
    files = {noise: cache / f"{run.name} {noise}.pickle" for noise in noises}
    for noise, case in made(run, [noise for noise, file in files.items() if not file.exists()]):
        files[noise].write_bytes(pickle.dumps(case))
    return {noise: pickle.loads(file.read_bytes()) for noise, file in files.items()}


def judged(case: Case, off: Off) -> Judged:
    """The whole map classified, with parts switched off, and held against the truth."""
    config, limits_of = load_config(TerrainConfig, off.config), Limits.of

    def limits(config: TerrainConfig, robot: RobotBody, resolution: float) -> Limits:
        return off.limits(limits_of(config, robot, resolution))

    with ExitStack() as stack:
        for name, instead in off.scene.items():
            stack.enter_context(mock.patch.object(scene, name, instead))
        stack.enter_context(mock.patch.object(classification_stage, "Limits", mock.Mock(of=limits)))
        terrain = classify(case.runs, case.T_map_base, config, RobotBody(), None, case.heights)
    centres = transform_points(case.T_world_map, terrain.centers().astype(np.float64))
    found = classification(case.true, centres, terrain.label)
    edge = found.false_safe_by_cause[EDGE]
    return Judged(found.false_safe_m2 - edge, edge, 100.0 * found.false_unsafe_m2 / case.area_m2)


def row(variant: str, noise: str, results: list[Judged]) -> str:
    """One line of the table."""
    beyond, within, unsafe = np.array([(j.beyond_m2, j.within_m2, j.unsafe_percent) for j in results]).T
    figures = f"{beyond.max():.3f} | {np.count_nonzero(beyond > 1e-9)} | {within.mean():.3f} | {unsafe.mean():.2f} | {unsafe.std():.2f}"
    return f"| {variant} | {noise} | {len(results)} | {figures} |"


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN_DIR", help="folders of finished runs")
    parser.add_argument("--off", nargs="+", default=[], choices=[*VARIANTS, "all"], help="parts to switch off, a row each")
    parser.add_argument("--set", nargs="+", default=[], metavar="NAME=VALUE", help="other values of ~terrain/ parameters, in one more row")
    parser.add_argument("--noise", nargs="+", default=list(NOISES), choices=list(NOISES))
    parser.add_argument("--cache", type=Path, default=Path("runs/terrain_ablation"), help="folder of the maps")
    parser.add_argument("--each", action="store_true", help="a line of every map, too")
    arguments = parser.parse_args()
    arguments.cache.mkdir(parents=True, exist_ok=True)
    variants = {"as configured": Off()} | {name: VARIANTS[name] for name in (VARIANTS if "all" in arguments.off else arguments.off)}
    if arguments.set:
        variants["set"] = Off({name: yaml.safe_load(text) for name, _, text in (item.partition("=") for item in arguments.set)})
    results: dict[tuple[str, str], list[Judged]] = {(noise, name): [] for noise in arguments.noise for name in variants}
    for run in arguments.runs:
        for noise, case in cases(run, arguments.noise, arguments.cache).items():
            for name, off in variants.items():
                results[noise, name].append(judged(case, off))
                if arguments.each:
                    print(row(f"{run.name}, {name}", noise, results[noise, name][-1:]), flush=True)
    print(HEAD + "\n|---|---|---|---|---|---|---|---|")
    for (noise, name), found in results.items():
        print(row(name, noise, found))


if __name__ == "__main__":
    main()
