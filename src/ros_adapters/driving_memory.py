"""What stop_scan_and_go_node goes on with when it is started again, beside latched topics.

Here and not in the node: what is kept has to have an importable name.
"""

import math
from dataclasses import dataclass, field

import rospy
from explore_3dnav.msg import RunEvent

from ros_adapters.mapping_mode import OpenSweeps
from stop_scan_and_go import DriveState, StopScanAndGo


@dataclass
class DrivingMemory:
    """The state machine, the sweeps without a result, and the decisions that were heard."""

    machine: StopScanAndGo
    open_sweeps: OpenSweeps
    heard_s: float = -math.inf  # stamp of the last decision
    taken_s: float = -math.inf  # of the last that has taken effect
    decided_stamp: rospy.Time = field(default_factory=rospy.Time)  # of the last that has a terrain
    told: tuple[DriveState | None, int] = (None, 0)
    nods: bool | None = None  # what the mount was told; None: nothing yet
    event: RunEvent | None = None

    def takes(self, stamp_s: float) -> bool:
        """Whether the decision about a sweep takes effect now: each once, though nodes that are started again say and hear it again."""
        is_new, self.taken_s = stamp_s != self.taken_s, stamp_s
        return is_new
