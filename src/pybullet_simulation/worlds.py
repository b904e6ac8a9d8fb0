"""A world by name or from a file, with its start: the one place that knows all worlds there are."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation import doors_world, ramp_world, rooms_world
from pybullet_simulation.height_map import HeightMap, read_height_map, terrain_between
from pybullet_simulation.mesh_file import MESH_SUFFIXES, cut_to, read_mesh
from pybullet_simulation.moon_world import SIDE_M as MOON_SIDE_M
from pybullet_simulation.moon_world import moon
from pybullet_simulation.solids import Solid, walls_around
from pybullet_simulation.start_pose import StandingTest, check_start, choose_start
from pybullet_simulation.terrain import surface_from_heights
from pybullet_simulation.world import HeightField, Surface, World, joined
from robot_body import RobotBody

Array = NDArray[np.float64]
Start = tuple[float, float, float]
Size = tuple[float, float, float]
Area = tuple[float, float]

FILE_WALL_BELOW_M, FILE_WALL_ABOVE_M = 0.5, 1.5
GENTLE_RAD = math.radians(6.0)


@dataclass(frozen=True)
class Parts:
    """What a world is made of before its start is known.

    `start_area` (2, 2), low and high x, y, is where a start may be chosen; `ground_z` the range of heights in which the start's
    ground lies, if known; `closed` whether all triangles face outwards from solids.
    """

    solids: list[Solid]
    start_area: Array
    surfaces: list[Surface] = field(default_factory=list)
    heightfield: HeightField | None = None
    ground_z: tuple[float, float] | None = None
    closed: bool = True


def _rooms(rng: np.random.Generator, start: Start | None) -> Parts:
    return Parts(rooms_world.rooms_solids(rng), np.array([rooms_world.LOW_XY, rooms_world.HIGH_XY]), ground_z=(-0.1, 0.1))


def _doors(rng: np.random.Generator, start: Start | None) -> Parts:
    return Parts(doors_world.doors_solids(rng), np.array([doors_world.LOW_XY, doors_world.HIGH_XY]), ground_z=(-0.1, 0.1))


def _ramp(rng: np.random.Generator, start: Start | None) -> Parts:
    return Parts(ramp_world.ramp_solids(rng), np.array([ramp_world.LOW_XY, ramp_world.HIGH_XY]), ground_z=(-0.1, 0.1))


def _moon(rng: np.random.Generator, start: Start | None) -> Parts:
    half = MOON_SIDE_M / 2
    if start is not None and max(abs(start[0]), abs(start[1])) > half - 1.0:
        raise ValueError(f"the robot cannot start at x {start[0]:g} y {start[1]:g}: moon ends in walls at {-half:g} and {half:g} m")
    terrain, surface, solids, spot = moon(rng, None if start is None else start[:2])
    return Parts(solids, np.array([spot, spot]), [surface], terrain)


WORLDS: dict[str, Callable[[np.random.Generator, Start | None], Parts]] = {"rooms": _rooms, "doors": _doors, "ramp": _ramp, "moon": _moon}
"""The built-in worlds; each is made from a generator, and the moon is levelled around the start that was asked for."""


def load_world(
    name_or_path: str,
    seed: int,
    size_xyz: Size | None = None,
    area_xy: Area | None = None,
    start: Start | None = None,
    robot: RobotBody | None = None,
) -> World:
    """The world of a name (`WORLDS`) or a file, in metres with z up; the seed sets clutter, terrain and start.

    `size_xyz`: size in m over which a height map (.png) is laid, only for those. `area_xy`: bounds a file to so many metres around the
    start, or fewer where the file ends, with walls added. `start`: (x, y, yaw) to start from instead of one chosen by the seed.
    ValueError when the world is unknown, unreadable or empty, an argument does not fit it, or the robot cannot stand at the start.
    """
    body = robot or RobotBody()
    if seed < 0:
        raise ValueError(f"seed {seed} is negative; expected 0 or more")
    if start is not None and not all(math.isfinite(v) for v in start):
        raise ValueError(f"start {start!r} is not three finite numbers x y yaw")
    terrain_rng, start_rng = (np.random.default_rng([seed, stream]) for stream in (1, 2))
    if name_or_path not in WORLDS:
        parts = _from_file(name_or_path, size_xyz, area_xy, start, start_rng, body)
        return _with_start(name_or_path, parts, start, start_rng, body)
    if size_xyz is not None or area_xy is not None:
        raise ValueError(f"size and area are for files; the world {name_or_path} has its own")
    return _with_start(name_or_path, WORLDS[name_or_path](terrain_rng, start), start, start_rng, body)


def _with_start(name: str, parts: Parts, start: Start | None, rng: np.random.Generator, robot: RobotBody) -> World:
    vertices, triangles = joined([*parts.solids, *parts.surfaces])
    test = StandingTest(vertices, triangles, parts.closed, robot)
    if start is None:
        start, start_z = choose_start(test, parts.start_area, rng, parts.ground_z)
    else:
        start_z = check_start(test, start, parts.ground_z)
    extent = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    solids, surfaces = tuple(parts.solids), tuple(parts.surfaces)
    return World(name, solids, surfaces, vertices, triangles, extent, start, start_z, parts.heightfield)


def _from_file(
    text: str,
    size_xyz: Size | None,
    area_xy: Area | None,
    start: Start | None,
    rng: np.random.Generator,
    robot: RobotBody,
) -> Parts:
    path = Path(text)
    if area_xy is not None and not all(math.isfinite(v) and v >= 3.0 for v in area_xy):
        raise ValueError(f"area {area_xy!r} is not two lengths of 3 m or more")
    suffix = path.suffix.lower()
    if suffix not in (*MESH_SUFFIXES, ".png"):
        kinds = ", ".join((*MESH_SUFFIXES, ".png"))
        raise ValueError(f"unknown world {text!r}: expected {', '.join(WORLDS)}, or a file ({kinds})")
    if not path.is_file():
        raise ValueError(f"there is no world file {text!r}; the built-in worlds are {', '.join(WORLDS)}")
    if suffix == ".png":
        if size_xyz is None:
            raise ValueError(f"the height map {text} needs a size x y z in metres")
        return _from_height_map(read_height_map(path, size_xyz), area_xy, start, rng)
    if size_xyz is not None:
        raise ValueError(f"a size is for height maps (.png); the mesh {text} has its own")
    return _from_mesh(read_mesh(path), area_xy, start, rng, robot)


def _from_mesh(surface: Surface, area_xy: Area | None, start: Start | None, rng: np.random.Generator, robot: RobotBody) -> Parts:
    bounds = np.array([surface.vertices[:, :2].min(axis=0), surface.vertices[:, :2].max(axis=0)])
    if area_xy is None:
        return Parts([], bounds, [surface], closed=False)
    centre = start
    if centre is None:
        centre, _ = choose_start(StandingTest(surface.vertices, surface.triangles, closed=False, robot=robot), bounds, rng)
    low, high = _area_around(centre, area_xy)
    low, high = np.maximum(low, bounds[0]), np.minimum(high, bounds[1])
    surface = cut_to(surface, low, high)
    # the start was chosen on the whole mesh, so it is the middle of the area; only its neighbourhood is searched again
    return Parts(_walls(low, high, surface), np.array([centre[:2], centre[:2]]), [surface], closed=False)


def _from_height_map(height_map: HeightMap, area_xy: Area | None, start: Start | None, rng: np.random.Generator) -> Parts:
    half = np.array(height_map.size_xy) / 2
    if area_xy is None:
        terrain = terrain_between(height_map, -half, half)
        return Parts([], np.array([-half, half]), [surface_from_heights(terrain)], terrain)
    centre = start if start is not None else _gentle_spot(height_map, area_xy, rng)
    low, high = _area_around(centre, area_xy)
    terrain = terrain_between(height_map, low, high)
    low = np.array([terrain.x0, terrain.y0])
    high = low + (np.array(terrain.heights.shape[::-1]) - 1) * terrain.step
    surface = surface_from_heights(terrain)
    middle, reach = (low + high) / 2, (high - low) / 4
    return Parts(_walls(low, high, surface), np.array([middle - reach, middle + reach]), [surface], terrain)


def _gentle_spot(height_map: HeightMap, area_xy: tuple[float, float], rng: np.random.Generator) -> tuple[float, float]:
    """A pixel of little slope, as far inside the map as the area reaches where that is possible."""
    rows, columns = np.nonzero(height_map.slopes() < GENTLE_RAD)
    if rows.size == 0:
        raise ValueError(f"the height map has no ground of less than {math.degrees(GENTLE_RAD):.0f} deg slope to start on; give a start")
    xy = np.array([height_map.pixel_xy(r, c) for r, c in zip(rows.tolist(), columns.tolist(), strict=True)])
    inside = (np.abs(xy) <= np.array(height_map.size_xy) / 2 - np.array(area_xy) / 2).all(axis=1)
    candidates = xy[inside] if inside.any() else xy
    x, y = candidates[int(rng.integers(len(candidates)))].tolist()
    return x, y


def _area_around(centre: tuple[float, ...], area_xy: tuple[float, float]) -> tuple[Array, Array]:
    middle, half = np.array(centre[:2]), np.array(area_xy) / 2
    return middle - half, middle + half


def _walls(low: Array, high: Array, surface: Surface) -> list[Solid]:
    z = surface.vertices[:, 2]
    return walls_around(low, high, float(z.min()) - FILE_WALL_BELOW_M, float(z.max()) + FILE_WALL_ABOVE_M)
