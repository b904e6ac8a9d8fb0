"""What the pictures of a run show: its classified and other occupied voxels, and the path that was driven.

Read from the run folder alone, in the map frame. Ceilings and the walls in front are cut off, so that one looks into rooms.
"""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from exploration_evaluation.classification import LABELS
from exploration_evaluation.run_files import read_arrays, read_occupied, read_sweep_poses, read_trajectory
from exploration_evaluation.scores import trajectory_errors
from exploration_evaluation.voxel_renderer import Image, View
from rigid_geometry import inverse, transform_points

Floats = NDArray[np.float64]

COLOURS = {
    "traversable": "#63b46c",
    "obstacle": "#d5483f",
    "cliff": "#8e5bb8",
    "inflation": "#f0a040",
    "frontier": "#2f7fdb",
    "potential cliff": "#35c4d7",
}
OTHER_COLOUR = "#d4d7dc"
_CEILING_M = 1.3
_STRIP_M = 0.10
_FRONT_WALL_M = 0.25
_SILL_M = 0.25
_PATH_ABOVE_BASE_M = 0.10
_PATH_STEP_M = 0.05


@dataclass(frozen=True)
class DrawnVoxels:
    """(N, 3) centres, (N,) edge lengths, (N, 3) colours, and (N,) how far they come forward where two share a face."""

    centres: Floats
    sizes: Floats
    colours: Image
    bias: Floats
    classes: tuple[str, ...]


@dataclass(frozen=True)
class DrivenPath:
    """(N, 3) line that was driven, and (S, 3) places of sweeps, both a little above base_link in the map frame."""

    line: Floats
    sweeps: Floats
    line_is_true: bool


def read_voxels(folder: Path) -> DrawnVoxels:
    """All voxels of a run folder; ValueError when there are none, or none can be read."""
    parts, reasons = [], []
    for read in (_occupied_voxels, _classified_voxels):
        try:
            parts.append(read(folder))
        except ValueError as error:
            reasons.append(str(error))
    parts = [part for part in parts if len(part.centres)]
    if not parts:
        raise ValueError(f"nothing to draw in {folder}: {'; '.join(reasons) or 'the map is empty'}")
    return DrawnVoxels(
        np.vstack([p.centres for p in parts]),
        np.concatenate([p.sizes for p in parts]),
        np.vstack([p.colours for p in parts]),
        np.concatenate([p.bias for p in parts]),
        tuple(name for p in parts for name in p.classes),
    )


def _occupied_voxels(folder: Path) -> DrawnVoxels:
    centres, sizes = read_occupied(folder / "occupied.npz")
    return DrawnVoxels(centres, sizes, np.tile(_rgb(OTHER_COLOUR), (len(centres), 1)), np.zeros(len(centres)), ("other",))


def _classified_voxels(folder: Path) -> DrawnVoxels:
    data = read_arrays(folder / "terrain.npz", ("x", "y", "z", "label"))
    known = data["label"] < len(LABELS)
    centres = np.column_stack([data[axis] for axis in "xyz"]).astype(np.float64)[known]
    label = data["label"][known].astype(np.int64)
    palette = np.stack([_rgb(COLOURS[name]) for name in LABELS])
    present = tuple(name for k, name in enumerate(LABELS) if (label == k).any())
    size = _spacing(centres)
    # Of classes that share a face the rarer tells more: a frontier beside ground, a cliff beside its inflation.
    return DrawnVoxels(
        centres, np.full(len(centres), size), palette[label], np.asarray(0.02 * size + 1e-5 * label, dtype=np.float64), present
    )


def _spacing(centres: Floats) -> float:
    """The grid that the centres lie on: the smallest distance between two different x."""
    gaps = np.diff(np.unique(np.round(centres[:, 0], 4))) if len(centres) else np.empty(0)
    gaps = gaps[gaps > 0.005]
    return float(gaps.min()) if len(gaps) else 0.08


def _rgb(code: str) -> Image:
    return np.array([int(code[k : k + 2], 16) / 255.0 for k in (1, 3, 5)], dtype=np.float32)


def driven_path(folder: Path) -> DrivenPath:
    """The true path where it is known, else the line from sweep to sweep; empty without a trajectory."""
    try:
        stamps, poses = read_sweep_poses(folder / "trajectory.txt")
    except ValueError:
        return DrivenPath(np.empty((0, 3)), np.empty((0, 3)), False)
    sweeps = poses[:, :3, 3] + [0.0, 0.0, _PATH_ABOVE_BASE_M]
    try:
        at_truth, truth = read_trajectory(folder / "trajectory_truth.txt")
        T_map_world = inverse(trajectory_errors(stamps, poses, at_truth, truth).T_world_map)
    except ValueError:
        return DrivenPath(_densified(sweeps), sweeps, False)
    driven = np.asarray(transform_points(T_map_world, truth[:, :3, 3]), dtype=np.float64) + [0.0, 0.0, _PATH_ABOVE_BASE_M]
    return DrivenPath(_densified(driven), sweeps, True)


def _densified(points: Floats) -> Floats:
    """Points every few centimetres along a line, so that each piece is seen or hidden as a whole."""
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    at = np.linspace(0.0, length[-1], max(2, math.ceil(length[-1] / _PATH_STEP_M)))
    return np.column_stack([np.interp(at, length, points[:, axis]) for axis in range(3)])


def without_ceiling(voxels: DrawnVoxels, path: DrivenPath) -> DrawnVoxels:
    """Without what lies higher than a head above the highest ground that was classified or driven."""
    classified = voxels.bias > 0
    ground = np.concatenate([voxels.centres[classified, 2], path.line[:, 2], path.sweeps[:, 2]])
    if not len(ground):
        return voxels
    kept = voxels.centres[:, 2] - 0.5 * voxels.sizes <= float(np.percentile(ground, 99.5)) + _CEILING_M
    return _kept(voxels, kept)


def without_front_walls(voxels: DrawnVoxels, view: View) -> DrawnVoxels:
    """Without the upper part of what stands between the viewer and all classified ground, as in a doll's house."""
    ground = voxels.centres[voxels.bias > 0]
    forward = np.array([view.axes[2, 0], view.axes[2, 1], 0.0])
    if not len(ground) or np.linalg.norm(forward) < 1e-3:
        return voxels
    right = view.axes[0]
    strip = np.round(ground @ right / _STRIP_M).astype(np.int64)
    order = np.lexsort((ground @ forward, strip))
    foremost = ground[order[np.append(np.diff(strip[order]) > 0, True)]]  # in each strip of the picture, left to right
    at = voxels.centres @ right
    before = voxels.centres @ forward > np.interp(at, foremost @ right, foremost @ forward) - _FRONT_WALL_M
    above = voxels.centres[:, 2] > np.interp(at, foremost @ right, foremost[:, 2]) + _SILL_M
    return _kept(voxels, ~(before & above & (voxels.bias == 0)))


def _kept(voxels: DrawnVoxels, kept: NDArray[np.bool_]) -> DrawnVoxels:
    return DrawnVoxels(voxels.centres[kept], voxels.sizes[kept], voxels.colours[kept], voxels.bias[kept], voxels.classes)
