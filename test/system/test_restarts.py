"""Each node of the robot is killed, or stopped, once in a run: it is started again, and the run ends as one in which nothing died.

Which node when is drawn by a seed. `--world rooms` takes some 70 s of simulated time; in lock-step the clock stands while a node is away.
"""

import os
import random
import re
import signal
import time
from pathlib import Path

import pytest
from exploring import ExploreRun, lines_of_sweeps, summary
from slow_machine import slowness

from explore_command.parameters import ROBOT_NODES

SEED = 5
STOPPED = "scan_filter_node", "pose_graph_mapping_node"
ASKED_S = 60.0  # for so long one that is not there is waited for
WITNESS = "exploration_monitor_node"  # which dies once more while it judges
GOES_ON = re.compile(r"t=([0-9.]+) s")


def strike(run: ExploreRun, node: str, number: signal.Signals) -> None:
    """Sends a signal to a node, and waits until another process is in its place and the clock goes on."""
    pid = run.pid_of(node)
    print(f"{number.name} to {node} at {run.output[-1].strip()}")
    os.kill(pid, number)
    run.wait_for_line(f"{node} died", 60.0)
    begun_s: float | None = None
    deadline_s = time.monotonic() + 480.0
    while time.monotonic() < deadline_s:
        time_s = float(GOES_ON.search(run.wait_for_line(GOES_ON, 60.0))[1])  # type: ignore[index]
        begun_s = time_s if begun_s is None else begun_s
        if time_s > begun_s:
            return
    raise AssertionError(f"the clock stands after the end of {node}:\n{run.text}")


def wait_until_judged(run: ExploreRun) -> None:
    """Until the maps are saved and all nodes but the witness have been ended."""
    deadline_s = time.monotonic() + 1200.0
    while any(f"__name:={node} " in f"{command} " for command in run.running().values() for node in ROBOT_NODES if node != WITNESS):
        assert run.process.poll() is None and time.monotonic() < deadline_s, run.text
        time.sleep(0.02)


@pytest.fixture(scope="module")
def struck_run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """Folder and output of a run in which every node died once, and two hung."""
    out, draws = tmp_path_factory.mktemp("restarts") / "run", random.Random(SEED)
    blows = [(node, signal.SIGKILL) for node in ROBOT_NODES] + [(node, signal.SIGSTOP) for node in STOPPED]
    draws.shuffle(blows)
    with ExploreRun("--world", "rooms", "--seed", 1, "--headless", "--out", out) as run:
        run.wait_for_first_sweep()
        for node, number in blows:
            time.sleep(draws.uniform(0.0, 0.7))
            strike(run, node, number)
        wait_until_judged(run)
        os.kill(run.pid_of(WITNESS), signal.SIGKILL)
        killed_s = time.monotonic()
        code = run.wait(300.0)
        assert time.monotonic() - killed_s < ASKED_S * slowness(), "nodes that were ended were asked once more"
        assert code == 0, run.text
        assert not run.running()
    return out, run.text


def test_run_ends_as_one_in_which_nothing_died(struck_run: tuple[Path, str]) -> None:
    found = summary(struck_run[0])
    assert found["success"] is True and found["collisions"] == 0
    assert float(str(found["coverage"])) > 0.99
    assert float(str(found["trajectory_ate_m"])) < 0.03  # undisturbed runs of rooms: 1 to 2 cm


def test_every_restart_is_told(struck_run: tuple[Path, str]) -> None:
    out, text = struck_run
    assert summary(out)["restarts"] == {node: 1 + (node in (*STOPPED, WITNESS)) for node in ROBOT_NODES}
    for node in STOPPED:
        assert f"{node} died: it made no progress for" in text


def test_no_sweep_is_lost_nor_mapped_twice(struck_run: tuple[Path, str]) -> None:
    out = struck_run[0]
    stamps = [float(line.split()[0]) for line in lines_of_sweeps(out)]
    assert len(stamps) == summary(out)["sweeps"]
    assert all(a < b for a, b in zip(stamps, stamps[1:], strict=False))
