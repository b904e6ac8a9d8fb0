"""Arguments of ./replay, and what is wrong with them before anything is started."""

import argparse
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from explore_command.arguments import ArgumentProblem, OneLineParser
from run_replay.bag_topics import bag_problem
from whole_files import check_files

PLAYED_FILES = ("trajectory.txt", "sweeps/index.json")
COMPARED_FILES = ("trajectory.txt", "cloud.ply")
_DEFAULT_SPEED = 10.0


@dataclass(frozen=True)
class ReplayArguments:
    """What is to be shown: one of a run's folder, a bag, or two run folders to compare."""

    run: Path | None
    bag: Path | None
    other: Path | None
    speed: float
    headless: bool
    export: Path | None = None


def parser() -> argparse.ArgumentParser:
    p = OneLineParser(
        prog="./replay",
        usage="./replay DIR|BAG [--speed X] [--headless]\n       ./replay --compare A B [--headless]\n"
        "       ./replay DIR --export FILE.mcap",
        description="Shows a finished run in rviz as it happened: the robot, its path, and the map as it grew sweep by sweep, at the end "
        "classified. No simulator runs, and the run's folder is only read.",
        epilog="What was played stays on screen until Ctrl-C or until rviz is closed. "
        "Example: ./replay runs/ramp-1 --speed 20. Exit code: 0 shown, 1 it broke off, 2 wrong argument or a run that cannot be read, "
        "130 an export that was interrupted.",
    )
    p.add_argument("source", nargs="?", type=Path, metavar="DIR|BAG", help="folder of a run of ./explore, or a bag of one, like run.bag")
    p.add_argument("--speed", type=float, metavar="X", help=f"times real time; default {_DEFAULT_SPEED:g}; 0: as fast as it goes")
    p.add_argument("--compare", nargs=2, type=Path, metavar=("A", "B"), help="the maps and paths of two runs, A's in orange, B's in blue")
    p.add_argument("--export", type=Path, metavar="FILE", help="writes the run into one MCAP file instead, for Foxglove or another reader")
    p.add_argument("--headless", action="store_true", help="no rviz: publishes all the same, and ends after the last message")
    return p


def parse(argv: Sequence[str] | None = None) -> ReplayArguments:
    """Checked arguments; ArgumentProblem for what is wrong with them, SystemExit(0) for --help."""
    a = parser().parse_args(argv)
    if (a.source is None) == (a.compare is None):
        raise ArgumentProblem("expected the folder of a run, a bag, or --compare A B, and one of them only; ./replay --help")
    if a.compare and a.speed is not None:
        raise ArgumentProblem("--speed: a comparison is shown at once, without --speed")
    speed = _DEFAULT_SPEED if a.speed is None else a.speed
    if not (math.isfinite(speed) and speed >= 0):
        raise ArgumentProblem(f"--speed {speed:g}: expected 0 or more")
    if a.export is not None:
        return _to_export(a.source, a.export, a.speed)
    found = _found(a.source, a.compare, speed, a.headless)
    if not (a.headless or os.environ.get("DISPLAY")):
        raise ArgumentProblem("there is no display (DISPLAY is not set) to open rviz on; --headless plays without it")
    return found


def _to_export(source: Path | None, target: Path, speed: float | None) -> ReplayArguments:
    if source is None or source.is_file():
        raise ArgumentProblem("--export: expected the folder of a run; bags can be opened as they are")
    if speed is not None:
        raise ArgumentProblem("--speed: an export has the run's own times, without --speed")
    if target.suffix != ".mcap":
        raise ArgumentProblem(f"--export {target}: expected a file that ends with .mcap")
    run = _run_folder(source, PLAYED_FILES)
    try:
        check_files([("--export", target)], [run])
    except ValueError as error:
        raise ArgumentProblem(str(error)) from error
    return ReplayArguments(run, None, None, 0.0, True, target.absolute())


def _found(source: Path, compared: Sequence[Path] | None, speed: float, headless: bool) -> ReplayArguments:
    if compared:
        first, second = (_run_folder(path, COMPARED_FILES) for path in compared)
        return ReplayArguments(first, None, second, speed, headless)
    if source.is_file():
        return ReplayArguments(None, _bag(source), None, speed, headless)
    return ReplayArguments(_run_folder(source, PLAYED_FILES), None, None, speed, headless)


def _run_folder(folder: Path, needed: Sequence[str]) -> Path:
    if not folder.exists():
        raise ArgumentProblem(f"{folder}: no such folder or file")
    if not folder.is_dir():
        raise ArgumentProblem(f"{folder}: not a folder; only the folders of runs can be compared")
    missing = [name for name in needed if not (folder / name).is_file()]
    if missing:
        what = "not the folder of a finished run" if (folder / "run.json").is_file() else "not the folder of a run"
        raise ArgumentProblem(f"{folder}: {what}: {' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not there")
    return folder.absolute()


def _bag(path: Path) -> Path:
    problem = bag_problem(path)
    if problem:
        raise ArgumentProblem(f"{path}: {problem}")
    return path.absolute()
