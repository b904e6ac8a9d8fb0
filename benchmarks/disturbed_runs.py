"""Runs of ./explore in which somebody lifts, pushes or tilts the robot, or puts ice under it: does it notice, and find itself again?

    python benchmarks/disturbed_runs.py [--worlds rooms] [--seeds 1-5] [--script "push 15 0.5, lift 35 2"] [--keep DIR]

Each sweep's pose in the final graph is compared with the true one, both as seen from the first sweep. A robot is found again when the first
sweep after a disturbance that is in the map is right. Noticed `no`: it drove on. One that stayed where it was needs no notice.
"""

import argparse
import csv
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from registration_scores import text_table
from tracking_drift import seeds_of

from rigid_geometry import interpolate_transforms, inverse, rotation_angle, transform_from_quat

ROOT = Path(__file__).resolve().parents[1]
Array = NDArray[np.float64]
SCRIPT = "push 15 0.5, tilt 30 20, lift 45 2, ice 65 8"
HEADER = (
    "world",
    "seed",
    "what",
    "at s",
    "moved m",
    "turned deg",
    "noticed after s",
    "found after s",
    "off cm",
    "off deg",
    "end of the run",
)
NOTICED_S = 15.0  # after its end at the latest


@dataclass(frozen=True)
class Poses:
    """(N,) stamps and (N, 4, 4) poses."""

    stamps_s: Array
    poses: Array


def read_poses(path: Path) -> Poses:
    """A trajectory in TUM's format."""
    rows = np.loadtxt(path, ndmin=2)
    return Poses(rows[:, 0], np.array([transform_from_quat(row[1:4], row[4:8]) for row in rows]))


def errors(folder: Path) -> Poses:
    """By how much each sweep of a finished run is off, as seen from the first one."""
    graph, truth = read_poses(folder / "trajectory.txt"), read_poses(folder / "trajectory_truth.txt")
    true = interpolate_transforms(truth.stamps_s, truth.poses, graph.stamps_s)
    seen, right = inverse(graph.poses[0]) @ graph.poses, inverse(true[0]) @ true
    return Poses(graph.stamps_s, np.linalg.inv(right) @ seen)


def events(folder: Path) -> list[tuple[float, str]]:
    """What the robot did, and why."""
    with (folder / "events.csv").open() as file:
        return [(float(row["stamp_s"]), row["reason"]) for row in csv.DictReader(file)]


def rows(world: str, seed: int, folder: Path) -> list[tuple[str, ...]]:
    """A line for each disturbance of a finished run."""
    summary = json.loads((folder / "summary.json").read_text())
    end = "success" if summary.get("success") else f"{summary.get('stop_reason')}: {', '.join(summary.get('faults') or [])}"
    off, told, found = errors(folder), events(folder), []
    begin_s = read_poses(folder / "trajectory_truth.txt").stamps_s[0]
    for row in csv.DictReader((folder / "disturbances.csv").open()):
        first_s, last_s = (begin_s + float(row[name]) for name in ("begin", "end"))
        noticed_s = [at for at, reason in told if "was moved" in reason and first_s - 0.1 <= at <= last_s + NOTICED_S]
        after = np.flatnonzero(off.stamps_s > last_s)
        cells = ["no", "-", "-", "-"]
        if noticed_s:
            cells[0] = f"{noticed_s[0] - first_s:.1f}"
        if len(after):
            T = off.poses[after[0]]
            cells[1:] = (
                f"{off.stamps_s[after[0]] - last_s:.1f}",
                f"{100 * np.linalg.norm(T[:3, 3]):.1f}",
                f"{np.degrees(rotation_angle(T)):.2f}",
            )
        moved, turned = float(row["moved_m"]), np.degrees(float(row["turned_rad"]))
        found.append((world, str(seed), row["kind"], f"{first_s:.1f}", f"{moved:.2f}", f"{turned:.0f}", *cells, end))
    return found


def explored(world: str, seed: int, folder: Path, script: str, more: list[str]) -> None:
    """Makes a run with a script of disturbances."""
    said = f"pybullet_sim_node/disturbances={script}"
    command = ["./explore", "--headless", "--force", "--world", world, "--seed", str(seed), "--out", str(folder), "--set", said, *more]
    subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, check=False)


def runs_made(worlds: str, seeds: str, keep: Path | None, make: Callable[[str, int, Path], None]) -> Iterator[tuple[str, int, Path]]:
    """World, seed and folder of every run; those that `keep` does not hold are made first, without it for as long as they are looked at."""
    with tempfile.TemporaryDirectory() as made:
        for world in worlds.split(","):
            for seed in seeds_of(seeds):
                folder = (keep or Path(made)) / f"{Path(world).stem}-{seed}"
                folder.parent.mkdir(parents=True, exist_ok=True)
                if not (folder / "summary.json").is_file():
                    make(world, seed, folder)
                yield world, seed, folder


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", default="rooms")
    parser.add_argument("--seeds", default="1-5")
    parser.add_argument("--script", default=SCRIPT, help="what is done to the robot, as pybullet_sim_node/disturbances has it")
    parser.add_argument("--keep", type=Path, help="a folder for the runs; those that are there are not made again")
    parser.add_argument("more", nargs="*", help="after --: arguments of ./explore")
    options = parser.parse_args()
    table = []

    def make(world: str, seed: int, folder: Path) -> None:
        explored(world, seed, folder, options.script, options.more)

    for made in runs_made(options.worlds, options.seeds, options.keep, make):
        table += rows(*made)
        print(*table[-1], file=sys.stderr, flush=True)
    print(text_table(HEADER, table))
    return 0


if __name__ == "__main__":
    sys.exit(main())
