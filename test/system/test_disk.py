"""A disk that takes nothing for a while: the run goes on, says so, and has lost nothing when there is room again."""

import json
import resource
from pathlib import Path

import numpy as np
import pytest
from exploring import ExploreRun, summary

WRITERS = ("pose_graph_mapping_node", "octomap_server_3dnav_node", "exploration_monitor_node")
MOST_BYTES = 10_000  # of a file, as `ulimit -f` has it: what is written beyond fails
FULL, ROOM = "is not on disk: .*files here may not be so large", "is not on disk: no longer"
Run = tuple[Path, int, str]


def limit(run: ExploreRun, most_bytes: int) -> None:
    for node in WRITERS:
        pid = run.pid_of(node)
        resource.prlimit(pid, resource.RLIMIT_FSIZE, (most_bytes, resource.prlimit(pid, resource.RLIMIT_FSIZE)[1]))


@pytest.fixture(scope="module")
def full_for_a_while(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Folder, exit code and output of a run of which nothing went on disk for some sweeps."""
    out = tmp_path_factory.mktemp("disk") / "run"
    with ExploreRun("--world", "rooms", "--seed", 1, "--headless", "--out", out) as run:
        run.wait_for_first_sweep()
        run.wait_for_line(r"\b[3-6] sweeps\b", 90.0)
        limit(run, MOST_BYTES)
        run.wait_for_line(f"the session {FULL}", 60.0)
        run.wait_for_line(r"\b([89]|1\d) sweeps\b", 90.0)
        limit(run, resource.RLIM_INFINITY)
        run.wait_for_line(f"the session {ROOM}", 60.0)
        return out, run.wait(400.0), run.text


def test_run_goes_on_and_succeeds(full_for_a_while: Run) -> None:
    out, code, text = full_for_a_while
    assert code == 0 and summary(out)["success"] is True and summary(out)["not_on_disk"] == [], text
    assert summary(out)["restarts"] == {}


def test_nothing_is_lost(full_for_a_while: Run) -> None:
    out = full_for_a_while[0]
    assert len(json.loads((out / "sweeps/index.json").read_text())) == summary(out)["sweeps"]
    truth_s = np.loadtxt(out / "trajectory_truth.txt")[:, 0]
    assert np.diff(truth_s).max() < 0.051


def test_terminal_says_it_once_and_in_one_line(full_for_a_while: Run) -> None:
    out, _, text = full_for_a_while
    assert text.count("the session is not on disk:") == 2 and text.count("the map is not on disk:") == 2
    assert "Traceback" not in (out / "roslaunch.log").read_text()
