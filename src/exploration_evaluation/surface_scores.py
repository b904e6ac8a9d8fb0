"""Scores of a run's map as a surface: how completely it shows what could be seen, and how rightly its terrain is classified.

What a scorer of run folders calls once it has ground truth and the map's place in the world.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from exploration_evaluation.classification import ClassificationConfig, classification
from exploration_evaluation.config import RobotShape
from exploration_evaluation.mesh import read_cloud
from exploration_evaluation.run_files import JsonObject, read_arrays
from exploration_evaluation.true_classes import true_classes
from exploration_evaluation.truth import CELL_M, ReachableGround
from exploration_evaluation.visible_surface import VisibilityConfig, completeness, visible_surface
from rigid_geometry import transform_points

Mesh = tuple[ArrayLike, ArrayLike]
Attempt = Callable[[str, Callable[[], dict[str, Any]]], dict[str, Any] | None]

NO_SURFACE_SCORES: dict[str, Any] = dict.fromkeys(
    ("visible_surface_m2", "map_completeness_rms_m", "map_completeness_p95_m", "seen_surface_share", "classification")
)


def surface_scores(
    folder: Path,
    mesh: Mesh,
    ground: ReachableGround,
    T_world_map: NDArray[np.float64],
    robot: RobotShape,
    voxel_m: float,
    attempt: Attempt,
) -> JsonObject:
    """The keys of `NO_SURFACE_SCORES`, of a map of voxels `voxel_m` wide.

    `attempt` calls what may raise ValueError, and notes why a score is not there.
    """

    def complete() -> dict[str, Any]:
        surface = visible_surface(*mesh, ground, VisibilityConfig(sensor_height_m=robot.laser_height_m))
        found = completeness(surface, transform_points(T_world_map, read_cloud(folder / "cloud.ply")))
        return {
            "visible_surface_m2": surface.area_m2,
            "map_completeness_rms_m": found.rms_m,
            "map_completeness_p95_m": found.p95_m,
            "seen_surface_share": found.seen_share,
        }

    def classified() -> dict[str, Any]:
        voxels = read_arrays(folder / "terrain.npz", ("x", "y", "z", "label"))
        centres = np.column_stack([voxels[axis] for axis in "xyz"]).astype(np.float64)
        true = true_classes(*mesh, ground, robot, CELL_M)
        one_voxel = ClassificationConfig(edge_m=voxel_m, voxel_m=voxel_m)
        return {"classification": classification(true, transform_points(T_world_map, centres), voxels["label"], one_voxel).summary()}

    return {
        **NO_SURFACE_SCORES,
        **(attempt("map completeness", complete) or {}),
        **(attempt("classification", classified) or {}),
    }
