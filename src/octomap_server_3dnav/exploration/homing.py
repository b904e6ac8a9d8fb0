"""Home: back to where the robot stood at its first sweep, over the paths of every goal, and what is told when it is there.

Beside exploration, for `decide`: somebody asks for it, exploration is at its end, or the budget is spent. A path is kept while it is
free and home stays where it was: in a passage that is driven backward, a new one would lead out again. A home that cannot be reached is
come as near to as the ground allows, and that is told.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.approach import Approach
from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.decision import Decision, DecisionKind, TerrainWithin, without_ground
from octomap_server_3dnav.exploration.observation import Observation
from octomap_server_3dnav.exploration.plan_validity import path_is_free
from octomap_server_3dnav.exploration.tried_places import PLACE_RADIUS_M
from octomap_server_3dnav.navigation.planner import Path, PlannerConfig, nearest_traversable, plan_path
from octomap_server_3dnav.terrain.classified_terrain import Terrain
from rigid_geometry import angle_difference, yaw_of
from rigid_geometry.transforms import Transform


class Homing:
    """Leads home after `begin`, until it says what it was told to say there."""

    def __init__(self, config: ExplorationConfig, planner: PlannerConfig, base_height_m: float) -> None:
        """`base_height_m`: of base_link above the ground."""
        self._approach = Approach(config, planner.trim_m)
        self.configure(config, planner)
        self._base_height_m = base_height_m
        self._vertex: int | None = None  # whose sweep was the first
        self._way_m = 0.0  # the last that was known
        self._why, self._then = "", DecisionKind.EXPLORED
        self._sent_whole: bool | None = None  # whether its goal is home itself; None: it was not sent yet
        self._failures = 0
        self._least_m = math.inf  # of the way left where a drive had ended
        self._plan: Decision | None = None  # to home, or to a part of the way there

    def configure(self, config: ExplorationConfig, planner: PlannerConfig) -> None:
        """From the next step on."""
        self._config, self._planner = config, planner
        self._approach.configure(config, planner.trim_m)

    def notice(self, vertex_id: int) -> None:
        """A sweep is in the map; home is where the robot stood at the first."""
        self._vertex = vertex_id if self._vertex is None else self._vertex

    def begin(self, why: str, then: DecisionKind) -> None:
        """From now on `step` leads home, and says `then` when it is there."""
        self._why, self._then, self._sent_whole, self._failures = why, then, None, 0
        self._least_m, self._plan = math.inf, None

    def way_m(self, vertex_poses: NDArray[np.float64], terrain: Terrain, driven_m: float) -> float:
        """Metres of the path home; where none is known, of the last one that was and those driven since."""
        xyz = self._ground_at_home(vertex_poses)
        node = None if xyz is None else nearest_traversable(terrain, xyz, PLACE_RADIUS_M)
        path = None if node is None else plan_path(terrain, node, self._planner)
        self._way_m = self._way_m + driven_m if path is None else path.length_m
        return self._way_m

    def step(self, observation: Observation) -> tuple[Decision, bool]:
        """The next decision on the way home after a sweep, and whether it is the last."""
        if self._vertex is None:
            return Decision(self._then, f"{self._why}; where home is nobody knows"), True
        here, home = observation.T_map_base, observation.vertex_poses[self._vertex]
        gap_m, turn_rad = math.dist(here[:3, 3], home[:3, 3]), abs(angle_difference(yaw_of(here), yaw_of(home)))
        off = f"{gap_m:.2f} m and {turn_rad:.2f} rad from the start"
        if observation.stands and gap_m <= self._config.home_tolerance_m and turn_rad <= self._config.home_tolerance_rad:
            return Decision(self._then, f"{self._why}; home, {off}"), True
        kept = self._kept(observation.terrain_within, home) if observation.on_the_way and not observation.drive_failure else None
        if kept is not None:
            return kept, False
        decision = self._after(self._towards(observation.vertex_poses, observation.terrain_within), observation)
        if decision is None:
            reason = observation.drive_failure or ("no nearer after another drive" if self._failures else "no way leads there")
            return Decision(self._then, f"{self._why}; not home, {off}: {reason}"), True
        return decision, False

    def _kept(self, terrain_within: TerrainWithin, home: Transform) -> Decision | None:
        """The plan under way, while nothing speaks against it; another look where no ground is beneath the robot."""
        local, plan = terrain_within(self._config.local_radius_m), self._plan
        if plan is None or plan.frontier is None or math.dist(plan.frontier, home[:3, 3]) > local.resolution:
            return None
        if local.start is None:
            return without_ground(local)
        return replace(plan, kind=DecisionKind.KEEP, terrain=local, scope="local") if path_is_free(local, plan) else None

    def _after(self, sent: tuple[Decision, bool, float] | None, observation: Observation) -> Decision | None:
        """The next drive, by (decision, whether its goal is home itself, metres of the way); None after too many that brought nothing."""
        way_m = sent[2] if sent else math.inf
        failure = bool(observation.drive_failure)
        if self._sent_whole is not None and (failure or observation.at_goal):
            is_nearer = way_m < self._least_m - self._config.home_tolerance_m
            self._failures = (0 if is_nearer else self._failures) + (failure or self._sent_whole or not is_nearer)
            self._least_m = min(self._least_m, way_m)
        if sent is None or self._failures >= self._config.max_failures:
            return None
        self._plan, self._sent_whole, _ = sent
        return self._plan

    def _ground_at_home(self, vertex_poses: NDArray[np.float64]) -> tuple[float, float, float] | None:
        if self._vertex is None:
            return None
        T_map_home = vertex_poses[self._vertex]
        x, y, z = (float(v) for v in T_map_home[:3, 3] - self._base_height_m * T_map_home[:3, 2])
        return x, y, z

    def _towards(self, vertex_poses: NDArray[np.float64], terrain_within: TerrainWithin) -> tuple[Decision, bool, float] | None:
        """A goal at home, or on the ground that is nearest to it, as for `_after`; None where no way leads."""
        xyz, here, radius_m = self._ground_at_home(vertex_poses), vertex_poses[-1], self._config.local_radius_m
        assert xyz is not None and self._vertex is not None
        for scope_m, scope, tolerance_m in ((radius_m, "local", self._config.home_tolerance_m), (None, "global", math.inf)):
            terrain = terrain_within(scope_m)
            node = nearest_traversable(terrain, xyz, tolerance_m)
            path = None if node is None else plan_path(terrain, node, self._planner)
            if path is not None:
                return self._along(_to_the_point(path, xyz, terrain.resolution), terrain, scope, here, vertex_poses[self._vertex])
        return None

    def _along(self, path: Path, terrain: Terrain, scope: str, here: Transform, home: Transform) -> tuple[Decision, bool, float]:
        part, yaw, is_whole = self._approach.towards(path, here, yaw_of(home))
        x, y, z = (float(v) for v in home[:3, 3])
        reason = f"going home, {path.length_m:.1f} m: {self._why}"
        decision = Decision(DecisionKind.GOAL, reason, terrain, scope, exact=is_whole).along(part, yaw, (x, y, z))
        return decision, is_whole, path.length_m


def _to_the_point(path: Path, xyz: tuple[float, float, float], within_m: float) -> Path:
    """A path that ends at a point itself, where its last voxel is that of the point or the next."""
    if math.dist(path.points[-1, :2], xyz[:2]) > within_m:
        return path
    points = path.points.copy()
    points[-1, :2] = xyz[:2]
    return Path(points, path.straight)
