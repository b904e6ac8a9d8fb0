"""Starts roslaunch with a master on a free port, hands Ctrl-C on, and turns the end into an exit code."""

import ctypes
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator

from explore_command.launching import free_port
from run_replay.arguments import ReplayArguments

_NODE_MARK = "[replay]"
_REFUSAL = "cannot be shown:"
_ENDED_WELL = "process has finished cleanly"
_DEATH = "REQUIRED process"
_PORT_TAKEN = "Address already in use"  # by somebody who came between the choice of a free port and the master
_ATTEMPTS = 3
_PR_SET_PDEATHSIG = 1
_TIMEOUTS = ("--sigint-timeout=4", "--sigterm-timeout=2")


def launch_arguments(arguments: ReplayArguments) -> list[str]:
    """The launch file's arguments, name:=value."""
    values = {
        "run": arguments.run or "",
        "other": arguments.other or "",
        "bag": arguments.bag or "",
        "speed": f"{arguments.speed:g}",
        "rviz": str(not arguments.headless).lower(),
    }
    return [f"{name}:={value}" for name, value in values.items()]


def run_launch(arguments: ReplayArguments) -> int:
    """Runs the launch file to its end: 0 when all was shown or the user ended it, 2 when the run cannot be read, else 1."""
    print(_what(arguments), flush=True)
    for _ in range(_ATTEMPTS):
        interrupted, lines = _launched(arguments, free_port())
        if interrupted:
            return 0
        if not any(_PORT_TAKEN in line for line in lines):
            break
    return _exit_code(lines)


def _launched(arguments: ReplayArguments, port: int) -> tuple[bool, list[str]]:
    """Whether the user ended it, and all lines of output, when roslaunch has ended."""
    with tempfile.TemporaryDirectory(prefix="replay-") as logs:
        environment = dict(os.environ, ROS_MASTER_URI=f"http://localhost:{port}", ROS_LOG_DIR=logs)
        command = ["roslaunch", "--port", str(port), *_TIMEOUTS, "explore_3dnav", "replay.launch", *launch_arguments(arguments)]
        launch = subprocess.Popen(
            command,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
            preexec_fn=_end_with_parent,
        )
        print(f"ROS_MASTER_URI=http://localhost:{port}", flush=True)
        interrupted = _hand_on_signals(launch)
        lines = list(_shown(launch))
        launch.wait()
    return bool(interrupted), lines


def _what(arguments: ReplayArguments) -> str:
    if arguments.other:
        return f"comparing {arguments.run} (orange) with {arguments.other} (blue)"
    speed = f"at {arguments.speed:g} times real time" if arguments.speed else "as fast as the machine can"
    return f"replaying {arguments.run or arguments.bag} {speed}"


def _end_with_parent() -> None:
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGINT)


def _hand_on_signals(launch: "subprocess.Popen[str]") -> list[int]:
    """The signals that were caught so far: a list that grows."""
    caught: list[int] = []

    def hand_on(number: int, _frame: object) -> None:
        caught.append(number)
        launch.send_signal(signal.SIGINT)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, hand_on)
    return caught


def _shown(launch: "subprocess.Popen[str]") -> Iterator[str]:
    """All lines of output; the node's go to the terminal, status lines over each other where it is one."""
    live, below_status = sys.stdout.isatty(), False
    assert launch.stdout is not None
    for line in launch.stdout:
        yield line.rstrip()
        _, found, text = line.rstrip().partition(_NODE_MARK)
        if found and live and text.startswith(" t="):
            print(f"\r\x1b[K{text.strip()}", end="", flush=True)
            below_status = True
        elif found and not text.strip().startswith(_REFUSAL):
            print(("\n" if below_status else "") + text.strip(), flush=True)
            below_status = False
    if below_status:
        print(flush=True)


def _exit_code(lines: list[str]) -> int:
    for line in lines:
        _, found, reason = line.partition(f"{_NODE_MARK} {_REFUSAL}")
        if found:
            print(f"./replay: {reason.strip()}", file=sys.stderr)
            return 2
    if any(_ENDED_WELL in line for line in lines):
        return 0
    print("\n".join(["./replay: it broke off; the last lines before:", *_last_words(lines)]), file=sys.stderr)
    return 1


def _last_words(lines: list[str]) -> list[str]:
    """The lines before the end of the first process that everything ends with; what others say while they are ended is noise."""
    died = next((k for k, line in enumerate(lines) if _DEATH in line), len(lines))
    return [line for line in lines[max(0, died - 12) : died + 2] if line.strip("= ")]
