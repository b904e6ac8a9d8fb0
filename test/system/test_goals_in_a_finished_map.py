"""A run with a budget, and its map driven in, also after its mapping node has died: goals are reached, and the map stays as it is."""

import hashlib
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from exploring import ExploreRun, summary
from slow_machine import LONGEST_S

from exploration_evaluation import read_trajectory, trajectory_errors
from rigid_geometry import inverse, transform_points

PORT = 12630
BUDGET_S = 54
REACHED = re.compile(r"at (\S+) (\S+) in map, (\S+) (\S+) in world")
LOCALISES = "pose_graph_mapping_node"
NEAR_M = 0.1  # what the robot takes for its place is so near to it


@pytest.fixture(scope="module")
def mapped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a run that was home again in time."""
    out = tmp_path_factory.mktemp("mapped") / "run"
    with ExploreRun("--headless", "--world", "rooms", "--seed", "3", "--budget", BUDGET_S / 60, "--out", out) as run:
        assert run.wait(300.0) == 0, run.text
    return out


def contents(folder: Path) -> dict[str, str]:
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.rglob("*") if p.is_file()}


def test_run_that_its_budget_brought_home_is_a_success_that_has_not_explored_all(mapped: Path) -> None:
    told = summary(mapped)
    assert told["success"] is True and not told["faults"] and str(told["stop_reason"]).startswith("ended: "), told
    assert float(str(told["sim_time_s"])) <= BUDGET_S and float(str(told["end_from_start_m"])) < 0.2, told
    assert 0.3 < float(str(told["coverage"])) < 0.99, told


def driven_to_goals(command: list[str], uri: str, after_the_first: Callable[[], None]) -> str:
    """What a client of goals printed, once it has ended well; something is done after the first goal."""
    environment = {**os.environ, "ROS_MASTER_URI": uri, "PYTHONUNBUFFERED": "1"}
    with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as client:
        limit = threading.Timer(LONGEST_S, client.kill)
        limit.start()
        assert client.stdout is not None
        lines = []
        for line in client.stdout:
            lines.append(line)
            if REACHED.search(line) and len(REACHED.findall("".join(lines))) == 1:
                after_the_first()
        limit.cancel()
    assert client.returncode == 0, "".join(lines)[-4000:]
    return "".join(lines)


def test_goals_are_driven_to_where_they_are_and_the_map_stays_as_it_is(mapped: Path, tmp_path: Path) -> None:
    before = contents(mapped)
    words = (
        "--headless",
        "--map",
        mapped,
        "--goals",
        "--rate",
        "0",
        "--start",
        "1.0",
        "1.0",
        "2.0",
        "--port",
        PORT,
        "--out",
        tmp_path / "run",
    )
    uri = f"http://localhost:{PORT}"
    with ExploreRun(*words) as run:
        run.wait_for_first_sweep(150.0)
        client = [sys.executable, str(Path(__file__).with_name("map_goal_client.py"))]
        told_by_client = driven_to_goals(client, uri, lambda: os.kill(run.pid_of(LOCALISES), signal.SIGKILL))
        run.interrupt()
        assert run.wait(60.0) == 0, run.text
    assert contents(mapped) == before
    stamps, poses = read_trajectory(mapped / "trajectory.txt")
    T_map_world = inverse(trajectory_errors(stamps, poses, *read_trajectory(mapped / "trajectory_truth.txt")).T_world_map)
    reached = np.array([[float(v) for v in found] for found in REACHED.findall(told_by_client)])
    assert len(reached) == 3
    true = transform_points(T_map_world, np.column_stack([reached[:, 2:], np.zeros(3)]))[:, :2]
    assert np.linalg.norm(true - reached[:, :2], axis=1).max() < NEAR_M
    told = summary(tmp_path / "run")
    assert (told["success"], told["mapping"], told["collisions"]) == (True, "off", 0), told
    assert told["restarts"] == {LOCALISES: 1}, told  # it knows where the robot is, or the goals after that are not reached
    assert [(c["parameter"], c["value"]) for c in told["parameter_changes"]] == [("follower_max_speed_mps", 0.3)], told  # type: ignore[attr-defined]


def test_map_s_own_folder_is_refused_for_the_results(mapped: Path) -> None:
    before = contents(mapped)
    launch = f"explore.launch sim:=true lockstep:=true mapping:=off map:={mapped} out:={mapped} required:=true"
    command = f"source {Path(__file__).parents[2]}/.ws/devel/setup.bash && exec roslaunch -p {PORT + 1} explore_3dnav {launch}"
    with ExploreRun("-c", command, command="/bin/bash", environment={"ROS_MASTER_URI": f"http://localhost:{PORT + 1}"}) as run:
        run.wait_for_line("wrong parameter: out .* is the finished map, which stays as it is", 60.0)
    after = contents(mapped)
    assert {name: after[name] for name in before} == before
