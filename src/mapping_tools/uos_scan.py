"""Scans as 3DTK keeps them (format uos, `scan000.3d`): text, a point a line, centimetres, left-handed with y upwards."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mapping_tools.cloud_files import CloudFile, CloudFileError

SUFFIX = ".3d"
_CM = 0.01
_HEADER_WORDS = 2  # a first line of fewer than three numbers tells the size of the scan


def read_uos_scan(path: Path) -> CloudFile:
    """The points in metres, x ahead, y to the left, z upwards, seen from the origin; CloudFileError when it is none or damaged."""
    try:
        with path.open(encoding="ascii") as file:
            first = file.readline().split()
            rows = np.loadtxt(file, ndmin=2, usecols=(0, 1, 2))
            if len(first) > _HEADER_WORDS:
                rows = np.vstack([np.array(first[:3], dtype=np.float64), rows])
    except OSError as error:
        raise CloudFileError(f"{path}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise CloudFileError(f"{path}: expected lines of x y z in centimetres: {' '.join(str(error).split())}") from error
    return CloudFile(in_metres(rows), None, np.zeros(3))


def in_metres(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """(N, 3) points of 3DTK (x to the right, y upwards, z ahead, cm) as (z, -x, y) in m."""
    return _CM * np.column_stack([rows[:, 2], -rows[:, 0], rows[:, 1]])
