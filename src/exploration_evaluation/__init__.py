"""The judge: scores a finished run against the true world, and draws what it left.

From the world's mesh: the ground that the robot can reach (`reachable_ground`). From a run folder: coverage, map and
trajectory error, collisions, tilt and falls (`evaluate_run`, `scores`), the time against that of a robot that knows the
world (`add_clairvoyant`), a screen of text (`format_summary`), and two pictures (`pictures.draw_pictures`, which is imported by
itself because it loads matplotlib). Nothing here is shared with the terrain classifier, nor with any other stage that is judged.
"""

from exploration_evaluation.clairvoyant_score import add_clairvoyant
from exploration_evaluation.config import RobotShape
from exploration_evaluation.mesh import read_cloud, read_mesh
from exploration_evaluation.report import format_summary
from exploration_evaluation.run_files import (
    read_arrays,
    read_contacts,
    read_events,
    read_json,
    read_occupied,
    read_robot,
    read_sweep_poses,
    read_trajectory,
    write_json,
)
from exploration_evaluation.run_folder import evaluate_run
from exploration_evaluation.scores import (
    align_poses,
    contact_episodes,
    coverage,
    covered_cells,
    divided_voxels,
    map_error,
    motion,
    trajectory_errors,
)
from exploration_evaluation.truth import CELL_M, ReachableGround, reachable_ground, size_problem

__all__ = [
    "CELL_M",
    "ReachableGround",
    "RobotShape",
    "add_clairvoyant",
    "align_poses",
    "contact_episodes",
    "coverage",
    "covered_cells",
    "divided_voxels",
    "evaluate_run",
    "format_summary",
    "map_error",
    "motion",
    "reachable_ground",
    "read_arrays",
    "read_cloud",
    "read_contacts",
    "read_events",
    "read_json",
    "read_mesh",
    "read_occupied",
    "read_robot",
    "read_sweep_poses",
    "read_trajectory",
    "size_problem",
    "trajectory_errors",
    "write_json",
]
