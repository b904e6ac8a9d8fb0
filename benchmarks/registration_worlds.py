"""Where the benchmarks of registration drive: the simulator's worlds and a few of their own, and seeded drives over their ground.

No physics: the robot stands on the plane that fits the ground below its wheels best, where the simulator would let it start.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation.clutter import plan_bounds, plan_gap
from pybullet_simulation.ramp_world import PLATEAU, PLATEAU_HEIGHT_M
from pybullet_simulation.solids import Solid, box, walls_around
from pybullet_simulation.start_pose import ASKED_FOR, StandingTest
from pybullet_simulation.world import World, joined, nearest_hits, raycasting_scene
from pybullet_simulation.worlds import load_world
from robot_body import RobotBody

Array = NDArray[np.float64]

BUILT_IN = ("rooms", "ramp", "moon")
CORRIDORS = ("corridor", "corridor_features")
MOVED = "_moved"  # behind a world's name: one piece of its furniture stands elsewhere
CORRIDOR_M, CORRIDOR_WIDTH_M, CEILING_M = 140.0, 2.4, 2.5
STEP_M = (2.0, 3.0)  # between two sweeps
CHECK_EVERY_M = 0.25
ROBOT_CLEAR_M = 0.8
MAX_CLIMB_M = 0.11  # between two checks: 22 deg
CLIMB_BONUS = 4.0  # a metre of height is worth so many of distance when the next place is chosen
CLUTTER = ("crate", "pillar", "box_", "dumpster", "hydrant")


def world_of(name: str, seed: int) -> World:
    """A world by name; ValueError for one that is not known."""
    if name in BUILT_IN:
        return load_world(name, seed)
    rng = np.random.default_rng([seed, 31])
    if name in CORRIDORS:
        return _made(name, _corridor(rng if name == "corridor_features" else None), (-8.0, -0.4), (8.0, 0.4))
    if name == "office":
        return _office(rng)
    raise ValueError(f"unknown world {name!r}; expected {', '.join((*BUILT_IN, *CORRIDORS, 'office'))}")


def _made(name: str, solids: list[Solid], low_xy: tuple[float, float], high_xy: tuple[float, float]) -> World:
    """A world of solids on a floor at height 0; the drive starts between the two corners."""
    vertices, triangles = joined(solids)
    extent = np.array([[*low_xy, 0.0], [*high_xy, CEILING_M]])
    return World(name, tuple(solids), (), vertices, triangles, extent, (0.0, 0.0, 0.0), 0.0)


def _corridor(rng: np.random.Generator | None) -> list[Solid]:
    """Floor, ceiling and two walls along x that end out of sight; with `rng` a pilaster or a cupboard every few metres."""
    x, y = CORRIDOR_M / 2, CORRIDOR_WIDTH_M / 2
    solids = [box("floor", (-x, -y - 0.2, -0.2), (x, y + 0.2, 0.0)), box("ceiling", (-x, -y - 0.2, CEILING_M), (x, y + 0.2, 2.7))]
    solids += [box("wall_south", (-x, -y - 0.2, -0.05), (x, -y, 2.55)), box("wall_north", (-x, y, -0.05), (x, y + 0.2, 2.55))]
    at = -x
    while rng is not None and (at := at + float(rng.uniform(3.0, 7.0))) < x:
        depth, width, height = (0.12, 0.3, 2.55) if rng.random() < 0.6 else (0.35, rng.uniform(0.5, 1.2), rng.uniform(0.7, 1.9))
        low, high = sorted((y, y - depth)) if rng.random() < 0.5 else sorted((-y, -y + depth))
        solids.append(box(f"feature_{len(solids)}", (at, low, -0.05), (at + width, high, height)))
    return solids


def _office(rng: np.random.Generator) -> World:
    """One closed room of 6-10 by 5-7 m with furniture along its walls."""
    x, y = rng.uniform(3.0, 5.0), rng.uniform(2.5, 3.5)
    solids = [box("floor", (-x - 0.2, -y - 0.2, -0.2), (x + 0.2, y + 0.2, 0.0))]
    solids += [box("ceiling", (-x - 0.2, -y - 0.2, CEILING_M), (x + 0.2, y + 0.2, 2.7)), *walls_around((-x, -y), (x, y), -0.05, 2.55)]
    for k in range(int(rng.integers(4, 8))):
        depth, width, height = rng.uniform(0.25, 0.7), rng.uniform(0.4, 1.6), rng.uniform(0.4, 2.0)
        side, along = rng.choice([-1.0, 1.0]), rng.uniform(-0.9, 0.9)
        middle, half = ((along * (x - width / 2), side * (y - depth / 2)), (width / 2, depth / 2))
        if k % 2:
            middle, half = ((side * (x - depth / 2), along * (y - width / 2)), (depth / 2, width / 2))
        low, high = np.subtract(middle, half), np.add(middle, half)
        solids.append(box(f"furniture_{k}", (*low, -0.05), (*high, height)))
    return _made("office", solids, (-x + 1.0, -y + 1.0), (x - 1.0, y - 1.0))


def with_moved_furniture(world: World, seed: int, standpoints_xy: Array) -> World:
    """One thing, with all that belongs to it, 0.4 to 0.8 m from where it was, clear of everything else and of standpoints (K, 2)."""
    rng = np.random.default_rng([seed, 34])
    things = sorted({"_".join(s.name.split("_")[:2]) for s in world.solids if s.name.startswith(CLUTTER)})
    for _ in range(500):
        thing, angle, shift = rng.choice(things), rng.uniform(-math.pi, math.pi), rng.uniform(0.4, 0.8)
        offset = shift * np.array([math.cos(angle), math.sin(angle), 0.0])
        solids = [replace(s, vertices=s.vertices + offset, box=None) if s.name.startswith(thing) else s for s in world.solids]
        bounds = plan_bounds([s for s in solids if s.name.startswith(thing)])
        others = [plan_bounds([s]) for s in world.solids if not s.name.startswith((thing, "ground"))]
        robots = [np.array([xy, xy]) for xy in standpoints_xy]
        if min(plan_gap(bounds, b) for b in others) > 0.05 and min(plan_gap(bounds, b) for b in robots) > ROBOT_CLEAR_M:
            vertices, triangles = joined([*solids, *world.surfaces])
            return replace(world, name=world.name + MOVED, solids=tuple(solids), vertices=vertices, triangles=triangles)
    raise ValueError(f"nothing of {world.name} can be moved")


class Ground:
    """Answers where the robot can stand in a world, and how."""

    def __init__(self, world: World) -> None:
        self._test = StandingTest(world.vertices, world.triangles, RobotBody())
        self._scene = raycasting_scene(world.vertices, world.triangles)
        self._base_m = RobotBody().base_height_m

    def level(self, x: float, y: float, yaw: float, near_z: float, reach_m: float) -> float | None:
        """The ground's height nearest to `near_z`, within `reach_m` of it, if the robot fits there."""
        levels = [z for z in self._test.ground_levels(x, y) if abs(z - near_z) <= reach_m]
        z = min(levels, key=lambda level: abs(level - near_z), default=None)
        return z if z is not None and self._test.obstruction(x, y, z, yaw, ASKED_FOR) is None else None

    def pose(self, x: float, y: float, z: float, yaw: float) -> Array:
        """T_map_base of the robot on the plane through the ground below its wheels."""
        u, v = (
            a.ravel()
            for a in np.meshgrid(np.linspace(-0.5, 0.5, 5) * RobotBody().wheelbase_m, np.linspace(-0.5, 0.5, 5) * RobotBody().track_m)
        )
        dx, dy = u * math.cos(yaw) - v * math.sin(yaw), u * math.sin(yaw) + v * math.cos(yaw)
        rays = np.column_stack([x + dx, y + dy, np.full(25, z + 0.9), np.zeros(25), np.zeros(25), np.full(25, -1.0)])
        heights = z + 0.9 - nearest_hits(self._scene, rays.astype(np.float32)).astype(float)
        (a, b, height), *_ = np.linalg.lstsq(np.column_stack([dx, dy, np.ones(25)]), heights, rcond=None)
        up = np.array([-a, -b, 1.0]) / math.sqrt(a * a + b * b + 1.0)
        ahead = np.array([math.cos(yaw), math.sin(yaw), a * math.cos(yaw) + b * math.sin(yaw)])
        ahead /= np.linalg.norm(ahead)
        T = np.eye(4)
        T[:3, :3] = np.column_stack([ahead, np.cross(up, ahead), up])
        T[:3, 3] = np.array([x, y, height]) + self._base_m * up
        return T

    def way(self, start: Array, yaw: float, length_m: float) -> float | None:
        """The height of the ground at the end of a straight drive from `start` (x, y, z) if all of it can be driven."""
        z = float(start[2])
        for gone in np.linspace(0.0, length_m, math.ceil(length_m / CHECK_EVERY_M) + 1)[1:]:
            found = self.level(start[0] + gone * math.cos(yaw), start[1] + gone * math.sin(yaw), yaw, z, MAX_CLIMB_M)
            if found is None:
                return None
            z = found
        return z


def drive_poses(world: World, seed: int, count: int) -> Array:
    """(count, 4, 4) T_map_base along a drive, each 2 to 3 m from the last; ValueError when no drive of that length was found.

    Every other drive through the ramp world starts on its plateau.
    """
    ground, rng = Ground(world), np.random.default_rng([seed, 32])
    on_plateau = world.name == "ramp" and seed % 2 == 0
    area, near_z = (np.array(PLATEAU), PLATEAU_HEIGHT_M) if on_plateau else (world.extent[:, :2], 0.0)
    for _ in range(300):
        x, y = rng.uniform(area[0], area[1])
        yaw = float(rng.uniform(-math.pi, math.pi))
        z = ground.level(x, y, yaw, near_z, 1.5)
        spots = [np.array([x, y, z, yaw])] if z is not None else []
        while 0 < len(spots) < count and (spot := next_spot(ground, spots, rng)) is not None:
            spots.append(spot)
        if len(spots) == count:
            return np.array([ground.pose(*spot) for spot in spots])
    raise ValueError(f"no drive of {count} sweeps was found in {world.name}")


def next_spot(ground: Ground, spots: list[Array], rng: np.random.Generator) -> Array | None:
    """Of a few places that can be driven to the one farthest from all that were seen, preferably up or down: (x, y, z, yaw)."""
    here, best, most = spots[-1], None, -1.0
    for k in range(24):
        bearing = here[3] + (rng.normal(0.0, 0.8) if k < 12 else rng.uniform(-math.pi, math.pi))
        length = float(rng.uniform(*STEP_M))
        x, y = here[0] + length * math.cos(bearing), here[1] + length * math.sin(bearing)
        gap = min(math.hypot(x - s[0], y - s[1]) for s in spots)
        yaw = bearing + rng.normal(0.0, 0.3)
        if (z := ground.way(here[:3], bearing, length)) is None or ground.level(x, y, yaw, z, 0.01) is None:
            continue
        worth = gap + CLIMB_BONUS * abs(z - here[2])
        if worth > most:
            best, most = np.array([x, y, z, yaw]), worth
    return best
