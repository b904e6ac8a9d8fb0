"""Starts ./explore as a person would, watches what it prints and leaves, and finds what it left running."""

import json
import os
import queue
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import uuid
from collections.abc import Callable
from pathlib import Path

from slow_machine import LONGEST_S, patience_s, slowness

PACKAGE = Path(__file__).resolve().parents[2]
RUN_MARK = "EXPLORE_3DNAV_TEST_RUN"
REVIVAL = " -m node_revival "  # what stands above a node and starts it again
GONE_AFTER_KILL_S = 5.0  # promised, of all that a killed parent leaves behind
_ONE_SWEEP = re.compile(r"\b1 sweeps\b")


def free_port() -> int:
    """A port of localhost that nobody has now."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        return int(probe.getsockname()[1])


def running_with(mark: str) -> dict[int, str]:
    """Process id and command line of every process with a mark in its environment."""
    wanted = f"{RUN_MARK}={mark}".encode()
    found = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                if wanted in (entry / "environ").read_bytes().split(b"\0"):
                    found[int(entry.name)] = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
            except OSError:
                continue  # it ended while we looked, or is another user's
    return found


class ExploreRun:
    """One ./explore, or another command, in a process group of its own; every process that comes of it inherits a mark."""

    def __init__(self, *arguments: object, environment: dict[str, str] | None = None, command: str = "explore") -> None:
        self.mark = uuid.uuid4().hex
        self.output: list[str] = []
        self._lines: queue.Queue[str | None] = queue.Queue()
        self.process = subprocess.Popen(
            [str(PACKAGE / command), *map(str, arguments)],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,
            env={**os.environ, **(environment or {}), RUN_MARK: self.mark},
        )
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def wait_for_line(self, pattern: re.Pattern[str] | str, timeout_s: float) -> str:
        """The first line from now on that matches; AssertionError with all output when the run or the time ends before.

        `timeout_s` is what no quick machine needs: a slow one has `patience_s`, here and in `wait`.
        """
        timeout_s = patience_s(timeout_s)
        deadline = time.monotonic() + timeout_s
        while (left := deadline - time.monotonic()) > 0:
            try:
                line = self._lines.get(timeout=left)
            except queue.Empty:
                break
            if line is None:
                break
            self.output.append(line)
            if re.search(pattern, line):
                return line
        raise AssertionError(f"no line with {pattern!r} within {timeout_s:.0f} s in:\n{self.text}")

    def wait_for_first_sweep(self, timeout_s: float = 90.0) -> None:
        """Until the status line says that one sweep is over."""
        self.wait_for_line(_ONE_SWEEP, timeout_s)

    def wait(self, timeout_s: float) -> int:
        """The exit code; the output up to there is in `output`. AssertionError, and an end of the run, when it takes longer."""
        timeout_s = patience_s(timeout_s)
        deadline = time.monotonic() + timeout_s
        while (left := deadline - time.monotonic()) > 0:
            try:
                line = self._lines.get(timeout=left)
            except queue.Empty:
                break
            if line is None:
                return self.process.wait(timeout=60.0)
            self.output.append(line)
        raise AssertionError(f"it still ran after {timeout_s:.0f} s, its output:\n{self.text}")

    @property
    def text(self) -> str:
        """Everything that was printed so far."""
        return "".join(self.output)

    def interrupt(self) -> None:
        """Ctrl-C: SIGINT to the whole foreground process group, as a terminal does it."""
        os.killpg(self.process.pid, signal.SIGINT)

    def running(self) -> dict[int, str]:
        """Process id and command line of everything that came of this run and still runs."""
        return running_with(self.mark)

    def pid_of(self, node: str) -> int:
        """Process id of a node of this run; AssertionError when there is not exactly one."""
        pids = [pid for pid, command in self.running().items() if f"__name:={node} " in f"{command} " and REVIVAL not in command]
        assert len(pids) == 1, f"expected one process of {node}, found {pids}"
        return pids[0]

    def wait_until_gone(self, wanted: Callable[[int, str], bool] = lambda _pid, _command: True) -> None:
        """Until none of the processes that run now and are `wanted` runs any more; AssertionError when that takes longer than is promised.

        Promised for a machine that does little else: a slower or busier one takes as much longer.
        """
        begun, pids = time.monotonic(), {pid for pid, command in self.running().items() if wanted(pid, command)}
        limit_s = GONE_AFTER_KILL_S * slowness()
        while left := pids & set(self.running()):
            assert time.monotonic() - begun < limit_s, f"still running after {limit_s:.1f} s: {[self.running().get(pid) for pid in left]}"
            time.sleep(0.05)
        print(f"gone after {time.monotonic() - begun:.1f} s")

    def end(self) -> None:
        """Ends what is still running, however the test went."""
        for _ in range(3):
            for pid in self.running():
                try:
                    os.kill(pid, signal.SIGKILL)
                except ProcessLookupError:
                    continue
            time.sleep(0.05)

    def __enter__(self) -> "ExploreRun":
        return self

    def __exit__(self, *_: object) -> None:
        self.end()


def explored_beside(client: str, launch: str, port: int) -> None:
    """Launches explore.launch, and after the first sweep a client of this folder, which has to end with 0 while the launch lives on.

    The client outlives exploration; what is judged then may take longer than the client.
    """
    uri = f"http://localhost:{port}"
    command = f"source {PACKAGE}/.ws/devel/setup.bash && exec roslaunch -p {port} explore_3dnav explore.launch {launch}"
    with ExploreRun("-c", command, command="/bin/bash", environment={"ROS_MASTER_URI": uri}) as run:
        run.wait_for_first_sweep(300.0)
        words = [sys.executable, str(Path(__file__).with_name(client))]
        done = subprocess.run(words, env={**os.environ, "ROS_MASTER_URI": uri}, capture_output=True, text=True, timeout=LONGEST_S)
        print(done.stdout)
        assert done.returncode == 0, f"{done.stdout}{done.stderr[-3000:]}"
        run.wait_for_line("the run has ended; the nodes live on", 120.0)
        assert run.process.poll() is None, "the launch ended with exploration"


def summary(out: Path) -> dict[str, object]:
    """summary.json of a run folder."""
    loaded = json.loads((out / "summary.json").read_text())
    assert isinstance(loaded, dict)
    return loaded


def lines_of_sweeps(out: Path) -> list[str]:
    """trajectory.txt's lines, one a sweep."""
    return [line for line in (out / "trajectory.txt").read_text().splitlines() if line and not line.startswith("#")]
