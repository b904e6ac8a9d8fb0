"""Whoever of a run's parents is killed: nothing stays behind, ./explore says what died, and the run is judged and goes on from its folder.

The nodes' own death is test_node_death.py's, that of a campaign's worker test_campaign.py's.
"""

import os
import re
import signal
from pathlib import Path

import numpy as np
import pytest
from box_worlds import box, walled_floor
from exploring import ExploreRun, summary

from pose_graph_mapping.session.session_store import SessionStore

THREE_MAPPED = re.compile(r"\b[3-9] sweeps\b.*\| (?!mapping)")
COMMANDS = {
    "roslaunch": re.compile(r"^\S+ \S+/roslaunch --port"),
    "rosmaster": re.compile(r"^\S+ \S+/rosmaster --core"),
    "the keeper of roslaunch": re.compile(r" -m roslaunch_process\.keeper "),
}
SAID = {
    "roslaunch": "roslaunch was killed",
    "rosmaster": "rosmaster died",
    "the keeper of roslaunch": "the keeper of roslaunch was killed",
}


def run_of(folder: Path) -> ExploreRun:
    """In two small rooms: a minute of simulated time."""
    world = folder / "two_rooms.ply"
    (walled_floor((-4.0, 4.0), (-2.0, 2.0)) + box((-0.1, 0.1), (-2.0, 0.4), (0.0, 1.8))).export(world)
    return ExploreRun("--world", world, "--start", -3.0, -1.0, 0.0, "--headless", "--out", folder / "run")


def assert_goes_on(out: Path) -> None:
    """The folder holds all sweeps that it held, and a run that begins there ends well."""
    before = SessionStore(out)
    clouds = [before.load_sweep(k).points for k in range(len(before.sweeps))]
    assert len(clouds) >= 2 and not before.notes
    with ExploreRun("--headless", "--resume", out) as run:
        assert run.wait(300.0) == 0, run.text
    store = SessionStore(out)
    assert len(store.sweeps) >= len(clouds)
    for k, points in enumerate(clouds):
        np.testing.assert_array_equal(store.load_sweep(k).points, points)


@pytest.mark.parametrize("victim", COMMANDS)
def test_run_whose_parent_was_killed_ends_with_its_map_and_a_summary_and_goes_on(victim: str, tmp_path: Path) -> None:
    out = tmp_path / "run"
    with run_of(tmp_path) as run:
        run.wait_for_line(THREE_MAPPED, 150.0)
        (pid,) = [pid for pid, command in run.running().items() if COMMANDS[victim].search(command)]
        os.kill(pid, signal.SIGKILL)
        run.wait_until_gone(lambda pid, _: pid != run.process.pid)
        assert run.wait(60.0) == 1, run.text
        assert not run.running()
    told = [line for line in run.text.splitlines() if line.startswith("./explore:")]
    assert len(told) == 1 and SAID[victim] in told[0] and f"./explore --resume {out}" in told[0], run.text
    assert "Traceback" not in run.text
    judged = summary(out)
    assert judged["success"] is False and judged["coverage"] is not None and judged["collisions"] == 0
    assert judged["stop_reason"] == SAID[victim] or victim == "the keeper of roslaunch"
    assert_goes_on(out)


def test_killed_explore_leaves_nothing_running_and_goes_on(tmp_path: Path) -> None:
    with run_of(tmp_path) as run:
        run.wait_for_line(THREE_MAPPED, 150.0)
        os.kill(run.process.pid, signal.SIGKILL)
        run.wait_until_gone()
        assert not run.running()
    assert_goes_on(tmp_path / "run")
