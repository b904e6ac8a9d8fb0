"""Runs in bad hands: nodes are killed, stopped and starved, sensors fall silent, and each run ends as if nothing had happened.

When in a run a node is struck depends on the machine, so no two runs are the same. They are made when asked for: CHAOS_RUNS=10 ./check
"""

import csv
import os
from pathlib import Path

import pytest
from exploring import ExploreRun, lines_of_sweeps, summary

SEEDS = range(2, 2 + int(os.environ.get("CHAOS_RUNS", "0")))
pytestmark = pytest.mark.skipif(not SEEDS, reason="CHAOS_RUNS says how many runs are made in bad hands")


@pytest.fixture(scope="module")
def soaked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Folder and output of a campaign."""
    out = tmp_path_factory.mktemp("chaos") / "runs"
    words = "--worlds", "rooms", "--seeds", SEEDS[0], "--soak", len(SEEDS), "--chaos", 5, "--jobs", 1, "--out", out
    with ExploreRun(*words, command="evaluate") as run:
        assert run.wait(600.0 * len(SEEDS)) == 0, run.text
        assert not run.running()
    return out, run.text


def folders(out: Path) -> list[Path]:
    return [out / "runs/ours" / f"rooms-{seed}" for seed in SEEDS]


def test_runs_end_as_ones_in_which_nothing_happened(soaked: tuple[Path, str]) -> None:
    for folder in folders(soaked[0]):
        found = summary(folder)
        assert found["success"] is True and found["collisions"] == 0, found
        assert float(str(found["coverage"])) > 0.99
        assert float(str(found["trajectory_ate_m"])) < 0.03  # undisturbed runs of rooms: 1 to 2 cm


def test_no_sweep_is_lost_nor_mapped_twice(soaked: tuple[Path, str]) -> None:
    for folder in folders(soaked[0]):
        stamps = [float(line.split()[0]) for line in lines_of_sweeps(folder)]
        assert len(stamps) == summary(folder)["sweeps"]
        assert all(a < b for a, b in zip(stamps, stamps[1:], strict=False))


def test_what_was_done_and_how_it_went_is_told(soaked: tuple[Path, str]) -> None:
    out, text = soaked
    for folder in folders(out):
        with (folder / "chaos.csv").open(newline="") as file:
            killed = [row["node"] for row in csv.DictReader(file) if row["kind"] == "kill"]
        log = (folder / "roslaunch.log").read_text()
        assert killed and any(f"{node} died: killed by signal 9" in log for node in killed)  # the last may have been about to end
    table = (out / "soak.md").read_text()
    assert table in text and f"| all | {len(SEEDS)} | 0 |" in table
