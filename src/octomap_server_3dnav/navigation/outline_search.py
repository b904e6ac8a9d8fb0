"""Where the robot's outline fits, and the cheapest way to move it through narrow ground: straight on, back, or turning on the spot.

The kernels of `bends`. A place and an axis are searched; the outline fits forward and backward alike. All is in voxels of the window of a
terrain.
"""

import heapq
import math
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.navigation.straight_lines import Demand, Ground, KeptOff, PassageConfig, step
from octomap_server_3dnav.octree.lean_kernels import Index, lean_njit
from octomap_server_3dnav.terrain.surfaces import find_node
from robot_body import RobotBody

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Mask = NDArray[np.bool_]

_BUCKET = 8  # voxels along a bucket of what is kept off


class Outline(NamedTuple):
    """Half the robot's length and width, from its middle to a corner, in height the band of levels that bar it and by how much the ground
    below it may differ, the longest way and run-up, the room that is as good as any more, by how many times a way costs more without it,
    the way that a corner is worth, and whether floor that was not seen is taken for ground."""

    ahead: float
    half_width: float
    to_corner: float
    band: float
    rise: int
    most: float
    run_up: float
    ample: float
    close_weight: float
    corner: float
    over_unknown: bool

    @classmethod
    def of(cls, config: PassageConfig, robot: RobotBody, resolution: float, *, over_unknown: bool = False) -> "Outline":
        """For this robot, on ways as long as straight ones may be."""
        demand, to_corner = Demand.of(config, robot, resolution), robot.turning_radius_m / resolution
        band = math.ceil(robot.max_step_m / resolution) + math.ceil(to_corner * math.tan(robot.max_slope_rad))
        return cls(
            ahead=robot.half_length_m / resolution,
            half_width=demand.half_width,
            to_corner=to_corner,
            band=float(band),
            rise=band,
            most=demand.most,
            run_up=demand.longest_run_up,
            ample=config.ample_room_m / resolution,
            close_weight=config.close_weight,
            corner=config.corner_m / resolution,
            over_unknown=over_unknown,
        )


class Around(NamedTuple):
    """What is kept off, as in `KeptOff`, sorted by square buckets: those of bucket (i, j) are `first[i * ny + j]` to the next; and the
    largest radius."""

    x: Floats
    y: Floats
    level: Floats
    radius: Floats
    widest: float
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
        return cls(b.x[order], b.y[order], b.level[order], b.radius[order], float(b.radius.max(initial=0.0)), first, across, along)


@lean_njit
def _room(b: Any, o: Any, x: Any, y: Any, angle: Any, level: Any) -> Any:
    """Voxels by which all that is kept off lies beyond the outline at a pose, `ample` at most; negative where it does not fit."""
    c, s, room = np.cos(angle), np.sin(angle), o.ample
    reach = np.hypot(o.ahead, b.widest) + o.ample
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
def dearer(o: Outline, room: float) -> float:
    """Times that a way costs with so much room."""
    return 1.0 + o.close_weight * (1.0 - max(room, 0.0) / o.ample)


@lean_njit
def axes_of(o: Outline, angle: float) -> Index:
    """Steps in which the outline turns by an angle, so that no corner moves farther than a voxel in one."""
    return max(1, int(np.ceil(abs(angle) * o.to_corner)))


@njit(cache=True)
def search(g: Ground, b: Around, o: Outline, ways: tuple[Ints, Ints, Mask, Mask, Mask]) -> tuple[Ints, Floats, Floats]:
    """The cheapest way from a source to a target: its nodes, x and y; empty where there is none.

    `ways`: the nodes that are searched, their places in that list, and which nodes are sources, targets, and room to turn. A turn is as
    long as the way of a corner.
    """
    nodes, slot, is_source, is_target, is_open = ways
    axes = axes_of(o, np.pi)
    turn, count = np.pi * o.to_corner / axes, nodes.size * axes
    cost, length = np.full(count, np.inf), np.zeros(count)
    px, py = np.zeros(count), np.zeros(count)
    before, is_done = np.full(count, -1, np.int64), np.zeros(count, np.bool_)
    heap = [(0.0, np.int64(0)) for _ in range(0)]
    for i in range(nodes.size):
        if is_source[nodes[i]]:
            for axis in range(axes):
                state = np.int64(i * axes + axis)
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
        s: Any = nodes[state // axes]
        k, x, y = state % axes, px[state], py[state]
        if is_target[s]:
            end = state
            break
        for move in range(4):
            n: Index = s
            ax, tx, ty, far = k, x, y, 0.0
            if move < 2:
                c, d = np.cos(np.pi * k / axes), np.sin(np.pi * k / axes)
                far = 1.0 / max(abs(c), abs(d))
                ahead = far if move == 0 else -far
                tx, ty = x + ahead * c, y + ahead * d
                n = step(g.graph, s, int(np.floor(tx)) - int(np.floor(x)), int(np.floor(ty)) - int(np.floor(y)))
                if n < 0 or slot[n] < 0 or is_source[n]:
                    continue
            else:
                ax = (k + 1) % axes if move == 2 else (k + axes - 1) % axes
            new = np.int64(slot[n] * axes + ax)
            if is_done[new] or length[state] + far > o.most:
                continue
            room = o.ample if is_open[n] else _room(b, o, tx, ty, np.pi * ax / axes, g.z[n])
            if room < 0.0:
                continue
            total = cost[state] + (far if move < 2 else turn) * dearer(o, room)
            if total < cost[new]:
                cost[new], before[new], px[new], py[new], length[new] = total, state, tx, ty, length[state] + far
                heapq.heappush(heap, (total, new))
    chain = [np.int64(0) for _ in range(0)]
    while end >= 0:
        chain.append(end)
        end = before[end]
    found = np.array(chain, dtype=np.int64)[::-1].copy()
    return nodes[found // axes], px[found], py[found]


@njit(cache=True)
def leg(g: Ground, b: Around, o: Outline, first: Index, at: tuple[float, float], to: tuple[float, float]) -> tuple[Ints, float]:
    """Nodes of a straight leg from node `first` at x, y to another place, and its least room; none where ground or room ends."""
    node: Any = first
    (x, y), (tx, ty) = at, to
    dx, dy = tx - x, ty - y
    steps = max(1, int(np.ceil(max(abs(dx), abs(dy)))))
    angle, nodes = np.arctan2(dy, dx), np.empty(steps + 1, np.int64)
    c, s, lanes, room = np.cos(angle), np.sin(angle), int(np.ceil(2 * o.half_width)), o.ample
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
            if (n < 0 and not o.over_unknown) or (n >= 0 and not g.ground[n]):
                return nodes[:0].copy(), -1.0
    return nodes, room


@njit(cache=True)
def turn_room(b: Around, o: Outline, at: tuple[float, float, int], angle: float, to: float) -> float:
    """The least room in a turn on the spot at x, y and a level from one axis to another, the short way."""
    x, y, level = at
    by = (to - angle + np.pi / 2) % np.pi - np.pi / 2
    steps, room = axes_of(o, by), o.ample
    for i in range(steps + 1):
        room = min(room, _room(b, o, x, y, angle + by * i / steps, level))
    return room
