"""Sweeps of a folder: point cloud files in the order of their names, and poses.txt, a TUM trajectory with one odometry pose a file."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mapping_tools.cloud_files import SUFFIXES, read_cloud
from mapping_tools.sweep_sources import Mount, SourceSweep, Unreadable
from rigid_geometry import transform_from_quat

Array = NDArray[np.float64]

POSES = "poses.txt"


def read_poses(path: Path) -> list[tuple[float, Array]]:
    """(stamp in seconds, (4, 4) pose) of every line "stamp x y z qx qy qz qw"; ValueError names the line that is none, or not later."""
    poses: list[tuple[float, Array]] = []
    for number, line in enumerate(path.read_text(encoding="ascii", errors="replace").splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        try:
            stamp, x, y, z, qx, qy, qz, qw = (float(word) for word in line.split())
            T = transform_from_quat((x, y, z), (qx, qy, qz, qw))
            if not np.isfinite([stamp, x, y, z]).all() or (poses and stamp <= poses[-1][0]):
                raise ValueError(f"stamp {stamp} or its position is not finite, or not later than the line before")
        except ValueError as error:
            raise ValueError(f"{path.name}, line {number}: {error}") from error
        poses.append((stamp, np.asarray(T)))
    return poses


class FolderSweeps:
    """See `SweepSource`. Without poses.txt the stamp of a sweep is its place in the order, in seconds."""

    problem: str | None = None
    notes: tuple[str, ...] = ()

    def __init__(self, folder: Path, T_base_cloud: Array, sensor: Array | None) -> None:
        """sensor (3,): where beams start that files do not tell of, in the clouds' frame; None: where each file says it was seen from.

        ValueError when there are no sweeps, or poses.txt does not fit them.
        """
        self._T_base_cloud, self._sensor = T_base_cloud, sensor
        self._files = sorted(path for path in folder.iterdir() if path.suffix.lower() in SUFFIXES)
        self._read = 0
        if not self._files:
            raise ValueError(f"no {' or '.join(SUFFIXES)} files in it")
        self._poses = read_poses(folder / POSES) if (folder / POSES).is_file() else None
        if self._poses is not None and len(self._poses) != len(self._files):
            raise ValueError(f"{len(self._poses)} poses in {POSES} for {len(self._files)} sweeps")

    @property
    def progress(self) -> float:
        return self._read / len(self._files)

    def sweeps(self) -> Iterator[SourceSweep | Unreadable]:
        """In the order of the names."""
        for number, path in enumerate(self._files):
            self._read = number + 1
            stamp_s, T_odom_base = self._poses[number] if self._poses is not None else (float(number), None)
            try:
                cloud = read_cloud(path)
                mount = Mount(self._T_base_cloud, cloud.sensor if self._sensor is None else self._sensor)
                points, origins = mount.placed(cloud.points, cloud.origins)
            except ValueError as error:
                yield Unreadable(path.name, stamp_s, str(error))
                continue
            yield SourceSweep(path.name, stamp_s, points, origins, T_odom_base)
