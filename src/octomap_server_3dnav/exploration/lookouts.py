"""Lookouts: places without room to turn from which something is to be seen, straight ways to them, and out of them again backwards.

Beside `passages`, for `exploration` when nothing else is left: a ramp whose head is too high to be seen from below, a dead end. A passage
leads on to room to turn; a lookout ends before floor that was not seen, and from there the robot sees whether it is a passage.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from octomap_server_3dnav.exploration.frontier_gain import unknown_area_m2
from octomap_server_3dnav.exploration.frontiers import FrontierConfig
from octomap_server_3dnav.navigation.passages import ASIDE_M, TerrainSettings, off_line, place_of, rest_from
from octomap_server_3dnav.navigation.straight_lines import (
    DIRECTIONS,
    Demand,
    Ground,
    KeptOff,
    centred_line,
    ground_of,
    is_covered,
    points_of,
    score_of,
)
from octomap_server_3dnav.octree.voxel_clusters import cluster_voxels
from octomap_server_3dnav.terrain.classified_terrain import Passage, Terrain, TerrainClass

_STARTS = 16  # nodes at the end of the ground from which ways back are tried
_LAST_M = 0.8  # how far from the floor that was not seen the ground may end
NEAR_END_M = 1.5 * _LAST_M  # and so near to its end what is looked at may be, for the ground is not level
SAME_STAND_M = 1.0  # from so near it looks the same
_FAR_INSIDE_M = 1.0  # from room to turn: nearer, the robot stands beside something
_FACING = 0.7  # cosine of the angle between a way and what it leads to
_IN_LINE = 0.985  # the same between a way and the robot in it
_FAR = 1e4  # voxels to where a direction points


@dataclass(frozen=True, eq=False)
class Lookout:
    """A place of unknown floor, its middle `xyz` in map and the ground in m2 that a look at it may show; and the straight way from where
    there is room to turn to where the ground before it ends: its `nodes`, and its `line` (K, 3) in map in metres. It may bend where it is
    not known which of the `voxels` that close it are ground. `is_stand`: it bends to its end, from where the floor is looked at."""

    xyz: tuple[float, float, float]
    gain_m2: float
    nodes: NDArray[np.int32]
    line: NDArray[np.float64]
    voxels: tuple[int, ...] = ()
    is_stand: bool = False

    @property
    def tried_at(self) -> tuple[float, float, float]:
        """The place under which looks and failures are kept."""
        x, y, z = (float(v) for v in self.line[-1])
        return (x, y, z) if self.is_stand else self.xyz

    def way_in(self, trim_m: float) -> Passage | None:
        """The way up to `trim_m` before its end, or to where it `is_stand`; None where nothing is left."""
        if self.is_stand:
            return Passage((int(self.nodes[0]), int(self.nodes[-1])), self.line)
        left = np.hypot(*(self.line[-1, :2] - self.line[:, :2]).T)
        last = int(np.count_nonzero(left >= trim_m)) - 1
        return Passage((int(self.nodes[0]), int(self.nodes[last])), self.line[: last + 1]) if last > 0 else None

    def still_in(self, terrain: Terrain) -> "Lookout | None":
        """The same in a later terrain; None where its way is not passable any more, or nothing is unknown near its end."""
        nodes = [terrain.surface_near(point) for point in self.line]
        places = [node for node in nodes if node is not None and (terrain.narrow[node] or terrain.label[node] == TerrainClass.TRAVERSABLE)]
        away = np.linalg.norm(terrain.centers(terrain.frontiers()) - self.line[-1], axis=1)
        is_left = len(places) == len(nodes) and (away <= NEAR_END_M).any()
        return replace(self, nodes=np.array(places, dtype=np.int32)) if is_left else None

    def is_seen_from(self, terrain: Terrain, trim_m: float) -> bool:
        """Whether the robot stands as near to the end of the way, in it, as where it would be sent to."""
        place = place_of(terrain)
        is_in_line = bool(off_line(self.line, place).min() <= ASIDE_M)
        return terrain.is_inside and is_in_line and math.dist(self.line[-1, :2], place[:2]) <= trim_m + ASIDE_M


class WayOut:
    """Remembers how the robot went to a lookout, where it cannot turn, and knows its way out for as long as it is there.

    Of a robot that it has not seen go in, as after a restart, it takes the way that lies in its line.
    """

    def __init__(self, settings: TerrainSettings) -> None:
        self._settings = settings
        self._way_in: Passage | None = None
        self._stands: list[tuple[float, float, float]] = []
        self.is_leaving = False

    def notice(self, terrain: Terrain, yaw: float) -> None:
        """After every sweep: where the robot can turn it is out; where it cannot it has looked. `yaw` is its heading in map."""
        if self._way_in is None and _is_far_inside(terrain):
            self._way_in = _way_in_line(terrain, yaw, self._settings)
        if terrain.start is not None and self._way_in is not None:
            if terrain.is_inside:
                self._stands.append(terrain.robot_xyz)
            else:
                self._way_in, self.is_leaving = None, False

    def has_looked_from(self, xyz: NDArray[np.float64]) -> bool:
        """Whether the robot looked from beside a place (3,) in an earlier visit."""
        return self._way_in is None and any(math.dist(xyz, stand) <= SAME_STAND_M for stand in self._stands)

    def enter(self, way: Passage, terrain: Terrain) -> None:
        """The robot is sent along a way to a lookout now. One that is inside already goes on, and knows its way out by where it came in."""
        known = self.from_inside(terrain)
        if known is not None and terrain.start is not None:
            ahead = rest_from(way, place_of(terrain), terrain.start)
            way = Passage(way.nodes, np.concatenate([known[::-1], way.line[:0] if ahead is None else _on_from(known[0], ahead.line)]))
        self._way_in = way

    def from_inside(self, terrain: Terrain) -> NDArray[np.float64] | None:
        """(K, 3) the line out, from where the robot stands; None where it can turn, and is not inside any more."""
        if self._way_in is None or terrain.start is None or not terrain.is_inside:
            return None
        rest = rest_from(self._way_in.turned(), place_of(terrain), terrain.start)
        return None if rest is None else rest.line

    def added_to(self, terrain: Terrain) -> Terrain:
        """The terrain with the way out as a passage, where it leads to ground that counts as reached."""
        line = self.from_inside(terrain) if not terrain.is_in_passage else None
        entry = None if line is None else terrain.surface_near(line[-1])
        if line is None or entry is None or terrain.label[entry] != TerrainClass.TRAVERSABLE or not terrain.reached[entry]:
            return terrain
        assert terrain.start is not None
        return replace(terrain, passages=(*terrain.passages, Passage((terrain.start, entry), line)))


def _on_from(place: NDArray[np.float64], line: NDArray[np.float64]) -> NDArray[np.float64]:
    """A line (K, 3) without its first points that a robot at a place (3,) would have to go back to."""
    steps = np.diff(line[:, :2], axis=0)
    is_ahead = ((line[:-1, :2] - place[:2]) * steps).sum(axis=1) > 0.0
    return line[int(np.argmax(np.append(is_ahead, True))) :]


def _is_far_inside(terrain: Terrain) -> bool:
    """Whether the robot stands where it cannot turn, in no passage, and not only beside something."""
    if not terrain.is_inside or terrain.departure is None or terrain.is_in_passage:
        return False
    return math.dist(terrain.centers(np.array([terrain.departure]))[0, :2], terrain.robot_xyz[:2]) > _FAR_INSIDE_M


@njit(cache=True)
def _best_way(g: Any, b: Any, demand: Any, starts: Any, towards: Any, facing: Any, directions: Any, longest: Any) -> Any:
    """The line with the most room that leads to any of the nodes `starts` and as near as it gets to x, y of `towards`: its nodes, x, y of
    the last, dx, dy; no nodes where the robot fits along none."""
    ahead, behind = np.empty(1, np.int32), np.empty(longest, np.int32)
    best, best_at, best_score = behind[:0].copy(), (0.0, 0.0, 1.0, 0.0), -np.inf
    for s in starts:
        ax, ay = towards[0] - g.column[s] // g.ny - 0.5, towards[1] - g.column[s] % g.ny - 0.5
        for k in range(2 * directions):
            dx, dy = np.cos(np.pi * k / directions), np.sin(np.pi * k / directions)
            if ax * dx + ay * dy < facing * np.hypot(ax, ay):
                continue
            line, before, x, y, room = centred_line(g, b, demand, s, (dx, dy), False, (ahead, behind))
            score = score_of(room, np.hypot(towards[0] - x, towards[1] - y))
            is_better = line.size > 0 and room >= 0 and score > best_score
            if is_better and is_covered(g, demand, (x, y), (dx, dy), line, -before):
                best, best_at, best_score = line, (x, y, dx, dy), score
    return best, best_at


def _ground_of(terrain: Terrain) -> Ground:
    """The surface of a terrain; all its reached traversable ground is one piece."""
    is_open = (terrain.label == TerrainClass.TRAVERSABLE) & terrain.reached
    return ground_of(terrain, np.where(is_open[: terrain.surface_count], 0, -1).astype(np.int32))


def unreached_floor(terrain: Terrain, of: FrontierConfig) -> list[tuple[NDArray[np.int64], int, float]]:
    """Unknown floor that no reached ground lies beside, of which a look may show `of.least_lookout_gain_m2`: nodes, middle, that."""
    unknown = terrain.frontiers()
    if not unknown.size:
        return []
    xyz = terrain.centers(unknown).astype(np.float64)
    cluster = cluster_voxels(np.stack([terrain.ix, terrain.iy, terrain.z], axis=1)[unknown])
    found = []
    for number in range(int(cluster.max()) + 1):
        members = np.flatnonzero(cluster == number)
        if members.size < of.min_voxels or terrain.reached[unknown[members]].any():
            continue
        middle = members[np.argmin(np.linalg.norm(xyz[members] - xyz[members].mean(axis=0), axis=1))]
        gain = float(unknown_area_m2(terrain, unknown[middle : middle + 1], of.gain_radius_m)[0])
        if gain >= of.least_lookout_gain_m2:
            found.append((unknown[members], int(unknown[middle]), gain))
    return found


def find_lookouts(terrain: Terrain, of: FrontierConfig, settings: TerrainSettings) -> list[Lookout]:
    """The lookouts at unknown floor of which a look may show `of.least_lookout_gain_m2`, the one that may show most first."""
    if terrain.departure is None or not terrain.narrow.any():
        return []
    ground, demand = _ground_of(terrain), Demand.of(settings.passages, settings.robot, terrain.resolution)
    kept_off = KeptOff.of(terrain, settings.robot)
    ends = np.flatnonzero(ground.passable & (ground.piece < 0))
    tree = cKDTree(terrain.centers(ends))
    found = []
    for members, middle, gain in unreached_floor(terrain, of):
        xyz = terrain.centers(members).astype(np.float64)
        near = np.unique(np.concatenate(tree.query_ball_point(xyz, NEAR_END_M)).astype(np.int64))
        line, points = _line_to(terrain, (ground, kept_off, demand), ends[near], xyz)
        if line.size:
            x, y, z = terrain.centers(np.array([middle]))[0].astype(np.float64).tolist()
            found.append(Lookout((x, y, z), gain, line, points))
    return sorted(found, key=lambda lookout: (-round(lookout.gain_m2, 6), lookout.xyz))


def _way_in_line(terrain: Terrain, yaw: float, settings: TerrainSettings) -> Passage | None:
    """The straight way from where there is room to turn to the robot, from before or behind it; None where there is no such way."""
    assert terrain.start is not None
    ground, demand = _ground_of(terrain), Demand.of(settings.passages, settings.robot, terrain.resolution)
    x, y = np.array(terrain.robot_xyz[:2]) / terrain.resolution - terrain.window_key
    kept_off = KeptOff.of(terrain, settings.robot)
    around, starts = kept_off.around(float(x), float(y), float(demand.longest_line)), np.array([terrain.start])
    found = []
    for towards in (yaw, yaw + math.pi):
        ahead = np.array([x + _FAR * math.cos(towards), y + _FAR * math.sin(towards)])
        line, (x0, y0, dx, dy) = _best_way(ground, around, demand, starts, ahead, _IN_LINE, DIRECTIONS, demand.longest_line)
        if line.size:
            points = points_of(ground, line, (x0, y0), (dx, dy), line.size - 1, terrain.window_key, terrain.resolution)
            found.append(Passage((int(line[0]), int(line[-1])), points))
    return min(found, key=lambda way: len(way.line)) if found else None


def _line_to(
    terrain: Terrain, of: tuple[Ground, KeptOff, Demand], ends: NDArray[np.int64], unknown: NDArray[np.float64]
) -> tuple[NDArray[np.int32], NDArray[np.float64]]:
    """Nodes and points of the way to one of the nodes `ends` before unknown floor (M, 3); none where there is no such way."""
    ground, kept_off, demand = of
    off = terrain.centers(ends)[:, None].astype(np.float64) - unknown
    away = np.where(np.abs(off[..., 2]) > _LAST_M, np.inf, np.hypot(off[..., 0], off[..., 1])).min(axis=1, initial=np.inf)
    near = np.flatnonzero(away <= _LAST_M)
    if not near.size:
        return np.empty(0, dtype=np.int32), np.empty((0, 3))
    starts = ends[near[np.argsort(away[near], kind="stable")][np.unique(np.linspace(0, near.size - 1, _STARTS).astype(np.int64))]]
    towards = unknown.mean(axis=0)[:2] / terrain.resolution - terrain.window_key
    reach = demand.longest_line + float(np.ptp(unknown[:, :2])) / terrain.resolution
    around = kept_off.around(float(towards[0]), float(towards[1]), reach)
    line, (x, y, dx, dy) = _best_way(ground, around, demand, starts, towards, _FACING, DIRECTIONS, demand.longest_line)
    return line, points_of(ground, line, (x, y), (dx, dy), line.size - 1, terrain.window_key, terrain.resolution)
