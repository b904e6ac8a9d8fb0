"""./calibrate_mount NAME:=VALUE...: calibrates the mount of a robot whose drivers run, or of a simulated one. ROS runs in its children."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping, Sequence

from mapping_tools.live_arguments import HELP, live_arguments
from roslaunch_process import hand_on_signals, start_launch

_FILE = "calibrate_mount.launch"
_SHUTDOWN_S = 15
_INTERRUPTED = 130


def exit_code(said: str, *, interrupted: bool) -> int:
    """0 saved, 1 nothing was observable, 130 interrupted, else 2, by all that roslaunch and its nodes said."""
    if re.search("^saved to ", said, re.MULTILINE):
        return 0
    if interrupted:
        return _INTERRUPTED
    return 1 if re.search(r"calibrate_mount_node.*exit code 1\b", said) else 2


def calibrate(arguments: Mapping[str, str]) -> int:
    """The exit code of a calibration; OSError when it does not begin."""
    launch = start_launch(_FILE, arguments, None, None, _SHUTDOWN_S)
    caught, said = hand_on_signals(launch), []
    assert launch.stdout is not None
    for line in launch.stdout:
        print(line, end="", flush=True)
        said.append(line)
    launch.wait()
    return exit_code("".join(said), interrupted=bool(caught))


def main(argv: Sequence[str] | None = None) -> int:
    """Exit code for arguments, sys.argv's by default."""
    words = list(sys.argv[1:] if argv is None else argv)
    if {"-h", "--help"} & set(words):
        print(HELP)
        return 0
    try:
        return calibrate(live_arguments(words))
    except (ValueError, OSError) as error:  # ArgumentProblem is a ValueError
        print(f"./calibrate_mount: {' '.join(str(error).split())}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
