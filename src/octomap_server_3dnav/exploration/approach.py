"""How far along the path to a frontier the robot goes before it looks, and which way it faces there (thesis 5.5.1).

Between `planner.plan_path` and a decision: paths are trimmed before the unknown, end where wheels may turn, and stop in line with a passage
before they lead through.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from octomap_server_3dnav.exploration.config import ExplorationConfig
from octomap_server_3dnav.exploration.frontiers import Frontier, facing_yaw
from octomap_server_3dnav.exploration.tried_places import NEAR_M, PLACE_RADIUS_M
from octomap_server_3dnav.navigation.planner import Path, trim_path
from octomap_server_3dnav.terrain.classify import Terrain
from rigid_geometry import angle_difference, yaw_of
from rigid_geometry.transforms import Transform

_LEAST_WAY_M = 0.3  # a shorter safe way towards a distant frontier is none
_ENTRY_M = 0.25  # a robot so near to where a passage begins drives in; from farther it stops there
_ENTRY_RAD = 0.35  # if it faces along it within this angle


class Approach:
    """Trims paths, and remembers the passage before which it last ended one."""

    def __init__(self, config: ExplorationConfig, trim_m: float) -> None:
        """`trim_m`: distance from a frontier that is no potential cliff at which a path ends."""
        self.configure(config, trim_m)
        self._entry: tuple[float, float] | None = None  # of the passage that the robot was last sent to

    def configure(self, config: ExplorationConfig, trim_m: float) -> None:
        """From the next path on."""
        self._config, self._trim_m = config, trim_m

    def part_of(self, path: Path, terrain: Terrain, T_map_base: Transform, frontier: Frontier, before_m: float) -> Path | None:
        """The path up to `before_m` from the frontier, from where the robot looks at it, and never beside floor that was not seen.

        That may be a cliff. None when it leaves no way to go although the frontier is far.
        """
        trimmed = trim_path(path, np.asarray(frontier.xyz), before_m)
        unknown = cKDTree(terrain.centers(terrain.frontiers()))
        gaps = unknown.query(trimmed.points)[0]
        from_robot = np.linalg.norm(trimmed.points[:, :2] - T_map_base[:2, 3], axis=1)
        beside = np.flatnonzero((gaps < self._config.unknown_clearance_m) & (from_robot > PLACE_RADIUS_M))
        if beside.size:
            trimmed = trimmed.up_to(int(beside[0]))
        if not len(trimmed.points):
            return None
        trimmed = self._clear_of_kerbs(terrain, self._out_of_passage(path, trimmed, unknown))
        trimmed, is_in_line = self._up_to_passage(T_map_base, path, trimmed)
        is_near = math.dist(frontier.xyz[:2], T_map_base[:2, 3]) <= NEAR_M
        is_entry = path.leads_on_straight(trimmed) and not is_in_line
        return trimmed if is_near or is_entry or trimmed.length_m >= _LEAST_WAY_M else None

    def distance_m(self, frontier: Frontier, looks: int) -> float:
        """How far from a frontier a path to it ends, for the `looks` + 1st look."""
        first = self._config.edge_trim_m if frontier.potential_cliff else self._trim_m
        return max(self._config.min_trim_m, first * self._config.closer_factor**looks)

    def goal_of(
        self, trimmed: Path, path: Path, terrain: Terrain, T_map_base: Transform, frontier: Frontier
    ) -> tuple[float, float, float, float]:
        """(x, y, z, yaw) in map at the end of a `trimmed` path; the robot counts as sent there from now on."""
        x, y, z = (float(v) for v in trimmed.points[-1])
        is_entry = path.leads_on_straight(trimmed)
        self._entry = (x, y) if is_entry else None
        target = path.points[len(trimmed.points)] if is_entry else np.asarray(frontier.xyz)
        return x, y, z, self._yaw(terrain, T_map_base, trimmed.points, target)

    def towards(self, path: Path, T_map_base: Transform, yaw: float) -> tuple[Path, float, bool]:
        """The part of a path to a given goal that is driven before the next sweep, the heading at its end, and whether it is all of it.

        It ends where a passage begins, unless the robot stands there in line.
        """
        part, _ = self._up_to_passage(T_map_base, path, path)
        if not path.leads_on_straight(part):
            self._entry = None
            return part, yaw, True
        end = part.points[-1]
        self._entry = (float(end[0]), float(end[1]))
        return part, facing_yaw(end, path.points[len(part.points)]), False

    def _up_to_passage(self, T_map_base: Transform, path: Path, trimmed: Path) -> tuple[Path, bool]:
        """A path up to where its first passage begins, unless the robot stands there in line: which it does, is told too.

        There a sweep tells where the robot is: odometry that slipped in turns is off by more than a door leaves at the sides.
        """
        is_in_line = False
        for first in path.entries():
            if first >= len(trimmed.points):
                break
            is_inside = first == 0  # so paths begin whose robot stands in a passage
            if not is_inside and not self._is_at_entry(T_map_base, path.points[first : first + 2]):
                return path.up_to(first + 1), is_in_line
            is_in_line = True
        return trimmed, is_in_line

    def _is_at_entry(self, T_map_base: Transform, line: NDArray[np.float64]) -> bool:
        """Whether the robot stands where a line (2, 3) begins and looks along it, or was sent there already and could not turn more."""
        here = T_map_base[:2, 3]
        is_aligned = abs(angle_difference(facing_yaw(line[0], line[1]), yaw_of(T_map_base))) <= _ENTRY_RAD
        was_sent = self._entry is not None and math.dist(self._entry, here) <= _ENTRY_M
        return math.dist(line[0, :2], here) <= _ENTRY_M and (is_aligned or was_sent)

    def _out_of_passage(self, path: Path, trimmed: Path, unknown: cKDTree) -> Path:
        """A path that ends inside of a passage goes on to where the robot can turn, if that is known all around, or ends before it."""
        if not trimmed.ends_inside(len(trimmed.points) - 1):
            return trimmed
        whole = path.to_the_end_of_passage(len(trimmed.points) - 1)
        beyond = whole.points[len(trimmed.points) - 1 :]
        is_known = unknown.query(beyond)[0] >= [*[self._config.unknown_clearance_m] * (len(beyond) - 1), self._config.min_trim_m]
        return whole if is_known.all() else trimmed.outside_passages()

    def _clear_of_kerbs(self, terrain: Terrain, path: Path) -> Path:
        """The path up to the last place where wheels may turn, unless that is far back, or no way to go is left."""
        places = [terrain.surface_near(point) for point in path.points]
        clear = [i for i, node in enumerate(places) if node is not None and not terrain.near_kerb[node] and not path.ends_inside(i)]
        if not clear:
            return path
        shorter = path.up_to(clear[-1] + 1)
        is_better = shorter.length_m >= max(_LEAST_WAY_M, path.length_m - self._config.most_back_m)
        return shorter if is_better else path

    def _yaw(self, terrain: Terrain, T_map_base: Transform, points: NDArray[np.float64], frontier_xyz: NDArray[np.float64]) -> float:
        """Faces what it is to look at; on a slope as the path arrives: wheels slip when they turn there, and a sweep looks all around."""
        if math.hypot(frontier_xyz[0] - points[-1, 0], frontier_xyz[1] - points[-1, 1]) <= 1e-6:
            return yaw_of(T_map_base)
        slope = terrain.slope_near(points[-1])
        if len(points) < 2 or slope is None or slope <= self._config.turn_slope_rad:
            return facing_yaw(points[-1], frontier_xyz)
        return facing_yaw(points[max(-4, -len(points))], points[-1])
