"""Poses in text, one a line, as TUM or KITTI write them, and which of them belongs to which file."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mapping_tools.number_rows import numbers_of
from rigid_geometry import as_transform, transform_from_quat

Array = NDArray[np.float64]

FORMS = {
    8: "TUM: stamp x y z qx qy qz qw, the stamp in seconds",
    12: "KITTI: the first three rows of the 4 x 4 pose, row by row",
}
STAMP_TOLERANCE_S = 0.005  # between a file's name and its pose: names are cut to milliseconds, and half of 100 Hz is another pose
_ORTHONORMAL = 1e-3  # what a rotation of four digits may be off
_CLIMB_M, _STEEPEST = 2.0, 0.6  # of a whole drive: steeper than 31 degrees, which no wheels climb
_STAMP = re.compile(r"(\d+\.\d+|[1-9](\d{9}|\d{12}|\d{15}|\d{18}))")  # seconds with a fraction, or since 1970 in s, ms, us or ns


@dataclass(frozen=True, eq=False)
class FilePose:
    """A pose (4, 4); stamp_s None where the file has none."""

    stamp_s: float | None
    T: Array


def read_poses(path: Path) -> list[FilePose]:
    """The pose of every line that is neither empty nor begins with "#".

    ValueError names the file and line that is no pose, or whose stamp is not later than the one before; OSError as the system gives it.
    """
    poses: list[FilePose] = []
    width = 0
    for number, line in enumerate(path.read_bytes().splitlines(), 1):
        if not line.strip() or line.lstrip().startswith(b"#"):
            continue
        try:
            numbers = numbers_of(line, number)
            width = width or len(numbers)
            poses.append(_pose(numbers, width, poses[-1].stamp_s if poses else None))
        except ValueError as error:
            text = str(error)
            raise ValueError(f"{path.name}, {text if text.startswith('line') else f'line {number}: {text}'}") from error
    if width == 12:
        _check_z_is_up(path, np.array([pose.T[:3, 3] for pose in poses]))
    return poses


def _check_z_is_up(path: Path, places: Array) -> None:
    """ValueError for the poses of a camera, which looks along z and has y below, as in KITTI's own files."""
    along_x, along_y, along_z = np.ptp(places, axis=0).tolist()
    if along_z > _CLIMB_M and along_z > _STEEPEST * max(along_x, along_y):
        raise ValueError(
            f"{path.name}: its poses climb {along_z:.0f} m over {max(along_x, along_y):.0f} m: z is wanted up, not a camera's axes"
        )


def _pose(numbers: list[float], width: int, before_s: float | None) -> FilePose:
    if width not in FORMS or len(numbers) != width:
        forms = "; ".join(f"{count} ({form})" for count, form in FORMS.items())
        wanted = f"{width}, as in the lines before" if width in FORMS else forms
        raise ValueError(f"{len(numbers)} numbers where {wanted} are wanted")
    if not np.isfinite(numbers).all():
        raise ValueError("a number is not finite")
    if width == 12:
        return FilePose(None, _of_matrix(np.array(numbers).reshape(3, 4)))
    stamp_s, x, y, z, qx, qy, qz, qw = numbers
    if before_s is not None and stamp_s <= before_s:
        raise ValueError(f"stamp {stamp_s} is not later than the one before, {before_s}")
    return FilePose(stamp_s, np.asarray(transform_from_quat((x, y, z), (qx, qy, qz, qw))))


def _of_matrix(rows: Array) -> Array:
    """(4, 4) with the rotation nearest to that of the rows (3, 4), which are written with few digits."""
    R = rows[:, :3]
    if np.abs(R).max() > 1.0 + _ORTHONORMAL or np.abs(R @ R.T - np.eye(3)).max() > _ORTHONORMAL or np.linalg.det(R) < 0.0:
        raise ValueError("its first three columns are no rotation")
    U, _, Vt = np.linalg.svd(R)
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = U @ Vt, rows[:, 3]
    return np.asarray(as_transform(T))


def in_order(files: Iterable[Path]) -> list[Path]:
    """Files by time where all names are stamps, else as people count: 9 before 10."""
    counted = sorted(files, key=_naturally)
    stamps = stamps_of([path.stem for path in counted])
    return counted if stamps is None else [counted[k] for k in np.argsort(stamps, kind="stable")]


def _naturally(path: Path) -> list[int | str]:
    return [int(part) if k % 2 else part for k, part in enumerate(re.split(r"(\d+)", path.name))]


def stamps_of(names: Sequence[str]) -> list[float] | None:
    """The stamps in seconds that file names without suffix are, if all of them are stamps; else None."""
    if not all(_STAMP.fullmatch(name) for name in names):
        return None
    return [float(name) if "." in name else int(name) / 10.0 ** (len(name) - 10) for name in names]


def paired(files: Sequence[Path], poses: Sequence[FilePose], source: str) -> list[FilePose]:
    """The pose of every file: that of its stamp where names and poses have stamps, else of its place in the order.

    ValueError, with both numbers, when there are not as many; or it names the first file at whose stamp there is no pose.
    """
    stamps = stamps_of([path.stem for path in files])
    if stamps is not None and poses and poses[0].stamp_s is not None:
        return _paired_by_stamp(files, stamps, poses, source)
    if len(poses) != len(files):
        raise ValueError(f"{len(poses)} poses in {source} for {len(files)} sweeps")
    return list(poses)


def _paired_by_stamp(files: Sequence[Path], stamps: Sequence[float], poses: Sequence[FilePose], source: str) -> list[FilePose]:
    known = np.array([pose.stamp_s for pose in poses])
    nearest = [int(np.argmin(np.abs(known - stamp))) for stamp in stamps]
    gaps = np.abs(known[nearest] - stamps)
    if gaps.max() > STAMP_TOLERANCE_S:
        k = int(np.argmax(gaps > STAMP_TOLERANCE_S))
        raise ValueError(
            f"no pose in {source} is of {files[k].name}: the nearest of {len(poses)} is {gaps[k]:.3f} s away, of {len(files)} files"
        )
    return [FilePose(stamp, poses[at].T) for stamp, at in zip(stamps, nearest, strict=True)]
