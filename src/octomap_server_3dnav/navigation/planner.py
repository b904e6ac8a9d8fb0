"""Paths on the navigation graph (thesis 5.5.1, 6.2.2): A*, shortcuts over the surface, trimming before the frontier.

After a frontier was chosen, before the path goes to move_base. The search moves over the four edges of a voxel and over a diagonal whose
both corners are open; inflated voxels cost infinity, but on the way out of the inflation when the robot stands in it.
"""

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.passages import is_along, place_of, rest_from
from octomap_server_3dnav.navigation.path_search import Ways, cheapest_way, distances
from octomap_server_3dnav.navigation.shortcuts import resampled, straightened
from octomap_server_3dnav.navigation.storey import STOREY_M
from octomap_server_3dnav.terrain.classified_terrain import Passage, Terrain, TerrainClass
from rigid_geometry import legs_of
from stage_config import check_ranges, parameter

_NEAR_NODES = 50_000  # that are searched for the cheapest path: 320 m2 of ground at 8 cm
_NOT_KNOWN = np.empty(0)  # what is left to the goal
_ESCAPE_COST = 5.0  # cost factor of inflated ground on the way out of it
_FAR_M = 30.0  # to goals that lie farther off along an axis, or far round, a path need not be the cheapest
_FAR_WEIGHT = 1.2  # such a path costs at most so many times as much, and is found sooner
WAYPOINT_SPACING_M = 0.15  # distance between the points of a path


@dataclass(frozen=True)
class PlannerConfig:
    """What a path costs and how it is handed on."""

    climb_weight: float = parameter(0.3, "-", "extra cost of a metre of height, up or down", low=0.0, high=50.0, at_runtime=True)
    passage_weight: float = parameter(
        5.0,
        "-",
        "cost factor of a metre straight through a passage without room to turn: other ground is looked at first",
        low=1.0,
        high=1e3,
        at_runtime=True,
    )
    trim_m: float = parameter(0.9, "m", "distance from the frontier at which a path ends", low=0.0, high=5.0, at_runtime=True)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)


@dataclass(frozen=True, eq=False)
class Path:
    """A path over the ground: points (K, 3) in map in metres, about evenly spaced, and its length over the ground.

    straight (K,) bool: whether from a point to the next one the path leads through a passage, without room to turn; None: nowhere.
    """

    points: NDArray[np.float64]
    straight: NDArray[np.bool_] | None = None

    def ends_inside(self, index: int) -> bool:
        """Whether point `index` lies inside of a passage, not at one of its ends."""
        return self.straight is not None and index > 0 and bool(self.straight[index - 1] and self.straight[index])

    def entries(self) -> list[int]:
        """Indices of the points where passages begin."""
        return [] if self.straight is None else np.flatnonzero(np.diff(self.straight.astype(int), prepend=0) == 1).tolist()

    def leads_on_straight(self, part: "Path") -> bool:
        """Whether a first `part` of this path ends where a passage begins, or in it."""
        last = len(part.points) - 1
        return self.straight is not None and last < len(self.points) - 1 and bool(self.straight[last])

    def up_to(self, count: int) -> "Path":
        """Its first `count` points."""
        return Path(self.points[:count], None if self.straight is None else self.straight[:count])

    def to_the_end_of_passage(self, index: int) -> "Path":
        """The path up to the end of the passage in which point `index` lies."""
        while self.ends_inside(index):
            index += 1
        return self.up_to(index + 1)

    def outside_passages(self) -> "Path":
        """The path up to its last point that does not lie inside of a passage."""
        last = len(self.points) - 1
        while last > 0 and self.ends_inside(last):
            last -= 1
        return self.up_to(last + 1)

    @property
    def length_m(self) -> float:
        """Length of the polyline."""
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def _passages(terrain: Terrain) -> list[Passage]:
    """Both ways of every passage; one that begins where the robot stands has only the way out."""
    return [way for p in terrain.passages for way in ((p,) if p.nodes[0] == terrain.start else (p, p.turned()))]


def _passage_costs(terrain: Terrain, config: PlannerConfig) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """(P, 2) nodes and (P,) cost in voxels of the ways through passages."""
    ways = _passages(terrain)
    nodes = np.array([way.nodes for way in ways], dtype=np.int64).reshape(-1, 2)
    lengths = [float(np.linalg.norm(np.diff(way.line, axis=0), axis=1).sum()) / terrain.resolution for way in ways]
    return nodes, np.array(lengths, dtype=np.float64) * config.passage_weight


def _ways(terrain: Terrain, cost: NDArray[np.float32], climb: float, config: PlannerConfig) -> Ways:
    return Ways(terrain.neighbours, terrain.ix, terrain.iy, terrain.z, cost, climb, *_passage_costs(terrain, config))


class _Distances:
    """What ways over the ground from a node to all others cost without its factors, of every terrain for the node asked for last."""

    def __init__(self) -> None:
        self._found: WeakKeyDictionary[Terrain, tuple[int, PlannerConfig, NDArray[np.float64]]] = WeakKeyDictionary()

    def known(self, terrain: Terrain, source: int, config: PlannerConfig) -> NDArray[np.float64] | None:
        """(N,) voxels, inf where no way leads; None where they were not asked for yet."""
        found = self._found.get(terrain)
        return found[2] if found is not None and found[:2] == (source, config) else None

    def of(self, terrain: Terrain, source: int, config: PlannerConfig) -> NDArray[np.float64]:
        """The same, found where they are not known."""
        total = self.known(terrain, source, config)
        if total is None:
            plain = np.where(np.isfinite(terrain.cost), np.float32(1.0), np.float32(np.inf))
            total = distances(_ways(terrain, plain, 0.0, config), source)
            self._found[terrain] = (source, config, total)
        return total


_distances = _Distances()


def _nodes_between(terrain: Terrain, cost: NDArray[np.float32], source: int, goal: int, config: PlannerConfig) -> NDArray[np.int64] | None:
    """The nodes of the cheapest path. It is looked for from the goal: the ground there is often dear, as beside what was not seen, and from
    the other end all cheap ground would be tried before.

    What is left to the source is known over the ground where that was asked for before, and else as long as it takes as the crow flies.
    """
    ways, most = _ways(terrain, cost, config.climb_weight, config), terrain.label.size + 1
    if not math.isfinite(cost[source]):  # in a passage, from where only links lead on
        chain, _ = cheapest_way(ways, source, goal, 1.0, _NOT_KNOWN, most)
        return chain if chain.size else None
    is_plain, back = cost is terrain.cost, ways._replace(links=np.ascontiguousarray(ways.links[:, ::-1]))
    left = _distances.known(terrain, source, config) if is_plain else None
    apart = np.ptp(terrain.centers(np.array([source, goal])), axis=0).max() if left is None else left[goal] * terrain.resolution
    if not math.isfinite(apart):
        return None
    near, weight = _NEAR_NODES if is_plain else most, _FAR_WEIGHT if apart > _FAR_M else 1.0
    chain, is_far_round = cheapest_way(back, goal, source, weight, _NOT_KNOWN if left is None else left, near)
    if is_far_round:
        chain, _ = cheapest_way(back, goal, source, _FAR_WEIGHT, _distances.of(terrain, source, config), most)
    return np.ascontiguousarray(chain[::-1]) if chain.size else None


def _escape_cost(terrain: Terrain) -> NDArray[np.float32]:
    """Costs with a finite price on inflated ground, for the way out of it; obstacles and cliffs stay closed."""
    return np.where(terrain.label == TerrainClass.INFLATION, np.float32(_ESCAPE_COST), terrain.cost)


def _source(terrain: Terrain) -> int | None:
    """Where paths of the robot begin: the departure, or where it stands when that is inside of a passage."""
    return terrain.start if terrain.is_in_passage else terrain.departure


def distances_over_ground(terrain: Terrain, config: PlannerConfig) -> NDArray[np.float64]:
    """(N,) length in metres of the cheapest way from the robot to every node, as cost without its factors; inf where there is none.

    The way out of the inflation, if the robot stands in it, counts as straight. Passages keep their factor.
    """
    source = _source(terrain)
    if source is None:
        return np.full(terrain.label.size, np.inf)
    total = _distances.of(terrain, source, config).copy()
    if not math.isfinite(terrain.cost[source]):
        total[source] = math.inf  # a place in a passage is no place to look from
    centers = terrain.centers(np.array([source]))[0]
    return np.asarray(total * terrain.resolution + math.dist(centers[:2], terrain.robot_xyz[:2]))


def nearest_traversable(terrain: Terrain, xyz: tuple[float, float, float], tolerance_m: float) -> int | None:
    """The traversable node that the robot can reach nearest to a point in map; None when none lies within `tolerance_m`.

    A height that is NaN is not known: of the storeys there it is the one nearest to the robot's own height.
    """
    nodes = np.flatnonzero(terrain.reached & (terrain.label == TerrainClass.TRAVERSABLE))
    if not nodes.size:
        return None
    off = terrain.centers(nodes) - np.asarray(xyz, dtype=np.float32)
    if math.isnan(xyz[2]):
        gaps = np.hypot(off[:, 0], off[:, 1])
        near = np.flatnonzero(gaps <= gaps.min() + terrain.resolution)
        aside = np.abs(terrain.z[nodes[near]] * terrain.resolution - terrain.robot_xyz[2])
        near = near[aside <= aside.min() + STOREY_M]
        best = int(near[np.argmin(gaps[near])])
    else:
        gaps = np.linalg.norm(off, axis=1)
        best = int(np.argmin(gaps))
    return int(nodes[best]) if gaps[best] <= max(tolerance_m, terrain.resolution) else None


def plan_path(terrain: Terrain, goal_node: int, config: PlannerConfig, start_node: int | None = None) -> Path | None:
    """The cheapest path from the robot (or `start_node`) to a traversable node, or None when there is none.

    A robot that stands in the inflation first leaves it by the cheapest way over inflated ground, never over an obstacle or a cliff.
    ValueError when a node index does not exist. Thesis 5.5.1 (A* with the straight distance as heuristic).
    """
    for node in (goal_node, start_node):
        if node is not None and not 0 <= node < terrain.label.size:
            raise ValueError(f"node {node} is none of the terrain's {terrain.label.size} nodes")
    source = terrain.start if start_node is None else start_node
    if source is None or terrain.departure is None or not math.isfinite(terrain.cost[goal_node]):
        return None
    way_out = None
    if not math.isfinite(terrain.cost[source]) and source != _source(terrain):
        cost = _escape_cost(terrain)
        way_out = _nodes_between(terrain, cost, source, terrain.departure, config)
        if way_out is None:
            return None
        source = terrain.departure
    nodes = _nodes_between(terrain, terrain.cost, source, goal_node, config)
    if nodes is None:
        return None
    parts = _parts(terrain, terrain.cost, nodes, config)
    if way_out is not None:
        parts[0] = (
            np.concatenate([straightened(terrain, _ways(terrain, cost, config.climb_weight, config), way_out), parts[0][0][1:]]),
            False,
        )
    return _joined(parts, WAYPOINT_SPACING_M)


def plan_into(terrain: Terrain, way: Passage, yaw: float, config: PlannerConfig) -> Path | None:
    """The cheapest path to the first node of a way that need not be one of the terrain's passages, and straight along it to its end.

    For a robot of heading `yaw` in map that stands in the way already, where it cannot turn or looks along it, what is left of it.
    """
    start = terrain.start
    rest = rest_from(way, place_of(terrain), start) if start is not None else None
    if rest is not None and (terrain.is_inside or is_along(rest, yaw)):
        return straight_path(rest.line)
    path, along = plan_path(terrain, way.nodes[0], config), straight_path(way.line)
    if path is None or along.straight is None:
        return None
    straight = np.zeros(len(path.points), dtype=bool) if path.straight is None else path.straight
    return Path(np.concatenate([path.points, along.points]), np.concatenate([straight, along.straight]))


def straight_path(line: NDArray[np.float64]) -> Path:
    """Straight along the legs of a line (K, 3), where the robot cannot turn."""
    points = _resampled_legs(line, WAYPOINT_SPACING_M)
    return Path(points, np.arange(len(points)) < len(points) - 1)


def _resampled_legs(line: NDArray[np.float64], spacing_m: float) -> NDArray[np.float64]:
    """Evenly spaced points on every leg of a line; its corners are kept."""
    legs = [resampled(line[first : last + 1], spacing_m) for first, last in legs_of(line)]
    return np.concatenate([legs[0], *(leg[1:] for leg in legs[1:])]) if legs else line[:1]


def _parts(
    terrain: Terrain, cost: NDArray[np.float32], chain: NDArray[np.int64], config: PlannerConfig
) -> list[tuple[NDArray[np.float64], bool]]:
    """The corners of what lies before, in and after every passage of a chain of nodes, and whether it is one."""
    ways, passages = _ways(terrain, cost, config.climb_weight, config), {way.nodes: way.line for way in _passages(terrain)}
    lines = [(i, passages[key]) for i in range(len(chain) - 1) if (key := (int(chain[i]), int(chain[i + 1]))) in passages]
    parts, begin = [], 0
    for i, line in lines:
        if i > 0 or math.isfinite(cost[chain[0]]):  # else the robot stands in a passage, which begins at its side
            parts.append((straightened(terrain, ways, chain[begin : i + 1]), False))
        parts.append((line, True))
        begin = i + 1
    return [*parts, (straightened(terrain, ways, chain[begin:]), False)]


def _joined(parts: list[tuple[NDArray[np.float64], bool]], spacing_m: float) -> Path:
    """One path of parts, each evenly spaced; between the passages it begins and ends at theirs, so that they stay straight."""
    points, straight = [], [np.zeros(0, dtype=bool)]
    for i, (corners, is_passage) in enumerate(parts):
        if not is_passage:
            before, after = (parts[j][0] if 0 <= j < len(parts) else np.empty((0, 3)) for j in (i - 1, i + 1))
            corners = np.concatenate([before[-1:], corners, after[:1]])
        even = _resampled_legs(corners, spacing_m) if is_passage else resampled(corners, spacing_m)
        points.append(even[1:] if i else even)
        straight.append(np.full(len(even) - 1, is_passage))
    return Path(np.concatenate(points), np.concatenate([*straight, np.zeros(1, dtype=bool)]))


def trim_path(path: Path, frontier_xyz: NDArray[np.floating], distance_m: float) -> Path:
    """The path up to its last point that is at least `distance_m` from the frontier, seen from above; its first point when none is."""
    gap = np.hypot(path.points[:, 0] - frontier_xyz[0], path.points[:, 1] - frontier_xyz[1])
    far = np.flatnonzero(gap >= distance_m - 1e-6)
    return path.up_to((int(far[-1]) if far.size else 0) + 1)
