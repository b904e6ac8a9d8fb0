"""`sim:=false`: the robot is another program at the topics, here the simulator by itself, in real time and with today's stamps."""

import socket
from pathlib import Path

from exploring import PACKAGE, ExploreRun, summary

DRIVEN_S = 60
LIMIT_S = 150.0


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return int(probe.getsockname()[1])


def roslaunch(port: int, arguments: str) -> ExploreRun:
    """A launch file of the package on a master of its own."""
    command = f"source {PACKAGE}/.ws/devel/setup.bash && exec roslaunch -p {port} explore_3dnav {arguments}"
    return ExploreRun("-c", command, command="/bin/bash", environment={"ROS_MASTER_URI": f"http://localhost:{port}"})


def test_robot_that_is_not_simulated_explores_in_real_time(tmp_path: Path) -> None:
    port = free_port()
    with (
        roslaunch(
            port, f"explore.launch sim:=false urdf:={PACKAGE}/urdf/husky.urdf out:={tmp_path} max_sim_time:={DRIVEN_S} required:=true"
        ) as run,
        roslaunch(port, "simulation.launch --wait world:=rooms rate:=1 clock_start:=now"),
    ):
        run.wait_for_first_sweep(LIMIT_S)
        run.wait(LIMIT_S)
    found = summary(tmp_path)
    assert str(found["stop_reason"]).startswith(("time limit", "explored")), "which of the two, the machine's speed decides"
    assert found["sweeps"] >= 2
    assert found["distance_m"] > 1.0
    assert "coverage" not in found, "of a real robot nobody knows the truth"
