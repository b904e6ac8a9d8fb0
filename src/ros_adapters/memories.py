"""What a node that is started again goes on with, beside the run's folder and latched topics.

Here and not in the nodes: what is kept has to have an importable name.
"""

import math
from dataclasses import dataclass, field

import numpy as np
import rospy
from explore_3dnav.msg import ExplorationDecision, RunEvent
from numpy.typing import NDArray

from octomap_server_3dnav.exploration.decide import Explorer
from pose_graph_mapping.graph.finished_map import Visits
from pose_graph_mapping.graph.mapping_update import MappingUpdate
from rigid_geometry.transforms import Transform
from ros_adapters.mapping_mode import OpenSweeps
from ros_adapters.stage_times import StageTimes
from stop_scan_and_go import DriveState, StopScanAndGo


def _frames_are_one() -> NDArray[np.float64]:
    return np.eye(4)  # before the first sweep (Alg. 1, line 3)


@dataclass
class MappingMemory:
    """Of pose_graph_mapping_node."""

    lost: bool  # nobody knows where the robot is in the map
    T_map_odom: Transform = field(default_factory=_frames_are_one)
    handled_s: float = -math.inf  # stamp of the last sweep that was mapped and told of, or given up
    unknown_s: list[float] = field(default_factory=list)  # since the last vertex: when odometry knew nothing of the way
    loop_closures: int = 0
    refused: int = 0
    refused_in_a_row: int = 0
    visits: Visits = field(default_factory=Visits)  # in a finished map

    def is_lost_at(self, stamp_s: float) -> bool:
        """Whether nobody knows where the robot was at the end of a sweep."""
        return self.lost or any(at <= stamp_s for at in self.unknown_s)

    def place(self, stamp_s: float, update: MappingUpdate) -> None:
        """A sweep is mapped: from then on it is known where the robot is."""
        self.lost, self.T_map_odom = False, update.T_map_odom
        self.unknown_s = [at for at in self.unknown_s if at > stamp_s]
        self.loop_closures += update.loop_closures
        self.refused += update.match_refused
        self.refused_in_a_row = self.refused_in_a_row + 1 if update.match_refused else 0


@dataclass
class DecidingMemory:
    """Of octomap_server_3dnav_node."""

    explorer: Explorer
    timing: StageTimes
    decided_s: float = -math.inf  # stamp of the last sweep about which was decided
    T_map_base: Transform | None = None  # where the robot was then
    decision: ExplorationDecision | None = None


@dataclass
class DrivingMemory:
    """Of stop_scan_and_go_node."""

    machine: StopScanAndGo
    open_sweeps: OpenSweeps
    heard_s: float = -math.inf  # stamp of the last decision
    taken_s: float = -math.inf  # of the last that has taken effect
    decided_stamp: rospy.Time = field(default_factory=rospy.Time)  # of the last that has a terrain
    told: tuple[DriveState | None, int] = (None, 0)
    nods: bool = False
    event: RunEvent | None = None

    def takes(self, stamp_s: float) -> bool:
        """Whether the decision about a sweep takes effect now: each once, though nodes that are started again say and hear it again."""
        is_new, self.taken_s = stamp_s != self.taken_s, stamp_s
        return is_new
