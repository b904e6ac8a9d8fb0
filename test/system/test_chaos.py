"""Runs in bad hands: nodes are killed, stopped and starved, sensors fall silent, and each run ends as if nothing had happened.

When in a run a node is struck depends on the machine, so no two runs are the same. CI makes ten of them.
Elsewhere they are made when asked for: CHAOS_RUNS=10 ./check
"""

import csv
import os
from pathlib import Path

import pytest
from box_worlds import two_rooms
from exploring import ExploreRun, lines_of_sweeps, summary

AT_THE_END_S = 4.0  # a node that is killed then may have been about to end; the status line that tells the time may be 2 s old
LAST_LINES = 60
SEEDS = range(2, 2 + int(os.environ.get("CHAOS_RUNS", "0")))


@pytest.mark.skipif(not SEEDS, reason="CHAOS_RUNS says how many runs are made in bad hands")
@pytest.mark.parametrize("seed", SEEDS)
def test_a_run_in_bad_hands_ends_as_one_in_which_nothing_happened(seed: int, tmp_path: Path) -> None:
    world = tmp_path / "two_rooms.ply"
    two_rooms().export(world)
    words = "--worlds", world, "--seeds", seed, "--soak", 1, "--chaos", 5, "--jobs", 1, "--out", tmp_path / "soak"
    folder = tmp_path / "soak/runs/ours" / f"two_rooms-{seed}"
    try:
        with ExploreRun(*words, "--max-wall-time", 400, command="evaluate") as run:
            assert run.wait(600.0) == 0, run.text
            assert not run.running()
    finally:
        show_what_happened(folder)
    found = summary(folder)
    assert found["success"] is True and found["collisions"] == 0, found
    assert float(str(found["coverage"])) > 0.98  # undisturbed runs of these seeds: 98.7 to 100 %
    assert float(str(found["trajectory_ate_m"])) < 0.03  # undisturbed runs: 0.4 to 1.3 cm
    check_that_each_sweep_is_mapped_once(folder)
    check_that_blows_are_told(folder)
    table = (tmp_path / "soak/soak.md").read_text()
    assert table in run.text and "| all | 1 | 0 |" in table


def show_what_happened(folder: Path) -> None:
    """For pytest, which keeps it for tests that fail: no two runs are the same."""
    for name in ("chaos.csv", "roslaunch.log", "outcome.json"):
        if (path := folder / name).exists():
            print(f"{name}:", *path.read_text(errors="replace").splitlines()[-LAST_LINES:], sep="\n")


def check_that_each_sweep_is_mapped_once(folder: Path) -> None:
    stamps = [float(line.split()[0]) for line in lines_of_sweeps(folder)]
    assert len(stamps) == summary(folder)["sweeps"]
    assert all(a < b for a, b in zip(stamps, stamps[1:], strict=False))


def check_that_blows_are_told(folder: Path) -> None:
    with (folder / "chaos.csv").open(newline="") as file:
        blows = list(csv.DictReader(file))
    log, told_until_s = (folder / "roslaunch.log").read_text(), float(str(summary(folder)["sim_time_s"])) - AT_THE_END_S
    killed = [row["node"] for row in blows if row["kind"] == "kill" and float(row["sim_s"] or 0.0) < told_until_s]
    assert blows and all(f"{node} died: killed by signal 9" in log for node in killed), blows
