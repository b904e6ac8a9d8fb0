"""Where the robot can stand: ground under all of it, nothing inside or too near. Chooses the start, or judges the one asked for."""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import open3d as o3d
from numpy.typing import NDArray

from pybullet_simulation.world import nearest_hits, raycasting_scene
from robot_body import RobotBody
from world_files import OPEN, closed_solids

Array = NDArray[np.float64]

HEADROOM_MARGIN_M = 0.2
UP = np.array([0.0, 0.0, 1.0])
_SAME_HEIGHT_M = 1e-3
_COMPARED = 20  # places to start, of which one that is low is taken
_ASIDE_M = (1.7e-4, 0.9e-4)  # off the edges of triangles, which a ray meets twice or not at all


@dataclass(frozen=True)
class Demand:
    """What a start must offer: free distance around a robot that turns (None: just its outline), slope and roughness of the ground."""

    around_m: float | None
    max_slope_rad: float
    max_roughness_m: float


FLAT = Demand(around_m=0.5, max_slope_rad=math.radians(2.0), max_roughness_m=0.03)
FLATTISH = Demand(around_m=0.5, max_slope_rad=math.radians(6.0), max_roughness_m=0.08)
ASKED_FOR = Demand(around_m=None, max_slope_rad=math.radians(20.0), max_roughness_m=0.10)


class NoStartError(ValueError):
    """There is no ground to start on, or not where it was asked for."""


class StandingTest:
    """Answers whether, and at which height, the robot can stand at (x, y, yaw) in a mesh."""

    def __init__(self, vertices: Array, triangles: NDArray[np.int32], robot: RobotBody, solid: NDArray[np.int32] | None = None) -> None:
        """`solid` (T,): the number of the closed solid that each triangle bounds, OPEN where it bounds none; None: found here."""
        self._scene = raycasting_scene(vertices, triangles)
        self._top = float(vertices[:, 2].max()) + 1.0
        self._solid, self._robot = closed_solids(vertices, triangles) if solid is None else solid, robot

    @property
    def height_tolerance_m(self) -> float:
        """How far the z of a start may be off the ground."""
        return self._robot.standing_tolerance_m

    @property
    def robot_height_m(self) -> float:
        """Height of the robot above the ground."""
        return self._robot.height_m

    def ground_levels(self, x: float, y: float) -> list[float]:
        """Heights of the surfaces at (x, y) with headroom above them, lowest first; empty when there is none."""
        ray = np.array([[x, y, self._top, 0.0, 0.0, -1.0]], np.float32)
        found = self._scene.list_intersections(o3d.core.Tensor.from_numpy(ray))
        heights = self._top - found["t_hit"].numpy().astype(float)
        heights.sort()
        return [z for z in self._with_headroom(heights.tolist()) if not self._is_inside(x, y, z)]

    def is_above_ground(self, x: float, y: float, z: float) -> bool:
        """Whether there is other ground below the robot, at (x, y, z) or around it: a roof may stand on a post just there."""
        places = np.array([x, y]) + _offsets(self._robot, 0.0, 0.0)[::4, :2]
        return any(level < z - self._robot.height_m for a, b in places.tolist() for level in self.ground_levels(a, b))

    def _with_headroom(self, heights: list[float]) -> list[float]:
        levels = []
        for i, z in enumerate(heights):
            above = next((higher for higher in heights[i + 1 :] if higher > z + _SAME_HEIGHT_M), math.inf)
            if above > z + self._robot.height_m + HEADROOM_MARGIN_M:
                levels.append(z)
        return levels

    def _is_inside(self, x: float, y: float, z: float) -> bool:
        """Whether a closed solid is around the space above a level: a ray upwards leaves it once more often than it enters."""
        ray = np.array([[x + _ASIDE_M[0], y + _ASIDE_M[1], z + _SAME_HEIGHT_M, 0.0, 0.0, 1.0]], np.float32)
        met = self._scene.list_intersections(o3d.core.Tensor.from_numpy(ray))["primitive_ids"].numpy()
        solids = self._solid[met]
        return bool((np.bincount(solids[solids != OPEN]) % 2 == 1).any())

    def obstruction(self, x: float, y: float, z: float, yaw: float, demand: Demand) -> str | None:
        """Why the robot cannot stand on the ground at (x, y, z), or None when it can."""
        offsets = _offsets(self._robot, yaw, demand.around_m)
        centre = np.array([x, y, z])
        down = np.hstack([centre + offsets + 0.9 * UP, np.tile(-UP, (len(offsets), 1))]).astype(np.float32)
        depths = nearest_hits(self._scene, down).astype(float)
        if not np.isfinite(depths).all():
            return self._beside(centre, np.zeros(2), yaw, demand) or "there is no ground under all of the robot"
        ground = centre + offsets + UP * (0.9 - depths)[:, None]
        plane, *_ = np.linalg.lstsq(np.column_stack([ground[:, :2] - centre[:2], np.ones(len(ground))]), ground[:, 2], rcond=None)
        slope = math.atan(math.hypot(plane[0], plane[1]))
        roughness = float(np.abs(ground[:, 2] - plane[2] - (ground[:, :2] - centre[:2]) @ plane[:2]).max())
        if slope > demand.max_slope_rad or roughness > demand.max_roughness_m:
            return f"it is inside an obstacle or on rough ground (slope {math.degrees(slope):.0f} deg, steps {roughness:.2f} m)"
        return self._beside(centre, np.array([plane[0], plane[1]]), yaw, demand)

    def _beside(self, centre: Array, gradient: Array, yaw: float, demand: Demand) -> str | None:
        angles = np.linspace(0.0, 2.0 * math.pi, 90, endpoint=False)
        directions = np.column_stack([np.cos(angles), np.sin(angles), gradient[0] * np.cos(angles) + gradient[1] * np.sin(angles)])
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        robot, around_m = self._robot, demand.around_m
        needed = _footprint_reach(robot, angles - yaw) if around_m is None else np.full(90, robot.turning_radius_m + around_m)
        for height in np.linspace(0.2, 1.0, 5) * robot.height_m:
            rays = np.hstack([np.tile(centre + height * UP, (90, 1)), directions]).astype(np.float32)
            if (nearest_hits(self._scene, rays) < needed).any():
                return "it is inside or too near to a wall or obstacle"
        return None


def _footprint_reach(robot: RobotBody, bearings: Array) -> Array:
    """Distance from the centre to the outline of the footprint along bearings, with 2 cm to spare."""
    with np.errstate(divide="ignore"):
        to_ends, to_sides = robot.half_length_m / np.abs(np.cos(bearings)), robot.half_width_m / np.abs(np.sin(bearings))
        return np.asarray(np.minimum(to_ends, to_sides) + 0.02)


def _offsets(robot: RobotBody, yaw: float, around_m: float | None) -> Array:
    """(N, 3) level offsets at which ground is needed: a disc around the robot, or its outline."""
    if around_m is not None:
        angles = np.linspace(0.0, 2.0 * math.pi, 24, endpoint=False)
        radii = np.repeat(np.array([0.0, 0.4, 0.75, 1.0]) * (robot.turning_radius_m + around_m), 24)
        return np.column_stack([radii * np.tile(np.cos(angles), 4), radii * np.tile(np.sin(angles), 4), np.zeros(96)])
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(-0.5, 0.5, 9) * robot.length_m, np.linspace(-0.5, 0.5, 7) * robot.width_m))
    return np.column_stack([u * math.cos(yaw) - v * math.sin(yaw), u * math.sin(yaw) + v * math.cos(yaw), np.zeros(u.size)])


@dataclass(frozen=True)
class AskedStart:
    """Where somebody wants the robot to start, in m and rad; z: the height of the ground, None where any will do."""

    x: float
    y: float
    yaw: float
    z: float | None = None
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __str__(self) -> str:
        """In the coordinates that it was asked for in."""
        x, y, z = self.origin
        return f"x {self.x + x:.12g} y {self.y + y:.12g}" + ("" if self.z is None else f" z {self.z + z:.12g}")

    @classmethod
    def of(cls, numbers: Sequence[float]) -> "AskedStart":
        """From x y yaw, or x y z yaw; ValueError for anything else."""
        if len(numbers) not in (3, 4) or not all(math.isfinite(v) for v in numbers):
            raise ValueError(f"start {tuple(numbers)} is not three or four finite numbers x y yaw, or x y z yaw")
        x, y, *z, yaw = numbers
        return cls(x, y, yaw, z[0] if z else None)

    def relative_to(self, origin: Array) -> "AskedStart":
        """The same start, seen from an origin (3,), which is kept for what is said of it."""
        x, y, z = origin.tolist()
        return AskedStart(self.x - x, self.y - y, self.yaw, None if self.z is None else self.z - z, (x, y, z))


def check_start(test: StandingTest, start: AskedStart, ground_z: tuple[float, float] | None = None) -> float:
    """Height of the ground at a start that somebody asked for, the lowest level that will do, or the nearest to its z.

    `ground_z`: the range of heights in which ground may lie, if known. NoStartError when there is no ground or the robot does not fit.
    """
    x, y = start.x, start.y
    levels = test.ground_levels(x, y)
    usable = [z for z in levels if ground_z is None or ground_z[0] <= z <= ground_z[1]]
    if (asked_z := start.z) is not None:
        usable = sorted((z for z in usable if abs(z - asked_z) <= test.height_tolerance_m), key=lambda z: abs(z - asked_z))
    reasons = []
    for z in usable:
        reason = test.obstruction(x, y, z, start.yaw, ASKED_FOR)
        if reason is None:
            return z
        reasons.append(reason)
    found = ", ".join(f"{z + start.origin[2]:.2f}" for z in levels)
    no_level = f"the ground with headroom there lies at z {found}" if start.z is not None else "it is inside a wall or obstacle"
    why = reasons[0] if reasons else (no_level if levels else "there is no ground with headroom")
    raise NoStartError(f"the robot cannot start at {start}: {why}")


def choose_start(
    test: StandingTest, area: Array, rng: np.random.Generator, ground_z: tuple[float, float] | None = None, tries: int = 2000
) -> tuple[tuple[float, float, float], float]:
    """A start (x, y, yaw) on flat free ground in `area` (2, 2) (low xy, high xy), and its height: the flattest kind that is found.

    It is never above other ground, and not higher than some place found beside it by the robot's height: not on a roof, nor on a
    crate. `ground_z`: the range of heights in which ground may lie, if known. NoStartError when nothing will do.
    """
    for demand in (FLAT, FLATTISH):
        places = list(itertools.islice(_places_to_stand(test, area, rng, ground_z, demand, tries), _COMPARED))
        for start, z in places:
            if z <= min(height for _, height in places) + test.robot_height_m:
                return start, z
    raise NoStartError(f"no flat ground with room around the robot and headroom to start on was found in {2 * tries} tries; give a start")


def _places_to_stand(
    test: StandingTest, area: Array, rng: np.random.Generator, ground_z: tuple[float, float] | None, demand: Demand, tries: int
) -> Iterator[tuple[tuple[float, float, float], float]]:
    """Those found in so many tries, on the lowest ground there is at a place."""
    for _ in range(tries):
        x, y = (float(v) for v in rng.uniform(area[0], area[1]))
        yaw = float(rng.uniform(-math.pi, math.pi))
        levels = [z for z in test.ground_levels(x, y) if ground_z is None or ground_z[0] <= z <= ground_z[1]]
        if not levels or test.obstruction(x, y, levels[0], yaw, demand) is not None:
            continue
        if ground_z is not None or not test.is_above_ground(x, y, levels[0]):
            yield (x, y, yaw), levels[0]
