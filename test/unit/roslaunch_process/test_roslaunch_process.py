"""A launch from outside, with a script in the place of roslaunch: its arguments, signals, output, and that it dies with its parent."""

import fcntl
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from roslaunch_process import free_port, shown_lines, start_launch


@pytest.fixture
def roslaunch(tmp_path, monkeypatch):
    """Puts a script on the PATH as roslaunch."""

    def put(script: str) -> None:
        path = tmp_path / "roslaunch"
        path.write_text("#!/bin/bash\n" + script)
        path.chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")

    return put


def test_taken_port_is_avoided():
    with socket.socket() as taken:
        taken.bind(("", 0))
        port = taken.getsockname()[1]
        assert free_port([port, port + 1, port + 2]) != port


def test_of_two_that_ask_at_one_moment_each_has_a_port_of_its_own():
    ask = "import sys; from roslaunch_process import free_port; print(free_port(), flush=True); sys.stdin.read()"
    with subprocess.Popen([sys.executable, "-c", ask], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdin is not None and other.stdout is not None
        theirs = int(other.stdout.readline())
        assert free_port() != theirs
        other.stdin.close()
    assert free_port([theirs]) == theirs


def test_no_free_port_is_an_error():
    with pytest.raises(OSError, match="no free port"):
        free_port([])


def test_launch_gets_file_arguments_port_and_log_folder(roslaunch, tmp_path):
    roslaunch('echo "$@"; echo $ROS_MASTER_URI $ROS_LOG_DIR')
    launch = start_launch("explore.launch", {"world": "ramp", "seed": 3}, 11399, tmp_path, 60)
    first, second = list(shown_lines(launch, "[explore]"))
    assert "--port 11399 --sigint-timeout=60" in first and first.endswith("explore_3dnav explore.launch world:=ramp seed:=3")
    assert second == f"http://localhost:11399 {tmp_path}"


def test_launch_without_a_port_joins_the_master_that_runs(roslaunch, tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_MASTER_URI", "http://robot:11311")
    monkeypatch.setenv("ROS_LOG_DIR", "logs")
    roslaunch('echo "[explore] $@"; echo "[explore] $ROS_MASTER_URI $ROS_LOG_DIR"')
    first, second = list(shown_lines(start_launch("explore.launch", {}, None, None, 60), "[explore]"))
    assert "--port" not in first and second == "[explore] http://robot:11311 logs"


def test_only_what_is_marked_and_not_hidden_is_shown(roslaunch, tmp_path, capsys):
    roslaunch("echo noise; echo '[explore] SUCCESS'; echo '[explore] hide me'; echo 'x [explore]  t=3 s'")
    launch = start_launch("explore.launch", {}, 11399, tmp_path, 60)
    assert len(list(shown_lines(launch, "[explore]", lambda text: text.startswith("hide")))) == 4
    assert capsys.readouterr().out.splitlines() == ["SUCCESS", "t=3 s"]


LISTENS = '"$ROS_LOG_DIR/listens"'  # a file of a node that has set its trap
NODE_AND_LAUNCH = f"setsid env --default-signal=INT bash -c '{{node}}' &\nuntil [ -e {LISTENS} ]; do sleep 0.02; done\necho $!; echo $$\n"
DEAF = f'trap "" INT; touch {LISTENS}; while :; do sleep 0.05; done'
LISTENING = 'trap "touch {mark}; exit" INT; touch ' + LISTENS + "; while :; do sleep 0.05; done"


def pids_of(launch) -> tuple[int, int]:
    """Process ids of a node and of its roslaunch, which print them."""
    return int(launch.stdout.readline()), int(launch.stdout.readline())


def is_running(pid: int) -> bool:
    stat = Path(f"/proc/{pid}/stat")
    return stat.exists() and "Z" not in stat.read_text().rpartition(")")[2].split()[0]


def wait_for(condition, timeout_s: float = 60.0) -> bool:
    deadline = time.monotonic() + timeout_s
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)
    return bool(condition())


def test_exit_code_is_that_of_roslaunch(roslaunch, tmp_path):
    roslaunch("exit 7")
    assert start_launch("explore.launch", {}, 11399, tmp_path, 60).wait(60.0) == 7


def test_interrupt_is_handed_on_and_the_end_is_waited_for(roslaunch, tmp_path):
    roslaunch("trap 'sleep 0.3; exit 5' INT\necho ready\nwhile :; do sleep 0.05; done")
    launch = start_launch("explore.launch", {}, 11399, tmp_path, 60)
    assert "ready" in launch.stdout.readline()
    launch.send_signal(signal.SIGINT)
    assert launch.wait(60.0) == 5


def test_nodes_of_a_killed_roslaunch_are_interrupted(roslaunch, tmp_path):
    mark = tmp_path / "saved"
    roslaunch(NODE_AND_LAUNCH.format(node=LISTENING.format(mark=mark)) + "wait")
    launch = start_launch("explore.launch", {}, 11399, tmp_path, 60)
    node, parent = pids_of(launch)
    os.kill(parent, signal.SIGKILL)
    assert launch.wait(60.0) == 128 + signal.SIGKILL
    assert mark.exists() and not is_running(node)


def test_node_that_does_not_listen_is_killed_with_its_output_closed(roslaunch, tmp_path):
    roslaunch(NODE_AND_LAUNCH.format(node=DEAF) + "exit 3")
    launch = start_launch("explore.launch", {}, 11399, tmp_path, 60)
    node, _ = pids_of(launch)
    assert launch.wait(60.0) == 3 and not is_running(node)
    assert list(shown_lines(launch, "[explore]")) == []


def started_and_killed(tmp_path: Path, lines: int) -> list[str]:
    """The first lines of a launch whose parent was killed then; the launch keeps the locked file `lock` open."""
    code = (
        "from pathlib import Path; from roslaunch_process import start_launch; import fcntl, os, time\n"
        f"lock = os.open({str(tmp_path / 'lock')!r}, os.O_RDWR | os.O_CREAT); fcntl.flock(lock, fcntl.LOCK_EX)\n"
        f"launch = start_launch('explore.launch', {{}}, 11399, Path({str(tmp_path)!r}), 60, kept_open=(lock,))\n"
        f"for _ in range({lines}): print(launch.stdout.readline(), end='', flush=True)\ntime.sleep(60)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, env=environment, text=True) as parent:
        assert parent.stdout is not None
        told = [parent.stdout.readline() for _ in range(lines)]
        time.sleep(0.3)
        parent.kill()
    return told


def test_launch_is_interrupted_when_its_parent_is_killed(roslaunch, tmp_path):
    mark = tmp_path / "ended"
    roslaunch(f"trap 'touch {mark}; exit' INT\necho ready\nwhile :; do sleep 0.05; done")
    started_and_killed(tmp_path, 1)
    assert wait_for(mark.exists)


def test_launch_that_does_not_listen_is_killed_with_its_nodes_after_its_parent(roslaunch, tmp_path):
    roslaunch('trap "" INT\n' + NODE_AND_LAUNCH.format(node=DEAF) + DEAF)
    node, launch = (int(line) for line in started_and_killed(tmp_path, 2))
    assert is_running(node) and is_running(launch)
    assert wait_for(lambda: not is_running(node) and not is_running(launch))


def test_lock_is_held_until_the_last_node_has_ended(roslaunch, tmp_path):
    roslaunch('trap "" INT\n' + NODE_AND_LAUNCH.format(node=DEAF) + DEAF)
    node, _ = (int(line) for line in started_and_killed(tmp_path, 2))

    def is_free() -> bool:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

    with (tmp_path / "lock").open() as lock:
        assert not is_free() and is_running(node)
        assert wait_for(is_free) and not is_running(node)
