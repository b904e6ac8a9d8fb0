"""A finished run on disk: has what its nodes left scored, and writes summary.json.

Last step of the judge. Whatever a score needs and cannot be read makes that score None, with a line in the summary's
"missing"; a partly written folder of a run that died is judged as far as it goes.
"""

import os
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from exploration_evaluation.activity import ActivityTimes, activity_times, time_spent
from exploration_evaluation.asked import budget_share, was_to_explore
from exploration_evaluation.collisions import NO_COLLISION_SCORES, collision_scores
from exploration_evaluation.config import RobotShape
from exploration_evaluation.curves import coverage_curve, driven_distances, placed_sweeps, swept_ground
from exploration_evaluation.graph_edges import read_edges, wrong_edges
from exploration_evaluation.ground_ahead import ground_ahead
from exploration_evaluation.mesh import read_cloud
from exploration_evaluation.mover_scores import MOVER_SCORES, mover_scores
from exploration_evaluation.relative_error import MatchedPoses, matched_poses, relative_pose_error
from exploration_evaluation.run_files import (
    JsonObject,
    Trajectory,
    crop_half_m,
    mapped_sweeps,
    read_events,
    read_json,
    read_occupied,
    read_robot,
    read_sweeps,
    read_trajectory,
    resolution_m,
    write_json,
)
from exploration_evaluation.scores import (
    TrajectoryErrors,
    coverage,
    covered_cells,
    divided_voxels,
    map_error,
    motion,
    trajectory_errors,
    trajectory_scores,
)
from exploration_evaluation.shortest_path import path_ratio, shortest_legs
from exploration_evaluation.start_distance import StartDistance, start_scores
from exploration_evaluation.surface_scores import NO_SURFACE_SCORES, surface_scores
from exploration_evaluation.truth import CELL_M, ReachableGround, reachable_ground
from exploration_evaluation.verdict import Outcome, faults, largest_piece_m2, succeeded
from exploration_evaluation.zone_scores import closed_in_world, farthest_outside_m, zones_of
from map_zones import NO_ZONES
from rigid_geometry import transform_points

Floats = NDArray[np.float64]
V = TypeVar("V")

_REPORTED = (
    "world",
    "seed",
    "stop_reason",
    "sim_time_s",
    "wall_time_s",
    "loop_closures",
    "refused_matches",
    "local_classifications",
    "local_classification_time_s",
    "global_classifications",
    "global_classification_time_s",
    "config",
    "version",
)
_OVER_THE_RUN = (
    "coverage_curve",
    "ground_ahead",
    "rpe_translation_m",
    "rpe_rotation_rad",
    "wrong_edges",
    "shortest_length_m",
    "path_ratio",
)


def evaluate_run(
    directory: str | os.PathLike[str],
    vertices: ArrayLike,
    triangles: ArrayLike,
    robot: RobotShape | None = None,
) -> JsonObject:
    """Scores a run folder against the true mesh, (V, 3) and (T, 3) in the world frame, and writes its summary.json.

    The summary has all that run.json and counters.json report (`_REPORTED` at least) and, of the judge: sweeps (as mapped), success and
    what speaks against it ("faults"), coverage, coverage_straight (with ground that is driven straight only), missed_piece_m2,
    reachable_area_m2, reachable_straight_m2, turning_area_m2, map_rmse_m, map_p95_m, trajectory_ate_m, trajectory_origin_error_m,
    map_tilt_rad, collisions, collision_top_speed_mps, collision_top_force_n, max_tilt_rad, fell, distance_m, end_from_start_m,
    end_from_start_rad, outside_m, coverage_curve (a CurvePoint a sweep), ground_ahead, rpe_translation_m, rpe_rotation_rad, wrong_edges,
    shortest_length_m, path_ratio, activity_s, time_spent, compute_s, runtime_s, visible_surface_m2, seen_surface_share,
    map_completeness_rms_m, map_completeness_p95_m, classification (confusion, false-safe and false-unsafe ground), movers, ghosts_m2, and
    "missing": what is None and why. `robot` is by default that of the folder's robot.yaml, ValueError when that is none, or no folder.
    """
    folder = Path(directory)
    if not folder.is_dir():
        raise ValueError(f"no run folder at {folder}")
    summary = _Judgement(folder, vertices, triangles, robot or read_robot(folder)).summary()
    write_json(folder / "summary.json", summary)
    return summary


class _Judgement:
    """One run being judged: every input is read once, and what cannot be had is noted once, with its reason."""

    def __init__(self, folder: Path, vertices: ArrayLike, triangles: ArrayLike, robot: RobotShape) -> None:
        self._folder, self._mesh, self._robot = folder, (vertices, triangles), robot
        self._missing: list[str] = []

    def summary(self) -> dict[str, Any]:
        reported = self._reported()
        self._voxel_m = resolution_m(reported)
        truth = self._try("truth", lambda: read_trajectory(self._folder / "trajectory_truth.txt"))
        estimate = self._try("trajectory", lambda: read_trajectory(self._folder / "trajectory.txt"))
        errors = self._trajectory(estimate, truth)
        zones, T_world_map = self._try("zones", lambda: zones_of(self._folder)) or NO_ZONES, errors.T_world_map if errors else None
        ground = self._ground(truth, closed_in_world(zones, T_world_map))
        scores = {
            "sweeps": self._try("sweeps", lambda: mapped_sweeps(self._folder)) if was_to_explore(reported) else reported.get("sweeps"),
            **self._motion(truth),
            **start_scores(truth),
            "outside_m": farthest_outside_m(zones, T_world_map, truth, self._robot),
            **(self._try("collisions", lambda: collision_scores(self._folder, truth)) or NO_COLLISION_SCORES),
            **trajectory_scores(errors),
            **self._coverage(ground, errors),
            **self._map_error(errors),
            **self._activity(truth, reported.get("sim_time_s")),
            **dict.fromkeys((*_OVER_THE_RUN, *MOVER_SCORES)),
            **NO_SURFACE_SCORES,
        }
        if estimate is not None and truth is not None and errors is not None:
            poses = matched_poses(*estimate, *truth)
            scores |= self._try("movers", lambda: mover_scores(self._folder, self._mesh, errors.T_world_map, self._voxel_m)) or {}
            scores |= self._relative_error(poses)
            scores["wrong_edges"] = self._try("wrong edges", lambda: self._wrong_edges(estimate[0], poses))
            if ground is not None:
                scores |= self._try("coverage curve", lambda: self._swept(reported, estimate, truth, errors, ground)) or {}
                scores |= self._way(poses, truth, ground)
                scores |= surface_scores(self._folder, self._mesh, ground, errors.T_world_map, self._robot, self._voxel_m, self._try)
        outcome = self._outcome(reported, scores, truth)
        verdict = {"success": succeeded(outcome), "faults": [str(fault) for fault in faults(outcome)]}
        return {**verdict, **reported, **scores, "missing": self._missing}

    def _outcome(self, reported: JsonObject, scores: Mapping[str, Any], truth: Trajectory | None) -> Outcome:
        stop_reason = reported.get("stop_reason")
        return Outcome(
            stop_reason=None if stop_reason is None else str(stop_reason),
            fell=scores["fell"],
            collisions=scores["collisions"],
            map_saved=self._map_saved(),
            coverage=scores["coverage"],
            missed_piece_m2=scores["missed_piece_m2"],
            start=None if truth is None else StartDistance.of(truth[1]),
            outside_m=scores["outside_m"],
            explores=was_to_explore(reported),
            budget_share=budget_share(reported, scores["distance_m"]),
            on_disk=not reported.get("not_on_disk"),
        )

    def _try(self, what: str, get: Callable[[], V]) -> V | None:
        try:
            return get()
        except ValueError as error:
            self._missing.append(f"{what}: {error}")
            return None

    def _reported(self) -> dict[str, Any]:
        known: dict[str, Any] = dict.fromkeys(_REPORTED)
        for name in ("run.json", "counters.json"):
            values = self._try(name, lambda name=name: read_json(self._folder / name))  # type: ignore[misc]
            known.update({key: value for key, value in (values or {}).items() if value is not None or key not in known})
        self._missing += [f"{key}: not reported by the run" for key in _REPORTED if known[key] is None]
        return known

    def _trajectory(self, estimate: Trajectory | None, truth: Trajectory | None) -> TrajectoryErrors | None:
        if truth is None or estimate is None:
            self._missing.append("all that compares trajectories, and coverage and map error: need truth and trajectory")
            return None
        return self._try("trajectory errors", lambda: trajectory_errors(*estimate, *truth))

    def _relative_error(self, poses: MatchedPoses) -> dict[str, Any]:
        found = self._try("relative error", lambda: relative_pose_error(poses.estimate, poses.truth))
        return {
            "rpe_translation_m": found.translation_rms_m if found else None,
            "rpe_rotation_rad": found.rotation_rms_rad if found else None,
        }

    def _wrong_edges(self, stamps: Floats, poses: MatchedPoses) -> int:
        truth = np.full((len(stamps), 4, 4), np.nan)
        truth[np.isin(stamps, poses.stamps)] = poses.truth
        return len(wrong_edges(read_edges(self._folder / "graph.g2o"), truth))

    def _swept(
        self, reported: JsonObject, estimate: Trajectory, truth: Trajectory, errors: TrajectoryErrors, ground: ReachableGround
    ) -> dict[str, Any]:
        stamps, poses = estimate
        sweeps = placed_sweeps(read_sweeps(self._folder, stamps), poses, crop_half_m(reported))
        swept = swept_ground(ground.covered_points, sweeps, errors.T_world_map, self._voxel_m)
        ahead = ground_ahead(ground.covered_points, swept.shown_s(stamps), truth)
        return {
            "coverage_curve": [asdict(point) for point in coverage_curve(swept.shares, stamps, *truth)],
            "ground_ahead": asdict(ahead) if ahead else None,
        }

    def _way(self, poses: MatchedPoses, truth: Trajectory, ground: ReachableGround) -> dict[str, Any]:
        driven = np.diff(driven_distances(*truth, np.maximum(poses.stamps, truth[0][0])))
        legs = self._try("shortest way", lambda: shortest_legs(ground, self._robot.foot(poses.truth)))
        if legs is None:
            return {"shortest_length_m": None, "path_ratio": None}
        shortest = float(np.minimum(legs, driven).sum())  # what was driven is a way, too
        ratio = self._try("path ratio", lambda: path_ratio(float(driven.sum()), shortest))
        return {"shortest_length_m": shortest, "path_ratio": ratio}

    def _activity(self, truth: Trajectory | None, sim_time_s: float | None) -> dict[str, Any]:
        found: ActivityTimes | None = None
        spent: dict[str, float] | None = None
        events = self._try("activity", lambda: read_events(self._folder / "events.csv"))
        if truth is not None and events is not None:
            end_s = float(truth[0][-1])
            found = self._try("activity", lambda: activity_times(*events, end_s))
            spent = self._try("time spent", lambda: time_spent(events[0], events[2], truth, self._robot.inscribed_radius_m))
        compute_s = found.compute_s if found else None
        if found and compute_s is None:
            self._missing.append("compute_s: the run was cut off while it was mapping")
        return {
            "activity_s": found.simulated_s if found else None,
            "time_spent": spent,
            "compute_s": compute_s,
            "runtime_s": None if compute_s is None or sim_time_s is None else sim_time_s + compute_s,
        }

    def _motion(self, truth: Trajectory | None) -> dict[str, Any]:
        found = None if truth is None else motion(*truth)
        return {
            "distance_m": found.distance_m if found else None,
            "max_tilt_rad": found.max_tilt_rad if found else None,
            "fell": found.fell if found else None,
        }

    def _ground(self, truth: Trajectory | None, closed: Callable[[Floats], NDArray[np.bool_]] | None) -> ReachableGround | None:
        if truth is None:
            return None
        start = truth[1][0, :3, 3]
        return self._try("reachable ground", lambda: reachable_ground(*self._mesh, start, self._robot, CELL_M, closed))

    def _coverage(self, ground: ReachableGround | None, errors: TrajectoryErrors | None) -> dict[str, Any]:
        shares: dict[str, float] = {}
        if ground is not None and errors is not None:
            shares = self._try("coverage", lambda: self._shares(ground, errors.T_world_map)) or {}
        return {
            "coverage": shares.get("coverage"),
            "coverage_straight": shares.get("coverage_straight"),
            "missed_piece_m2": shares.get("missed_piece_m2"),
            "reachable_area_m2": ground.covered_area_m2 if ground else None,
            "reachable_straight_m2": ground.straight_area_m2 if ground else None,
            "turning_area_m2": ground.area_m2 if ground else None,
        }

    def _shares(self, ground: ReachableGround, T_world_map: Floats) -> dict[str, float]:
        voxels = divided_voxels(*read_occupied(self._folder / "occupied.npz"), self._voxel_m)
        mapped = transform_points(T_world_map, voxels)
        covered = covered_cells(ground.covered_points, mapped)
        return {
            "coverage": float(covered.mean()),
            "coverage_straight": coverage(ground.straight_points, mapped),
            "missed_piece_m2": largest_piece_m2(ground.covered_points[~covered], CELL_M),
        }

    def _map_error(self, errors: TrajectoryErrors | None) -> dict[str, Any]:
        error = None if errors is None else self._try("map error", lambda: self._cloud_error(errors.T_world_map))
        return {"map_rmse_m": error.rms_m if error else None, "map_p95_m": error.p95_m if error else None}

    def _cloud_error(self, T_world_map: Floats) -> Any:
        cloud = read_cloud(self._folder / "cloud.ply")
        return map_error(transform_points(T_world_map, cloud), *self._mesh)

    def _map_saved(self) -> bool:
        saved = [name for name in ("map.bt", "cloud.ply") if (self._folder / name).is_file() and (self._folder / name).stat().st_size]
        if len(saved) < 2:
            self._missing.append(f"saved map: of map.bt and cloud.ply only {saved or 'nothing'} is there")
        return len(saved) == 2
