"""Exploration does as it is asked: paused, bounded, sent home and on again, at the end at home, and started anew, by its services."""

import os
import subprocess
import sys
from pathlib import Path

from exploring import PACKAGE, ExploreRun, summary
from test_on_a_robot import free_port

LIMIT_S = 1500.0


def test_what_people_ask_of_exploration(tmp_path: Path) -> None:
    port = free_port()
    uri = f"http://localhost:{port}"
    launch = f"explore.launch world:=rooms seed:=2 at_end:=home out:={tmp_path}"
    command = f"source {PACKAGE}/.ws/devel/setup.bash && exec roslaunch -p {port} explore_3dnav {launch}"
    with ExploreRun("-c", command, command="/bin/bash", environment={"ROS_MASTER_URI": uri}) as run:
        run.wait_for_first_sweep(300.0)
        client = [sys.executable, str(Path(__file__).with_name("request_client.py"))]
        done = subprocess.run(client, env={**os.environ, "ROS_MASTER_URI": uri}, capture_output=True, text=True, timeout=LIMIT_S)
        print(done.stdout)
        assert done.returncode == 0, f"{done.stdout}{done.stderr[-3000:]}"
    found = summary(tmp_path)
    assert str(found["stop_reason"]).startswith("explored") and found["collisions"] == 0, found
    assert found["end_from_start_m"] < 0.2 and found["end_from_start_rad"] < 0.2 and found["coverage"] > 0.99, found
