"""A node of the robot loads nothing that only the judge, its pictures and the simulator need."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

HEAVY = {"open3d", "matplotlib", "dash", "pandas"}
NODES = sorted(path for path in (Path(__file__).resolve().parents[3] / "nodes").iterdir() if path.name != "pybullet_sim_node")
LOADS = "import runpy, sys; runpy.run_path(sys.argv[1], run_name='loaded'); print(*sys.modules)"


def test_nodes_are_found() -> None:
    assert {"exploration_monitor_node", "octomap_server_3dnav_node"} <= {path.name for path in NODES}


@pytest.mark.parametrize("node", NODES, ids=lambda path: path.name)
def test_node_loads_no_heavy_library(node: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    loaded = subprocess.run([sys.executable, "-c", LOADS, str(node)], env=environment, capture_output=True, text=True)
    assert loaded.returncode == 0, loaded.stderr
    modules = set(loaded.stdout.split())
    assert "rospy" in modules
    assert HEAVY & modules == set()
