"""Where to go after a sweep (thesis algorithm 3, lines 22 to 35, and 6.2.2): `Explorer.step(observation) -> Decision`.

The last step of the octomap stage. Algorithm 3 as printed begins anew whenever the robot is at a frontier; around it stands what becomes of
a plan that is under way, of drives that failed, and of sweeps that found no place in the map; and what people ask for: home, or the end.
"""

from dataclasses import replace
from enum import Enum

from map_zones import Zones
from octomap_server_3dnav.exploration.budget import Budget
from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.decision import Decision, DecisionKind, without_ground
from octomap_server_3dnav.exploration.frontiers import Frontier, FrontierConfig
from octomap_server_3dnav.exploration.goals import GoalSearch, View
from octomap_server_3dnav.exploration.homing import Homing
from octomap_server_3dnav.exploration.observation import Observation, SweepOutcome
from octomap_server_3dnav.exploration.plan_validity import Validity, validity_in
from octomap_server_3dnav.exploration.retreat import Retreat, way_back
from octomap_server_3dnav.navigation.passages import TerrainSettings, place_of
from octomap_server_3dnav.navigation.planner import PlannerConfig
from octomap_server_3dnav.terrain.classified_terrain import Terrain
from rigid_geometry import as_transforms

_MAX_UNPLACED_SWEEPS = 3  # sweeps in a row that did not come into the map at all after which the robot ends


class State(Enum):
    """What the robot is about between two sweeps."""

    STARTING = "starting"  # nothing was decided yet
    UNDER_WAY = "under way"  # to where it looks at a frontier
    RETREATING = "retreating"  # to where a sweep found its place in the map
    EXPLORED = "explored"  # nothing reachable is unknown
    TRAPPED = "trapped"  # no way leads anywhere, or nobody knows where the robot is
    GOING_HOME = "going home"
    HOME = "home"  # or as near as it could come
    ENDED = "ended"  # where it stood


EXPLORING = State.STARTING, State.UNDER_WAY, State.RETREATING


class Errand(Enum):
    """What somebody may ask the robot for."""

    EXPLORE = "explore"
    HOME = "home"  # and wait there
    END = "end"  # as when nothing is left to explore


class Explorer:
    """Chooses goals until nothing reachable is unknown; one `step` a sweep."""

    def __init__(
        self,
        config: ExplorationConfig | None = None,
        terrain: TerrainSettings | None = None,
        frontier: FrontierConfig | None = None,
        planner: PlannerConfig | None = None,
        *,
        explores: bool = True,
    ) -> None:
        """Without `explores` it waits after every sweep, and only leads home. ValueError lists every violation of the configurations."""
        self.explores = explores
        self.config = config or ExplorationConfig()
        self.terrain_settings = terrain or TerrainSettings()
        self.frontier_config = frontier or FrontierConfig()
        self.planner_config = planner or PlannerConfig()
        configs = self.config, self.terrain_settings, self.frontier_config, self.planner_config
        if problems := [problem for c in configs for problem in c.validate()]:
            raise ValueError("\n".join(problems))
        self._goals = GoalSearch(*configs)
        self._homing = Homing(self.config, self.planner_config, self.terrain_settings.robot.base_height_m)
        self._budget = Budget(self.config, since_start=True)
        self._state = State.STARTING
        self._asked: tuple[Errand, str] | None = None
        self._plan: Decision | None = None
        self._is_overruled = False
        self.forget_sweeps()

    @property
    def state(self) -> State:
        """What the robot is about now."""
        return self._state

    @property
    def is_going_home(self) -> bool:
        """Whether it is on its way there, or will be after the next sweep."""
        return self._state is State.GOING_HOME or (self._asked is not None and self._is_home_next(self._asked[0]))

    def ask(self, errand: Errand, reason: str) -> None:
        """Somebody wants something else from the next sweep on; a robot that is told to explore again has its budget anew."""
        self._asked = None if errand is Errand.EXPLORE else (errand, reason)
        if errand is Errand.EXPLORE and self._state not in EXPLORING:
            self._state, self._budget = State.STARTING, Budget(self.config, since_start=False)

    def overrule(self) -> None:
        """Somebody's goal or joystick, or a pause, comes before what was decided last."""
        self._is_overruled = True

    def configure(self, config: ExplorationConfig, frontier: FrontierConfig, planner: PlannerConfig) -> None:
        """From the next sweep on. ValueError lists every violation; nothing is changed then."""
        if problems := [problem for c in (config, frontier, planner) for problem in c.validate()]:
            raise ValueError("\n".join(problems))
        self.config, self.frontier_config, self.planner_config = config, frontier, planner
        self._goals.configure(config, frontier, planner)
        self._homing.configure(config, planner)
        self._budget.configure(config)

    def set_zones(self, zones: Zones) -> None:
        """Where the robot may drive, from the next sweep on. ValueError lists what is wrong with them; nothing is changed then."""
        if problems := zones.problems():
            raise ValueError("; ".join(problems))
        self.terrain_settings = replace(self.terrain_settings, zones=zones)

    def set_aside(self) -> list[tuple[tuple[float, float, float], str]]:
        """Frontiers given up so far, each with the reason."""
        return self._goals.set_aside()

    def with_way_out(self, terrain: Terrain) -> Terrain:
        """The terrain around the robot with the way by which it went to where it cannot turn, while nothing else leads out."""
        return self._goals.with_way_out(terrain)

    def know_sweep(self, vertex_id: int, is_matched: bool) -> None:
        """A sweep of an earlier session is in the map; `step` notices those of this one."""
        self._retreat.add_sweep(vertex_id, is_matched)

    def forget_sweeps(self) -> None:
        """The map begins anew."""
        self._retreat = Retreat(self.config.max_refused_sweeps, self.config.max_failures)
        self._unplaced = 0

    def step(self, observation: Observation) -> Decision:
        """What to do after a sweep. ValueError for poses that are none; nothing is changed then."""
        as_transforms(observation.vertex_poses)
        self._count(observation)
        if self._is_overruled:
            self._goals.take_back()
            self._is_overruled, observation = False, replace(observation, at_goal=False, drive_failure="")
        decision = self._why_not_on(observation) or self._homeward(observation) or self._goes_on(observation)
        self._plan = replace(decision, kind=DecisionKind.GOAL) if decision.path is not None else None
        return replace(decision, set_aside=len(self.set_aside()))

    def _goes_on(self, observation: Observation) -> Decision:
        if not self.explores:
            return Decision(DecisionKind.WAIT, "exploration is off")
        return self._kept(observation) or self._back(observation) or self._onward(observation)

    def _count(self, observation: Observation) -> None:
        if observation.sweep in (SweepOutcome.UNPLACED, SweepOutcome.LOST):
            self._unplaced += 1
            return
        self._unplaced = 0
        self._homing.notice(len(observation.vertex_poses) - 1)
        self.know_sweep(len(observation.vertex_poses) - 1, observation.sweep is SweepOutcome.MATCHED)

    def _why_not_on(self, observation: Observation) -> Decision | None:
        """A robot that does not know where it is looks again, and again; then that is its end."""
        is_lost, again = observation.sweep is SweepOutcome.LOST, self._unplaced < _MAX_UNPLACED_SWEEPS
        if again:
            return Decision(DecisionKind.LOOK, observation.trouble) if is_lost else None
        self._state = State.TRAPPED
        in_a_row = f"{self._unplaced} sweeps in a row could not be placed in the map"
        return Decision(DecisionKind.TRAPPED, f"{in_a_row}; {observation.trouble}" if is_lost else in_a_row)

    def _is_home_next(self, errand: Errand) -> bool:
        return errand is Errand.HOME or (errand is Errand.END and self.config.at_end == "home")

    def _homeward(self, observation: Observation) -> Decision | None:
        """The way home, once somebody has asked for it or the budget needs it, and the end that somebody has asked for."""
        asked, self._asked = self._asked, None
        over = self._why_over(observation)
        if asked is not None:
            errand, why = asked
            kind = DecisionKind.WAIT if errand is Errand.HOME else DecisionKind.ENDED
            if not self._is_home_next(errand):
                self._state = State.ENDED
                return Decision(kind, why)
            self._begin_homing(why, kind)
        elif over and self._state not in (State.GOING_HOME, State.HOME, State.ENDED):
            self._begin_homing(over, DecisionKind.ENDED)
        return self._go_home(observation) if self._state is State.GOING_HOME else None

    def _why_over(self, observation: Observation) -> str:
        o = observation
        leg_m = self._budget.spend(o.elapsed_s, o.driven_m, o.T_map_base[:3, 3], o.paused_s)
        return self._budget.why_over(self._homing.way_m(o.vertex_poses, o.terrain_within(None), leg_m)) if self._budget.is_set else ""

    def _begin_homing(self, why: str, then: DecisionKind) -> None:
        self._state = State.GOING_HOME
        self._homing.begin(why, then)

    def _go_home(self, observation: Observation) -> Decision:
        within = lambda radius_m: self.with_way_out(observation.terrain_within(radius_m))  # noqa: E731
        decision, is_last = self._homing.step(replace(observation, terrain_within=within))
        self._state = State.HOME if is_last else State.GOING_HOME
        return decision

    def _kept(self, observation: Observation) -> Decision | None:
        """The plan under way, while nothing speaks against it: no new frontier is chosen at a sweep on the way (6.2.2).

        Where no ground is beneath the robot nothing around it is known, and it looks once more.
        """
        plan = self._plan
        if self._state is not State.UNDER_WAY or plan is None or plan.frontier is None:
            return None
        if observation.drive_failure:
            self._goals.report_failure(plan.frontier, observation.drive_failure)
            return None
        if not observation.on_the_way or self._retreat.target(observation.vertex_poses) is not None:
            return None
        local = observation.terrain_within(self.config.local_radius_m)
        if local.start is None:
            return without_ground(local)
        if validity_in(local, plan, self.frontier_config.min_voxels) is not Validity.VALID:
            return None
        return replace(plan, kind=DecisionKind.KEEP, terrain=local, scope="local")

    def _back(self, observation: Observation) -> Decision | None:
        """To known ground, when sweep after sweep was refused and a way leads there."""
        if self._state is State.RETREATING and observation.drive_failure:
            self._retreat.report_failure()
        target = self._retreat.target(observation.vertex_poses)
        if target is None:
            return None
        decision = way_back(observation.terrain_within, self.config.local_radius_m, observation.T_map_base, target, self.planner_config)
        if decision is not None:
            self._state = State.RETREATING
        return decision

    def _onward(self, observation: Observation) -> Decision:
        decision = self._search(observation)
        if decision.kind is DecisionKind.EXPLORED and self.config.at_end == "home":
            self._begin_homing(decision.reason, decision.kind)
            return self._go_home(observation)
        after = {DecisionKind.GOAL: State.UNDER_WAY, DecisionKind.EXPLORED: State.EXPLORED, DecisionKind.TRAPPED: State.TRAPPED}
        self._state = after[decision.kind]
        return decision

    def _search(self, observation: Observation) -> Decision:
        """Algorithm 3 for a robot that has to choose anew; line numbers in the code are its. Ground beneath it is in the map (2)."""
        for dist_limit in (self.config.local_radius_m, None):  # 5, 6 and 34: all around the robot, then COMPLETE_MAP
            view = self._seen_within(dist_limit, observation)  # 3, 7 to 20
            if self._goals.is_inside(view):
                return self._without_frontiers([], view)
            if view.terrain.departure is None:
                if dist_limit is None:  # 16: no start voxel is left
                    return self._goals.decision(DecisionKind.TRAPPED, _why_trapped(view.terrain), view)  # 17
                continue
            frontiers = self._goals.frontiers_in(view)  # 21
            decision = self._goals.towards([f for f in frontiers if not f.last], view)  # 35
            if decision is not None:
                return replace(decision, frontiers=tuple(frontiers))  # 29 to 32: the next search begins around the robot again
            # 22 to 25: nothing near, so the whole map
        return self._without_frontiers([f for f in frontiers if f.last], view)  # 26

    def _seen_within(self, dist_limit: float | None, observation: Observation) -> View:
        o, scope = observation, "global" if dist_limit is None else "local"
        view = View(o.terrain_within(dist_limit), o.T_map_base, scope, o.vertex_poses)
        if dist_limit is not None:
            self._goals.notice(view)
        return view

    def _without_frontiers(self, last: list[Frontier], view: View) -> Decision:
        """Line 27, but for what is looked at when nothing else is left."""
        aside = len(self.set_aside())
        reason = "no reachable frontier is left in the whole map" + (f"; {aside} set aside" if aside else "")
        return self._goals.last_of_all(last, view) or self._goals.decision(DecisionKind.EXPLORED, reason, view)


def _why_trapped(terrain: Terrain) -> str:
    if closed := terrain.zones.why_closed(place_of(terrain)):
        return f"the robot at {closed}"
    if terrain.start is None:
        return "no ground beneath the robot from which enough traversable ground can be reached"
    return "all ground around the robot is too near to obstacles or cliffs"
