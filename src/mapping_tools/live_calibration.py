"""./calibrate_mount NAME:=VALUE...: calibrates the mount of a robot whose drivers run, or of a simulated one. ROS runs in its children.

A simulation has a master of its own. With real drivers it joins theirs, unless nodes run there that it would replace.
"""

from __future__ import annotations

import http.client
import os
import re
import subprocess
import sys
import xmlrpc.client
from collections.abc import Mapping, Sequence

from explore_command.arguments import ArgumentProblem
from mapping_tools.live_arguments import HELP, live_arguments
from mapping_tools.tool_errors import code_of
from roslaunch_process import free_port, hand_on_signals, start_launch

_PACKAGE, _FILE, _NAME = "explore_3dnav", "calibrate_mount.launch", "/calibrate_mount"
_ANSWER_S = 3.0
_SHUTDOWN_S = 15
_INTERRUPTED = 130


class _Patient(xmlrpc.client.Transport):
    """Waits so long for an answer, and no longer."""

    def make_connection(self, host: tuple[str, dict[str, str]] | str) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = _ANSWER_S
        return connection


def running_nodes(master_uri: str, names: Sequence[str]) -> list[str]:
    """Those of the nodes with these full names that run under a master; OSError or xmlrpc.client.Error when it does not answer.

    A node that was killed is known there, too, but nobody listens at its address.
    """
    master = xmlrpc.client.ServerProxy(master_uri, _Patient())
    found = []
    for name in names:
        answer = master.lookupNode(_NAME, name)
        if isinstance(answer, list) and answer[0] == 1 and _is_there(str(answer[2])):
            found.append(name)
    return found


def _is_there(uri: str) -> bool:
    try:
        xmlrpc.client.ServerProxy(uri, _Patient()).getPid(_NAME)
    except ConnectionRefusedError:
        return False
    except (OSError, http.client.HTTPException, xmlrpc.client.Error):  # a node that hangs is one, too
        return True
    return True


def nodes_of_launch(arguments: Mapping[str, str]) -> list[str]:
    """Full names of the nodes that the launch file would start. ArgumentProblem when roslaunch cannot read it."""
    words = [f"{name}:={value}" for name, value in arguments.items()]
    listed = subprocess.run(["roslaunch", "--nodes", _PACKAGE, _FILE, *words], capture_output=True, text=True, check=False)
    if listed.returncode:
        raise ArgumentProblem(" ".join(listed.stderr.split()) or "roslaunch cannot read the launch file")
    return [line for line in listed.stdout.splitlines() if line.startswith("/")]


def check_master(arguments: Mapping[str, str]) -> None:
    """ArgumentProblem when no master runs whose drivers could be heard, or when a node there would be replaced."""
    uri = os.environ.get("ROS_MASTER_URI", "")
    try:
        found = running_nodes(uri, nodes_of_launch(arguments))
    except (OSError, http.client.HTTPException, xmlrpc.client.Error) as error:
        where = uri or "ROS_MASTER_URI, which is not set"
        raise ArgumentProblem(f"no ROS master at {where}: start the robot's drivers first, or take sim:=true") from error
    if found:
        raise ArgumentProblem(f"{', '.join(found)} at {uri} would be replaced: end the exploration, or the calibration, there first")


def exit_code(said: str, *, interrupted: bool) -> int:
    """0 saved, 1 nothing was observable, 130 interrupted, else 2, by all that roslaunch and its nodes said."""
    if re.search("^saved to ", said, re.MULTILINE):
        return 0
    if interrupted:
        return _INTERRUPTED
    return 1 if re.search(r"calibrate_mount_node.*exit code 1\b", said) else 2


def calibrate(arguments: Mapping[str, str]) -> int:
    """The exit code of a calibration; ArgumentProblem or OSError when it does not begin."""
    port = None
    if arguments["sim"] == "true":
        port = free_port()
        print(f"simulates; ROS_MASTER_URI=http://localhost:{port}", flush=True)
    else:
        check_master(arguments)
    launch = start_launch(_FILE, arguments, port, None, _SHUTDOWN_S)
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
    return code_of("calibrate_mount", lambda: calibrate(live_arguments(words)))


if __name__ == "__main__":
    sys.exit(main())
