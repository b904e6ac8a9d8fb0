"""Starts roslaunch with a master on a free port, hands Ctrl-C on, and turns the summary into an exit code."""

import ctypes
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import TextIO

import yaml

from explore_command.arguments import NAMED_WORLDS, ExploreArguments
from explore_command.parameters import all_overrides, override_problems

ROS_PORTS = range(11311, 11400)
_SHUTDOWN_S = 60
_PR_SET_PDEATHSIG = 1
_MONITOR_MARK = "[explore]"


def world_problem(arguments: ExploreArguments) -> str | None:
    """Why the world or the start cannot be used, or None; named worlds with their own start need no look."""
    if arguments.world in NAMED_WORLDS and arguments.start is None:
        return None
    from pybullet_simulation import load_world

    try:
        load_world(arguments.world, arguments.seed, size_xyz=arguments.size, area_xy=arguments.area, start=arguments.start)
    except ValueError as error:
        return f"--world {arguments.world}: {error}"
    return None


def parameter_problem(arguments: ExploreArguments) -> str | None:
    """What is wrong with the names and values of --profile and --set, in one line, or None."""
    try:
        problems = override_problems(all_overrides(arguments.profile, arguments.set_parameters))
    except ValueError as error:
        problems = [str(error)]
    return f"--profile, --set: wrong parameter: {'; '.join(problems)}" if problems else None


def free_port(among: Iterable[int] = ROS_PORTS) -> int:
    """The first port that nobody has: ROS's usual one, else one near it, below those that the system hands out to whoever asks."""
    for port in among:
        with socket.socket() as s:
            try:
                s.bind(("", port))
                return port
            except OSError:
                continue
    raise OSError(f"no free port for a ROS master in {among}")


def _joined(values: tuple[float, ...] | None) -> str:
    return " ".join(f"{v:g}" for v in values) if values else ""


def launch_arguments(arguments: ExploreArguments, overrides: str) -> list[str]:
    """The launch file's arguments, name:=value."""
    values = {
        "world": arguments.world,
        "seed": arguments.seed,
        "start": _joined(arguments.start),
        "size": _joined(arguments.size),
        "area": _joined(arguments.area),
        "out": arguments.out,
        "rate": arguments.rate,
        "lockstep": str(arguments.lockstep).lower(),
        "record": str(arguments.record).lower(),
        "rviz": str(not arguments.headless).lower(),
        "max_sim_time": arguments.max_sim_time_s,
        "overrides": overrides,
    }
    return [f"{name}:={value}" for name, value in values.items()]


def _end_with_parent() -> None:
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGINT)


def _write_overrides(arguments: ExploreArguments) -> str:
    """The file with the parameters of --profile and --set for the launch file."""
    overrides = all_overrides(arguments.profile, arguments.set_parameters)
    overrides.setdefault("exploration_monitor_node", {})["profile"] = arguments.profile
    path = arguments.out / "overrides.yaml"
    path.write_text(yaml.safe_dump(overrides))
    return str(path)


def _show(launch: "subprocess.Popen[str]", log: TextIO) -> None:
    """Writes all output to the log, and the monitor's lines to the terminal, status lines over each other where it is one."""
    live = sys.stdout.isatty()
    assert launch.stdout is not None
    for line in launch.stdout:
        log.write(line)
        log.flush()
        _, found, text = line.rstrip().partition(_MONITOR_MARK)
        if found and live and text.startswith(" t="):
            print(f"\r\x1b[K{text.strip()}", end="", flush=True)
        elif found:
            print(("\n" if live else "") + text.strip(), flush=True)


def run_launch(arguments: ExploreArguments) -> int:
    """Runs the launch file to its end; 0 when the run succeeded, 2 for a wrong parameter, else 1."""
    port = arguments.port or free_port()
    environment = dict(os.environ, ROS_MASTER_URI=f"http://localhost:{port}", ROS_LOG_DIR=str(arguments.out / "log"))
    command = ["roslaunch", "--port", str(port), f"--sigint-timeout={_SHUTDOWN_S}", "explore_3dnav", "explore.launch"]
    command += launch_arguments(arguments, _write_overrides(arguments))
    print(
        f"exploring {arguments.world}, seed {arguments.seed}; results in {arguments.out}; ROS_MASTER_URI=http://localhost:{port}",
        flush=True,
    )
    with (arguments.out / "roslaunch.log").open("w") as log:
        launch = subprocess.Popen(
            command,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            preexec_fn=_end_with_parent,
        )
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, lambda _n, _f: launch.send_signal(signal.SIGINT))
        _show(launch, log)
        launch.wait()
    return _exit_code(arguments.out)


def _exit_code(out: Path) -> int:
    summary = out / "summary.json"
    if summary.exists():
        return 0 if json.loads(summary.read_text()).get("success") is True else 1
    lines = (out / "roslaunch.log").read_text(errors="replace").strip().splitlines()
    wrong = [line for line in lines if "wrong parameter" in line]
    print("\n".join(wrong or lines[-15:]), file=sys.stderr)
    return 2 if wrong else 1
