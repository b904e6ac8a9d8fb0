"""What the robot is told falls silent while it drives, or a node dies: the wheels stand, /diagnostics names it, and the run goes on."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from exploring import PACKAGE, ExploreRun, free_port
from slow_machine import LONGEST_S
from wheels_watcher import wake_up

# what falls silent: the process that is stopped, the node that must name it, and how it calls it
SILENCES = {
    "laser": ("relay_scan", "scan_filter_node", "/scan"),
    "joint states": ("relay_joint_states", "stop_scan_and_go_node", "/joint_states"),
    "IMU": ("relay_imu", "odometry_fusion_node", "/imu/data"),
    "wheels": ("relay_wheel_odom", "odometry_fusion_node", "/wheel_odom"),
    "odometry": ("odometry_fusion_node", "move_base_node", "/odom"),
    "map->odom": ("pose_graph_mapping_node", "move_base_node", "/tf map->odom"),
    "commands": ("move_base_node", "stop_scan_and_go_node", "/cmd_vel/move_base"),
    "wheel commands": ("stop_scan_and_go_node", "", ""),
}
MOVE_IT = (  # without any of these no command is sent
    "scan_filter_node",
    "odometry_fusion_node",
    "scan_tracking_node",
    "pose_graph_mapping_node",
    "move_base_node",
    "stop_scan_and_go_node",
)


@pytest.fixture(scope="class")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[ExploreRun, ExploreRun, int]]:
    """The nodes, the robot and the port of their master, once the robot has its first sweep. One a class: a world has an end."""
    port = free_port()
    out = tmp_path_factory.mktemp("silence")

    def roslaunch(arguments: str) -> ExploreRun:
        command = f"source {PACKAGE}/.ws/devel/setup.bash && exec roslaunch -p {port} {arguments}"
        return ExploreRun("-c", command, command="/bin/bash", environment={"ROS_MASTER_URI": f"http://localhost:{port}"})

    with (
        roslaunch(
            f"explore_3dnav explore.launch sim:=false urdf:={PACKAGE}/urdf/husky.urdf check:=false out:={out} max_sim_time:=600"
        ) as nodes,
        roslaunch(f"--wait {PACKAGE}/test/system/relayed_robot.launch world:=ramp seed:=901 clock_start:=now") as hardware,
    ):
        nodes.wait_for_first_sweep(150.0)
        yield nodes, hardware, port


def watched(port: int, *arguments: object) -> subprocess.CompletedProcess[str]:
    """What wheels_watcher.py says of a process."""
    command = [sys.executable, str(Path(__file__).with_name("wheels_watcher.py")), *map(str, arguments)]
    return subprocess.run(
        command, env={**os.environ, "ROS_MASTER_URI": f"http://localhost:{port}"}, capture_output=True, text=True, timeout=LONGEST_S
    )


class TestInputThatIsSilent:
    @pytest.mark.parametrize("what", list(SILENCES))
    def test_wheels_stand_while_it_is_silent_and_go_on_afterwards(self, robot: tuple[ExploreRun, ExploreRun, int], what: str) -> None:
        nodes, hardware, port = robot
        stopped, names_it, called = SILENCES[what]
        pid = (hardware if stopped.startswith("relay") else nodes).pid_of(stopped)
        try:
            done = watched(port, pid, names_it, called)
        finally:
            wake_up(pid)
        assert done.returncode == 0, f"{what}: {done.stdout}{done.stderr}"
        print(f"{what}: {done.stdout.strip()}")


class TestNodeThatIsAway:
    @pytest.mark.parametrize("node", MOVE_IT)
    def test_wheels_stand_and_go_on_when_it_was_started_again(self, robot: tuple[ExploreRun, ExploreRun, int], node: str) -> None:
        nodes, _, port = robot
        done = watched(port, nodes.pid_of(node), "", "", "killed")
        assert done.returncode == 0, f"{node}: {done.stdout}{done.stderr}"
        print(f"{node}: {done.stdout.strip()}")
