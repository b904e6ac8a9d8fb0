"""Starts roslaunch with a master on a free port, hands Ctrl-C on, and turns the end into an exit code."""

import sys
import tempfile
from pathlib import Path

from roslaunch_process import free_port, hand_on_signals, shown_lines, start_launch
from run_replay.arguments import ReplayArguments

_NODE_MARK = "[replay]"
_REFUSAL = "cannot be shown:"
_ENDED_WELL = "process has finished cleanly"
_DEATH = "REQUIRED process"
_PORT_TAKEN = "Address already in use"  # by somebody who came between the choice of a free port and the master
_ATTEMPTS = 3


def launch_arguments(arguments: ReplayArguments) -> dict[str, object]:
    """The launch file's arguments by name."""
    return {
        "run": arguments.run or "",
        "other": arguments.other or "",
        "bag": arguments.bag or "",
        "speed": f"{arguments.speed:g}",
        "rviz": str(not arguments.headless).lower(),
    }


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
        launch = start_launch("replay.launch", launch_arguments(arguments), port, Path(logs), sigint_timeout_s=4)
        print(f"ROS_MASTER_URI=http://localhost:{port}", flush=True)
        interrupted = hand_on_signals(launch)
        lines = list(shown_lines(launch, _NODE_MARK, lambda text: text.startswith(_REFUSAL)))
        launch.wait()
    return bool(interrupted), lines


def _what(arguments: ReplayArguments) -> str:
    if arguments.other:
        return f"comparing {arguments.run} (orange) with {arguments.other} (blue)"
    speed = f"at {arguments.speed:g} times real time" if arguments.speed else "as fast as the machine can"
    return f"replaying {arguments.run or arguments.bag} {speed}"


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
