"""Back to known ground: where the robot goes when sweep after sweep found no place in the map.

Beside exploration: while sweeps match, it has nothing to say. A robot that goes on by odometry alone maps what it sees to where it is not;
from ground that was seen before, the next sweep finds its place again.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from octomap_server_3dnav.exploration.decision import Decision, DecisionKind, TerrainWithin
from octomap_server_3dnav.navigation.planner import PlannerConfig, nearest_traversable, plan_path
from rigid_geometry.transforms import Transform

_TOLERANCE_M = 1.5


class Retreat:
    """Counts sweeps that were refused in a row; every further one sends the robot back by one more sweep that matched.

    After drives back that failed there is no target any more, until a sweep matches.
    """

    def __init__(self, after: int, max_failures: int) -> None:
        """`after` refused sweeps in a row the robot turns back, 0: never; and no more after `max_failures` drives that failed."""
        self._after, self._max_failures, self._failures = after, max_failures, 0
        self._matched: list[int] = []
        self._refused_in_a_row = 0

    def add_sweep(self, vertex_id: int, matched: bool) -> None:
        """What became of a sweep; the first of a map counts as matched, and one that is told again as one."""
        self._refused_in_a_row = 0 if matched else self._refused_in_a_row + 1
        self._failures = 0 if matched else self._failures
        if matched and self._matched[-1:] != [vertex_id]:
            self._matched.append(vertex_id)

    def report_failure(self) -> None:
        """A drive back did not come there."""
        self._failures += 1

    def target(self, vertex_poses: ArrayLike) -> NDArray[np.float64] | None:
        """(3,) place of the sweep to go back to, of all (V, 4, 4) poses in map; None while there is no need, or no way."""
        further = self._refused_in_a_row - self._after
        if self._after == 0 or further < 0 or not self._matched or self._failures >= self._max_failures:
            return None
        vertex_id = self._matched[max(0, len(self._matched) - 1 - further)]
        return np.asarray(np.asarray(vertex_poses, dtype=np.float64)[vertex_id, :3, 3])


def way_back(
    terrain_within: TerrainWithin, local_radius_m: float, T_map_base: Transform, target_xyz: NDArray[np.float64], config: PlannerConfig
) -> Decision | None:
    """The decision to drive to the ground nearest `target_xyz` (3,) in map, in the local terrain or else the whole; None without a path."""
    x, y, z = (float(v) for v in target_xyz)
    for radius, scope in ((local_radius_m, "local"), (None, "global")):
        terrain = terrain_within(radius)
        node = nearest_traversable(terrain, (x, y, z), _TOLERANCE_M)
        path = None if node is None else plan_path(terrain, node, config)
        if path is None or len(path.points) < 2:
            continue
        end, before = path.points[-1], path.points[max(-4, -len(path.points))]
        yaw = math.atan2(end[1] - before[1], end[0] - before[0])
        away = math.dist((x, y), T_map_base[:2, 3])
        reason = f"sweeps found no place in the map: back to where one did, {away:.1f} m away"
        return Decision(DecisionKind.GOAL, reason, terrain, scope).along(path, yaw, (x, y, z))
    return None
