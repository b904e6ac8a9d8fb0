"""Passages: straight ways through where the robot fits but cannot turn, from one place with room to turn to another.

After the inflation, in `terrain.classify`. A passage is looked for only where inflated ground parts two pieces of traversable ground: a
door, a ramp with a drop on both sides. Its middle line is chosen so that the nearest barriers on its left and right are equally far,
and what the outline sweeps along it must be ground. At both ends the line goes on for a run-up over traversable ground.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.straight_lines import (
    DIRECTIONS,
    Demand,
    Ground,
    KeptOff,
    centred_line,
    is_covered,
    points_of,
    score_of,
)
from octomap_server_3dnav.terrain import kernels as kernels
from octomap_server_3dnav.terrain.config import Limits, TerrainConfig
from octomap_server_3dnav.terrain.scene import Scene
from rigid_geometry import angle_difference

Array = NDArray[np.float64]

_STARTS = 9  # nodes across it from which they are tried
_ALONG_RAD = 0.35
ASIDE_M = 0.2  # a robot so near to the line of a passage stands in it


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
        return Passage((node, self.nodes[1]), self.line[at:]) if off[at] <= ASIDE_M and at < len(self.line) - 1 else None


@njit(cache=True)
def _best_line(g: Any, b: Any, demand: Any, starts: Any, directions: Any, longest: Any) -> Any:
    """The line with the most room through any of the nodes `starts`: its nodes, how many come before x, y, then x, y, dx, dy; no nodes
    where the robot fits along none."""
    ahead, behind = np.empty(longest, np.int32), np.empty(longest, np.int32)
    best, best_before, best_at, best_score = ahead[:0].copy(), 0, (0.0, 0.0, 1.0, 0.0), -np.inf
    for s in starts:
        for k in range(directions):
            dx, dy = np.cos(np.pi * k / directions), np.sin(np.pi * k / directions)
            line, before, x, y, room = centred_line(g, b, demand, s, dx, dy, True, ahead, behind)
            score = score_of(room, np.sum(g.piece[line] < 0) / max(abs(dx), abs(dy)))
            is_better = line.size > 0 and room >= 0 and score > best_score
            if is_better and is_covered(g, demand, x, y, dx, dy, line, -before):
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
    demand = Demand.of(config, limits)
    longest = demand.longest_line
    found = []
    for number in range(int(group.max()) + 1):
        members = np.flatnonzero(group == number)
        starts = members[np.unique(np.linspace(0, members.size - 1, _STARTS).astype(np.int64))]
        x, y = ground.column[starts] // ground.ny + 0.5, ground.column[starts] % ground.ny + 0.5
        near = barriers.around(float(x.mean()), float(y.mean()), longest + float(np.ptp(x) + np.ptp(y)))
        line, before, (x0, y0, dx, dy) = _best_line(ground, near, demand, starts, DIRECTIONS, longest)
        if line.size:
            points = points_of(ground, line, (x0, y0), (dx, dy), before, scene.key, limits.resolution)
            found.append(Passage((int(line[0]), int(line[-1])), points))
    return found


def connected_pieces(piece: NDArray[np.int32], passages: list[Passage], first: int) -> NDArray[np.bool_]:
    """(N,) nodes of the piece of node `first` and of all that passages lead to from there."""
    reached, ends = {int(piece[first])}, [tuple(int(piece[n]) for n in p.nodes) for p in passages]
    for _ in passages:
        for a, b in ends:
            reached |= {a, b} if a in reached or b in reached else set()
    return np.isin(piece, list(reached - {-1}))
