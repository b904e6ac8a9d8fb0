"""What pose_graph_mapping_node goes on with when it is started again, beside the run's folder.

Here and not in the node: what is kept has to have an importable name.
"""

import math
from dataclasses import dataclass, field

import numpy as np
from explore_3dnav.msg import MappedSweep
from numpy.typing import NDArray

from pose_graph_mapping.graph.finished_map import Visits
from pose_graph_mapping.graph.mapping_update import MappingUpdate
from rigid_geometry.transforms import Transform

_KEPT = 10  # stamps: a node that is started again sends its last sweep once more


def _frames_are_one() -> NDArray[np.float64]:
    return np.eye(4)  # before the first sweep (Alg. 1, line 3)


@dataclass
class MappingMemory:
    """Where the robot is in the map, as far as anybody knows, and how sweeps were matched."""

    lost: bool  # nobody knows where the robot is in the map
    T_map_odom: Transform = field(default_factory=_frames_are_one)
    lately_s: tuple[float, ...] = ()  # stamps of the last sweeps that were mapped and told of, or given up
    unknown_s: list[float] = field(default_factory=list)  # since the last vertex: when odometry knew nothing of the way
    loop_closures: int = 0
    mapped: int = 0  # sweeps in the map that others heard of
    refused: int = 0
    refused_in_a_row: int = 0
    visits: Visits = field(default_factory=Visits)  # in a finished map
    failure: MappedSweep | None = None  # what was told of the last sweep, where it failed

    @property
    def handled_s(self) -> float:
        """Stamp of the last sweep that was mapped and told of, or given up."""
        return self.lately_s[-1] if self.lately_s else -math.inf

    def handle(self, stamp_s: float) -> None:
        """A sweep was mapped and told of, or given up."""
        self.lately_s = (*self.lately_s, stamp_s)[-_KEPT:]

    def why_not(self, found: int) -> str:
        """Why nobody can go on with so many sweeps that were found in the run's folder; empty where that is all."""
        if found >= self.mapped:
            return ""
        return f"of {self.mapped} sweeps that were mapped {found} are on disk: the others were in the memory of the process that died"

    def is_lost_at(self, stamp_s: float) -> bool:
        """Whether nobody knows where the robot was at the end of a sweep."""
        return self.lost or any(at <= stamp_s for at in self.unknown_s)

    def place(self, stamp_s: float, update: MappingUpdate) -> None:
        """A sweep is mapped: from then on it is known where the robot is."""
        self.lost, self.T_map_odom, self.failure = False, update.T_map_odom, None
        self.unknown_s = [at for at in self.unknown_s if at > stamp_s]
        self.loop_closures += update.loop_closures
        self.refused += update.match_refused
        self.refused_in_a_row = self.refused_in_a_row + 1 if update.match_refused else 0
