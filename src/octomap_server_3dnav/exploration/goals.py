"""Goals in one terrain: the frontier that is cheapest and has a path, a look from where the robot cannot turn, and out of there again.

For `decide`, which asks for the terrain around the robot first and then for the whole map. Frontiers that stay what they are although the
robot looked at them, or that driving failed to reach, are set aside (`tried_places`).
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.approach import Approach
from octomap_server_3dnav.exploration.closed_ways import closed_ways, entrance, stands
from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.decision import Decision, DecisionKind
from octomap_server_3dnav.exploration.frontiers import Frontier, FrontierConfig, facing_yaw, find_frontiers
from octomap_server_3dnav.exploration.lookouts import SAME_STAND_M, Lookout, WayOut, find_lookouts
from octomap_server_3dnav.exploration.nearest_ground import nearest_ground
from octomap_server_3dnav.exploration.tried_places import Place, TriedPlaces
from octomap_server_3dnav.navigation.passages import TerrainSettings
from octomap_server_3dnav.navigation.planner import Path, PlannerConfig, distances_over_ground, plan_into, plan_path, straight_path
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass
from rigid_geometry import yaw_of
from rigid_geometry.transforms import Transform

_STILL_WORTH = 0.5  # of what a look must show at least: with less a robot that went in turns back


@dataclass(frozen=True, eq=False)
class View:
    """The terrain around the robot, "local" or "global" by its `scope`, the robot's pose in it, and those of all sweeps (V, 4, 4)."""

    terrain: Terrain
    T_map_base: Transform
    scope: str
    vertex_poses: NDArray[np.float64]

    def has_looked_from(self, node: int) -> bool:
        """Whether a sweep was made beside a node."""
        return bool((np.linalg.norm(self.vertex_poses[:, :3, 3] - self.terrain.centers(np.array([node])), axis=1) <= SAME_STAND_M).any())


class GoalSearch:
    """Chooses a goal in a terrain; remembers what was tried where, and how the robot went to where it cannot turn."""

    def __init__(self, config: ExplorationConfig, terrain: TerrainSettings, frontier: FrontierConfig, planner: PlannerConfig) -> None:
        self._terrain_settings = terrain
        self._tried = TriedPlaces(config)
        self._approach = Approach(config, planner.trim_m)
        self.configure(config, frontier, planner)
        self._way_out = WayOut(terrain)
        self._begun: tuple[float, float, float] | None = None  # the frontier on the way to which it was sent to where a passage begins
        self._sent_to: Lookout | None = None  # before whose way it was sent
        self._chosen: Place | None = None  # the goal that was counted last

    def configure(self, config: ExplorationConfig, frontier: FrontierConfig, planner: PlannerConfig) -> None:
        """From the next search on."""
        self._config, self._frontier_config, self._planner_config = config, frontier, planner
        self._tried.configure(config)
        self._approach.configure(config, planner.trim_m)

    def set_aside(self) -> list[tuple[tuple[float, float, float], str]]:
        """Frontiers given up so far, each with the reason."""
        return self._tried.set_aside()

    def report_failure(self, frontier_xyz: tuple[float, float, float], reason: str) -> None:
        """Driving to the goal of this frontier failed; after `max_failures` it is set aside."""
        self._tried.at(frontier_xyz).failures.append(reason)

    def take_back(self) -> None:
        """The goal that was chosen last was not driven to, for somebody else had the robot: it does not count as tried."""
        if self._chosen is not None:
            self._chosen.idle_goals -= 1
        self._chosen = None

    def with_way_out(self, terrain: Terrain) -> Terrain:
        """The terrain around the robot with the way by which it went to a lookout, while it stands there and nothing else leads out."""
        return self._way_out.added_to(terrain)

    def notice(self, view: View) -> None:
        """After every sweep: where the robot is now, that went to where it cannot turn, or woke up there."""
        self._way_out.notice(view.terrain, yaw_of(view.T_map_base))

    def is_inside(self, view: View) -> bool:
        """Whether the robot stands where nothing but straight on or straight out is left."""
        return self._way_out.from_inside(view.terrain) is not None and not view.terrain.is_in_passage

    def frontiers_in(self, view: View) -> list[Frontier]:
        """The frontiers that are not set aside, now that the robot has looked once more."""
        frontiers = find_frontiers(view.terrain, view.T_map_base, self._frontier_config, self._planner_config)
        x, y, z = (float(v) for v in view.T_map_base[:3, 3])
        self._tried.count_looks([f.xyz for f in frontiers], (x, y, z))
        return [f for f in frontiers if not self._tried.is_aside(f.xyz)]

    def towards(self, left: list[Frontier], view: View) -> Decision | None:
        """The first of some frontiers to which a path leads, as a goal; None where none does, and that is remembered."""
        for count, frontier in enumerate(left):
            path = plan_path(view.terrain, frontier.node, self._planner_config)
            place = self._tried.known(frontier.xyz)
            looks = 0 if place is None else place.looks
            before_m = self._approach.distance_m(frontier, looks)
            trimmed = None if path is None else self._approach.part_of(path, view.terrain, view.T_map_base, frontier, before_m)
            if path is not None and trimmed is not None:
                return self._goal(view, frontier, path, trimmed, len(left) - count)
            self._tried.at(frontier.xyz).failures.append("no path" if path is None else "no path clear of unknown floor")
        return None

    def last_of_all(self, last: list[Frontier], view: View) -> Decision | None:
        """When nothing else is left: to a frontier that is looked at last, to a look from inside, or out of there.

        First of all to that which the robot is on its way to.
        """
        looks = (lambda: self.towards(last, view), lambda: self._lookout_in(view))
        first, second = looks if self._sent_to is None else looks[::-1]
        return first() or second() or self._entrance(view) or self._nearer(view) or self._out_of(view)

    def decision(self, kind: DecisionKind, reason: str, view: View, left: int = 0) -> Decision:
        """A decision in a view that left so many frontiers to visit."""
        return Decision(kind, reason, view.terrain, view.scope, left, len(self.set_aside()))

    def _goal(self, view: View, frontier: Frontier, path: Path, trimmed: Path, left: int) -> Decision:
        place = self._tried.at(frontier.xyz)
        place.goals += 1
        self._count_goal(place, frontier.distance_m)
        reason = f"frontier of {len(frontier.voxels)} voxels, {frontier.distance_m:.1f} m away"
        goal = self._approach.goal_of(trimmed, path, view.terrain, view.T_map_base, frontier)
        self._begun = frontier.xyz if path.leads_on_straight(trimmed) else None
        return self.decision(DecisionKind.GOAL, reason, view, left).along(trimmed, goal[3], frontier.xyz)

    def _count_goal(self, place: Place, distance_m: float) -> None:
        self._tried.count_progress(place, distance_m)
        self._chosen = place

    def _lookout_in(self, view: View) -> Decision | None:
        """To where something is to be seen from a place without room to turn, and nearer if that did not show it.

        A robot that is in one already only goes straight on.
        """
        is_inside = self.is_inside(view)
        if not self._config.lookouts or (is_inside and self._way_out.is_leaving):
            return None
        for lookout in self._lookouts_left(view.terrain, is_inside):
            place = self._tried.at(lookout.tried_at)
            place.looks += lookout.is_seen_from(view.terrain, self._trim_at(place))
            way = lookout.way_in(self._trim_at(place))
            if way is None:
                continue
            end = way.nodes[1]
            if view.terrain.label[end] == TerrainClass.TRAVERSABLE and view.terrain.reached[end]:
                continue
            has_looked = not lookout.voxels and self._way_out.has_looked_from(way.line[-1])
            if has_looked or self._tried.why_aside(place) or self._tried.was_not_reached(lookout.xyz):
                continue
            path = plan_into(view.terrain, way, yaw_of(view.T_map_base), self._planner_config)
            if path is None or (is_inside and 0 not in path.entries()):
                place.failures.append("no path to a place from where to look")
                continue
            self._count_goal(place, path.length_m)
            part, yaw, is_whole = self._approach.towards(path, view.T_map_base, facing_yaw(*way.line[[0, -1]]))
            self._sent_to = None if is_whole else lookout
            if is_whole:
                place.looks += lookout.is_stand  # once there it has looked, whatever it sees
                self._way_out.enter(way, view.terrain)
            reason = f"a look at {lookout.gain_m2:.0f} m2 from where there is no room to turn"
            return self.decision(DecisionKind.GOAL, reason, view, 1).along(part, yaw, lookout.xyz)
        return None

    def _entrance(self, view: View) -> Decision | None:
        """To where the robot can turn before a way that floor closes which was not seen."""
        if not self._config.lookouts or self.is_inside(view):
            return None
        distance = distances_over_ground(view.terrain, self._planner_config)
        ways = closed_ways(view.terrain, self._frontier_config, self._terrain_settings)
        found = [place for way in ways if (place := entrance(view.terrain, way, distance))]
        return self.towards([place for place in found if not self._tried.is_aside(place.xyz)], view)

    def _nearer(self, view: View) -> Decision | None:
        """To the ground nearest to floor that no way leads to: what was seen from afar only may look like a step that is none."""
        if not self._config.lookouts or self.is_inside(view):
            return None
        distance = distances_over_ground(view.terrain, self._planner_config)
        found = nearest_ground(view.terrain, self._frontier_config, distance)
        return self.towards([f for f in found if not self._tried.is_aside(f.xyz) and not view.has_looked_from(f.node)], view)

    def _lookouts_left(self, terrain: Terrain, is_inside: bool) -> Iterator[Lookout]:
        """The one that the robot is on its way to, then all others: first those that lie straight ahead."""
        least_m2 = self._frontier_config.least_lookout_gain_m2 * (_STILL_WORTH if is_inside else 1.0)
        of = replace(self._frontier_config, least_lookout_gain_m2=least_m2)
        before = None if self._sent_to is None or is_inside else self._sent_to.still_in(terrain)
        if before is not None:
            yield before
        for find in (find_lookouts, closed_ways, stands):
            yield from find(terrain, of, self._terrain_settings)

    def _trim_at(self, place: Place) -> float:
        """How far before the end of the way a lookout is: nearer at every look."""
        return max(self._config.min_trim_m, self._config.edge_trim_m * self._config.closer_factor**place.looks)

    def _out_of(self, view: View) -> Decision | None:
        """Out of where the robot cannot turn, along the line by which it came in: there it is not left, whatever it sees."""
        line: NDArray[np.float64] | None = self._way_out.from_inside(view.terrain)
        if line is None:
            return None
        x, y, z = (float(v) for v in line[-1])
        place = self._tried.at((x, y, z))
        if self._tried.why_aside(place):
            return None
        self._way_out.is_leaving = True
        path = straight_path(line)
        self._count_goal(place, path.length_m)
        decision = self.decision(DecisionKind.GOAL, "out of a place without room to turn", view)
        return decision.along(path, yaw_of(view.T_map_base), place.xyz)
