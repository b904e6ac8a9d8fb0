"""Runs of ./explore from start to judged end: real-time factor, sweeps, coverage, error and classification times, as a Markdown table.

    python benchmarks/whole_run.py [--worlds rooms ramp] [--seeds 1 2 3] [--keep DIR]

The real-time factor is simulated time over wall time from the robot's first odometry to the stop: start and judgement are left out.
Runs follow one another; nothing else should keep the machine busy. Exit code 1 when a run did not succeed.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
COLUMNS = (
    "world",
    "seed",
    "end",
    "simulated s",
    "wall s",
    "x real time",
    "sweeps",
    "coverage",
    "ATE cm",
    "collisions",
    "local ms",
    "global ms",
)


def explore(world: str, seed: int, out: Path) -> dict[str, Any]:
    """The summary of one run; an empty one when it left none."""
    command = ["./explore", "--headless", "--world", world, "--seed", str(seed), "--out", str(out), "--force"]
    subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL, check=False)
    summary = out / "summary.json"
    found: dict[str, Any] = json.loads(summary.read_text()) if summary.exists() else {}
    return found


def _ratio(summary: dict[str, Any], over: str, under: str, scale: float = 1.0) -> float | None:
    return scale * summary[over] / summary[under] if summary.get(over) is not None and summary.get(under) else None


def _shown(value: float | None, digits: int) -> str:
    return "?" if value is None else f"{value:.{digits}f}"


def row(world: str, seed: int, summary: dict[str, Any]) -> tuple[str, ...]:
    """A line of the table; what a run did not measure is a question mark."""
    end = "explored" if summary.get("success") else str(summary.get("stop_reason", "no summary"))
    return (
        world,
        str(seed),
        end,
        _shown(summary.get("sim_time_s"), 0),
        _shown(summary.get("wall_time_s"), 1),
        _shown(_ratio(summary, "sim_time_s", "wall_time_s"), 1),
        str(summary.get("sweeps", "?")),
        _shown(summary.get("coverage"), 3),
        _shown(summary["trajectory_ate_m"] * 100 if summary.get("trajectory_ate_m") is not None else None, 2),
        str(summary.get("collisions", "?")),
        _shown(_ratio(summary, "local_classification_time_s", "local_classifications", 1000), 1),
        _shown(_ratio(summary, "global_classification_time_s", "global_classifications", 1000), 1),
    )


def line(cells: tuple[str, ...]) -> str:
    return f"| {' | '.join(cells)} |"


def main() -> int:
    parser = argparse.ArgumentParser(description="Measures whole runs of ./explore.")
    parser.add_argument("--worlds", nargs="+", default=["rooms", "ramp"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1])
    parser.add_argument("--keep", type=Path, help="folder for the runs; default: a temporary one")
    arguments = parser.parse_args()
    print(line(COLUMNS), line(("---",) * len(COLUMNS)), sep="\n", flush=True)
    succeeded = True
    with tempfile.TemporaryDirectory() as folder:
        for world in arguments.worlds:
            for seed in arguments.seeds:
                summary = explore(world, seed, (arguments.keep or Path(folder)).absolute() / f"{Path(world).stem}-{seed}")
                print(line(row(world, seed, summary)), flush=True)
                succeeded = succeeded and summary.get("success") is True
    return 0 if succeeded else 1


if __name__ == "__main__":
    sys.exit(main())
