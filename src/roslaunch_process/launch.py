"""A launch file of the package under a master on a free port."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from roslaunch_process.children import end_with_parent

ROS_PORTS = range(11311, 11400)
_PACKAGE = "explore_3dnav"
_STATUS = " t="

_claims: list[socket.socket] = []


def free_port(among: Iterable[int] = ROS_PORTS) -> int:
    """The first port that nobody has: ROS's usual one, else one near it, below those that the system hands out to whoever asks.

    It is claimed until this process asks again or ends: a master takes its port some seconds later, and others ask meanwhile.
    """
    _claims.clear()
    for port in among:
        claim = socket.socket(socket.AF_UNIX)
        try:
            claim.bind(f"\0{_PACKAGE}-master-{port}")  # a name that is no file, gone with the process
            with socket.socket() as s:
                s.bind(("", port))
        except OSError:
            claim.close()
            continue
        _claims.append(claim)
        return port
    raise OSError(f"no free port for a ROS master in {among}")


def start_launch(
    file: str,
    arguments: Mapping[str, object],
    port: int | None,
    log_folder: Path | None,
    sigint_timeout_s: int,
    kept_open: Sequence[int] = (),
) -> "subprocess.Popen[str]":
    """roslaunch with name:=value arguments, its output in a pipe, in a process group of its own.

    Nothing of it outlives it, and when the caller dies it ends (`keeper`). Its exit code is 128 and the signal when it was killed.
    The descriptors `kept_open` are open until all of it has ended.
    A port of None joins the master that runs; a log folder of None is ROS's.
    """
    of_master = [] if port is None else ["--port", str(port)]
    timeouts = [f"--sigint-timeout={sigint_timeout_s}", "--sigterm-timeout=2"]
    command = [sys.executable, "-m", "roslaunch_process.keeper", "roslaunch", *of_master, *timeouts, _PACKAGE, file]
    return subprocess.Popen(
        [*command, *(f"{name}:={value}" for name, value in arguments.items())],
        env=_environment(port, log_folder),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        start_new_session=True,
        pass_fds=kept_open,
        preexec_fn=partial(end_with_parent, signal.SIGTERM),
    )


def _environment(port: int | None, log_folder: Path | None) -> dict[str, str]:
    """The caller's, with the master and the log folder that are not as there."""
    of_master = {} if port is None else {"ROS_MASTER_URI": f"http://localhost:{port}"}
    return {**os.environ, **of_master, **({} if log_folder is None else {"ROS_LOG_DIR": str(log_folder)})}


def hand_on_signals(launch: "subprocess.Popen[str]") -> list[int]:
    """From now on SIGINT, SIGTERM and SIGHUP interrupt the launch; the signals that were caught so far, a list that grows."""
    caught: list[int] = []

    def hand_on(number: int, _frame: object) -> None:
        caught.append(number)
        launch.send_signal(signal.SIGINT)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, hand_on)
    return caught


def shown_lines(launch: "subprocess.Popen[str]", mark: str, is_hidden: Callable[[str], bool] = lambda _: False) -> Iterator[str]:
    """All lines of output as they come; what follows `mark` goes to the terminal, status lines over each other where it is one."""
    live, below_status = sys.stdout.isatty(), False
    assert launch.stdout is not None
    for line in launch.stdout:
        yield line.rstrip()
        _, found, text = line.rstrip().partition(mark)
        if found and live and text.startswith(_STATUS):
            print(f"\r\x1b[K{text.strip()}", end="", flush=True)
            below_status = True
        elif found and not is_hidden(text.strip()):
            print(("\n" if below_status else "") + text.strip(), flush=True)
            below_status = False
    if below_status:
        print(flush=True)
