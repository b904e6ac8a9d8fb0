"""What was tried at which place, for `exploration`: looks, failed drives and goals that brought the robot no nearer.

After a bounded number of them a place is set aside: so every run ends.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from octomap_server_3dnav.exploration.config import ExplorationConfig

Point = tuple[float, float, float]
PLACE_RADIUS_M = 0.6  # frontiers within this distance of each other are the same place
NEAR_M = 1.6  # a sweep taken within this distance of a frontier was a look at it
_NEARER_M = 0.5  # a frontier this much nearer over the ground than ever before is progress


@dataclass
class Place:
    """What happened so far at a frontier or lookout, `xyz` in map in metres."""

    xyz: Point
    goals: int = 0
    looks: int = 0
    nearest_m: float = math.inf
    idle_goals: int = 0
    failures: list[str] = field(default_factory=list)


class TriedPlaces:
    """All places that were ever a goal, or could have been one but for a path; those within `PLACE_RADIUS_M` of each other are one."""

    def __init__(self, config: ExplorationConfig) -> None:
        self._config = config
        self._places: list[Place] = []

    def configure(self, config: ExplorationConfig) -> None:
        """Places are judged by it from now on, also those that were tried before."""
        self._config = config

    def known(self, xyz: Point) -> Place | None:
        """The place at a point; None where nothing was tried yet."""
        near = [(math.dist(p.xyz, xyz), i) for i, p in enumerate(self._places)]
        best = min(near, default=None)
        return self._places[best[1]] if best and best[0] <= PLACE_RADIUS_M else None

    def at(self, xyz: Point) -> Place:
        """The place at a point, from now on a known one."""
        place = self.known(xyz)
        if place is None:
            place = Place((float(xyz[0]), float(xyz[1]), float(xyz[2])))
            self._places.append(place)
        return place

    def why_aside(self, place: Place) -> str | None:
        """Why a place is not tried any more; None while it is."""
        if len(place.failures) >= self._config.max_failures:
            return f"not reached in {len(place.failures)} tries: {place.failures[-1]}"
        if place.looks >= self._config.max_looks:
            return f"unchanged after {place.looks} looks from near"
        if place.idle_goals >= self._config.max_goals:
            return f"no nearer after {place.idle_goals} goals"
        return None

    def is_aside(self, xyz: Point) -> bool:
        """Whether what lies at a point is not tried any more."""
        place = self.known(xyz)
        return place is not None and self.why_aside(place) is not None

    def was_not_reached(self, xyz: Point) -> bool:
        """Whether drives to what lies at a point failed too often."""
        place = self.known(xyz)
        return place is not None and len(place.failures) >= self._config.max_failures

    def set_aside(self) -> list[tuple[Point, str]]:
        """The places that are not tried any more, each with the reason."""
        return [(p.xyz, reason) for p in self._places if (reason := self.why_aside(p))]

    def count_looks(self, left: Sequence[Point], robot_xyz: Point) -> None:
        """Of what is `left` after a sweep, that which was a goal and lies near was looked at in vain."""
        for place in {id(p): p for xyz in left if (p := self.known(xyz))}.values():
            if math.dist(place.xyz, robot_xyz) <= NEAR_M and place.goals > place.looks:
                place.looks += 1

    def count_progress(self, place: Place, distance_m: float) -> None:
        """A far frontier may be chosen anew at every sweep on the way to it; only goals that do not bring it nearer are in vain."""
        if distance_m <= place.nearest_m - _NEARER_M:
            place.nearest_m, place.idle_goals = distance_m, 0
        place.idle_goals += 1
