"""What movers did to a run: touches that were not the robot's doing, and what they left in the map."""

import csv
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from exploration_evaluation.mesh import RayScene, checked_mesh
from exploration_evaluation.run_files import read_occupied
from exploration_evaluation.scores import divided_voxels
from rigid_geometry import transform_points

Floats = NDArray[np.float64]

MOVERS_FILE = "movers.csv"
MOVER_SCORES = ("movers", "ghosts_m2")

_GHOST_OFF_M = 0.2  # distance to the true surfaces beyond which a mapped voxel is none of them
_GHOST_REACH_M = 0.7  # how near to a mover's place such a voxel is taken for its ghost


def mover_scores(folder: Path, mesh: tuple[ArrayLike, ArrayLike], T_world_map: Floats, voxel_m: float) -> dict[str, float | None]:
    """How many movers there were and `ghosts_m2`, the ground under what they left in the map; None for a run without movers.

    ValueError when a file is absent or damaged.
    """
    path = folder / MOVERS_FILE
    if not path.is_file():
        return dict.fromkeys(MOVER_SCORES)
    names, places = read_mover_places(path)
    voxels = divided_voxels(*read_occupied(folder / "occupied.npz"), voxel_m)
    return {"movers": len(set(names)), "ghosts_m2": ghosts_m2(transform_points(T_world_map, voxels), mesh, places, voxel_m)}


def read_mover_places(path: Path) -> tuple[tuple[str, ...], Floats]:
    """Names (N) and places (N, 2) in the world frame, one for every mover and instant of movers.csv; half a last line is left out."""
    with path.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row.get("yaw")]
    try:
        places = np.array([[float(row["x"]), float(row["y"])] for row in rows]).reshape(-1, 2)
    except (KeyError, ValueError) as error:
        raise ValueError(f"{path.name} has a line that is none: {error}") from error
    return tuple(row["name"] for row in rows), places


def ghosts_m2(voxels: ArrayLike, mesh: tuple[ArrayLike, ArrayLike], places: Floats, voxel_m: float) -> float:
    """Ground under (K, 3) occupied voxels, `voxel_m` wide, world frame, that are no surface of the world and lie where a mover once was."""
    centres = np.asarray(voxels, dtype=np.float64).reshape(-1, 3)
    if not len(centres) or not len(places):
        return 0.0
    near, _ = cKDTree(places).query(centres[:, :2], distance_upper_bound=_GHOST_REACH_M)
    candidates = centres[np.isfinite(near)]
    if not len(candidates):
        return 0.0
    off = candidates[RayScene(*checked_mesh(*mesh)).distances(candidates) > _GHOST_OFF_M]
    columns = np.unique(np.floor(off[:, :2] / voxel_m), axis=0)
    return float(len(columns) * voxel_m**2)
