"""What the exploration answers to a sweep."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.frontiers import Frontier
from octomap_server_3dnav.navigation.planner import Path
from octomap_server_3dnav.terrain.classified_terrain import Terrain

TerrainWithin = Callable[[float | None], Terrain]
"""Gives the terrain classified within a radius in metres around the robot; None: all of the map."""


class DecisionKind(Enum):
    """What the robot is to do."""

    GOAL = "goal"
    KEEP = "keep"
    LOOK = "look"  # again, from where it stands: nobody knows where that is, or no ground is found there
    EXPLORED = "explored"
    TRAPPED = "trapped"
    ENDED = "ended"  # somebody or a budget has ended exploration
    WAIT = "wait"  # until somebody asks for more


@dataclass(frozen=True, eq=False)
class Decision:
    """What to do and why.

    `terrain` that decided, "local" or "global" by its `scope`; None and "" where none was asked. `open_frontiers` were left to visit in it,
    this one included; `set_aside` were given up in the whole run. Of GOAL and KEEP only: `path` (K, 3) in map, trimmed; `straight` (K,)
    bool, where from a point to the next it leads through a passage without room to turn; `goal` (x, y, z,
    yaw) in map, its yaw facing `frontier` (3,), on a slope that of the path's end; `exact`: the goal is a place to stand at. `frontiers`:
    those among which it was chosen, the cheapest first.
    """

    kind: DecisionKind
    reason: str
    terrain: Terrain | None = None
    scope: str = ""
    open_frontiers: int = 0
    set_aside: int = 0
    path: NDArray[np.float64] | None = None
    goal: tuple[float, float, float, float] | None = None
    frontier: tuple[float, float, float] | None = None
    straight: NDArray[np.bool_] | None = None
    exact: bool = False
    frontiers: tuple[Frontier, ...] = ()

    def along(self, part: Path, yaw: float, frontier_xyz: tuple[float, float, float]) -> "Decision":
        """The same with a goal at the end of a path, or of the first `part` of one."""
        x, y, z = (float(v) for v in part.points[-1])
        goal = (x, y, z, yaw)
        return replace(self, path=part.points, goal=goal, frontier=frontier_xyz, straight=part.straight)


def without_ground(local: Terrain) -> Decision:
    """What a robot on its way does where its surroundings begin nowhere: another look, and no drive over what it does not know."""
    return Decision(DecisionKind.LOOK, "no ground beneath the robot: its height in the map may be wrong", local, "local")
