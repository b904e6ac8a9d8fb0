"""A world by name, from a file, or from a description, with its start: the one place that knows all worlds there are."""

from collections.abc import Callable

import numpy as np

from pybullet_simulation import doors_world, ramp_world, rooms_world
from pybullet_simulation.file_worlds import FILE_SUFFIXES, from_file, start_advice
from pybullet_simulation.mesh_guess import unit_hint
from pybullet_simulation.moon_world import SIDE_M as MOON_SIDE_M
from pybullet_simulation.moon_world import moon
from pybullet_simulation.start_pose import AskedStart, NoStartError, StandingTest, check_start, choose_start
from pybullet_simulation.world import World, joined
from pybullet_simulation.world_parts import Parts, Request
from robot_body import RobotBody
from simulated_movers import specs_of
from world_files import MeshFrame, WorldDescription, described

Start = AskedStart
Size = tuple[float, float, float]
Area = tuple[float, float]


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
    name_or_path: str | WorldDescription,
    seed: int,
    size_xyz: Size | None = None,
    area_xy: Area | None = None,
    start: tuple[float, ...] | None = None,
    robot: RobotBody | None = None,
    frame: MeshFrame | None = None,
) -> World:
    """The world of a name (`WORLDS`), a file or a description, in metres with z up; the seed sets clutter, terrain and start.

    `size_xyz`: size in m over which a height map (.png) is laid, only for those. `area_xy`: bounds a file to so many metres around the
    start, or fewer where the file ends, with walls added. `start`: (x, y, yaw) or (x, y, z, yaw) to start from instead of one chosen by the
    seed, in the coordinates of the file; z tells storeys apart. `frame`: how a mesh is to be read. A description says all that itself, and
    a YAML file that is one fills in what is not given. What lies far away is brought near the world's `origin`.
    ValueError when the world is unknown, unreadable or empty, an argument does not fit it, or the robot cannot stand at the start.
    """
    if seed < 0:
        raise ValueError(f"seed {seed} is negative; expected 0 or more")
    if isinstance(name_or_path, str):
        scale, up = (None, None) if frame is None else (frame.scale, frame.up)
        name_or_path = WorldDescription(name_or_path, start, area_xy, size_xyz, scale, up)
    about = described(name_or_path)
    asked = None if about.start is None else AskedStart.of(about.start)
    terrain_rng, start_rng = (np.random.default_rng([seed, stream]) for stream in (1, 2))
    by = Request(about.area, asked, start_rng, robot or RobotBody())
    if about.world in WORLDS:
        if about != WorldDescription(about.world, about.start, movers=about.movers):
            raise ValueError(f"size, area, scale, up, models and ground are for files; the world {about.world} has its own")
        return _with_start(about, WORLDS[about.world](terrain_rng, asked), by)
    if not about.world.lower().endswith(FILE_SUFFIXES):
        raise ValueError(f"unknown world {about.world!r}: expected {', '.join(WORLDS)}, or a file ({', '.join(FILE_SUFFIXES)})")
    try:
        return _with_start(about, from_file(about, by), by)
    except NoStartError as error:
        raise ValueError(f"{error}{start_advice(about, by)}") from error


def _with_start(about: WorldDescription, parts: Parts, by: Request) -> World:
    vertices, triangles = joined([*parts.solids, *parts.surfaces])
    test = StandingTest(vertices, triangles, by.robot, parts.solid_of_triangles())
    if by.start is None:
        start, start_z = choose_start(test, parts.start_area, by.rng, parts.ground_z)
    else:
        asked = by.start.relative_to(parts.origin)
        start, start_z = (asked.x, asked.y, asked.yaw), check_start(test, asked, parts.ground_z)
    extent = np.array([vertices.min(axis=0), vertices.max(axis=0)])
    x, y, z = parts.origin.tolist()
    return World(
        about.world,
        tuple(parts.solids),
        tuple(parts.surfaces),
        vertices,
        triangles,
        extent,
        start,
        start_z,
        parts.heightfield,
        (x, y, z),
        movers=() if about.movers is None else specs_of(about.movers),
        notes=parts.notes,
        unit_hint=unit_hint(about, parts.surfaces),
    )
