"""Ways that bend through narrow ground: straight legs, with turns on the spot between them where the outline has just enough room.

For `passages`, between pieces of turning room that no straight line joins: a door beside a corridor, a gap that winds. The pose of the
outline is searched, cell by cell and axis by axis; it fits forward and backward alike. All is in voxels of the window of a terrain.
"""

import heapq
import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.straight_lines import Demand, Ground, KeptOff, step
from octomap_server_3dnav.octree.lean_kernels import lean_njit
from octomap_server_3dnav.terrain.classified_terrain import TRAVERSABLE, UNREACHED
from octomap_server_3dnav.terrain.flood import components
from octomap_server_3dnav.terrain.surfaces import find_node
from robot_body import RobotBody

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_AXES = 32  # of the outline that are tried, to half a turn: its corner moves by less than a voxel from one to the next
_BUCKET = 8  # voxels along a bucket of what is kept off
_AMPLE = 2.0  # voxels of room beyond what is needed that are as good as any more
_ENOUGH = 1.0  # and so many that fewer legs are better than more
_CLOSE = 2.0  # times that a way costs more where there is no more room than needed
_TURN = 1.0  # voxels of way that a turn from one axis to the next is worth
_CORNER = 3.0  # and one corner less
_SAME_RAD = 1e-6  # legs that differ by less are one


class Outline(NamedTuple):
    """Half the robot's length, and in height the band of levels that bar it and by how much the ground below it may differ."""

    ahead: float
    half_width: float
    band: float
    rise: int
    most: float
    run_up: float

    @classmethod
    def of(cls, robot: RobotBody, demand: Demand, resolution: float) -> "Outline":
        """For this robot, on ways as long as straight ones may be."""
        slope = math.ceil(robot.turning_radius_m / resolution * math.tan(robot.max_slope_rad))
        band = math.ceil(robot.max_step_m / resolution) + slope
        return cls(robot.half_length_m / resolution, demand.half_width, float(band), band, demand.most, demand.longest_run_up)


class Around(NamedTuple):
    """What is kept off, as in `KeptOff`, sorted by square buckets: those of bucket (i, j) are `first[i * ny + j]` to the next."""

    x: Floats
    y: Floats
    level: Floats
    radius: Floats
    first: Ints
    nx: int
    ny: int

    @classmethod
    def of(cls, b: KeptOff, nx: int, ny: int) -> "Around":
        """For a window of so many columns."""
        across, along = nx // _BUCKET + 1, ny // _BUCKET + 1
        i, j = (np.floor(v / _BUCKET).astype(np.int64).clip(0, n - 1) for v, n in ((b.x, across), (b.y, along)))
        order = np.argsort(i * along + j, kind="stable")
        first = np.searchsorted((i * along + j)[order], np.arange(across * along + 1))
        return cls(b.x[order], b.y[order], b.level[order], b.radius[order], first, across, along)


@lean_njit
def _room(b: Any, o: Any, x: Any, y: Any, angle: Any, level: Any) -> Any:
    """Voxels by which all that is kept off lies beyond the outline at a pose, `_AMPLE` at most; negative where it does not fit."""
    c, s, room = np.cos(angle), np.sin(angle), _AMPLE
    reach = o.ahead + 2.0 * _AMPLE
    i0, i1 = max(0, int((x - reach) // _BUCKET)), min(b.nx - 1, int((x + reach) // _BUCKET))
    j0, j1 = max(0, int((y - reach) // _BUCKET)), min(b.ny - 1, int((y + reach) // _BUCKET))
    for i in range(i0, i1 + 1):
        for n in range(b.first[i * b.ny + j0], b.first[i * b.ny + j1 + 1]):
            if abs(b.level[n] - level) > o.band:
                continue
            dx, dy = b.x[n] - x, b.y[n] - y
            off = max(abs(dx * c + dy * s) - o.ahead, abs(dy * c - dx * s) - b.radius[n])
            room = min(room, off)
        if room < 0.0:
            return room
    return room


@lean_njit
def _dearer(room: Any) -> Any:
    """Times that a way costs with so much room."""
    return 1.0 + _CLOSE * (1.0 - max(room, 0.0) / _AMPLE)


@njit(cache=True)
def _search(g: Any, b: Any, o: Any, ways: Any) -> Any:
    """The cheapest way from a source to a target: its nodes, x and y; empty where there is none.

    `ways`: the nodes that are searched, their places in that list, and which nodes are sources, targets, and room to turn.
    """
    nodes, slot, is_source, is_target, is_open = ways
    count = nodes.size * _AXES
    cost, length = np.full(count, np.inf), np.zeros(count)
    px, py = np.zeros(count), np.zeros(count)
    before, is_done = np.full(count, -1, np.int64), np.zeros(count, np.bool_)
    heap = [(0.0, np.int64(0)) for _ in range(0)]
    for i in range(nodes.size):
        if is_source[nodes[i]]:
            for k in range(_AXES):
                state = np.int64(i * _AXES + k)
                cost[state] = 0.0
                px[state], py[state] = g.column[nodes[i]] // g.ny + 0.5, g.column[nodes[i]] % g.ny + 0.5
                heap.append((0.0, state))
    heapq.heapify(heap)
    end = np.int64(-1)
    while len(heap) > 0:
        _, state = heapq.heappop(heap)
        if is_done[state]:
            continue
        is_done[state] = True
        s, k, x, y = nodes[state // _AXES], state % _AXES, px[state], py[state]
        if is_target[s]:
            end = state
            break
        for move in range(4):
            ax, n, tx, ty, far = k, s, x, y, 0.0
            if move < 2:
                c, d = np.cos(np.pi * k / _AXES), np.sin(np.pi * k / _AXES)
                far = 1.0 / max(abs(c), abs(d))
                ahead = far if move == 0 else -far
                tx, ty = x + ahead * c, y + ahead * d
                n = np.int64(step(g.graph, s, int(np.floor(tx)) - int(np.floor(x)), int(np.floor(ty)) - int(np.floor(y))))
                if n < 0 or slot[n] < 0 or is_source[n]:
                    continue
            else:
                ax = (k + 1) % _AXES if move == 2 else (k + _AXES - 1) % _AXES
            new = np.int64(slot[n] * _AXES + ax)
            if is_done[new] or length[state] + far > o.most:
                continue
            room = _AMPLE if is_open[n] else _room(b, o, tx, ty, np.pi * ax / _AXES, g.z[n])
            if room < 0.0:
                continue
            total = cost[state] + (far if move < 2 else _TURN) * _dearer(room)
            if total < cost[new]:
                cost[new], before[new], px[new], py[new], length[new] = total, state, tx, ty, length[state] + far
                heapq.heappush(heap, (total, new))
    chain = [np.int64(0) for _ in range(0)]
    while end >= 0:
        chain.append(end)
        end = before[end]
    found = np.array(chain, dtype=np.int64)[::-1].copy()
    return nodes[found // _AXES], px[found], py[found]


@njit(cache=True)
def _leg(g: Any, b: Any, o: Any, node: Any, x: Any, y: Any, tx: Any, ty: Any) -> Any:
    """Nodes of a straight leg from `node` at x, y to tx, ty, and the least room along it; none where the ground or the room ends."""
    dx, dy = tx - x, ty - y
    steps = max(1, int(np.ceil(max(abs(dx), abs(dy)))))
    angle, nodes = np.arctan2(dy, dx), np.empty(steps + 1, np.int64)
    c, s, lanes, room = np.cos(angle), np.sin(angle), int(np.ceil(2 * o.half_width)), _AMPLE
    px, py = int(np.floor(x)), int(np.floor(y))
    for i in range(steps + 1):
        ax, ay = x + dx * i / steps, y + dy * i / steps
        cx, cy = int(np.floor(ax)), int(np.floor(ay))
        node = step(g.graph, node, cx - px, cy - py)
        if node < 0 or not g.passable[node]:
            return nodes[:0].copy(), -1.0
        px, py, nodes[i] = cx, cy, node
        if g.piece[node] < 0:
            room = min(room, _room(b, o, ax, ay, angle, g.z[node]))
        if room < 0.0:
            return nodes[:0].copy(), room
        for lane in range(lanes + 1):
            aside = o.half_width * (2.0 * lane / lanes - 1.0)
            column = int(np.floor(ax - aside * s)) * g.ny + int(np.floor(ay + aside * c))
            n = find_node(g.start, g.z, column, np.int64(g.z[node]), o.rise)
            if n < 0 or not g.ground[n]:
                return nodes[:0].copy(), -1.0
    return nodes, room


@njit(cache=True)
def _turn_room(b: Any, o: Any, x: Any, y: Any, level: Any, angle: Any, to: Any) -> Any:
    """The least room in a turn on the spot from one axis to another, the short way."""
    by = (to - angle + np.pi / 2) % np.pi - np.pi / 2
    steps, room = max(1, int(np.ceil(abs(by) * _AXES / np.pi))), _AMPLE
    for i in range(steps + 1):
        room = min(room, _room(b, o, x, y, angle + by * i / steps, level))
    return room


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
    moved = np.r_[True, np.hypot(np.diff(x), np.diff(y)) > _SAME_RAD]
    nodes, x, y = nodes[moved], x[moved], y[moved]
    turned = np.abs(np.diff(np.unwrap(np.arctan2(np.diff(y), np.diff(x))))) > _SAME_RAD
    keep = np.r_[True, turned, True]
    return _Corners(nodes[keep], x[keep], y[keep])


class _Narrow(NamedTuple):
    """The ground, what is kept off, and the outline that is moved between."""

    ground: Ground
    around: Around
    outline: Outline

    def leg(self, at: _Corners, i: int, j: int) -> tuple[Ints, float]:
        """Nodes of the straight leg between two corners and its room; none where it is not free."""
        nodes, room = _leg(*self, at.node[i], at.x[i], at.y[i], at.x[j], at.y[j])
        return (nodes, float(room)) if nodes.size and nodes[-1] == at.node[j] else (nodes[:0], -1.0)

    def can_turn(self, at: _Corners, h: int, i: int, j: int) -> bool:
        """Whether there is room for the turn at corner i, on the way from h to j."""
        if self.ground.piece[at.node[i]] >= 0:
            return True
        angles = at.angle(h, i), at.angle(i, j)
        return bool(_turn_room(self.around, self.outline, at.x[i], at.y[i], self.ground.z[at.node[i]], *angles) >= 0)


def _fewest_legs(narrow: _Narrow, at: _Corners) -> list[int]:
    """Indices of the corners that stay where longer legs stand for those that have no more room, or that have enough."""
    count = len(at.x)
    rooms = [narrow.leg(at, i, i + 1)[1] for i in range(count - 1)]
    if min(rooms) < 0:
        return []
    best: dict[tuple[int, int], tuple[float, list[int]]] = {}
    for i in range(count - 1):
        for j in range(i + 1, count):
            room = narrow.leg(at, i, j)[1]
            if room < min(_ENOUGH, *rooms[i:j]):
                continue
            cost = at.apart(i, j) * _dearer(room) + _CORNER
            if i == 0:
                best[i, j] = cost, [i, j]
                continue
            before = [(total, chain) for (_, end), (total, chain) in best.items() if end == i and narrow.can_turn(at, chain[-2], i, j)]
            turns = [(total + cost + _turned(at, chain[-2], i, j), [*chain, j]) for total, chain in before]
            if turns:
                best[i, j] = min(turns)
    ends = [found for (_, j), found in best.items() if j == count - 1]
    return min(ends)[1] if ends else []


def _turned(at: _Corners, h: int, i: int, j: int) -> float:
    """What the turn at corner i costs."""
    return _TURN * _AXES / math.pi * abs(math.remainder(at.angle(i, j) - at.angle(h, i), math.pi))


def _run_up(narrow: _Narrow, x: float, y: float, node: int, angle: float) -> tuple[float, float, int]:
    """The place up to a run-up farther on in a direction over the same piece of turning room, and its node."""
    g, (c, s) = narrow.ground, (math.cos(angle), math.sin(angle))
    by = 1.0 / max(abs(c), abs(s))
    for _ in range(int(narrow.outline.run_up / by)):
        tx, ty = x + by * c, y + by * s
        on = step(g.graph, node, math.floor(tx) - math.floor(x), math.floor(ty) - math.floor(y))
        if on < 0 or g.piece[on] != g.piece[node]:
            break
        x, y, node = tx, ty, int(on)
    return x, y, node


def _with_run_ups(narrow: _Narrow, at: _Corners) -> _Corners:
    ends = [_run_up(narrow, at.x[i], at.y[i], int(at.node[i]), at.angle(j, i)) for i, j in ((0, 1), (-1, -2))]
    x, y, node = at.x.copy(), at.y.copy(), at.node.copy()
    for i, (ex, ey, end) in zip((0, -1), ends, strict=True):
        x[i], y[i], node[i] = ex, ey, end
    return _Corners(node, x, y)


def _searched(ground: Ground, connected: NDArray[np.bool_]) -> tuple[Ints, Mask, Mask] | None:
    """The narrow ground between pieces that are `connected` (P,) and others, with the places in both from where it begins; and which are
    which (N,). None where there is none."""
    is_narrow = ground.passable & (ground.piece < 0)
    group, _ = components(np.where(is_narrow, np.uint8(TRAVERSABLE), np.uint8(UNREACHED)), ground.graph, 0, is_narrow.size + 1)
    inside = np.append(connected, False)[ground.piece] & (ground.piece >= 0)
    outside = (ground.piece >= 0) & ~inside
    beside = np.where(ground.graph >= 0, np.append(group, -1)[ground.graph], -1)
    joins = [np.unique(beside[which][beside[which] >= 0]) for which in (inside, outside)]
    both = np.intersect1d(*joins)
    if not both.size:
        return None
    is_border = np.isin(beside, both).any(axis=1) & (ground.piece >= 0)
    nodes = np.flatnonzero((is_narrow & np.isin(group, both)) | is_border)
    return nodes, inside, outside


def find_bend(ground: Ground, around: Around, outline: Outline, connected: Mask) -> tuple[Ints, Floats, Floats]:
    """The cheapest way from the pieces of turning room that are `connected` (P,) to another: its nodes, and their x and y.

    Empty where there is none.
    """
    none = np.empty(0, dtype=np.int64), np.empty(0), np.empty(0)
    searched = _searched(ground, connected)
    if searched is None:
        return none
    nodes, inside, outside = searched
    slot = np.full(ground.piece.size, -1, dtype=np.int64)
    slot[nodes] = np.arange(nodes.size)
    is_open = ground.piece >= 0
    found = _search(ground, around, outline, (nodes, slot, inside, outside, is_open))
    if not found[0].size:
        return none
    narrow = _Narrow(ground, around, outline)
    at = _corners_of(*found)
    legs = _fewest_legs(narrow, at)
    if not legs:
        return none
    at = _with_run_ups(narrow, _Corners(at.node[legs], at.x[legs], at.y[legs]))
    parts = [narrow.leg(at, i, i + 1)[0] for i in range(len(at.x) - 1)]
    if not all(part.size for part in parts):
        return none
    x, y = (np.concatenate([np.linspace(v[i], v[i + 1], len(part))[i > 0 :] for i, part in enumerate(parts)]) for v in (at.x, at.y))
    return np.concatenate([part[i > 0 :] for i, part in enumerate(parts)]), x, y
