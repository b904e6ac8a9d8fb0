"""Scans as 3DTK keeps them (format uos, `scan000.3d`): text, a point a line, centimetres, left-handed with y upwards."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mapping_tools.cloud_files import CloudFile, CloudFileError

SUFFIX = ".3d"
_M_A_CM = 0.01


def read_uos_scan(path: Path) -> CloudFile:
    """The points in metres, x ahead, y to the left, z upwards, seen from the origin; CloudFileError when it is none or damaged.

    A first line may tell the size of the scan instead of a point, as "481 x 361".
    """
    try:
        lines = path.read_text(encoding="ascii").splitlines()
        begin = 1 if lines and ("x" in lines[0].split() or len(lines[0].split()) == 1) else 0
        points = [line.split()[:3] for line in lines[begin:] if line.strip()]
        rows = np.array(points, dtype=np.float64) if points else np.zeros((0, 3))
        if rows.shape[1:] != (3,):
            raise ValueError("lines of fewer than three numbers")
    except OSError as error:
        raise CloudFileError(f"{path}: cannot be read: {error.strerror or error}") from error
    except ValueError as error:
        raise CloudFileError(f"{path}: expected lines of x y z in centimetres: {' '.join(str(error).split())}") from error
    if not len(rows):
        raise CloudFileError(f"{path}: holds no points")
    return CloudFile(_M_A_CM * np.column_stack([rows[:, 2], -rows[:, 0], rows[:, 1]]), None, np.zeros(3))
