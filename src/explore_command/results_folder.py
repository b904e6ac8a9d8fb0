"""The folder that a run writes its results into: made, kept for this run alone, and emptied of an earlier one."""

import fcntl
import os
import re
import shutil
from collections.abc import Iterable
from itertools import count
from pathlib import Path

from explore_command.sessions import BEFORE, CONTACTS, RUN, ZONES
from whole_files import lies_in, refusal, remove_unfinished, written_whole

_RUN_FILES: tuple[str, ...] = (
    RUN,
    BEFORE,
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
    "overrides.yaml",
    "roslaunch.log",
)
_RUN_FOLDERS = ("sweeps", "log")
_OF_SESSION = ("sweeps", ZONES, CONTACTS, RUN, BEFORE, "robot.yaml", "robot.urdf")  # with which a run goes on
_RECORDED = re.compile(r"run(_\d+)?\.bag(\.active)?")  # as launch/explore.launch names them; active: its recorder was killed
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


def prepare_out(out: Path, force: bool, keep_session: bool = False, inputs: Iterable[Path] = ()) -> None:
    """Makes an empty results folder; ArgumentProblem when it cannot be written, or holds something and `force` is not set.

    With `force` only the files of an earlier run are removed, and whatever else lies there stays. ArgumentProblem, and nothing is removed,
    where one of these is among `inputs`. With `keep_session` its sweeps, zones, contacts, robot and bags stay, too, and what run.json says:
    as `BEFORE`, so that nobody takes it for the one that the new run writes.
    """
    removed = (set(_RUN_FILES) | set(_RUN_FOLDERS)) - set(_OF_SESSION if keep_session else ())
    try:
        out.mkdir(parents=True, exist_ok=True)
        if not keep_session:
            removed |= {path.name for path in out.iterdir() if _RECORDED.fullmatch(path.name)}
        if any(out.iterdir()) and not force:
            raise ArgumentProblem(f"--out {out}: not empty; --force overwrites the run in it")
        for path in inputs:
            if any(lies_in(path, out / name) for name in removed):
                raise ArgumentProblem(f"{path}: the run in {out} would overwrite it; copy it, or name another folder with --out")
        remove_unfinished(out)
        with written_whole(out / ".writable") as probe:
            probe.write_bytes(bytes(_LEAST_BYTES))
        (out / ".writable").unlink()
        _remove_run(out, removed)
        if (out / RUN).exists():
            (out / RUN).replace(out / BEFORE)
    except OSError as error:
        raise ArgumentProblem(f"--out {refusal(error, out)}") from error


def _remove_run(out: Path, names: set[str]) -> None:
    for name in names - set(_RUN_FOLDERS):
        (out / name).unlink(missing_ok=True)
    for name in names & set(_RUN_FOLDERS):
        shutil.rmtree(out / name, ignore_errors=True)
