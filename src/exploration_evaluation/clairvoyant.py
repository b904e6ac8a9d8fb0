"""The clairvoyant: how long a robot would take that knew the world, and only had to see all of it that can be reached.

A yardstick beside `shortest_path`: views from a grid that together see the reachable ground, and a tour over them. It is what a very good
tour takes, not a proven bound; it neither turns, nor brakes, nor drives slower on a slope.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from exploration_evaluation.covering_tour import covering_tour
from exploration_evaluation.ground_grid import Floats, Ints, Mask
from exploration_evaluation.mesh import RayScene
from exploration_evaluation.shortest_path import lengths_between
from exploration_evaluation.truth import ReachableGround
from exploration_evaluation.visible_surface import standpoints
from stage_config import check_ranges, parameter

_REACH_VIEWS = 3.5  # legs of so many steps of the grid are straight, in 24 directions
_GROUND_STEP_M = 0.4  # grid of the ground that has to be seen
VIEW_STEP_M = 1.0  # grid of the views
SETTLE_S = 0.75  # coming to rest before a sweep
_ROUNDS = 600  # of the search for a tour
_ABOVE_GROUND_M, _SAME_SURFACE_M = 0.03, 0.08


@dataclass(frozen=True)
class ClairvoyantConfig:
    """What a view of the sensor is, and for how much ground the clairvoyant is computed."""

    range_m: float = parameter(
        6.0, "m", "ground this near is seen: in one sweep on a plain the tilting laser maps a disc of 111 m2", low=0.5, high=100.0
    )
    sweep_s: float = parameter(
        5.65, "s", "a whole sweep while standing: of the tilting laser, from horizontal to horizontal", low=0.0, high=60.0
    )
    eye_m: float = parameter(0.92, "m", "height of the laser above the ground; that of the run's robot", low=0.05, high=5.0)
    max_ground_m2: float = parameter(1200.0, "m2", "larger ground has no clairvoyant: it would take minutes to compute", low=1.0)

    def validate(self) -> list[str]:
        """All violations of ranges."""
        return check_ranges(self)


SENSOR_VIEWS = {"tilting": ClairvoyantConfig(), "spinning": ClairvoyantConfig(range_m=6.9, sweep_s=3.0)}
"""By the name of the sensor. On a plain a sweep of the spinning lidar maps 151 m2 of ground."""


@dataclass(frozen=True)
class Clairvoyant:
    """Times of two robots that know the world: one stops for each of its `sweeps`, one maps while it drives.

    seen_share: share of the reachable ground that is seen at all from the views.
    """

    stopping_s: float
    sweeps: int
    stopping_way_m: float
    driving_s: float
    driving_way_m: float
    seen_share: float


def clairvoyant(
    vertices: ArrayLike, triangles: ArrayLike, ground: ReachableGround, start_xyz: ArrayLike, speed_mps: float, config: ClairvoyantConfig
) -> Clairvoyant:
    """The clairvoyant's times for a true mesh, (V, 3) and (T, 3), its reachable ground, a start (3,) there and a speed.

    ValueError for ground that is too large, a speed that is none, or a configuration out of its ranges.
    """
    if problems := config.validate():
        raise ValueError("; ".join(problems))
    if not (math.isfinite(speed_mps) and speed_mps > 0):
        raise ValueError(f"a speed is a positive number of m/s, not {speed_mps}")
    if ground.covered_area_m2 > config.max_ground_m2:
        raise ValueError(f"{ground.covered_area_m2:.0f} m2 of reachable ground; at most {config.max_ground_m2:.0f} m2 are computed")
    views, start = _views(ground, np.asarray(start_xyz, dtype=np.float64), VIEW_STEP_M)
    way_m = lengths_between(ground, views, _REACH_VIEWS * VIEW_STEP_M)
    targets = ground.covered_points[standpoints(ground.covered_points, _GROUND_STEP_M)]
    sees = _sees(RayScene(np.asarray(vertices), np.asarray(triangles)), ground.way_points[views], targets, config)
    sees[~np.isfinite(way_m[start])] = False
    way_m = np.where(np.isfinite(way_m), way_m, 1e6)  # views that no way leads to show nothing, so that no tour has them
    tours = []
    for stop_s in (config.sweep_s + SETTLE_S, 0.0):
        tour = covering_tour(sees, way_m / speed_mps, start, stop_s, _ROUNDS, np.random.default_rng(0))
        way = float(way_m[tour[:-1], tour[1:]].sum())
        tours.append((way / speed_mps + stop_s * len(tour), len(tour), way))
    (stopping_s, sweeps, stopping_way_m), (driving_s, _, driving_way_m) = tours
    return Clairvoyant(stopping_s, sweeps, stopping_way_m, driving_s, driving_way_m, float(sees.any(axis=0).mean()))


def _views(ground: ReachableGround, start: Floats, step_m: float) -> tuple[Ints, int]:
    """(P,) way points to look from, of a grid where the robot turns, and of one where it only passes; and which of them is the start."""
    turning = cKDTree(ground.way_points).query(ground.points)[1]
    passing = np.setdiff1d(np.arange(len(ground.way_points)), turning)
    nearest = turning[np.argmin(np.linalg.norm(ground.points - start, axis=1))]
    grids = [some[standpoints(ground.way_points[some], step_m)] for some in (turning, passing) if len(some)]
    views = np.unique(np.concatenate([*grids, [nearest]]))
    return views, int(np.searchsorted(views, nearest))


def _sees(scene: RayScene, places: Floats, targets: Floats, config: ClairvoyantConfig) -> Mask:
    """(P, T) whether the laser over each place sees each piece of ground."""
    eyes, marks = places + [0.0, 0.0, config.eye_m], targets + [0.0, 0.0, _ABOVE_GROUND_M]
    seen = np.zeros((len(eyes), len(marks)), dtype=np.bool_)
    tree = cKDTree(marks)
    for k, eye in enumerate(eyes):
        near = np.array(tree.query_ball_point(eye, config.range_m), dtype=np.int64)
        beams = marks[near] - eye
        free = scene.first_hits(np.column_stack([np.broadcast_to(eye, beams.shape), beams])) if len(near) else np.empty(0)
        seen[k, near] = (1.0 - free) * np.linalg.norm(beams, axis=1) <= _SAME_SURFACE_M
    return seen
