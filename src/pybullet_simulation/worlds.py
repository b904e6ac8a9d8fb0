"""A world by name or from a file, with its start: the one place that knows all worlds there are."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pybullet_simulation import doors_world, ramp_world, rooms_world
from pybullet_simulation.closed_solids import OPEN
from pybullet_simulation.height_map import HeightMap, read_height_map, terrain_between
from pybullet_simulation.mesh_file import MESH_SUFFIXES, Mesh, MeshFrame, cut_to, read_mesh
from pybullet_simulation.mesh_guess import fits_as_it_is, question, size_problem, size_text
from pybullet_simulation.moon_world import SIDE_M as MOON_SIDE_M
from pybullet_simulation.moon_world import moon
from pybullet_simulation.solids import Solid, walls_around
from pybullet_simulation.start_pose import AskedStart, NoStartError, StandingTest, check_start, choose_start
from pybullet_simulation.terrain import surface_from_heights
from pybullet_simulation.world import HeightField, Surface, World, joined
from robot_body import RobotBody

Array = NDArray[np.float64]
Start = AskedStart
Size = tuple[float, float, float]
Area = tuple[float, float]

FILE_WALL_BELOW_M, FILE_WALL_ABOVE_M = 0.5, 1.5
GENTLE_RAD = math.radians(6.0)
SAME_LEVEL_M = 0.01


@dataclass(frozen=True)
class Parts:
    """What a world is made of before its start is known.

    `start_area` (2, 2), low and high x, y, is where a start may be chosen; `ground_z` the range of heights in which the start's
    ground lies, if known; `origin` where its own origin lies, in the coordinates of its file.
    """

    solids: list[Solid]
    start_area: Array
    surfaces: list[Surface] = field(default_factory=list)
    heightfield: HeightField | None = None
    ground_z: tuple[float, float] | None = None
    origin: Array = field(default_factory=lambda: np.zeros(3))


def _rooms(rng: np.random.Generator, start: Start | None) -> Parts:
    return Parts(rooms_world.rooms_solids(rng), np.array([rooms_world.LOW_XY, rooms_world.HIGH_XY]), ground_z=(-0.1, 0.1))


def _doors(rng: np.random.Generator, start: Start | None) -> Parts:
    return Parts(doors_world.doors_solids(rng), np.array([doors_world.LOW_XY, doors_world.HIGH_XY]), ground_z=(-0.1, 0.1))


def _ramp(rng: np.random.Generator, start: Start | None) -> Parts:
    return Parts(ramp_world.ramp_solids(rng), np.array([ramp_world.LOW_XY, ramp_world.HIGH_XY]), ground_z=(-0.1, 0.1))


def _moon(rng: np.random.Generator, start: Start | None) -> Parts:
    half = MOON_SIDE_M / 2
    if start is not None and max(abs(start.x), abs(start.y)) > half - 1.0:
        raise ValueError(f"the robot cannot start at x {start.x:g} y {start.y:g}: moon ends in walls at {-half:g} and {half:g} m")
    terrain, surface, solids, spot = moon(rng, None if start is None else (start.x, start.y))
    return Parts(solids, np.array([spot, spot]), [surface], terrain)


WORLDS: dict[str, Callable[[np.random.Generator, Start | None], Parts]] = {"rooms": _rooms, "doors": _doors, "ramp": _ramp, "moon": _moon}
"""The built-in worlds; each is made from a generator, and the moon is levelled around the start that was asked for."""


def load_world(
    name_or_path: str,
    seed: int,
    size_xyz: Size | None = None,
    area_xy: Area | None = None,
    start: tuple[float, ...] | None = None,
    robot: RobotBody | None = None,
    frame: MeshFrame | None = None,
) -> World:
    """The world of a name (`WORLDS`) or a file, in metres with z up; the seed sets clutter, terrain and start.

    `size_xyz`: size in m over which a height map (.png) is laid, only for those. `area_xy`: bounds a file to so many metres around the
    start, or fewer where the file ends, with walls added. `start`: (x, y, yaw) or (x, y, z, yaw) to start from instead of one chosen by the
    seed, in the coordinates of the file; z tells storeys apart. `frame`: how a mesh is to be read. What lies far away is brought near the
    world's `origin`.
    ValueError when the world is unknown, unreadable or empty, an argument does not fit it, or the robot cannot stand at the start.
    """
    body = robot or RobotBody()
    if seed < 0:
        raise ValueError(f"seed {seed} is negative; expected 0 or more")
    asked = None if start is None else AskedStart.of(start)
    terrain_rng, start_rng = (np.random.default_rng([seed, stream]) for stream in (1, 2))
    if name_or_path not in WORLDS:
        request = _Request(area_xy, asked, start_rng, body)
        try:
            return _with_start(name_or_path, _from_file(name_or_path, size_xyz, frame, request), request)
        except NoStartError as error:
            path = Path(name_or_path)
            if frame is not None or path.suffix.lower() not in MESH_SUFFIXES or fits_as_it_is(path, body):
                raise
            raise ValueError(f"{error}. It is {size_text(read_mesh(path))} m large{question(path, body)}") from error
    if size_xyz is not None or area_xy is not None or frame is not None:
        raise ValueError(f"size, area, scale and up are for files; the world {name_or_path} has its own")
    return _with_start(name_or_path, WORLDS[name_or_path](terrain_rng, asked), _Request(None, asked, start_rng, body))


@dataclass(frozen=True)
class _Request:
    """What a start, and the area around it, are chosen by."""

    area_xy: Area | None
    start: Start | None
    rng: np.random.Generator
    robot: RobotBody


def _with_start(name: str, parts: Parts, by: _Request) -> World:
    vertices, triangles = joined([*parts.solids, *parts.surfaces])
    test = StandingTest(vertices, triangles, by.robot, _solids_of(parts))
    if by.start is None:
        start, start_z = choose_start(test, parts.start_area, by.rng, parts.ground_z)
    else:
        asked = by.start.relative_to(parts.origin)
        start, start_z = (asked.x, asked.y, asked.yaw), check_start(test, asked, parts.ground_z)
    extent = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    solids, surfaces = tuple(parts.solids), tuple(parts.surfaces)
    x, y, z = parts.origin.tolist()
    return World(name, solids, surfaces, vertices, triangles, extent, start, start_z, parts.heightfield, (x, y, z))


def _solids_of(parts: Parts) -> NDArray[np.int32]:
    """(T,) the number of the solid of every triangle of the joined parts, OPEN for those of surfaces; a mesh knows its own."""
    of_solids = [np.full(len(solid.triangles), k) for k, solid in enumerate(parts.solids)]
    of_surfaces = [
        s.solid + (s.solid != OPEN) * len(parts.solids) if isinstance(s, Mesh) else np.full(len(s.triangles), OPEN) for s in parts.surfaces
    ]
    return np.concatenate([*of_solids, *of_surfaces]).astype(np.int32)


def _from_file(text: str, size_xyz: Size | None, frame: MeshFrame | None, by: _Request) -> Parts:
    path, area_xy = Path(text), by.area_xy
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
        if frame is not None:
            raise ValueError(f"scale and up are for meshes; the height map {text} has a size")
        return _from_height_map(read_height_map(path, size_xyz), area_xy, by.start, by.rng)
    if size_xyz is not None:
        raise ValueError(f"a size is for height maps (.png); the mesh {text} has its own")
    mesh = read_mesh(path, frame)
    if problem := size_problem(path, mesh, frame, area_xy is not None):
        raise ValueError(f"{problem}{question(path, by.robot)}")
    return _from_mesh(mesh, by)


def _from_mesh(mesh: Mesh, by: _Request) -> Parts:
    """The mesh, or the area of it around a start that is found on the whole: what is cut is closed no more."""
    bounds = np.array([mesh.vertices[:, :2].min(axis=0), mesh.vertices[:, :2].max(axis=0)])
    if by.area_xy is None:
        return Parts([], bounds, [mesh], origin=mesh.origin)
    test = StandingTest(mesh.vertices, mesh.triangles, by.robot, mesh.solid)
    if by.start is None:
        start, start_z = choose_start(test, bounds, by.rng)
    else:
        asked = by.start.relative_to(mesh.origin)
        start, start_z = (asked.x, asked.y, asked.yaw), check_start(test, asked)
    around, level = np.array([start[:2], start[:2]]), (start_z - SAME_LEVEL_M, start_z + SAME_LEVEL_M)
    low, high = _area_around(start, by.area_xy)
    low, high = np.maximum(low, bounds[0]), np.minimum(high, bounds[1])
    cut = cut_to(mesh, low, high)
    return Parts(_walls(low, high, cut), around, [cut], ground_z=level, origin=mesh.origin)


def _from_height_map(height_map: HeightMap, area_xy: Area | None, start: Start | None, rng: np.random.Generator) -> Parts:
    half = np.array(height_map.size_xy) / 2
    if area_xy is None:
        terrain = terrain_between(height_map, -half, half)
        return Parts([], np.array([-half, half]), [surface_from_heights(terrain)], terrain)
    centre = (start.x, start.y) if start is not None else _gentle_spot(height_map, area_xy, rng)
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
