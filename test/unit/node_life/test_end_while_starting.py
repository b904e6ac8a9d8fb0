"""A node that is interrupted while it starts: it has nothing to save, and is not waited for."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from explore_command.parameters import ROBOT_NODES
from robot_body.package_folder import PACKAGE_FOLDER

IGNORES = """
import os, signal, sys, pathlib, time
from node_life import Life
signal.signal(signal.SIGINT, signal.SIG_IGN)
life = Life()
life.beat(starts=True)
{begins}
pathlib.Path(sys.argv[1]).touch()
time.sleep({seconds})
"""


def seconds_to_end(folder: Path, begins: str, seconds: float) -> float:
    """From an interrupt that the node does not hear, as in an import that hangs, to its end."""
    up, body = folder / "up", IGNORES.format(begins=begins, seconds=seconds)
    command = [sys.executable, "-m", "node_revival", sys.executable, "-c", body, str(up), "__name:=a_node"]
    environment = {**os.environ, "ROS_MASTER_URI": "http://localhost:1", "TMPDIR": str(folder)}
    with subprocess.Popen(command, env=environment, start_new_session=True) as process:
        while not up.exists():
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGINT)
        begun_s = time.monotonic()
        process.wait(120.0)
    return time.monotonic() - begun_s


def test_node_that_hangs_in_its_start_ends_with_the_launch(tmp_path: Path) -> None:
    assert seconds_to_end(tmp_path, "", 100.0) < 50.0


def test_node_that_was_up_and_did_not_hear_it_is_asked_again(tmp_path: Path) -> None:
    begins = "life.beat(); asked = []; signal.signal(signal.SIGINT, lambda *_: asked.append(1) or len(asked) > 1 and os._exit(0))"
    assert seconds_to_end(tmp_path, begins, 100.0) < 50.0


@pytest.mark.parametrize("begins", ["life.beat()", "life.ends()"])
def test_node_that_has_begun_or_says_that_it_ends_is_waited_for(tmp_path: Path, begins: str) -> None:
    assert seconds_to_end(tmp_path, begins, 6.0) > 5.0


def test_interrupt_that_a_library_would_swallow_ends_a_node_that_loads_it() -> None:
    swallows = "import os, signal, time\ntry:\n    os.kill(os.getpid(), signal.SIGINT); time.sleep(1.0)\nexcept BaseException:\n    pass"
    for first, code in (("", 0), ("import node_life.early_interrupt\n", -signal.SIGINT)):
        assert subprocess.run([sys.executable, "-c", first + swallows], check=False, timeout=60.0).returncode == code


@pytest.mark.parametrize("node", ["pybullet_sim_node", *ROBOT_NODES])
def test_node_is_interrupted_at_once_while_it_loads(node: str) -> None:
    imports = [line for line in (PACKAGE_FOLDER / "nodes" / node).read_text().splitlines() if line.startswith(("import ", "from "))]
    assert imports[0].startswith("import node_life.early_interrupt ")
