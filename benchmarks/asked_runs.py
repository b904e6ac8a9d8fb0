"""Runs of ./explore that people ask something of: to pause, to stay within bounds, to be home at the end. Did it, and at what cost?

    python benchmarks/asked_runs.py [--worlds rooms] [--seeds 1-10] [--pauses 5] [--bounds] [--stay] [--keep DIR]

Bounds are a polygon around the start that the seed draws. Without --stay the robot drives home at the end. The judge has the true poses.
"""

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from disturbed_runs import runs_made
from registration_scores import text_table

from map_zones import Zone, Zones, write_zones
from roslaunch_process import free_port

ROOT = Path(__file__).resolve().parents[1]
HEADER = ("world", "seed", "coverage", "ATE cm", "touches", "m from start", "rad", "outside cm", "pauses", "drove", "minutes", "end")
RADII_M, CORNERS = (1.5, 7.0), (4, 9)


def star(seed: int) -> Zones:
    """Bounds of 4 to 8 corners; the start sees all of them."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(*CORNERS))
    turn = 2.0 * np.pi * (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count
    radius = rng.uniform(*RADII_M, count)
    return Zones(bounds=(Zone(radius[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])),))


def explored(world: str, seed: int, folder: Path, options: argparse.Namespace) -> None:
    """Makes a run, and pauses it meanwhile; what the pauser says is kept beside the run."""
    port, more = free_port(), []
    if options.bounds:
        zones = folder.with_suffix(".yaml")
        write_zones(star(seed), zones)
        more = ["--zones", str(zones)]
    command = ["./explore", "--headless", "--force", "--world", world, "--seed", str(seed), "--out", str(folder), "--port", str(port)]
    run = subprocess.Popen(
        [*command, "--at-end", "stay" if options.stay else "home", *more, *options.more], cwd=ROOT, stdout=subprocess.DEVNULL
    )
    pauser = [sys.executable, str(ROOT / "benchmarks/pauser.py"), str(seed), str(options.pauses)]
    environment = {**os.environ, "ROS_MASTER_URI": f"http://localhost:{port}"}
    asked = subprocess.Popen(pauser, env=environment, stdout=subprocess.PIPE) if options.pauses else None
    run.wait()
    if asked:
        folder.with_suffix(".pauses.json").write_bytes(asked.communicate()[0])


def _number(summary: Mapping[str, object], name: str, scale: float, digits: int) -> str:
    value = summary.get(name)
    return f"{scale * value:.{digits}f}" if isinstance(value, (int, float)) else "-"


def row(world: str, seed: int, folder: Path) -> tuple[str, ...]:
    """A line of the table; what a run does not say is a dash."""
    file, pauses = folder / "summary.json", folder.with_suffix(".pauses.json")
    s = json.loads(file.read_text()) if file.is_file() else {}
    told = json.loads((pauses.read_text().splitlines() or ["{}"])[-1]) if pauses.is_file() else {}
    end = "success" if s.get("success") else f"{s.get('stop_reason')}: {', '.join(s.get('faults') or [])}"
    return (
        *(world, str(seed)),
        *(_number(s, "coverage", 100.0, 1), _number(s, "trajectory_ate_m", 100.0, 1), _number(s, "collisions", 1.0, 0)),
        *(_number(s, "end_from_start_m", 1.0, 2), _number(s, "end_from_start_rad", 1.0, 2), _number(s, "outside_m", 100.0, 1)),
        *(str(told.get("pauses", "-")), str(told.get("drove_while_paused", "-"))),
        *(_number(s, "sim_time_s", 1.0 / 60.0, 1), end),
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--worlds", default="rooms")
    parser.add_argument("--seeds", default="1-10")
    parser.add_argument("--pauses", type=int, default=0, help="so many in a run")
    parser.add_argument("--bounds", action="store_true", help="within a polygon")
    parser.add_argument("--stay", action="store_true", help="do not drive home at the end")
    parser.add_argument("--keep", type=Path, help="a folder for the runs; those that are there are not made again")
    parser.add_argument("more", nargs="*", help="after --: arguments of ./explore")
    options = parser.parse_args()
    table = []

    def make(world: str, seed: int, folder: Path) -> None:
        explored(world, seed, folder, options)

    for made in runs_made(options.worlds, options.seeds, options.keep, make):
        table.append(row(*made))
        print(*table[-1], file=sys.stderr, flush=True)
    print(text_table(HEADER, table))
    return 0


if __name__ == "__main__":
    sys.exit(main())
