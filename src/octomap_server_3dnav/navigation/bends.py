"""Ways that bend through narrow ground: straight legs, with turns on the spot between them where the outline has just enough room.

For `passages`, between pieces of turning room that no straight line joins: a door beside a corridor, a gap that winds. The cheapest way of
`outline_search` is drawn with the legs that cost least. All is in voxels of the window of a terrain.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.outline_search import Around, Outline, dearer, leg, search, turn_room
from octomap_server_3dnav.navigation.straight_lines import Ground, step
from octomap_server_3dnav.terrain.classified_terrain import TRAVERSABLE, UNREACHED
from octomap_server_3dnav.terrain.flood import components

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

Way = tuple[Ints, Floats, Floats]
"""Nodes of a way, and their x and y."""
NO_WAY: Way = np.empty(0, dtype=np.int64), np.empty(0), np.empty(0)

_SAME = 1e-6  # places and directions that differ by less are one


class _Corners(NamedTuple):
    """Where a way bends, its ends too: nodes, x and y."""

    node: Ints
    x: Floats
    y: Floats

    def angle(self, i: int, j: int) -> float:
        """Direction from one to another."""
        return math.atan2(self.y[j] - self.y[i], self.x[j] - self.x[i])

    def apart(self, i: int, j: int) -> float:
        """Distance of one from another."""
        return math.hypot(self.x[j] - self.x[i], self.y[j] - self.y[i])


def _corners_of(nodes: Ints, x: Floats, y: Floats) -> _Corners:
    moved = np.r_[True, np.hypot(np.diff(x), np.diff(y)) > _SAME]
    nodes, x, y = nodes[moved], x[moved], y[moved]
    turned = np.abs(np.diff(np.unwrap(np.arctan2(np.diff(y), np.diff(x))))) > _SAME
    keep = np.r_[True, turned, True]
    return _Corners(nodes[keep], x[keep], y[keep])


class _Narrow(NamedTuple):
    """The ground, what is kept off, and the outline that is moved between."""

    ground: Ground
    around: Around
    outline: Outline

    def leg(self, at: _Corners, i: int, j: int) -> tuple[Ints, float]:
        """Nodes of the straight leg between two corners and its room; none where it is not free."""
        nodes, room = leg(*self, at.node[i], (at.x[i], at.y[i]), (at.x[j], at.y[j]))
        return (nodes, float(room)) if nodes.size and nodes[-1] == at.node[j] else (nodes[:0], -1.0)

    def can_turn(self, at: _Corners, h: int, i: int, j: int) -> bool:
        """Whether there is room for the turn at corner i, on the way from h to j."""
        if self.ground.piece[at.node[i]] >= 0:
            return True
        angles = at.angle(h, i), at.angle(i, j)
        return bool(turn_room(self.around, self.outline, (at.x[i], at.y[i], self.ground.z[at.node[i]]), *angles) >= 0)


def _cheapest_legs(narrow: _Narrow, at: _Corners) -> list[int]:
    """Indices of the corners that stay where longer legs stand for several; none where no legs are free and have room for the turns."""
    count = len(at.x)
    best: dict[tuple[int, int], tuple[float, list[int]]] = {}
    for i in range(count - 1):
        for j in range(i + 1, count):
            room = narrow.leg(at, i, j)[1]
            if room < 0:
                continue
            cost = at.apart(i, j) * dearer(narrow.outline, room) + narrow.outline.corner
            if i == 0:
                best[i, j] = cost, [i, j]
                continue
            before = [(total, chain) for (_, end), (total, chain) in best.items() if end == i and narrow.can_turn(at, chain[-2], i, j)]
            turns = [(total + cost + _turned(narrow, at, chain[-2], i, j), [*chain, j]) for total, chain in before]
            if turns:
                best[i, j] = min(turns)
    ends = [found for (_, j), found in best.items() if j == count - 1]
    return min(ends)[1] if ends else []


def _turned(narrow: _Narrow, at: _Corners, h: int, i: int, j: int) -> float:
    """What the turn at corner i costs."""
    return narrow.outline.to_corner * abs(math.remainder(at.angle(i, j) - at.angle(h, i), math.pi))


def _run_up(narrow: _Narrow, x: float, y: float, node: int, angle: float) -> tuple[float, float, int]:
    """The place up to a run-up farther on in a direction over the same piece of turning room, away from kerbs, and its node."""
    g, (c, s) = narrow.ground, (math.cos(angle), math.sin(angle))
    by = 1.0 / max(abs(c), abs(s))
    for _ in range(int(narrow.outline.run_up / by) if g.piece[node] >= 0 else 0):
        tx, ty = x + by * c, y + by * s
        on = step(g.graph, node, math.floor(tx) - math.floor(x), math.floor(ty) - math.floor(y))
        if on < 0 or g.piece[on] != g.piece[node] or g.kerbed[on]:
            break
        x, y, node = tx, ty, int(on)
    return x, y, node


def _with_run_ups(narrow: _Narrow, at: _Corners) -> _Corners:
    ends = [_run_up(narrow, at.x[i], at.y[i], int(at.node[i]), at.angle(j, i)) for i, j in ((0, 1), (-1, -2))]
    x, y, node = at.x.copy(), at.y.copy(), at.node.copy()
    for i, (ex, ey, end) in zip((0, -1), ends, strict=True):
        x[i], y[i], node[i] = ex, ey, end
    return _Corners(node, x, y)


def _narrow_ground(ground: Ground) -> tuple[Mask, NDArray[np.int32]]:
    """(N,) narrow ground, and the number of its connected group that each of the four neighbours of a node (N, 4) belongs to, else -1."""
    is_narrow = ground.passable & (ground.piece < 0)
    group, _ = components(np.where(is_narrow, np.uint8(TRAVERSABLE), np.uint8(UNREACHED)), ground.graph, 0, is_narrow.size + 1)
    return group >= 0, np.where(ground.graph >= 0, np.append(group, -1)[ground.graph], -1)


def find_bend(ground: Ground, around: Around, outline: Outline, connected: Mask) -> Way:
    """The cheapest way from the pieces of turning room that are `connected` (P,) to another; empty where there is none."""
    _, beside = _narrow_ground(ground)
    inside = np.append(connected, False)[ground.piece] & (ground.piece >= 0)
    outside = (ground.piece >= 0) & ~inside
    both = np.intersect1d(beside[inside], beside[outside])
    joins = np.isin(beside, both[both >= 0]).any(axis=1)
    return _way(_Narrow(ground, around, outline), np.asarray(joins), inside, outside) if joins.any() else NO_WAY


def find_bend_to(ground: Ground, around: Around, outline: Outline, connected: Mask, to: Mask) -> Way:
    """The cheapest way from `connected` pieces (P,) to narrow ground `to` (N,) that is not turning room; empty where there is none."""
    is_narrow, beside = _narrow_ground(ground)
    inside = np.append(connected, False)[ground.piece] & (ground.piece >= 0)
    return _way(_Narrow(ground, around, outline), np.asarray((beside >= 0).any(axis=1)), inside, to & is_narrow)


def _way(narrow: _Narrow, beside: Mask, source: Mask, target: Mask) -> Way:
    """The cheapest way from source to target (N,) over narrow ground, with the legs that cost least.

    `beside` (N,): next to a group of narrow ground that is searched.
    """
    ground = narrow.ground
    nodes = np.flatnonzero(beside & ground.passable)
    slot = np.full(ground.piece.size, -1, dtype=np.int64)
    slot[nodes] = np.arange(nodes.size)
    found = search(*narrow, (nodes, slot, source, target, ground.piece >= 0))
    legs = []
    if found[0].size:
        at = _corners_of(*found)
        legs = _cheapest_legs(narrow, at)
    if not legs:
        return NO_WAY
    at = _with_run_ups(narrow, _Corners(at.node[legs], at.x[legs], at.y[legs]))
    parts = [narrow.leg(at, i, i + 1)[0] for i in range(len(at.x) - 1)]
    if not all(part.size for part in parts):
        return NO_WAY
    x, y = (np.concatenate([np.linspace(v[i], v[i + 1], len(part))[i > 0 :] for i, part in enumerate(parts)]) for v in (at.x, at.y))
    return np.concatenate([part[i > 0 :] for i, part in enumerate(parts)]), x, y
