"""The folder that a run writes its results into: made, or emptied of an earlier run."""

import shutil
from pathlib import Path

_RUN_FILES: tuple[str, ...] = (
    "run.json",
    "summary.json",
    "counters.json",
    "trajectory.txt",
    "trajectory_truth.txt",
    "contacts.csv",
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
    "run.bag",
    "overrides.yaml",
    "roslaunch.log",
)
_RUN_FOLDERS = ("sweeps", "log")


class ArgumentProblem(ValueError):
    """One line that says what is wrong and what to do."""


def prepare_out(out: Path, force: bool, keep_sweeps: bool = False) -> None:
    """Makes an empty results folder; ArgumentProblem when it cannot be written, or holds something and `force` is not set.

    With `force` only the files of an earlier run are removed: whatever else lies there stays, with `keep_sweeps` also its sweeps.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        if any(out.iterdir()):
            if not force:
                raise ArgumentProblem(f"--out {out}: not empty; --force overwrites the run in it")
            _remove_run(out, keep_sweeps)
        probe = out / ".writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ArgumentProblem(f"--out {out}: cannot be written: {error.strerror}") from error


def _remove_run(out: Path, keep_sweeps: bool) -> None:
    for name in _RUN_FILES:
        (out / name).unlink(missing_ok=True)
    for name in set(_RUN_FOLDERS) - ({"sweeps"} if keep_sweeps else set()):
        shutil.rmtree(out / name, ignore_errors=True)
