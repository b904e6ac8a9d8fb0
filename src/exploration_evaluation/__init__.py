"""The judge: scores a finished run against the true world, and draws what it left.

From the world's mesh: the ground that the robot can reach (`reachable_ground`). From a run folder: coverage, map and
trajectory error, collisions, tilt and falls (`evaluate_run`, `scores`), the time against that of a robot that knows the
world (`add_clairvoyant`), a screen of text (`format_summary`), and two pictures (`pictures.draw_pictures`, which is imported by
itself because it loads matplotlib). Nothing here is shared with the terrain classifier, nor with any other stage that is judged.
"""

from exploration_evaluation.activity import ActivityTimes, activity_times
from exploration_evaluation.clairvoyant_score import add_clairvoyant
from exploration_evaluation.config import EvaluationConfig, RobotShape
from exploration_evaluation.curves import CurvePoint, coverage_curve, driven_distances, placed_sweeps, swept_ground
from exploration_evaluation.mesh import read_cloud, read_mesh
from exploration_evaluation.relative_error import MatchedPoses, RelativeError, matched_poses, relative_pose_error
from exploration_evaluation.report import format_summary
from exploration_evaluation.run_files import (
    read_arrays,
    read_contacts,
    read_events,
    read_json,
    read_occupied,
    read_robot,
    read_sweep_poses,
    read_sweeps,
    read_trajectory,
    write_json,
)
from exploration_evaluation.run_folder import evaluate_run
from exploration_evaluation.scores import (
    ContactEpisode,
    MapError,
    Motion,
    TrajectoryErrors,
    align_poses,
    align_positions,
    contact_episodes,
    coverage,
    covered_cells,
    divided_voxels,
    map_error,
    motion,
    trajectory_errors,
)
from exploration_evaluation.shortest_path import path_ratio, shortest_legs
from exploration_evaluation.truth import ReachableGround, reachable_ground

__all__ = [
    "ActivityTimes",
    "ContactEpisode",
    "CurvePoint",
    "EvaluationConfig",
    "MapError",
    "MatchedPoses",
    "Motion",
    "ReachableGround",
    "RelativeError",
    "RobotShape",
    "TrajectoryErrors",
    "activity_times",
    "add_clairvoyant",
    "align_poses",
    "align_positions",
    "contact_episodes",
    "coverage",
    "coverage_curve",
    "covered_cells",
    "divided_voxels",
    "driven_distances",
    "evaluate_run",
    "format_summary",
    "map_error",
    "matched_poses",
    "motion",
    "path_ratio",
    "placed_sweeps",
    "reachable_ground",
    "read_arrays",
    "read_cloud",
    "read_contacts",
    "read_events",
    "read_json",
    "read_mesh",
    "read_occupied",
    "read_robot",
    "read_sweeps",
    "read_sweep_poses",
    "read_trajectory",
    "relative_pose_error",
    "shortest_legs",
    "swept_ground",
    "trajectory_errors",
    "write_json",
]
