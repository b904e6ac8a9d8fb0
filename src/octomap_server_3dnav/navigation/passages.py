"""Passages: straight ways through where the robot fits but cannot turn, from one place with room to turn to another.

After `terrain.classify`, of a finished terrain. A passage is looked for only where inflated ground parts two pieces of traversable
ground: a door, a ramp with a drop on both sides. Its middle line is chosen so that the nearest barriers on its left and right are
equally far, and what the outline sweeps along it must be ground. At both ends the line goes on for a run-up over traversable ground.
What no such line leads to may be reached by a way that bends (`bends`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from map_zones import NO_ZONES, Zones
from octomap_server_3dnav.navigation.bends import NO_WAY, Way, find_bend, find_bend_to
from octomap_server_3dnav.navigation.outline_search import Around, Outline
from octomap_server_3dnav.navigation.storey import STOREY_M
from octomap_server_3dnav.navigation.straight_lines import (
    DIRECTIONS,
    Demand,
    Ground,
    KeptOff,
    PassageConfig,
    centred_line,
    ground_of,
    is_covered,
    points_of,
    score_of,
)
from octomap_server_3dnav.octree.column_runs import ColumnRuns
from octomap_server_3dnav.octree.surface_heights import SurfaceHeights
from octomap_server_3dnav.terrain.classified_terrain import TRAVERSABLE, UNREACHED, Passage, Terrain, TerrainClass
from octomap_server_3dnav.terrain.classify import classify
from octomap_server_3dnav.terrain.config import TerrainConfig
from octomap_server_3dnav.terrain.flood import components
from rigid_geometry import angle_difference, legs_of, yaw_of
from rigid_geometry.transforms import Transform
from robot_body import RobotBody

_STARTS = 9  # nodes across it from which they are tried
_ALONG_RAD = 0.35
ASIDE_M = 0.2  # a robot so near to the line of a passage stands in it


@dataclass(frozen=True)
class TerrainSettings:
    """What a terrain is made for: the robot, how carefully the map is read, where it may drive, and where only straight."""

    robot: RobotBody = field(default_factory=RobotBody)
    terrain: TerrainConfig = field(default_factory=TerrainConfig)
    passages: PassageConfig = field(default_factory=PassageConfig)
    zones: Zones = NO_ZONES

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return self.robot.validate() + self.terrain.validate() + self.passages.validate() + self.zones.problems()


def navigable_terrain(
    runs: ColumnRuns, T_map_base: Transform, settings: TerrainSettings, radius_m: float | None, heights: SurfaceHeights | None = None
) -> Terrain:
    """What `classify` finds, with its passages."""
    terrain = classify(runs, T_map_base, settings.terrain, settings.robot, radius_m, heights, settings.zones)
    terrain = replace(terrain, zones=settings.zones) if settings.zones.are_set else terrain
    return with_passages(terrain, yaw_of(T_map_base), settings)


def is_along(passage: Passage, yaw: float) -> bool:
    """Whether a robot of this heading in map looks along the first leg of a passage."""
    first, last = legs_of(passage.line)[0]
    dx, dy = passage.line[last, :2] - passage.line[first, :2]
    return abs(angle_difference(math.atan2(dy, dx), yaw)) <= _ALONG_RAD


def rest_from(passage: Passage, place: tuple[float, float, float], node: int) -> Passage | None:
    """What is left of a passage for a robot at `node`, on the ground at a place (3,) in map; None when it does not stand in it.

    Nor in one of another storey, above it or below.
    """
    off = off_line(passage.line, place)
    at = int(np.argmin(off))
    return Passage((node, passage.nodes[1]), passage.line[at:]) if off[at] <= ASIDE_M and at < len(passage.line) - 1 else None


def off_line(line: NDArray[np.float64], place: tuple[float, float, float]) -> NDArray[np.float64]:
    """(K,) how far a place (3,) is beside the points of a line (K, 3) on its storey; inf of others."""
    off = np.hypot(line[:, 0] - place[0], line[:, 1] - place[1])
    return np.where(np.abs(line[:, 2] - place[2]) < STOREY_M, off, math.inf)


def place_of(terrain: Terrain) -> tuple[float, float, float]:
    """Where the robot stands on the ground, in map; where none is known there, its base_link."""
    x, y, z = terrain.robot_xyz
    return x, y, z if terrain.start is None else float(terrain.centers(np.array([terrain.start]))[0, 2])


@njit(cache=True)
def _best_line(g: Any, b: Any, demand: Any, starts: Any, directions: Any, longest: Any) -> Any:
    """The line with the most room through any of the nodes `starts`: its nodes, how many come before x, y, then x, y, dx, dy; no nodes
    where the robot fits along none."""
    ahead, behind = np.empty(longest, np.int32), np.empty(longest, np.int32)
    best, best_before, best_at, best_score = ahead[:0].copy(), 0, (0.0, 0.0, 1.0, 0.0), -np.inf
    for s in starts:
        for k in range(directions):
            dx, dy = np.cos(np.pi * k / directions), np.sin(np.pi * k / directions)
            line, before, x, y, room = centred_line(g, b, demand, s, (dx, dy), True, (ahead, behind))
            score = score_of(room, np.sum(g.piece[line] < 0) / max(abs(dx), abs(dy)))
            is_better = line.size > 0 and room >= 0 and score > best_score
            if is_better and is_covered(g, demand, (x, y), (dx, dy), line, -before):
                best, best_before, best_at, best_score = line, before, (x, y, dx, dy), score
    return best, best_before, best_at


@njit(cache=True)
def _necks(g: Any) -> Any:
    """(N,) bool nodes that are as far from one piece as from another, over ground where the middle of the robot fits."""
    owner, queue = g.piece.copy(), np.empty(g.piece.size, np.int32)
    neck = np.zeros(g.piece.size, np.bool_)
    seeds = np.flatnonzero(owner >= 0)
    queue[: seeds.size] = seeds
    head, tail = 0, seeds.size
    while head < tail:
        s = queue[head]
        head += 1
        for k in range(4):
            n = g.graph[s, k]
            if n < 0 or not g.passable[n]:
                continue
            if owner[n] < 0:
                owner[n] = owner[s]
                queue[tail] = n
                tail += 1
            elif owner[n] != owner[s]:
                neck[s] = True
    return neck


def _find_passages(terrain: Terrain, ground: Ground, kept_off: KeptOff, demand: Demand) -> list[Passage]:
    """The best passage at every neck between two pieces of turning room, one way each."""
    neck = np.where(_necks(ground), np.uint8(TRAVERSABLE), np.uint8(UNREACHED))
    if not (neck == TRAVERSABLE).any():
        return []
    group, _ = components(neck, ground.graph, 0, neck.size + 1)
    longest, found = demand.longest_line, []
    for number in range(int(group.max()) + 1):
        members = np.flatnonzero(group == number)
        starts = members[np.unique(np.linspace(0, members.size - 1, _STARTS).astype(np.int64))]
        x, y = ground.column[starts] // ground.ny + 0.5, ground.column[starts] % ground.ny + 0.5
        near = kept_off.around(float(x.mean()), float(y.mean()), longest + float(np.ptp(x) + np.ptp(y)))
        line, before, (x0, y0, dx, dy) = _best_line(ground, near, demand, starts, DIRECTIONS, longest)
        if line.size:
            points = points_of(ground, line, (x0, y0), (dx, dy), before, terrain.window_key, terrain.resolution)
            found.append(Passage((int(line[0]), int(line[-1])), points))
    return found


def _pieces(terrain: Terrain, least: int) -> tuple[NDArray[np.int32], int]:
    """(N,) number of the piece of traversable ground of each surface node, -1 in none, and how many there are; small ones do not count but
    that of the departure, which is number 0."""
    label, graph = terrain.label[: terrain.surface_count], terrain.neighbours[: terrain.surface_count]
    assert terrain.departure is not None
    piece, sizes = components(label, graph, terrain.departure, label.size + 1)
    large = np.append(sizes >= least, False)
    large[0] = True
    return np.where(large[piece], piece, -1).astype(np.int32), int(np.count_nonzero(large))


def _connected(passages: Sequence[Passage], piece: NDArray[np.int32], first: int) -> NDArray[np.bool_]:
    """(P,) pieces that passages lead to from the piece `first`, and that itself."""
    reached, ends = {first}, [tuple(int(piece[n]) for n in p.nodes) for p in passages]
    for _ in passages:
        for a, b in ends:
            reached |= {a, b} if a in reached or b in reached else set()
    return np.isin(np.arange(piece.max() + 1), list(reached))


def _passage(terrain: Terrain, way: Way) -> Passage:
    nodes, x, y = way
    xy = np.column_stack([x, y]) + terrain.window_key
    return Passage((int(nodes[0]), int(nodes[-1])), np.column_stack([xy, terrain.z[nodes] + 0.5]) * terrain.resolution)


def _bends(terrain: Terrain, ground: Ground, kept_off: KeptOff, outline: Outline, passages: Sequence[Passage]) -> list[Passage]:
    """Ways that bend to the pieces that no passages lead to."""
    assert terrain.departure is not None
    around, first = Around.of(kept_off, terrain.columns.nx, terrain.columns.ny), int(ground.piece[terrain.departure])
    found: list[Passage] = []
    while True:
        nodes, x, y = find_bend(ground, around, outline, _connected([*passages, *found], ground.piece, first))
        if not nodes.size:
            return found
        found.append(_passage(terrain, (nodes, x, y)))


def ways_if_floor(terrain: Terrain, settings: TerrainSettings) -> list[tuple[Passage, NDArray[np.int64]]]:
    """The ways that there would be to ground that none leads to, if floor that was not seen is ground; each with that floor's nodes."""
    if terrain.departure is None or not terrain.narrow.any() or not settings.passages.enabled:
        return []
    robot, resolution, unknown = settings.robot, terrain.resolution, terrain.frontiers()
    piece, _ = _pieces(terrain, settings.terrain.min_ground_voxels)
    outline = Outline.of(settings.passages, robot, resolution, over_unknown=True)
    kept_off = KeptOff.of(terrain, robot, unknown_too=False)
    places, found = terrain.centers(unknown).astype(np.float64), []
    for way in _bends(terrain, ground_of(terrain, piece), kept_off, outline, terrain.passages):
        under = under_outline(way.line, places, robot)
        if under.any():
            found.append((way, unknown[under]))
    return found


def ways_near(terrain: Terrain, settings: TerrainSettings, places: NDArray[np.float64], reach_m: float) -> list[Passage | None]:
    """For each of (K, 3) places in map the way that bends to the narrow ground nearest to it; None where none leads within `reach_m`."""
    if terrain.departure is None or not terrain.narrow.any() or not settings.passages.enabled:
        return [None] * len(places)
    piece, _ = _pieces(terrain, settings.terrain.min_ground_voxels)
    ground, kept_off = ground_of(terrain, piece), KeptOff.of(terrain, settings.robot)
    outline = Outline.of(settings.passages, settings.robot, terrain.resolution)
    around = Around.of(kept_off, terrain.columns.nx, terrain.columns.ny)
    connected = _connected(terrain.passages, piece, int(piece[terrain.departure]))
    centers, found = terrain.centers(slice(0, piece.size)), []
    for place in places:
        off, way = np.linalg.norm(centers - place, axis=1), NO_WAY
        nearest = off[ground.passable & (piece < 0)].min(initial=math.inf)
        for within in np.arange(nearest + terrain.resolution, reach_m, terrain.resolution):
            way = find_bend_to(ground, around, outline, connected, off <= within)
            if way[0].size:
                break
        found.append(_passage(terrain, way) if way[0].size else None)
    return found


def under_outline(line: NDArray[np.float64], places: NDArray[np.float64], robot: RobotBody) -> NDArray[np.bool_]:
    """(M,) which places (M, 3) the outline, with what it strays, passes over on a line on its level."""
    under = np.zeros(len(places), dtype=np.bool_)
    for first, last in legs_of(line):
        a, b = line[first], line[last]
        length = math.dist(a[:2], b[:2])
        along = (b - a)[:2] / max(length, 1e-9)
        off = places - a
        t, aside = off[:, :2] @ along, np.abs(off[:, 0] * along[1] - off[:, 1] * along[0])
        level = np.abs(places[:, 2] - np.interp(t, [0.0, length], [a[2], b[2]])) <= robot.standing_tolerance_m
        under |= (np.abs(t - length / 2) <= length / 2 + robot.half_length_m) & (aside <= robot.passage_cliff_radius_m) & level
    return under


def _narrow(terrain: Terrain, robot: RobotBody) -> NDArray[np.bool_]:
    """(N,) inflated ground over which the middle of a robot may be that drives straight, at least in a corner of the voxel."""
    least_m = robot.passage_radius_m - math.sqrt(0.5) * terrain.resolution
    return np.asarray((terrain.label == TerrainClass.INFLATION) & (terrain.distance_m > least_m))


def with_passages(terrain: Terrain, yaw: float, settings: TerrainSettings) -> Terrain:
    """The terrain with its passages, and with `reached` what they connect the departure with, for a robot that looks along `yaw`.

    A robot in a small place with room to turn departs from there, if a passage leads on.
    """
    if not settings.passages.enabled:
        return terrain
    terrain = replace(terrain, narrow=_narrow(terrain, settings.robot))
    if terrain.departure is None or not terrain.narrow.any():
        return terrain
    if terrain.start not in (None, terrain.departure) and not terrain.is_inside:
        here = _with_passages_from_departure(replace(terrain, departure=terrain.start), yaw, settings)
        if any(here.reached[node] for passage in here.passages for node in passage.nodes):
            return here
    return _with_passages_from_departure(terrain, yaw, settings)


def _with_passages_from_departure(terrain: Terrain, yaw: float, settings: TerrainSettings) -> Terrain:
    robot = settings.robot
    piece, count = _pieces(terrain, settings.terrain.min_ground_voxels)
    demand = Demand.of(settings.passages, robot, terrain.resolution)
    found: list[Passage] = []
    if count > 1:
        ground, kept_off, outline = (
            ground_of(terrain, piece),
            KeptOff.of(terrain, robot),
            Outline.of(settings.passages, robot, terrain.resolution),
        )
        found = _find_passages(terrain, ground, kept_off, demand)
        found += _bends(terrain, ground, kept_off, outline, found)
    passages, start = list(found), terrain.start
    if start is not None:
        rests = [rest for p in found for way in (p, p.turned()) if (rest := rest_from(way, place_of(terrain), start))]
        passages += [rest for rest in rests if terrain.narrow[start] or is_along(rest, yaw)]
    reached = terrain.reached.copy()
    reached[: piece.size] = np.append(_connected(found, piece, int(piece[terrain.departure])), False)[piece]
    beside = terrain.neighbours[terrain.frontiers()]
    reached[terrain.frontiers()] = (np.append(reached, False)[beside] & (beside >= 0)).any(axis=1)
    return replace(terrain, passages=tuple(passages), reached=reached)
