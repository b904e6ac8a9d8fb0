"""The outcome of a run does not depend on how busy the machine is: lock-step, stamps and serial sums."""

import contextlib
import subprocess
import sys
from collections.abc import Iterator
from itertools import zip_longest
from pathlib import Path

from exploring import ExploreRun, lines_of_sweeps, summary

BUSY_LIMIT_S = 400.0


@contextlib.contextmanager
def busy_loops(count: int) -> Iterator[None]:
    """Processes that do nothing but take the processors."""
    loops = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for loop in loops:
            loop.kill()
            loop.wait()


def first_difference(a: str, b: str) -> str | None:
    """The first line in which two texts differ, both readings; None when they are equal."""
    for number, (left, right) in enumerate(zip_longest(a.splitlines(), b.splitlines()), start=1):
        if left != right:
            return f"line {number}: {left!r} / {right!r}"
    return None


def test_rooms_gives_the_same_run_beside_two_busy_loops(rooms_run: tuple[Path, int, str], tmp_path: Path) -> None:
    quiet, busy = rooms_run[0], tmp_path / "busy"
    with busy_loops(2), ExploreRun("--world", "rooms", "--seed", 1, "--headless", "--out", busy) as run:
        assert run.wait(BUSY_LIMIT_S) == 0, run.text
    assert summary(quiet)["sweeps"] == summary(busy)["sweeps"]
    assert lines_of_sweeps(quiet) == lines_of_sweeps(busy)
    difference = first_difference(*((folder / "trajectory_truth.txt").read_text() for folder in (quiet, busy)))
    assert difference is None, f"quiet and busy run part at {difference}"
