"""Sweeps of a folder: point cloud files in the order of stamps, or of counting, and poses.txt, the odometry pose of every file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mapping_tools.cloud_files import SUFFIXES, no_return_text, read_cloud
from mapping_tools.pose_files import FilePose, in_order, paired, read_poses, stamps_of
from mapping_tools.sweep_sources import Mount, SourceSweep, StoppedError, Unreadable, never

Array = NDArray[np.float64]

POSES = "poses.txt"
_OF_A_RUN = ("run.json", "sweeps/index.json")


class FolderSweeps:
    """See `SweepSource`. A file whose name and pose are no stamp has its place in the order for one, in seconds."""

    problem: str | None = None

    def __init__(self, folder: Path, T_base_cloud: Array, sensor: Array | None) -> None:
        """sensor (3,): where beams start that files do not tell of, in the clouds' frame; None: where each file says it was seen from.

        ValueError when there are no sweeps, or poses.txt does not fit them, or the folder is a run's.
        """
        if any((folder / name).is_file() for name in _OF_A_RUN):
            raise ValueError("is the folder of a run or session, whose clouds are finished maps; give its sweeps/, or its run.bag")
        self._T_base_cloud, self._sensor = T_base_cloud, sensor
        self._files = in_order(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
        self._read = self._no_returns = 0
        if not self._files:
            raise ValueError(f"no {' or '.join(SUFFIXES)} files in it")
        self._poses = self._found_poses(folder / POSES)

    def _found_poses(self, path: Path) -> list[FilePose] | None:
        return paired(self._files, read_poses(path), POSES) if path.is_file() else None

    @property
    def progress(self) -> float:
        return self._read / len(self._files)

    @property
    def notes(self) -> tuple[str, ...]:
        return (no_return_text(self._no_returns),) if self._no_returns else ()

    def sweeps(self, is_stopping: Callable[[], bool] = never) -> Iterator[SourceSweep | Unreadable]:
        """In their order."""
        stamps = stamps_of([path.stem for path in self._files])
        for number, path in enumerate(self._files):
            if is_stopping():
                raise StoppedError
            self._read = number + 1
            stamp_s = float(number) if stamps is None else stamps[number]
            pose = FilePose(None, np.eye(4)) if self._poses is None else self._poses[number]
            stamp_s = stamp_s if pose.stamp_s is None else pose.stamp_s
            try:
                cloud = read_cloud(path, self._sensor)
                points, origins = Mount(self._T_base_cloud, cloud.sensor).placed(cloud.points, cloud.origins)
            except ValueError as error:
                yield Unreadable(path.name, stamp_s, str(error))
                continue
            T_odom_base = None if self._poses is None else pose.T
            self._no_returns += cloud.no_returns
            yield SourceSweep(path.name, stamp_s, points, origins, T_odom_base)
