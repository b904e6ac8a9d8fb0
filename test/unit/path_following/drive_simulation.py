"""A unicycle that slips, on a world of lethal cells: enough of a robot to drive the follower in a loop, without physics."""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy import ndimage

from path_following import FollowerObservation, FollowerOutput, PathFollower
from rigid_geometry import transform_from_rpy

TICK_S = 0.05
RESOLUTION = 0.08


@dataclass(frozen=True)
class Grid:
    """A costmap as the follower expects one."""

    cost: np.ndarray
    origin_xy: tuple[float, float]
    resolution: float = RESOLUTION
    unknown: np.ndarray | None = None


def costs_around(lethal: np.ndarray, unknown: np.ndarray | None = None) -> np.ndarray:
    """Inflated costs of a (ny, nx) bool grid, as costmap_2d has them: inscribed 0.34 m, scaling 5 to 0.9 m."""
    if not lethal.any():
        cost = np.zeros(lethal.shape)
    else:
        distance = ndimage.distance_transform_edt(~lethal, sampling=RESOLUTION)
        cost = np.where(distance > 0.9, 0, 252 * np.exp(-5 * np.maximum(distance - 0.34, 0)))
        cost[distance <= 0.34] = 253
    cost[lethal] = 254
    if unknown is not None:
        cost[unknown & (cost < 253)] = 255
    return cost.astype(np.uint8)


@dataclass
class World:
    """A square of `size` metres around the origin; `lethal` may change while the robot drives."""

    size: float = 20.0
    lethal: np.ndarray = field(init=False)
    unknown: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        n = round(self.size / RESOLUTION)
        self.lethal, self.unknown = np.zeros((n, n), dtype=bool), np.zeros((n, n), dtype=bool)

    def cells(self, x0: float, x1: float, y0: float, y1: float) -> tuple[slice, slice]:
        """The cells of a box in metres."""
        columns, rows = (tuple(round((v + self.size / 2) / RESOLUTION) for v in pair) for pair in ((x0, x1), (y0, y1)))
        return slice(*rows), slice(*columns)

    def grid(self) -> Grid:
        return Grid(costs_around(self.lethal, self.unknown), (-self.size / 2, -self.size / 2), unknown=self.unknown & ~self.lethal)

    def touches(self, x: float, y: float, yaw: float) -> bool:
        """True when the outline of 0.99 x 0.67 m covers a lethal cell's centre."""
        rows, columns = np.nonzero(self.lethal)
        dx = (columns + 0.5) * RESOLUTION - self.size / 2 - x
        dy = (rows + 0.5) * RESOLUTION - self.size / 2 - y
        ahead, left = math.cos(yaw) * dx + math.sin(yaw) * dy, math.cos(yaw) * dy - math.sin(yaw) * dx
        return bool(((np.abs(ahead) < 0.495) & (np.abs(left) < 0.335)).any())


@dataclass
class Drive:
    """What a run left behind: true poses (K, 3), outputs, and whether the robot touched anything."""

    poses: np.ndarray
    outputs: list[FollowerOutput]
    touched: bool

    @property
    def last(self) -> FollowerOutput:
        return self.outputs[-1]

    def states(self) -> list[str]:
        """The states in their order, without repetitions."""
        names = [o.state.value for o in self.outputs]
        return [n for i, n in enumerate(names) if i == 0 or names[i - 1] != n]


@dataclass(frozen=True)
class Robot:
    """How the robot falls short of the command: share of speed and turn rate, drift to the left, dead band of a turn in place, how far it
    slides to its side for every radian that it turns on a slope that falls to that side, along -y, how steeply that falls, and whether it
    notices; how late a command takes effect, and how fast it can slow down; whether its wheels spin, so that odometry has the command."""

    speed_share: float = 0.97
    turn_share: float = 0.85
    sideways: float = 0.0
    dead_turn_radps: float = 0.15
    slide_m_per_rad: float = 0.0
    slope_rad: float = 0.0
    feels_slide: bool = True
    delay_s: float = 0.0
    deceleration_mps2: float = math.inf
    spins: bool = False


def drive(
    follower: PathFollower,
    world: World,
    start: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    robot: Robot | None = None,
    seconds: float = 90.0,
    pose_error: Callable[[float], tuple[float, float, float]] = lambda t: (0.0, 0.0, 0.0),
    each_tick: Callable[[float], None] = lambda t: None,
) -> Drive:
    """Drive until the follower is over or the time is; `pose_error(t)` is added to the true pose that the follower is told."""
    robot = robot or Robot()
    x, y, yaw = start
    poses, outputs, touched, twist, unfelt = [], [], False, (0.0, 0.0), np.zeros(2)
    told = (0.0, 0.0)
    grid, seen = world.grid(), (world.lethal.copy(), world.unknown.copy())
    late = deque([(0.0, 0.0)] * round(robot.delay_s / TICK_S))
    for k in range(round(seconds / TICK_S)):
        t = 1.0 + k * TICK_S
        each_tick(t)
        if not np.array_equal(seen, (world.lethal, world.unknown)):
            grid, seen = world.grid(), (world.lethal.copy(), world.unknown.copy())
        ex, ey, eyaw = pose_error(t)
        tilted = transform_from_rpy([x + ex - unfelt[0], y + ey - unfelt[1], 0.132], (robot.slope_rad, 0.0, 0.0))
        T_map_base = tilted @ transform_from_rpy([0.0, 0.0, 0.0], (0.0, 0.0, yaw + eyaw))
        out = follower.step(FollowerObservation(t, T_map_base, grid, told if robot.spins else twist))
        poses.append((x, y, yaw))
        outputs.append(out)
        if out.state.is_over and (not robot.delay_s or twist == (0.0, 0.0)):
            break
        late.append((out.v, out.w))
        told = v, w = late.popleft()
        w = 0.0 if abs(w) < robot.dead_turn_radps and abs(v) < 0.02 else w * robot.turn_share
        twist = (max(v * robot.speed_share, twist[0] - robot.deceleration_mps2 * TICK_S), w)
        x += (math.cos(yaw) * twist[0] - math.sin(yaw) * robot.sideways * twist[0]) * TICK_S
        y += (math.sin(yaw) * twist[0] + math.cos(yaw) * robot.sideways * twist[0]) * TICK_S
        slid = robot.slide_m_per_rad * abs(w) * TICK_S * -math.cos(yaw) * np.array([-math.sin(yaw), math.cos(yaw)])
        x, y, unfelt = x + slid[0], y + slid[1], unfelt + (0.0 if robot.feels_slide else slid)
        yaw += w * TICK_S
        touched = touched or (k % 4 == 0 and world.touches(x, y, yaw))
    return Drive(np.array(poses), outputs, touched)


def cluttered_world(rng: np.random.Generator) -> World:
    """14 boxes of 0.2 to 0.8 m anywhere but at the origin."""
    world = World(16.0)
    for x, y, half in zip(rng.uniform(-6, 6, 14), rng.uniform(-6, 6, 14), rng.uniform(0.1, 0.4, 14), strict=True):
        if math.hypot(x, y) > 1.2:
            world.lethal[world.cells(x - half, x + half, y - half, y + half)] = True
    return world


def planned_path(world: World, rng: np.random.Generator, clearance_m: float) -> np.ndarray:
    """(K, 3) shortest path over four neighbours from the origin to a random cell 2 to 6 m away, off all that is lethal."""
    n = world.lethal.shape[0]
    free = ndimage.distance_transform_edt(~world.lethal, sampling=RESOLUTION) >= clearance_m
    previous: dict[tuple[int, int], tuple[int, int] | None] = {(n // 2, n // 2): None}
    queue = deque(previous)
    while queue:
        row, column = queue.popleft()
        for near in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1)):
            if 0 <= near[0] < n and 0 <= near[1] < n and free[near] and near not in previous:
                previous[near] = (row, column)
                queue.append(near)
    goals = [c for c in previous if 2.0 < math.dist(c, (n / 2, n / 2)) * RESOLUTION < 6.0]
    cell: tuple[int, int] | None = goals[rng.integers(len(goals))]
    cells = []
    while cell is not None:
        cells.append(cell)
        cell = previous[cell]
    xy = (np.array(cells[::-1], dtype=float)[:, ::-1] + 0.5) * RESOLUTION - world.size / 2
    return np.column_stack([xy, np.zeros(len(xy))])


def distance_to_path(poses: np.ndarray, path: np.ndarray) -> np.ndarray:
    """(K,) distances of poses from a polyline (brute force)."""
    a, b = path[:-1, :2], path[1:, :2]
    best = np.full(len(poses), np.inf)
    for p, q in zip(a, b, strict=True):
        share = np.clip((poses[:, :2] - p) @ (q - p) / max(float((q - p) @ (q - p)), 1e-12), 0, 1)
        best = np.minimum(best, np.linalg.norm(p + share[:, None] * (q - p) - poses[:, :2], axis=1))
    return best
