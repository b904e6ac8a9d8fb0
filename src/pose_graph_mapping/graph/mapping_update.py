"""What a sweep changed in the map: the mapper's answer to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pose_graph_mapping.registration.matching import RegistrationResult

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MappingUpdate:
    """What a sweep changed.

    vertex_poses (V, 4, 4) T_map_base; result of the match, None for the first sweep; match_used: an edge came of it; tries: how many
    matches were called; loop_closures: new loop edges.
    """

    vertex_id: int
    vertex_poses: Array
    T_map_odom: Array
    result: RegistrationResult | None
    match_used: bool
    tries: int
    loop_closures: int

    @property
    def match_refused(self) -> bool:
        """Whether the sweep was matched, and hangs on odometry all the same."""
        return self.result is not None and not self.match_used
