"""What is known after a sweep, for `decide`."""

from dataclasses import dataclass
from enum import Enum

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.decision import TerrainWithin
from rigid_geometry.transforms import Transform


class SweepOutcome(Enum):
    """What became of a sweep."""

    MATCHED = "matched"
    REFUSED = "refused"  # it is in the map where odometry says
    UNPLACED = "unplaced"  # it is not in the map
    LOST = "lost"  # and where the robot is in the map nobody knows


@dataclass(frozen=True, eq=False)
class Observation:
    """What is known after a sweep.

    `vertex_poses` (V, 4, 4): T_map_base of every sweep of the map, the last where the robot is now; `terrain_within` gives the terrain
    around it; `trouble`: why the sweep is UNPLACED or LOST. `on_the_way`: it was not made at the goal; `drive_failure`: what the follower
    said when it could not reach that, else empty. `elapsed_s` since the start, `paused_s` of them, `driven_m` by odometry, for a budget.
    `stands`: the robot stood when the sweep ended; `at_goal`: because it had reached its goal, not because somebody had stopped it.
    """

    sweep: SweepOutcome
    vertex_poses: NDArray[np.float64]
    terrain_within: TerrainWithin
    trouble: str = ""
    on_the_way: bool = False
    drive_failure: str = ""
    elapsed_s: float = 0.0
    driven_m: float = 0.0
    stands: bool = True
    at_goal: bool = True
    paused_s: float = 0.0

    @property
    def T_map_base(self) -> Transform:
        """(4, 4) where the robot is."""
        return np.asarray(self.vertex_poses[-1])
