"""Straight lines over the ground that the robot drives where it cannot turn: how long they are, how much room is beside them.

The kernels of `passages` and `lookouts`. All is in voxels of the window of a terrain.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from octomap_server_3dnav.octree.lean_kernels import Index, lean_njit
from octomap_server_3dnav.terrain.classified_terrain import Terrain, TerrainClass
from octomap_server_3dnav.terrain.planes import diagonal
from octomap_server_3dnav.terrain.surfaces import find_node
from robot_body import RobotBody
from stage_config import check_ranges, parameter

Array = NDArray[np.float64]
Nodes = NDArray[np.int32]

DIRECTIONS = 180  # of lines that are tried, to half a turn
_AMPLE = 3.0  # voxels of room beyond the radius that are as good as any more
_ENOUGH = 1.0  # and so many that a shorter line, straight across a wall, is better than more
_LENGTH_WEIGHT = 0.02  # voxels of room that are worth a voxel less of the way


class KeptOff(NamedTuple):
    """What the middle of a passage keeps off, in voxels of the window: x, y, level, and how far to keep, (B,) float64 each."""

    x: Array
    y: Array
    level: Array
    radius: Array

    @classmethod
    def of(cls, terrain: Terrain, robot: RobotBody, *, unknown_too: bool = True) -> "KeptOff":
        """The barriers of a terrain and, unless it is taken for ground, floor that was not seen: from that as from a drop."""
        b, unknown = terrain.barriers, terrain.frontiers()[: None if unknown_too else 0]
        stands, falls = robot.passage_radius_m / terrain.resolution, robot.passage_cliff_radius_m / terrain.resolution
        radius = np.where((b.column >= 0) & ~b.falls, stands, max(stands, falls))
        x, y = terrain.ix[unknown] - terrain.window_key[0] + 0.5, terrain.iy[unknown] - terrain.window_key[1] + 0.5
        return cls(
            np.append(b.x, x),
            np.append(b.y, y),
            np.append(b.level, terrain.z[unknown]).astype(np.float64),
            np.append(radius, np.full(unknown.size, falls)),
        )

    def around(self, x: float, y: float, reach: float) -> "KeptOff":
        """Those within `reach` of a place along both axes."""
        near = (np.abs(self.x - x) <= reach) & (np.abs(self.y - y) <= reach)
        return KeptOff(self.x[near], self.y[near], self.level[near], self.radius[near])


class Ground(NamedTuple):
    """The ground that lines may lead over: `column` and its first node, z, `graph`; whether a node is `ground`, whether the middle line may
    be over it (`passable`), which piece of turning room it belongs to (`piece`, -1 for none), and whether a kerb is so near that wheels
    should not turn there (`kerbed`)."""

    ny: int
    start: NDArray[np.int32]
    column: NDArray[np.int32]
    z: NDArray[np.int16]
    graph: NDArray[np.int32]
    ground: NDArray[np.bool_]
    passable: NDArray[np.bool_]
    piece: NDArray[np.int32]
    kerbed: NDArray[np.bool_]


@dataclass(frozen=True)
class PassageConfig:
    """Where the robot may drive straight without room to turn."""

    enabled: bool = parameter(True, "-", "false: the robot goes only where it can turn, as in the thesis")
    most_length_m: float = parameter(12.0, "m", "longest way without room to turn", low=0.0, high=20.0)
    run_up_m: float = parameter(
        0.5,
        "m",
        "way in line with a straight passage, over ground with room to turn, at both ends; ways that bend need none",
        low=0.0,
        high=5.0,
    )
    longest_run_up_m: float = parameter(0.8, "m", "the same where there is more room", low=0.0, high=5.0)
    ample_room_m: float = parameter(
        0.16, "m", "room beside the outline, beyond what is needed, with which a way that bends costs no more", low=0.01, high=1.0
    )
    close_weight: float = parameter(2.0, "-", "by how many times a way that bends costs more without any of that room", low=0.0, high=50.0)
    corner_m: float = parameter(0.24, "m", "way that one corner less of a way that bends is worth", low=0.0, high=5.0)

    def validate(self) -> list[str]:
        """All violations, as sentences."""
        return check_ranges(self)


class Demand(NamedTuple):
    """What is asked of a line, in voxels: its longest narrow part, shortest and longest run-up, half the width of the outline, and in
    height the band of levels that bar it and by how much the ground may differ from side to side."""

    most: float
    run_up: float
    longest_run_up: float
    half_width: float
    band: float
    rise: int

    @classmethod
    def of(cls, config: PassageConfig, robot: RobotBody, resolution: float) -> "Demand":
        """As configured, for this robot."""
        half_width, step, slope = robot.half_width_m / resolution, math.ceil(robot.max_step_m / resolution), math.tan(robot.max_slope_rad)
        band = step + math.ceil(robot.passage_radius_m / resolution * slope)
        run_up, longest = config.run_up_m / resolution, max(config.run_up_m, config.longest_run_up_m) / resolution
        return cls(config.most_length_m / resolution, run_up, longest, half_width, float(band), step + math.ceil(half_width * slope))

    @property
    def longest_line(self) -> int:
        """Nodes that a line from any of its nodes to one end can have."""
        return math.ceil(self.most + self.longest_run_up) + 3


def ground_of(terrain: Terrain, piece: NDArray[np.int32]) -> Ground:
    """The surface of a terrain, whose nodes belong to these pieces (N,) of turning room."""
    count, start = terrain.surface_count, terrain.column_start.astype(np.int32)
    label = terrain.label[:count]
    column = np.repeat(np.arange(start.size - 1, dtype=np.int32), np.diff(start))
    is_open = label == TerrainClass.TRAVERSABLE
    ground = is_open | (label == TerrainClass.INFLATION)
    graph, passable = terrain.neighbours[:count], is_open | terrain.narrow[:count]
    return Ground(terrain.columns.ny, start, column, terrain.z[:count], graph, ground, passable, piece, terrain.near_kerb[:count])


@lean_njit
def step(graph: NDArray[np.int32], node: Index, mx: Index, my: Index) -> Index:
    """The node one column on along x, y or both."""
    if mx != 0 and my != 0:
        return diagonal(graph, node, 0 if mx > 0 and my > 0 else 1 if mx < 0 and my > 0 else 2 if mx < 0 else 3)
    if mx == 0 and my == 0:
        return node
    on: Index = graph[node, 0 if mx > 0 else 2 if mx < 0 else 1 if my > 0 else 3]
    return on


@lean_njit
def _walk(g: Any, demand: Any, node: Any, x: Any, y: Any, dx: Any, dy: Any, out: Any) -> Any:
    """Number of nodes from `node` at x, y in direction dx, dy to the end of the run-up, where wheels may turn, written to `out`; 0 when
    none is reached."""
    h = 1.0 / max(abs(dx), abs(dy))
    px, py, begun, end = int(np.floor(x)), int(np.floor(y)), -1, 0
    out[0] = node
    for i in range(1, out.size):
        cx, cy = int(np.floor(x + i * h * dx)), int(np.floor(y + i * h * dy))
        node = step(g.graph, node, cx - px, cy - py)
        if begun >= 0 and (node < 0 or g.piece[node] != g.piece[out[begun]] or (i - begun) * h > demand.longest_run_up):
            return end
        if node < 0 or not g.passable[node] or (begun < 0 and i * h > demand.most):
            return 0
        px, py = cx, cy
        out[i] = node
        if begun < 0 and g.piece[node] >= 0:
            begun = i
        if begun >= 0 and (i - begun) * h >= demand.run_up and not g.kerbed[node]:
            end = i + 1
    return 0


@lean_njit
def _room_beside(b: Any, demand: Any, x: Any, y: Any, dx: Any, dy: Any, levels: Any, first: Any) -> Any:
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


@njit(cache=True)
def _line_through(g: Any, demand: Any, node: Any, x: Any, y: Any, dx: Any, dy: Any, is_through: Any, ahead: Any, behind: Any) -> Any:
    """Nodes of the line through x, y from a run-up to one in another piece, or, if it is not to lead `through`, to x, y only; and how many
    of them come before `node`; none where there is no such line."""
    ahead[0] = node
    count = _walk(g, demand, node, x, y, dx, dy, ahead) if is_through else 1
    back = _walk(g, demand, node, x, y, -dx, -dy, behind) if count > 0 else 0
    if back == 0 or (is_through and g.piece[ahead[count - 1]] == g.piece[behind[back - 1]]):
        return ahead[:0].copy(), 0
    return np.concatenate((behind[1:back][::-1], ahead[:count])), back - 1


@njit(cache=True)
def centred_line(
    g: Ground, b: KeptOff, demand: Demand, s: int, way: tuple[float, float], is_through: bool, scratch: tuple[Nodes, Nodes]
) -> tuple[Nodes, int, float, float, float]:
    """The line through node s in a direction, or up to it if it is not to lead `through`, moved aside to where as much room is on its
    left as on its right: its nodes, how many come before x, y, then x, y, and the lesser room; no nodes where there is none."""
    (dx, dy), (ahead, behind) = way, scratch
    x, y = g.column[s] // g.ny + 0.5, g.column[s] % g.ny + 0.5
    node: Any = np.int64(s)
    line, before = _line_through(g, demand, node, x, y, dx, dy, is_through, ahead, behind)
    if line.size == 0:
        return line, 0, x, y, 0.0
    left, right = _room_beside(b, demand, x, y, dx, dy, g.z[line], -before)
    shift = (left - right) / 2
    x, y = x - shift * dy, y + shift * dx
    node = find_node(g.start, g.z, int(np.floor(x)) * g.ny + int(np.floor(y)), np.int64(g.z[s]), demand.rise)
    if left + right < 0 or node < 0 or not g.passable[node]:
        return line[:0], 0, x, y, 0.0
    line, before = _line_through(g, demand, node, x, y, dx, dy, is_through, ahead, behind)
    if line.size == 0:
        return line, 0, x, y, 0.0
    left, right = _room_beside(b, demand, x, y, dx, dy, g.z[line], -before)
    return line, before, x, y, min(left, right)


@lean_njit
def is_covered(g: Ground, demand: Demand, at: tuple[float, float], way: tuple[float, float], line: Nodes, first: int) -> bool:
    """Whether there is ground everywhere beside a line through a place in a direction, as far as the outline reaches."""
    (x, y), (dx, dy) = at, way
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


@lean_njit
def score_of(room: float, length: float) -> float:
    """How good a line is with so many voxels of room beside it and so many on a way that had better be short."""
    return min(room, _ENOUGH) - _LENGTH_WEIGHT * length


def points_of(
    ground: Ground,
    line: NDArray[np.int32],
    at: tuple[float, float],
    way: tuple[float, float],
    before: int,
    key: tuple[int, int],
    resolution: float,
) -> Array:
    """(K, 3) points in map in metres of the nodes of a line in direction `way` through `at`, `before` of which come before that."""
    steps = (np.arange(line.size) - before) / max(abs(way[0]), abs(way[1]))
    xy = (np.array(at) + key + steps[:, None] * np.array(way)) * resolution
    return np.column_stack([xy, (ground.z[line] + 0.5) * resolution])
