"""What octomap_server_3dnav_node goes on with when it is started again, beside the run's folder.

Here and not in the node: what is kept has to have an importable name.
"""

import math
from dataclasses import dataclass

from explore_3dnav.msg import ExplorationDecision

from octomap_server_3dnav.exploration.decide import Explorer
from rigid_geometry.transforms import Transform
from ros_adapters.stage_times import StageTimes


@dataclass
class DecidingMemory:
    """What was explored and decided."""

    explorer: Explorer
    timing: StageTimes
    decided_s: float = -math.inf  # stamp of the last sweep about which was decided
    T_map_base: Transform | None = None  # where the robot was then
    decision: ExplorationDecision | None = None
