"""A map classified from a start, its frontiers, and the path to a goal: what ./classify_map finds out."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TypeVar

from octomap_server_3dnav.exploration.frontiers import Frontier, find_frontiers
from octomap_server_3dnav.navigation.passages import navigable_terrain
from octomap_server_3dnav.navigation.planner import Path, nearest_traversable, plan_path
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.octree import OctreeMap
from octomap_server_3dnav.terrain.classify import Terrain
from terrain_tools.criteria import Criteria
from terrain_tools.ground import Place, Point, nearest_ground, nearest_reached, outside, pose_on, why_no_goal, why_no_start

T = TypeVar("T")


@dataclass(frozen=True)
class Problem:
    """Why there is no start or no path, and the nearest ground that would do, if any was found."""

    what: str
    reason: str
    nearest: Place | None

    def __str__(self) -> str:
        nearest = f"the nearest ground that would do is at {self.nearest}" if self.nearest else "no ground that would do was found"
        return f"{self.what}: {self.reason}; {nearest}"


@dataclass(frozen=True, eq=False)
class Analysis:
    """What was found; `terrain` is None without a start, `goal` one of its nodes, frontiers by their distance over the ground."""

    octree: OctreeMap
    runs: ColumnRuns
    terrain: Terrain | None = None
    frontiers: list[Frontier] = field(default_factory=list)
    goal: int | None = None
    path: Path | None = None
    problem: Problem | None = None
    time_s: dict[str, float] = field(default_factory=dict)


class _Clock:
    def __init__(self) -> None:
        self.time_s: dict[str, float] = {}

    def of(self, step: str, call: Callable[[], T]) -> T:
        begun = time.perf_counter()
        try:
            return call()
        finally:
            self.time_s[step] = round(time.perf_counter() - begun, 4)


def analyse(octree: OctreeMap, by: Criteria, start: Point, goal: Point | None, tolerance_m: float) -> Analysis:
    """Classifies the whole map from `start`, a point on the ground, and plans to the reached ground within `tolerance_m` of `goal`.

    Points are finite, in map, in metres. ValueError where the known voxels span more columns than an octree lists.
    """
    clock, T_map_base = _Clock(), pose_on(start, by.robot)
    runs = clock.of("column_runs", octree.column_runs)
    found, no_start = Analysis(octree, runs, time_s=clock.time_s), outside(runs, start)
    if no_start is None:
        terrain = clock.of("classification", lambda: navigable_terrain(runs, T_map_base, by.settings, None))
        no_start = None if terrain.departure is not None else why_no_start(octree, runs, terrain, start, by.terrain, by.robot)
    if no_start is not None:
        return dataclasses.replace(found, problem=Problem("no start", no_start, nearest_ground(runs, start, by.terrain, by.robot)))
    frontiers = clock.of("frontiers", lambda: find_frontiers(terrain, T_map_base, by.frontier, by.planner))
    found = dataclasses.replace(found, terrain=terrain, frontiers=sorted(frontiers, key=lambda f: f.distance_m))
    if goal is None:
        return found
    node = nearest_traversable(terrain, goal, tolerance_m)
    if node is None:
        reason = why_no_goal(octree, runs, terrain, goal, tolerance_m)
        return dataclasses.replace(found, problem=Problem("no path", reason, nearest_reached(terrain, goal)))
    path = clock.of("path", lambda: plan_path(terrain, node, by.planner))
    problem = None if path else Problem("no path", "no way leads from the start to the goal", nearest_reached(terrain, start))
    return dataclasses.replace(found, goal=node, path=path, problem=problem)
