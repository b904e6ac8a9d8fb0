"""Passages: straight ways through where the robot fits but cannot turn, from one place with room to turn to another.

After the inflation, in `terrain.classify`. A passage is looked for only where inflated ground parts two pieces of traversable ground: a
door, a ramp with a drop on both sides. Its middle line is chosen so that the nearest barriers on its left and right are equally far,
and what the outline sweeps along it must be ground. At both ends the line goes on for a run-up over traversable ground.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav import terrain_kernels as kernels
from octomap_server_3dnav.lean_kernels import lean_njit
from octomap_server_3dnav.surface_columns import find_node
from octomap_server_3dnav.surface_graph import diagonal
from octomap_server_3dnav.terrain_config import Limits, TerrainConfig
from octomap_server_3dnav.terrain_scene import Scene
from rigid_geometry import angle_difference

Array = NDArray[np.float64]

_DIRECTIONS = 180  # tried around the middle of a neck
_STARTS = 9  # nodes across it from which they are tried
_AMPLE = 3.0  # voxels of room beyond the radius that are as good as any more
_ENOUGH = 1.0  # and so many that a shorter line, straight across a wall, is better than more
_ALONG_RAD = 0.35
_ASIDE_M = 0.2  # a robot so near to the line of a passage stands in it


@dataclass(frozen=True, eq=False)
class Passage:
    """A way to be driven straight: node at each end, and its middle line (K, 3) in map in metres, from the first to the second."""

    nodes: tuple[int, int]
    line: Array

    def turned(self) -> "Passage":
        """The same the other way."""
        return Passage((self.nodes[1], self.nodes[0]), self.line[::-1])

    def is_along(self, yaw: float) -> bool:
        """Whether a robot of this heading in map looks along it."""
        dx, dy = self.line[-1, :2] - self.line[0, :2]
        return abs(angle_difference(math.atan2(dy, dx), yaw)) <= _ALONG_RAD

    def rest_from(self, xy: tuple[float, float], node: int) -> "Passage | None":
        """What is left of it for a robot at `node`, at (x, y) in map; None when it does not stand in it."""
        off = np.hypot(self.line[:, 0] - xy[0], self.line[:, 1] - xy[1])
        at = int(np.argmin(off))
        return Passage((node, self.nodes[1]), self.line[at:]) if off[at] <= _ASIDE_M and at < len(self.line) - 1 else None


class KeptOff(NamedTuple):
    """What the middle of a passage keeps off, in voxels of the window: x, y, level, and how far to keep, (B,) float64 each."""

    x: Array
    y: Array
    level: Array
    radius: Array

    @classmethod
    def of(cls, groups: list[tuple[Array, float]]) -> "KeptOff":
        """From places (M, 3) and radius in voxels of each kind."""
        x, y, level = np.concatenate([places for places, _ in groups]).T.copy()
        return cls(x, y, level, np.concatenate([np.full(len(places), radius) for places, radius in groups]))

    def around(self, x: float, y: float, reach: float) -> "KeptOff":
        """Those within `reach` of a place along both axes."""
        near = (np.abs(self.x - x) <= reach) & (np.abs(self.y - y) <= reach)
        return KeptOff(self.x[near], self.y[near], self.level[near], self.radius[near])


class Ground(NamedTuple):
    """The ground that lines may lead over: `column` and its first node, z, `graph`; whether a node is `ground`, whether the middle line may
    be over it (`passable`), and which piece of turning room it belongs to (`piece`, -1 for none)."""

    ny: int
    start: NDArray[np.int32]
    column: NDArray[np.int32]
    z: NDArray[np.int16]
    graph: NDArray[np.int32]
    ground: NDArray[np.bool_]
    passable: NDArray[np.bool_]
    piece: NDArray[np.int32]


class Demand(NamedTuple):
    """What is asked of a line, in voxels: its longest narrow part, shortest and longest run-up, half the width of the outline, and in
    height the band of levels that bar it and by how much the ground may differ from side to side."""

    most: float
    run_up: float
    longest_run_up: float
    half_width: float
    band: float
    rise: int


@lean_njit
def _step(graph: Any, node: Any, mx: Any, my: Any) -> Any:
    """The node one column on along x, y or both."""
    if mx != 0 and my != 0:
        return diagonal(graph, node, 0 if mx > 0 and my > 0 else 1 if mx < 0 and my > 0 else 2 if mx < 0 else 3)
    if mx == 0 and my == 0:
        return node
    return graph[node, 0 if mx > 0 else 2 if mx < 0 else 1 if my > 0 else 3]


@lean_njit
def _walk(g: Any, demand: Any, node: Any, x: Any, y: Any, dx: Any, dy: Any, out: Any) -> Any:
    """Number of nodes from `node` at x, y in direction dx, dy to the end of the run-up, written to `out`; 0 when none is reached."""
    h = 1.0 / max(abs(dx), abs(dy))
    px, py, begun = int(np.floor(x)), int(np.floor(y)), -1
    out[0] = node
    for i in range(1, out.size):
        cx, cy = int(np.floor(x + i * h * dx)), int(np.floor(y + i * h * dy))
        node = _step(g.graph, node, cx - px, cy - py)
        if begun >= 0 and (node < 0 or g.piece[node] != g.piece[out[begun]] or (i - begun) * h > demand.longest_run_up):
            return i if (i - 1 - begun) * h >= demand.run_up else 0
        if node < 0 or not g.passable[node] or (begun < 0 and i * h > demand.most):
            return 0
        px, py = cx, cy
        out[i] = node
        if begun < 0 and g.piece[node] >= 0:
            begun = i
    return 0


@lean_njit
def _room(b: Any, demand: Any, x: Any, y: Any, dx: Any, dy: Any, levels: Any, first: Any) -> Any:
    """Voxels by which the nearest barriers on the left and right of a line lie beyond their radius; levels[i] is its height `first + i`
    steps from x, y."""
    h = 1.0 / max(abs(dx), abs(dy))
    left, right = _AMPLE, _AMPLE
    for i in range(b.x.size):
        along = ((b.x[i] - x) * dx + (b.y[i] - y) * dy) / h - first
        aside = (b.y[i] - y) * dx - (b.x[i] - x) * dy
        if along < 0 or along > levels.size - 1 or abs(levels[int(round(along))] - b.level[i]) > demand.band:
            continue
        if aside >= 0:
            left = min(left, aside - b.radius[i])
        if aside <= 0:
            right = min(right, -aside - b.radius[i])
    return left, right


@lean_njit
def _is_covered(g: Any, demand: Any, x: Any, y: Any, dx: Any, dy: Any, line: Any, first: Any) -> Any:
    """Whether there is ground everywhere beside a line, as far as the outline reaches."""
    h = 1.0 / max(abs(dx), abs(dy))
    lanes = int(np.ceil(2 * demand.half_width))
    for i in range(line.size):
        t = (first + i) * h
        for lane in range(lanes + 1):
            aside = demand.half_width * (2.0 * lane / lanes - 1.0)
            c = int(np.floor(x + t * dx - aside * dy)) * g.ny + int(np.floor(y + t * dy + aside * dx))
            n = find_node(g.start, g.z, c, np.int64(g.z[line[i]]), demand.rise)
            if n < 0 or not g.ground[n]:
                return False
    return True


@njit(cache=True)
def _line_through(g: Any, demand: Any, node: Any, x: Any, y: Any, dx: Any, dy: Any, ahead: Any, behind: Any) -> Any:
    """Nodes of the line through x, y between two run-ups in different pieces, and how many of them come before `node`; none where there
    is no such line."""
    count = _walk(g, demand, node, x, y, dx, dy, ahead)
    back = _walk(g, demand, node, x, y, -dx, -dy, behind) if count > 0 else 0
    if back == 0 or g.piece[ahead[count - 1]] == g.piece[behind[back - 1]]:
        return ahead[:0].copy(), 0
    return np.concatenate((behind[1:back][::-1], ahead[:count])), back - 1


@njit(cache=True)
def _centred_line(g: Any, b: Any, demand: Any, s: Any, dx: Any, dy: Any, ahead: Any, behind: Any) -> Any:
    """The line through node s in direction dx, dy, moved aside to where as much room is on its left as on its right: its nodes, how many
    come before x, y, then x, y, and the lesser room; no nodes where there is none."""
    x, y, node = g.column[s] // g.ny + 0.5, g.column[s] % g.ny + 0.5, np.int64(s)
    line, before = _line_through(g, demand, node, x, y, dx, dy, ahead, behind)
    if line.size == 0:
        return line, 0, x, y, 0.0
    left, right = _room(b, demand, x, y, dx, dy, g.z[line], -before)
    shift = (left - right) / 2
    x, y = x - shift * dy, y + shift * dx
    node = find_node(g.start, g.z, int(np.floor(x)) * g.ny + int(np.floor(y)), np.int64(g.z[s]), demand.rise)
    if left + right < 0 or node < 0 or not g.passable[node]:
        return line[:0], 0, x, y, 0.0
    line, before = _line_through(g, demand, node, x, y, dx, dy, ahead, behind)
    if line.size == 0:
        return line, 0, x, y, 0.0
    left, right = _room(b, demand, x, y, dx, dy, g.z[line], -before)
    return line, before, x, y, min(left, right)


@njit(cache=True)
def _best_line(g: Any, b: Any, demand: Any, starts: Any, directions: Any, longest: Any) -> Any:
    """The line with the most room through any of the nodes `starts`: its nodes, how many come before x, y, then x, y, dx, dy; no nodes
    where the robot fits along none."""
    ahead, behind = np.empty(longest, np.int32), np.empty(longest, np.int32)
    best, best_before, best_at, best_score = ahead[:0].copy(), 0, (0.0, 0.0, 1.0, 0.0), -np.inf
    for s in starts:
        for k in range(directions):
            dx, dy = np.cos(np.pi * k / directions), np.sin(np.pi * k / directions)
            line, before, x, y, room = _centred_line(g, b, demand, s, dx, dy, ahead, behind)
            score = min(room, _ENOUGH) - 0.02 * np.sum(g.piece[line] < 0) / max(abs(dx), abs(dy))
            is_better = line.size > 0 and room >= 0 and score > best_score
            if is_better and _is_covered(g, demand, x, y, dx, dy, line, -before):
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


def find_passages(ground: Ground, barriers: KeptOff, scene: Scene, config: TerrainConfig, limits: Limits) -> list[Passage]:
    """The best passage at every neck between two pieces of turning room, one way each; nodes are those of the scene."""
    neck = np.where(_necks(ground), np.uint8(kernels.TRAVERSABLE), np.uint8(kernels.UNREACHED))
    if not (neck == kernels.TRAVERSABLE).any():
        return []
    group, _ = kernels.components(neck, ground.graph, 0, neck.size + 1)
    demand = _demand(config, limits)
    longest = math.ceil(demand.most + demand.longest_run_up) + 3
    found = []
    for number in range(int(group.max()) + 1):
        members = np.flatnonzero(group == number)
        starts = members[np.unique(np.linspace(0, members.size - 1, _STARTS).astype(np.int64))]
        x, y = ground.column[starts] // ground.ny + 0.5, ground.column[starts] % ground.ny + 0.5
        near = barriers.around(float(x.mean()), float(y.mean()), longest + float(np.ptp(x) + np.ptp(y)))
        line, before, (x0, y0, dx, dy) = _best_line(ground, near, demand, starts, _DIRECTIONS, longest)
        if line.size:
            found.append(_passage(ground, scene, line, (x0, y0), (dx, dy), before, limits.resolution))
    return found


def _demand(config: TerrainConfig, limits: Limits) -> Demand:
    half_width = config.narrow_width_m / 2 / limits.resolution
    band = limits.step + math.ceil(config.narrow_radius_m / limits.resolution * limits.max_slope)
    rise = limits.step + math.ceil(half_width * limits.max_slope)
    run_up, longest = config.run_up_m / limits.resolution, max(config.run_up_m, config.longest_run_up_m) / limits.resolution
    return Demand(config.narrow_length_m / limits.resolution, run_up, longest, half_width, float(band), rise)


def _passage(
    ground: Ground, scene: Scene, line: NDArray[np.int32], at: tuple[float, float], way: tuple[float, float], before: int, resolution: float
) -> Passage:
    steps = (np.arange(line.size) - before) / max(abs(way[0]), abs(way[1]))
    xy = (np.array(at) + scene.key + steps[:, None] * np.array(way)) * resolution
    z = (ground.z[line] + 0.5) * resolution
    return Passage((int(line[0]), int(line[-1])), np.column_stack([xy, z]))


def connected_pieces(piece: NDArray[np.int32], passages: list[Passage], first: int) -> NDArray[np.bool_]:
    """(N,) nodes of the piece of node `first` and of all that passages lead to from there."""
    reached, ends = {int(piece[first])}, [tuple(int(piece[n]) for n in p.nodes) for p in passages]
    for _ in passages:
        for a, b in ends:
            reached |= {a, b} if a in reached or b in reached else set()
    return np.isin(piece, list(reached - {-1}))
