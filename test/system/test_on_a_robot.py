"""`sim:=false`: the robot is another program at the topics, here the simulator by itself, in real time and with today's stamps."""

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from xmlrpc.client import ServerProxy

from exploring import PACKAGE, ExploreRun, free_port, summary

DRIVEN_S = 60
LIMIT_S = 150.0


def roslaunch(port: int, arguments: str) -> ExploreRun:
    """A launch file of the package on a master of its own."""
    command = f"source {PACKAGE}/.ws/devel/setup.bash && exec roslaunch -p {port} explore_3dnav {arguments}"
    return ExploreRun("-c", command, command="/bin/bash", environment={"ROS_MASTER_URI": f"http://localhost:{port}"})


@contextmanager
def drivers(port: int, robot: str = "") -> Iterator[None]:
    """A robot's drivers, once they have loaded its description."""
    with roslaunch(port, f"simulation.launch world:=rooms rate:=1 clock_start:=now {robot}"):
        deadline_s = time.monotonic() + LIMIT_S
        while not is_described(port):
            assert time.monotonic() < deadline_s, "no description of the drivers"
            time.sleep(0.2)
        yield


def is_described(port: int) -> bool:
    with suppress(OSError):
        return ServerProxy(f"http://localhost:{port}").hasParam("/test", "/robot_description")[2] is True
    return False


def test_robot_that_is_not_simulated_explores_in_real_time(tmp_path: Path) -> None:
    port = free_port()
    with drivers(port), roslaunch(port, f"explore.launch sim:=false out:={tmp_path} max_sim_time:={DRIVEN_S} required:=true") as run:
        run.wait_for_first_sweep(LIMIT_S)
        run.wait(LIMIT_S)
    found = summary(tmp_path)
    assert str(found["stop_reason"]).startswith(("time limit", "explored")), "which of the two, the machine's speed decides"
    assert found["sweeps"] >= 2
    assert found["distance_m"] > 1.0
    assert "coverage" not in found, "of a real robot nobody knows the truth"


def test_another_robot_is_not_taken_for_a_husky(tmp_path: Path) -> None:
    """Its file was forgotten; its drivers' description tells."""
    jackal = f"robot_file:={PACKAGE}/config/robots/jackal.yaml urdf:={PACKAGE}/urdf/jackal.urdf"
    port = free_port()
    with drivers(port, jackal), roslaunch(port, f"explore.launch sim:=false out:={tmp_path} required:=true") as run:
        run.wait_for_line("robot.yaml contradicts robot_description: .*robot_file:=FILE urdf:=FILE", LIMIT_S)
