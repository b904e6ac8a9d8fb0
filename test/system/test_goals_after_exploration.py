"""Exploration among others: a joystick in between, the graph that lives on, and goals in the finished map, with move_base's clients."""

import os
import subprocess
import sys
from pathlib import Path

from exploring import PACKAGE, ExploreRun, summary
from test_on_a_robot import free_port

LIMIT_S = 1500.0


def test_joystick_in_between_and_goals_in_the_finished_map(tmp_path: Path) -> None:
    port = free_port()
    uri = f"http://localhost:{port}"
    launch = f"explore.launch world:=rooms seed:=1 out:={tmp_path}"
    command = f"source {PACKAGE}/.ws/devel/setup.bash && exec roslaunch -p {port} explore_3dnav {launch}"
    with ExploreRun("-c", command, command="/bin/bash", environment={"ROS_MASTER_URI": uri}) as run:
        run.wait_for_first_sweep(300.0)
        client = [sys.executable, str(Path(__file__).with_name("goal_client.py"))]
        done = subprocess.run(client, env={**os.environ, "ROS_MASTER_URI": uri}, capture_output=True, text=True, timeout=LIMIT_S)
        print(done.stdout)
        assert done.returncode == 0, f"{done.stdout}{done.stderr[-3000:]}"
        assert run.process.poll() is None, "the launch ended with exploration"
    found = summary(tmp_path)
    assert str(found["stop_reason"]).startswith("explored") and found["collisions"] == 0, found
