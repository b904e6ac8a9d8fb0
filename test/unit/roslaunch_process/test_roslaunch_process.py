"""A launch from outside, with a script in the place of roslaunch: its arguments, signals, output, and that it dies with its parent."""

import os
import signal
import socket
import subprocess
import sys
import time

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


def test_no_free_port_is_an_error():
    with pytest.raises(OSError, match="no free port"):
        free_port([])


def test_launch_gets_file_arguments_port_and_log_folder(roslaunch, tmp_path):
    roslaunch('echo "$@"; echo $ROS_MASTER_URI $ROS_LOG_DIR')
    launch = start_launch("explore.launch", {"world": "ramp", "seed": 3}, 11399, tmp_path, 60)
    first, second = list(shown_lines(launch, "[explore]"))
    assert "--port 11399 --sigint-timeout=60" in first and first.endswith("explore_3dnav explore.launch world:=ramp seed:=3")
    assert second == f"http://localhost:11399 {tmp_path}"


def test_only_what_is_marked_and_not_hidden_is_shown(roslaunch, tmp_path, capsys):
    roslaunch("echo noise; echo '[explore] SUCCESS'; echo '[explore] hide me'; echo 'x [explore]  t=3 s'")
    launch = start_launch("explore.launch", {}, 11399, tmp_path, 60)
    assert len(list(shown_lines(launch, "[explore]", lambda text: text.startswith("hide")))) == 4
    assert capsys.readouterr().out.splitlines() == ["SUCCESS", "t=3 s"]


def test_launch_is_interrupted_when_its_parent_is_killed(roslaunch, tmp_path):
    mark = tmp_path / "ended"
    roslaunch(f"trap 'touch {mark}; exit' INT\necho ready\nwhile :; do sleep 0.05; done")
    code = (
        "from pathlib import Path; from roslaunch_process import start_launch; import time\n"
        f"launch = start_launch('explore.launch', {{}}, 11399, Path({str(tmp_path)!r}), 60)\n"
        "print(launch.stdout.readline(), flush=True)\ntime.sleep(60)"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    parent = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, env=environment)
    assert parent.stdout is not None and b"ready" in parent.stdout.readline()
    parent.send_signal(signal.SIGKILL)
    parent.wait()
    parent.stdout.close()
    deadline = time.monotonic() + 20.0
    while not mark.exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    assert mark.exists()
