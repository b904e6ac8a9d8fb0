"""The folder that a run writes its results into: made, kept for this run alone, and emptied of an earlier one."""

import fcntl
import os
import shutil
from itertools import count
from pathlib import Path

from explore_command.sessions import CONTACTS, ZONES
from whole_files import refusal, remove_unfinished, written_whole

_RUN_FILES: tuple[str, ...] = (
    "run.json",
    "summary.json",
    "counters.json",
    "trajectory.txt",
    "trajectory_truth.txt",
    CONTACTS,
    "movers.csv",
    "events.csv",
    "map_missed.png",
    "outcome.json",
    "map.bt",
    "map.ot",
)
_RUN_FILES += (
    "cloud.ply",
    "cloud.pcd",
    "graph.g2o",
    "occupied.npz",
    "terrain.npz",
    "path.npz",
    "map_top.png",
    "map_angle.png",
    "world.ply",
    "world_origin.json",
    "config.yaml",
    "robot.yaml",
    "robot.urdf",
    "mount_calibration.yaml",
    ZONES,
    "run.bag",
    "overrides.yaml",
    "roslaunch.log",
)
_RUN_FOLDERS = ("sweeps", "log")
_OF_SESSION = ("sweeps", ZONES, CONTACTS)  # with which a run goes on
_LEAST_BYTES = 10_000_000  # a sweep of the largest sensor, and what a run writes at its start


class ArgumentProblem(ValueError):
    """One line that says what is wrong and what to do."""


def claimed_out(out: Path, may_be_another: bool) -> tuple[Path, int]:
    """The folder, made, and this run's alone; where another run writes into it, the next free of out-2, out-3 and so on.

    And the descriptor of its lock, which is held until all processes that have it have ended.
    ArgumentProblem when it cannot be written, or is another run's and `may_be_another` is false.
    """
    for number in count(1):
        folder = out if number == 1 else out.with_name(f"{out.name}-{number}")
        try:
            folder.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        except OSError as error:
            raise ArgumentProblem(f"--out {refusal(error, folder)}") from error
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(descriptor)
            if not may_be_another:
                raise ArgumentProblem(f"--out {folder}: another run writes into it; name another folder, or wait for its end") from None
        else:
            return folder, descriptor
    raise AssertionError


def prepare_out(out: Path, force: bool, keep_session: bool = False) -> None:
    """Makes an empty results folder; ArgumentProblem when it cannot be written, or holds something and `force` is not set.

    With `force` only the files of an earlier run are removed, and whatever else lies there stays.
    With `keep_session` its sweeps, zones and contacts stay, too.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            if not force:
                raise ArgumentProblem(f"--out {out}: not empty; --force overwrites the run in it")
            _remove_run(out, _OF_SESSION if keep_session else ())
        remove_unfinished(out)
        with written_whole(out / ".writable") as probe:
            probe.write_bytes(bytes(_LEAST_BYTES))
        (out / ".writable").unlink()
    except OSError as error:
        raise ArgumentProblem(f"--out {refusal(error, out)}") from error


def _remove_run(out: Path, kept: tuple[str, ...]) -> None:
    for name in set(_RUN_FILES) - set(kept):
        (out / name).unlink(missing_ok=True)
    for name in set(_RUN_FOLDERS) - set(kept):
        shutil.rmtree(out / name, ignore_errors=True)
