"""Where to go next (thesis algorithm 3 as a whole, 6.2.2): local terrain first, then the whole map, the cheapest frontier with a path.

The last step of the octomap stage: `ExplorationPlanner.decide` after every sweep at a goal, `still_valid` after a sweep on the way.
Frontiers that stay what they are although the robot looked at them, or that driving failed to reach, are set aside (`tried_places`).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.approach import Approach
from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.frontiers import Frontier, FrontierConfig, facing_yaw, find_frontiers
from octomap_server_3dnav.exploration.lookouts import Lookout, WayOut, find_lookouts
from octomap_server_3dnav.exploration.tried_places import Place, TriedPlaces
from octomap_server_3dnav.navigation.passages import TerrainSettings, navigable_terrain
from octomap_server_3dnav.navigation.planner import Path, PlannerConfig, plan_into, plan_path, straight_path
from octomap_server_3dnav.octree.column_runs import ColumnRuns, VoxelState
from octomap_server_3dnav.octree.surface_heights import HitHeights, SurfaceHeights
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass
from rigid_geometry import as_transform, yaw_of
from rigid_geometry.transforms import Transform

TerrainWithin = Callable[[float | None], Terrain]

_STILL_WORTH = 0.5  # of what a look must show at least: with less a robot that went in turns back


class DecisionKind(Enum):
    """What the robot is to do."""

    GOAL = "goal"
    EXPLORED = "explored"
    TRAPPED = "trapped"


class Validity(Enum):
    """Whether a plan still holds after a sweep on the way."""

    VALID = "valid"
    PATH_BLOCKED = "path blocked"
    FRONTIER_GONE = "frontier gone"


@dataclass(frozen=True, eq=False)
class Decision:
    """What to do and why.

    `path` (K, 3) in map, trimmed, None unless kind is GOAL, `straight` (K,) bool where from a point to the next it leads through a passage
    without room to turn, `full_path` the path up to the frontier; `goal` (x, y, z, yaw) in map, its yaw
    facing `frontier` (3,), on a slope that of the path's end. `scope` is "local" or "global", the terrain that decided; `open_frontiers`
    were left to visit in it, this one included; `set_aside` were given up in the whole run.
    """

    kind: DecisionKind
    reason: str
    terrain: Terrain
    scope: str
    open_frontiers: int
    set_aside: int
    path: NDArray[np.float64] | None = None
    goal: tuple[float, float, float, float] | None = None
    frontier: tuple[float, float, float] | None = None
    full_path: NDArray[np.float64] | None = None
    straight: NDArray[np.bool_] | None = None


class ExplorationPlanner:
    """Chooses goals until nothing reachable is unknown; remembers what was tried where, and how the robot went to where it cannot turn."""

    def __init__(
        self,
        config: ExplorationConfig | None = None,
        terrain: TerrainSettings | None = None,
        frontier: FrontierConfig | None = None,
        planner: PlannerConfig | None = None,
    ) -> None:
        """ValueError lists every violation of the four configurations."""
        self.config = config or ExplorationConfig()
        self.terrain_settings = terrain or TerrainSettings()
        self.frontier_config = frontier or FrontierConfig()
        self.planner_config = planner or PlannerConfig()
        problems = [p for c in (self.config, self.terrain_settings, self.frontier_config, self.planner_config) for p in c.validate()]
        if problems:
            raise ValueError("\n".join(problems))
        self._tried = TriedPlaces(self.config)
        self._approach = Approach(self.config, self.planner_config.trim_m)
        self._way_out = WayOut(self.terrain_settings)
        self._sent_to: Lookout | None = None  # before whose way it was sent

    def set_aside(self) -> list[tuple[tuple[float, float, float], str]]:
        """Frontiers given up so far, each with the reason."""
        return self._tried.set_aside()

    def report_failure(self, frontier_xyz: tuple[float, float, float], reason: str) -> None:
        """Driving to the goal of this frontier failed; after `max_failures` it is set aside. ValueError when it is not three numbers."""
        if len(frontier_xyz) != 3 or not np.isfinite(frontier_xyz).all():
            raise ValueError(f"a frontier is three finite numbers, not {frontier_xyz!r}")
        self._tried.at(frontier_xyz).failures.append(reason)

    def with_way_out(self, terrain: Terrain) -> Terrain:
        """The terrain around the robot with the way by which it went to a lookout, while it stands there and nothing else leads out."""
        return self._way_out.added_to(terrain)

    def decide(self, terrain_within: TerrainWithin | ColumnRuns, T_map_base: Transform) -> Decision:
        """The next goal, or why there is none, for the robot at `T_map_base` after a sweep.

        `terrain_within` gives the terrain classified within a radius in metres around the robot (None: all), or is the whole map.
        ValueError for a transform that is not rigid.
        """
        T_map_base = as_transform(T_map_base)
        for radius in (self.config.local_radius_m, None):
            if isinstance(terrain_within, ColumnRuns):
                terrain = navigable_terrain(terrain_within, T_map_base, self.terrain_settings, radius)
            else:
                terrain = terrain_within(radius)
            if radius is not None:
                self._way_out.notice(terrain, yaw_of(T_map_base))
            scope, line_out = "global" if radius is None else "local", self._way_out.from_inside(terrain)
            is_inside = line_out is not None and not terrain.is_in_passage
            if is_inside:
                break  # nothing but straight on or straight out
            if terrain.departure is None and radius is None:
                return self._decision(DecisionKind.TRAPPED, self._why_trapped(terrain), terrain, scope, 0)
            frontiers = self._left_in(terrain, T_map_base)
            decision = self._goal_at([f for f in frontiers if not f.last], terrain, T_map_base, scope)
            if decision is not None:
                return decision
        last = [] if is_inside else [f for f in frontiers if f.last]
        return (
            self._last_in(last, terrain, T_map_base, scope, is_inside)
            or self._out_by(line_out, terrain, T_map_base, scope)
            or self._decision(DecisionKind.EXPLORED, self._why_explored(), terrain, scope, 0)
        )

    def still_valid(
        self,
        terrain: Terrain,
        path: NDArray[np.floating],
        frontier_xyz: tuple[float, float, float],
        straight: NDArray[np.bool_] | None = None,
    ) -> Validity:
        """Whether the rest of `path` (K, 3) is still free in `terrain`, taken after a sweep on the way, and its frontier still one.

        What lies outside the terrain counts as unchanged. The part that the robot stands on may be inflated, and where the path leads
        `straight` (K,) it may lie in ground that is wide enough for that.
        """
        points = np.asarray(path, dtype=np.float64)
        if not self._path_is_free(terrain, points, np.zeros(len(points), dtype=bool) if straight is None else straight):
            return Validity.PATH_BLOCKED
        robot, target = np.asarray(terrain.robot_xyz), np.asarray(frontier_xyz)
        if terrain.radius_m is not None and np.linalg.norm(target[:2] - robot[:2]) > terrain.radius_m - self.config.place_radius_m:
            return Validity.VALID
        frontiers = terrain.centers(terrain.frontiers())
        near = np.linalg.norm(frontiers - target, axis=1) <= self.config.place_radius_m
        return Validity.VALID if np.count_nonzero(near) >= self.frontier_config.min_voxels else Validity.FRONTIER_GONE

    def _path_is_free(self, terrain: Terrain, path: NDArray[np.float64], straight: NDArray[np.bool_]) -> bool:
        from_robot = np.linalg.norm(path[:, :2] - np.asarray(terrain.robot_xyz[:2]), axis=1)
        for i in range(int(np.argmin(from_robot)), len(path)):
            node = terrain.surface_near(path[i]) if from_robot[i] > self.config.place_radius_m else None
            if node is None or terrain.label[node] == TerrainClass.TRAVERSABLE or (straight[i] and terrain.narrow[node]):
                continue
            return False
        return True

    def _left_in(self, terrain: Terrain, T_map_base: Transform) -> list[Frontier]:
        """The frontiers that are not set aside, now that the robot has looked once more."""
        frontiers = find_frontiers(terrain, T_map_base, self.frontier_config, self.planner_config)
        x, y, z = (float(v) for v in T_map_base[:3, 3])
        self._tried.count_looks([f.xyz for f in frontiers], (x, y, z))
        return [f for f in frontiers if not self._tried.is_aside(f.xyz)]

    def _goal_at(self, left: list[Frontier], terrain: Terrain, T_map_base: Transform, scope: str) -> Decision | None:
        """The first of them to which a path leads, as a goal."""
        for count, frontier in enumerate(left):
            path = plan_path(terrain, frontier.node, self.planner_config)
            place = self._tried.known(frontier.xyz)
            looks = 0 if place is None else place.looks
            trimmed = None if path is None else self._approach.part_of(path, terrain, T_map_base, frontier, looks)
            if path is not None and trimmed is not None:
                return self._goal(terrain, T_map_base, scope, frontier, (path, trimmed), len(left) - count)
            self._tried.at(frontier.xyz).failures.append("no path" if path is None else "no path clear of unknown floor")
        return None

    def _goal(
        self, terrain: Terrain, T_map_base: Transform, scope: str, frontier: Frontier, paths: tuple[Path, Path], left: int
    ) -> Decision:
        path, trimmed = paths
        place = self._tried.at(frontier.xyz)
        place.goals += 1
        self._tried.count_progress(place, frontier.distance_m)
        reason = f"frontier of {len(frontier.voxels)} voxels, {frontier.distance_m:.1f} m away"
        decision = self._decision(DecisionKind.GOAL, reason, terrain, scope, left)
        goal = self._approach.goal_of(trimmed, path, terrain, T_map_base, frontier)
        return _with_path(decision, trimmed, path, goal[3], frontier.xyz)

    def _last_in(self, last: list[Frontier], terrain: Terrain, T_map_base: Transform, scope: str, is_inside: bool) -> Decision | None:
        """To a frontier that is looked at last, or to a look from inside: first of all to that which the robot is on its way to."""
        if self._sent_to is not None:
            return self._lookout_in(terrain, T_map_base, scope, is_inside) or self._goal_at(last, terrain, T_map_base, scope)
        return self._goal_at(last, terrain, T_map_base, scope) or self._lookout_in(terrain, T_map_base, scope, is_inside)

    def _lookout_in(self, terrain: Terrain, T_map_base: Transform, scope: str, is_inside: bool) -> Decision | None:
        """To where something is to be seen from a place without room to turn, and nearer if that did not show it.

        A robot that is in one already only goes straight on.
        """
        if not self.config.lookouts or (is_inside and self._way_out.is_leaving):
            return None
        for lookout in self._lookouts_left(terrain, is_inside):
            place = self._tried.at(lookout.xyz)
            place.looks += lookout.is_seen_from(terrain, self._trim_at(place))
            way = lookout.way_in(self._trim_at(place))
            if way is None or terrain.label[way.nodes[1]] == TerrainClass.TRAVERSABLE:
                continue
            if self._way_out.has_looked_from(way.line[-1]) or self._tried.why_aside(place):
                continue
            path = plan_into(terrain, way, self.planner_config)
            if path is None or (is_inside and 0 not in path.entries()):
                place.failures.append("no path to a place from where to look")
                continue
            self._tried.count_progress(place, path.length_m)
            part, yaw, is_whole = self._approach.towards(path, T_map_base, facing_yaw(*way.line[[0, -1]]))
            self._sent_to = None if is_whole else lookout
            if is_whole:
                self._way_out.enter(way, terrain)
            reason = f"a look at {lookout.gain_m2:.0f} m2 from where there is no room to turn"
            return _with_path(self._decision(DecisionKind.GOAL, reason, terrain, scope, 1), part, path, yaw, lookout.xyz)
        return None

    def _lookouts_left(self, terrain: Terrain, is_inside: bool) -> list[Lookout]:
        """The one that the robot is on its way to, then all others."""
        least_m2 = self.frontier_config.least_lookout_gain_m2 * (_STILL_WORTH if is_inside else 1.0)
        found = find_lookouts(terrain, replace(self.frontier_config, least_lookout_gain_m2=least_m2), self.terrain_settings)
        before = None if self._sent_to is None or is_inside else self._sent_to.still_in(terrain)
        return found if before is None else [before, *found]

    def _trim_at(self, place: Place) -> float:
        """How far before the end of the way a lookout is: nearer at every look."""
        return max(self.config.min_trim_m, self.config.edge_trim_m * self.config.closer_factor**place.looks)

    def _out_by(self, line: NDArray[np.float64] | None, terrain: Terrain, T_map_base: Transform, scope: str) -> Decision | None:
        """Out of where the robot cannot turn, along the line by which it came in: there it is not left, whatever it sees."""
        if line is None:
            return None
        x, y, z = (float(v) for v in line[-1])
        place = self._tried.at((x, y, z))
        if self._tried.why_aside(place):
            return None
        self._way_out.is_leaving = True
        path = straight_path(line, self.planner_config)
        self._tried.count_progress(place, path.length_m)
        decision = self._decision(DecisionKind.GOAL, "out of a place without room to turn", terrain, scope, 0)
        return _with_path(decision, path, path, yaw_of(T_map_base), place.xyz)

    def _decision(self, kind: DecisionKind, reason: str, terrain: Terrain, scope: str, left: int) -> Decision:
        return Decision(kind, reason, terrain, scope, left, len(self.set_aside()))

    def _why_explored(self) -> str:
        aside = len(self.set_aside())
        return "no reachable frontier is left in the whole map" + (f"; {aside} set aside" if aside else "")

    def _why_trapped(self, terrain: Terrain) -> str:
        if terrain.start is None:
            return "no ground beneath the robot from which enough traversable ground can be reached"
        return "all ground around the robot is too near to obstacles or cliffs"


def _with_path(decision: Decision, part: Path, path: Path, yaw: float, frontier_xyz: tuple[float, float, float]) -> Decision:
    """A goal at the end of the first `part` of a path."""
    x, y, z = (float(v) for v in part.points[-1])
    goal = (x, y, z, yaw)
    return replace(decision, path=part.points, goal=goal, frontier=frontier_xyz, full_path=path.points, straight=part.straight)


def compile_kernels() -> None:
    """Compiles every kernel of the terrain analysis and the planner for the types that `decide` passes, by deciding in a small world."""
    states = np.zeros((64, 64, 24), dtype=np.uint8)
    states[:, :, 4], states[:, :, 5:] = VoxelState.OCCUPIED, VoxelState.FREE
    states[:, 0, 4:] = VoxelState.OCCUPIED  # a wall, a drop that was seen, a hole to bridge, and three sides that go on
    states[:, 60:, 1:5] = VoxelState.FREE
    states[40, 30, 4] = VoxelState.UNKNOWN
    T_map_base = np.eye(4)
    T_map_base[:3, 3] = 2.5, 2.5, 0.08 * 5 + TerrainSettings().robot.base_height_m
    ExplorationPlanner().decide(ColumnRuns.from_dense(states), T_map_base)
    states[32, :27, 4:], states[32, 38:, 4:] = VoxelState.OCCUPIED, VoxelState.OCCUPIED  # a narrow door
    T_map_base[0, 3] = 1.2
    runs, heights = ColumnRuns.from_dense(states), SurfaceHeights(0.08)
    heights.add(HitHeights.of((np.argwhere(states == VoxelState.OCCUPIED) + 0.5) * 0.08, 0.08))
    ExplorationPlanner().decide(lambda radius_m: navigable_terrain(runs, T_map_base, TerrainSettings(), radius_m, heights), T_map_base)
    states[32:, :27, 4:], states[32:, 38:, 4:], states[52:, 27:38] = VoxelState.OCCUPIED, VoxelState.OCCUPIED, VoxelState.UNKNOWN
    dead_end = navigable_terrain(ColumnRuns.from_dense(states), T_map_base, TerrainSettings(), None)
    find_lookouts(dead_end, FrontierConfig(least_lookout_gain_m2=0.0), TerrainSettings())
